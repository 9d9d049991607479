"""One question a file, or a folder where a question needs several.

`python -m experiments.questions.NAME` answers it.
"""
