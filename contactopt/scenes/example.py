"""The scene file that `contactopt new` writes: an example that runs, with every entry explained."""

from pathlib import Path

from contactopt.errors import InputError

EXAMPLE = Path(__file__).with_suffix(".toml").read_text(encoding="utf-8")


def write_example(path: Path) -> None:
    """Write an example of a scene file. InputError for a name that is taken or no .toml."""
    if path.suffix != ".toml":
        raise InputError(f"a scene file's name ends in .toml; got '{path}'.")
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(EXAMPLE.replace("{name}", str(path)))
    except FileExistsError as error:
        raise InputError(f"'{path}' is there already; choose another name.") from error
    except OSError as error:
        raise InputError(f"cannot write '{path}': {error.strerror}.") from error
