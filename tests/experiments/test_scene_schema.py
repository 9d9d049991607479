"""The JSON schema that the package prints is what the reader of scene files asks for."""

import json

from experiments.site.scene_schema import FILE, schema


def test_the_schema_is_that_of_the_reader():
    assert json.loads(FILE.read_text()) == json.loads(json.dumps(schema())), (
        "make it anew: python -m experiments.site.scene_schema"
    )
