"""What objects say of themselves, and what is said about input that cannot be used."""

import ast
import html.parser
import logging
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from conftest import two_blocks

import contactopt
from contactopt import (
    InputError,
    Plate,
    Rigid,
    Scene,
    Support,
    diagnose,
    reduce,
    reduce_bodies,
    run,
    scenes,
)
from contactopt.cards import card
from contactopt.problem import InterfaceProblem
from contactopt.solving.follow import follow


@pytest.fixture(scope="module")
def result():
    return run("punch-2d", elements=4)


def test_an_object_says_in_one_line_what_it_is(result):
    objects = (result, result.solution, result.problem, result.reduction, diagnose(result.problem))
    for one in objects:
        assert len(repr(one)) < 200 and "\n" not in repr(one)
        assert repr(one).startswith(type(one).__name__)
    assert repr(result.solution).startswith("Solution(solved, residual ")
    assert "5 contacts" in repr(result)
    single = InterfaceProblem(np.eye(2), np.array([[-1.0, 0.0]]), 0.5)
    assert "1 contact," in repr(single) and "Coulomb mu = 0.5" in repr(single)


def test_a_notebook_shows_a_table_with_all_names_escaped(result):
    found = set()

    class Reader(html.parser.HTMLParser):
        def handle_starttag(self, tag, attrs):
            found.add(tag)

    hostile = replace(result, scene=replace(result.scene, name="<script>alert(1)</script>"))
    for one in (
        hostile,
        result.solution,
        result.problem,
        result.reduction,
        diagnose(result.problem, result.solution),
    ):
        Reader().feed(one._repr_html_())
    assert found == {"table", "caption", "thead", "tbody", "tr", "th", "td", "br", "img"}
    assert "&lt;script&gt;" in hostile._repr_html_() and "&lt;b&gt;" in card("x", {"<b>": 1})


def test_the_grammar_of_a_diagnosis_agrees_with_its_numbers():
    single = InterfaceProblem(np.array([[2.0, 0.5], [0.5, 1.0]]), np.array([[-1.0, 0.0]]), 0.5)
    assert str(diagnose(single)).startswith("1 contact in 2D")
    assert "asymmetry 0" in str(diagnose(single))
    tilted = InterfaceProblem(
        np.eye(4), -np.ones((2, 2)), 0.5, V=np.array([[0.0], [1.0], [0.0], [1.0]]), s=[0.0]
    )
    assert "convergence is not guaranteed" in str(diagnose(tilted))


# values that are no number, never one, or one of many, beside what `count` says elsewhere
MANY = {
    "MOST_CONTACTS", "MOST_LEVELS", "MOST_ITERATIONS", "FEW", "most", "cells", "loose", "law",
    "scene.copies",
}  # fmt: skip
MANY |= {"scene.dim", "', '.join(map(str, SIZES[dim]))", "len(contacts)", "len(states)", "number"}
MANY |= {"len(names)", "len(self.couplings)", "axes", "width"}  # said where there are several
ALWAYS = {"unknown", "node", "name"}  # names is a verb, too


def test_numbers_and_their_words_agree():
    """What `count` says somewhere is not written as a number and a plural elsewhere."""
    files = Path(contactopt.__file__).parent.rglob("*.py")
    trees = {file: list(ast.walk(ast.parse(file.read_text()))) for file in files}
    things = set()
    for node in (node for nodes in trees.values() for node in nodes):
        if isinstance(node, ast.Call) and ast.unparse(node.func) in ("count", "said"):
            texts = [one.value for one in node.args[1:] if isinstance(one, ast.Constant)]
            things |= {str(texts[0]).split()[-1 if len(texts) == 1 else 0]} if texts else set()
    assert {"contact", "state", "place"} <= things
    plural = {f"{thing}s" for thing in things - ALWAYS} | {"bodies", "boundaries", "meshes"}
    words = re.compile(r" (?:more |other |free |named )?(" + "|".join(plural) + r")\b")
    found = [
        f"{file.name}: {ast.unparse(value.value)}{after.value[:30]}"
        for file, nodes in trees.items()
        for text in (node for node in nodes if isinstance(node, ast.JoinedStr))
        for value, after in zip(text.values, text.values[1:])
        if isinstance(value, ast.FormattedValue) and ast.unparse(value.value) not in MANY
        if isinstance(after, ast.Constant) and words.match(str(after.value))
    ]
    assert not found


def test_no_share_of_less_than_one_percent_is_printed_as_none():
    """Only constants, which are round, are printed as whole percents."""
    found = [
        f"{path.name}: {value}"
        for path in Path(contactopt.__file__).parent.rglob("*.py")
        for value in re.findall(r"\{([^{}]*):\.0%\}", path.read_text())
        if not value.isupper()
    ]
    assert not found


def test_a_path_says_how_many_states_there_are():
    said = []
    path = follow(scenes.growing_indentation(steps=2, elements=6), note=said.append)
    assert [text.partition(":")[0] for text in said if text.startswith("state")] == [
        "state 1 of 2",
        "state 2 of 2",
    ]
    assert "2 states" in repr(path) and len(path._repr_html_()) < 1000
    said.clear()
    follow((state for state in scenes.growing_indentation(steps=2, elements=6)), note=said.append)
    assert [text for text in said if text.startswith("state")][-1].startswith("state 2: ")


def test_a_component_of_another_kind_names_that_kind():
    base = two_blocks("plane-strain")
    wrong = replace(base.upper, supports=(Support("top", {"z": 0.0}),))
    with pytest.raises(
        InputError, match=r"no component 'z'; use x, y, .*kind 'plane-strain', or .*kind='solid'"
    ):
        replace(base, upper=wrong)


def test_unknown_fields_of_a_scene_name_the_fields():
    with pytest.raises(
        InputError, match="no field 'friction_coefficient'; its fields are name, upper"
    ):
        run(two_blocks("plane-strain"), friction_coefficient=0.1)


def test_boundaries_without_facets_are_no_choice():
    base = two_blocks("plane-strain")
    mesh = base.upper.mesh.with_boundaries({"nothing": np.array([], dtype=int)})
    for name, words in (
        ("nothing", "boundary 'nothing' has no facets"),
        ("topp", "no boundary named 'topp'"),
    ):
        wrong = replace(base.upper, mesh=mesh, loads=(Plate(name, {"y": -1.0}),))
        with pytest.raises(InputError, match=words) as error:
            reduce(replace(base, upper=wrong))
        assert "nothing" not in str(error.value).partition("it has ")[2]


def test_a_gap_on_a_curved_surface_without_a_direction_is_spoken_of(caplog):
    cylinder = scenes.cylinder(elements=6).upper
    for normal, expected in ((None, 1), ((0.0, 1.0), 0)):
        caplog.clear()
        floor = Rigid("floor", normal=normal, gap=lambda x: x[1] - x[1].min())
        with caplog.at_level(logging.WARNING, "contactopt"):
            reduce_bodies(Scene("s", cylinder, floor, 0.3, copies=2, zone=10.0, elements=6))
        assert (
            sum("give Rigid(normal=...)" in record.getMessage() for record in caplog.records)
            == expected
        )
