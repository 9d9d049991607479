"""One sentence instead of a hang, a traceback or a wrong answer."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from contactopt import (
    InputError,
    InterfaceProblem,
    Material,
    all_solutions,
    diagnose,
    fclib,
    follow,
    reduce,
    run,
    solve,
)
from contactopt.cli import main
from contactopt.meshes.structured import rename, tensor_mesh
from contactopt.problem.laws import find_law
from contactopt.scenes import flat_punch
from contactopt.scenes.contact import Contact
from contactopt.scenes.scene import BodyForce, Part, Plate, Rigid, Scene, Support, Traction

PROBLEM = InterfaceProblem(np.eye(2), [[-1.0, 0.2]], 0.3)


# Files of other codes


def sound(path):
    fclib.write(PROBLEM, path)
    return path


def test_a_file_that_never_ends_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "pipe.hdf5")
    with pytest.raises(InputError, match=r"pipe\.hdf5"):
        fclib.read(tmp_path / "pipe.hdf5")


def test_nothing_is_read_from_other_files(tmp_path):
    """A link of the whole problem, of one group, and data that lie outside."""
    import h5py

    sound(tmp_path / "secret.hdf5")
    with h5py.File(tmp_path / "whole.hdf5", "w") as file:
        file["fclib_local"] = h5py.ExternalLink("secret.hdf5", "/fclib_local")
    with h5py.File(sound(tmp_path / "group.hdf5"), "a") as file:
        del file["fclib_local/W"]
        file["fclib_local/W"] = h5py.ExternalLink("secret.hdf5", "/fclib_local/W")
    (tmp_path / "numbers").write_bytes(np.array([-1.0, 0.2]).tobytes())
    with h5py.File(sound(tmp_path / "data.hdf5"), "a") as file:
        del file["fclib_local/vectors/q"]
        outside = [(str(tmp_path / "numbers"), 0, 16)]
        file["fclib_local/vectors"].create_dataset("q", shape=(2,), dtype=float, external=outside)
    for name in ("whole", "group", "data"):
        with pytest.raises(InputError, match="another file"):
            fclib.read(tmp_path / f"{name}.hdf5")


def named(wrong):
    """The name of a case: the field, and what is wrong in it; functions and arrays have no name
    that stays the same.
    """
    return ", ".join(
        f"{key} {value if isinstance(value, (int, str)) else type(value).__name__}"
        for key, value in wrong.items()
    )


@pytest.mark.parametrize("name", ["W/x", "W/i", "vectors/q", "vectors/mu"])
def test_sizes_that_a_file_only_declares_take_no_memory(tmp_path, name):
    """A data set without data announces 8 terabytes, which HDF5 reads as zeros."""
    import h5py

    path = sound(tmp_path / "huge.hdf5")
    with h5py.File(path, "a") as file:
        kind = file[f"fclib_local/{name}"].dtype
        del file[f"fclib_local/{name}"]
        file["fclib_local"].create_dataset(name, shape=(10**12,), dtype=kind, chunks=(1000,))
    with pytest.raises(InputError, match="announces more numbers, 1000000000000, than"):
        fclib.read(path)


def test_a_problem_is_written_into_a_new_folder_or_not_at_all(tmp_path):
    fclib.write(PROBLEM, tmp_path / "new" / "a.hdf5")
    assert fclib.read(tmp_path / "new" / "a.hdf5").fingerprint == PROBLEM.fingerprint
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="file"):
        fclib.write(PROBLEM, tmp_path / "file" / "a.hdf5")


# Scenes


@pytest.mark.parametrize(
    "make",
    [
        lambda: Support("top", "x"),
        lambda: Support(3, {"x": 0.0}),
        lambda: Plate("top", "y"),
        lambda: Plate("top", ["y"]),
        lambda: Traction("top", "up"),
        lambda: Traction("top", (1.0, "x")),
        lambda: BodyForce("down"),
    ],
)
def test_loads_and_supports_of_the_wrong_type(make):
    with pytest.raises(InputError):
        part = flat_punch(2).upper
        load = make()
        kind = "supports" if isinstance(load, Support) else "loads"
        reduce(
            Scene(
                "s",
                Part("a", part.mesh, part.material, **{kind: (load,)}),
                Rigid("floor"),
                0.3,
                elements=4,
            )
        )


@pytest.mark.parametrize("fields", [
    {"normal": "up"},
    {"normal": (0.0, 0.0)},
    {"normal": (np.nan, 1.0)},
    {"normal": (0.0, 1.0, 0.0)},
    {"gap": "wide"},
    {"gap": lambda x: np.full(x.shape[1] + 1, 0.1)},
    {"gap": lambda x: np.full(x.shape[1], np.nan)},
    {"gap": lambda x: None},
    {"force": 3},
    {"force": {"y": "heavy"}},
    {"force": {"q": 1.0}},
    {"displacement": {"y": np.inf}},
    {"displacement": 1.0},
    {"force": {"y": 1.0}, "displacement": {"y": 1.0}},
], ids=named)  # fmt: skip
def test_rigid_bodies_of_wrong_fields(fields):
    scene = flat_punch(2)
    with pytest.raises(InputError):
        reduce(Scene("s", scene.upper, Rigid("floor", **fields), 0.3, elements=4))


@pytest.mark.parametrize("fields", [
    {"upper": 3},
    {"lower": "punch"},
    {"mu": None},
    {"mu": -0.1},
    {"mu": np.nan},
    {"mu": "rough"},
    {"mu": [[0.1], [0.1, 0.2]]},
    {"mu": np.ones(77)},
    {"mu": lambda x: "rough"},
    {"mu": lambda x: -np.ones(x.shape[1])},
    {"law": "glue"},
    {"law": 3},
    {"coupling": "rope"},
    {"coupling": None},
    {"carrier": "left"},
    {"lower": "nobody"},
    {"lower": "foundation:nowhere"},
], ids=named)  # fmt: skip
def test_contacts_of_wrong_fields(fields):
    scene = flat_punch(2)
    with pytest.raises(InputError):
        contact = Contact(**({"upper": "punch", "lower": "foundation", "mu": 0.3} | fields))
        reduce(Scene("s", bodies=(scene.upper, scene.lower), contacts=(contact,), elements=4))


def test_a_law_without_friction_needs_no_coefficient(caplog):
    for law in ("frictionless", "tied"):
        pair = Contact("punch", "foundation", law=law)
        assert (pair.mu, pair.friction) == (0.0, law)
        for mu in (0.3, lambda x: 0.3):
            caplog.clear()
            reduce(replace(flat_punch(2, elements=4), law=law, mu=mu))
            said = [text for text in caplog.messages if f"the law '{law}' reads no mu" in text]
            assert len(said) == 1 and said[0].startswith("contact 'punch-foundation': ")
        with pytest.raises(InputError, match="reads no mu"):
            find_law(law)(0.3)
    with pytest.raises(InputError, match="contact 'a-b' has no mu, which the law 'coulomb' needs"):
        Contact("a", "b")


@pytest.mark.parametrize("height", [0.0, -1.0, np.nan], ids=["flat", "turned over", "nowhere"])
def test_an_element_without_volume_is_refused(height):
    """One corner of a block is moved so that its element is flat, folds over, or is nowhere."""

    def mesh(elements, zone):
        made = rename(
            tensor_mesh(np.linspace(0, 1, 3), np.array([0.0, 1.0])), contact="y-", top="y+"
        )
        above = np.flatnonzero(made.p[1] == 1.0)
        made.p[1, above[:2]] = height
        return made

    part = flat_punch(2).upper
    bad = Part("a", mesh, part.material, loads=(Plate("top", {"y": -1.0}),))
    with pytest.raises(InputError):
        reduce(Scene("s", bad, Rigid("floor"), 0.3, elements=2))


def test_too_little_memory_is_one_sentence(monkeypatch, tmp_path, capsys):
    """Wherever it runs out: the command line says so and leaves nothing behind."""

    def full(*arguments, **settings):
        raise MemoryError

    monkeypatch.setattr("contactopt.solving.zone.solve_scene", full)
    monkeypatch.setattr("contactopt.solving.solve_scene.reduce_bodies", full)
    assert main(["run", "punch-2d", "--elements", "4", "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert (
        said.strip()
        .splitlines()[-1]
        .startswith(
            "contactopt: scene 'punch-2d' of 2 bodies with elements = 4 needs more memory than"
            " there is"
        )
        and "Traceback" not in said
    )
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("elements", [10**9, 10**300, -1, 2.5, "many", np.nan])
def test_meshes_that_cannot_be(elements):
    for name in ("punch-2d", "punch-3d", "sphere"):
        with pytest.raises(InputError):
            run(name, elements=elements)


def test_a_body_that_is_held_everywhere_is_refused():
    sides = {"foot": lambda x: x[1] == 0, "rest": lambda x: x[1] > 0}
    mesh = tensor_mesh(np.array([0.0, 1.0]), np.array([0.0, 1.0])).with_boundaries(sides)
    body = Part("block", mesh, Material(1, 0), (Support("rest"),), (), "foot")
    with pytest.raises(InputError, match="'block' is held at all its nodes"):
        run(Scene("held", body, Rigid("floor"), mu=0.1))


@pytest.mark.parametrize(
    "choice", [{"Q": "zz"}, {"Q": 3}, {"solver": "zz"}, {"coupling": "zz"}], ids=str
)
def test_choices_that_there_are_not(choice):
    with pytest.raises(InputError):
        reduce(flat_punch(2, elements=4), **choice)


@pytest.mark.parametrize("units", ["mpa", ("mm", "mpa"), ("MM", "MPa"), ("mm", " "), ("mm", 3)])
def test_units_are_two_names(units):
    with pytest.raises(InputError, match="unit"):
        replace(flat_punch(2, elements=4), units=units)


@pytest.mark.parametrize("function", [solve, all_solutions, diagnose, run, reduce, follow])
@pytest.mark.parametrize("given", [None, 3, [], {}, "no-such", Path(__file__)])
def test_what_is_no_problem_or_scene(function, given):
    with pytest.raises(InputError, match=r"InterfaceProblem|[Ss]cene"):
        function(given)


def test_a_list_of_scenes_is_a_path():
    with pytest.raises(InputError, match=r"got list. contactopt.follow solves"):
        run([flat_punch(2, elements=4)])


# Loads that no contact can balance


@pytest.mark.parametrize(
    "method", ["auto", "lagrangian", "apg", "tresca", "nsgs", "admm", "proximal"]
)
@pytest.mark.parametrize("column", [[0.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [1e-300, 0.0]], ids=str)
def test_a_plate_that_no_contact_can_hold(method, column):
    """V is zero, moves along the surface, or pulls: an answer or one sentence."""
    problem = InterfaceProblem(np.eye(2), [[0.1, 0.0]], 0.0, np.array(column)[:, None], [-1.0])
    try:
        assert not solve(problem, method, max_iterations=50, time_limit=1.0).solved
    except InputError as error:
        assert "\n" not in str(error)


@pytest.mark.parametrize("form, words", [("fclib", "it is a folder"), ("mtx", "file/a'")])
def test_an_export_that_cannot_be_written_names_its_path(tmp_path, capsys, form, words):
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").write_text("")
    out = {"fclib": "folder", "mtx": "file/a"}[form]
    command = ["export", "punch-2d", "--set", "elements=4", "--to", form]
    assert main([*command, "--out", str(tmp_path / out)]) == 2
    assert words in capsys.readouterr().err
