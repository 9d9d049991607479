"""What holds where nothing else is asked for; read by words and numbers alike."""

TOL = 1e-8  # largest natural-map residual that counts as solved


def install(extra: str) -> str:
    """How the packages of an extra are installed, for messages: the one place that says it."""
    return f"run pip install -e '.[{extra}]' in the folder of the clone"
