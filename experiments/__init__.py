"""One question each; run with `python -m experiments.NAME`, which writes reports/NAME/."""
