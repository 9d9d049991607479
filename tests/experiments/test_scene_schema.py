"""Files that are made from the package say what it says."""

import json
import subprocess
import sys

from experiments.site import command_names
from experiments.site.scene_schema import FILE, schema


def test_the_schema_is_that_of_the_reader():
    assert json.loads(FILE.read_text()) == json.loads(json.dumps(schema())), (
        "make it again: python -m experiments.site.scene_schema"
    )


def test_options_take_the_names_of_the_tables():
    assert json.loads(command_names.FILE.read_text()) == command_names.names(), (
        "make it again: python -m experiments.site.command_names"
    )


def test_words_need_no_numerical_package():
    program = (
        "import sys; from contactopt.cli import make_parser\n"
        "text = make_parser().format_help()\n"
        "print([name for name in ('numpy', 'skfem', 'cvxpy', 'rich') if name in sys.modules])"
    )
    told = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert told.stdout.strip() == "[]", told.stderr
