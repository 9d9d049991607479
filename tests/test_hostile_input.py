"""Input of every wrong kind ends in an answer or in the project's own exceptions."""

from __future__ import annotations

import contextlib
import io
import os
import tempfile
import time
import warnings
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp

import contactopt as co
from contactopt.methods import METHODS

CASES = 12  # of each door
LIMIT, SLACK = 0.3, 1.0  # seconds
OWN = (co.InputError, co.BackendError)

NUMBERS: tuple[Any, ...] = (None, True, -1, 0, 3, 1e308, -1e308, float("nan"), float("inf"), 1j)
TEXTS: tuple[Any, ...] = ("", "x", "nan", b"x")
CONTAINERS: tuple[Any, ...] = ([], [[]], [[1.0], [1.0, 2.0]], {}, {"a": 1}, object(), lambda: 0)
NANS, LETTERS = np.full((2, 2), np.nan), np.array(["a", "b"])
ARRAYS: tuple[Any, ...] = (np.zeros(0), np.zeros((2, 2)), NANS, np.eye(2) * 1j, np.array("x"))
OTHERS: tuple[Any, ...] = (10**30, range(3), Path("."), np.ma.masked, ValueError)
JUNK = (
    *(*NUMBERS, *TEXTS, *CONTAINERS, *ARRAYS),
    *(LETTERS, np.array([object()]), sp.eye_array(4), *OTHERS),
)
SETTINGS = ("method", "tol", "time_limit", "max_iterations", "change_tol", "start", "relaxation")
PLACES = ["material", "support", "traction", "replace", "part", "follow", "reduce", "name"]
PLACES += ["body force"]
WORDS = ["x", "-1", "0", "nan", "1e308", "1000000000", "", "../..", "--zz", "punch-2d"]
WORDS += ["é", "\x00", "inf"]
OPTIONS = ["--mu", "--force", "--elements", "--tol", "--method", "--degree", "--q", "--solver"]
OPTIONS += ["--accuracy", "--quantity"]


def good(rng: np.random.Generator) -> dict[str, Any]:
    """The arguments of a small problem, of any kind that may occur."""
    k, d = int(rng.integers(0, 4)), int(rng.integers(2, 4))
    A = rng.normal(size=(k * d, int(rng.integers(1, k * d + 2))))
    Q: Any = A @ A.T * 10.0 ** rng.integers(-12, 12)
    if rng.random() < 0.2:
        Q = np.zeros_like(Q)
    if rng.random() < 0.2:
        Q = sp.csr_array(Q)
    p = int(rng.integers(0, 3))
    return dict(
        Q=Q,
        q=rng.normal(size=(k, d)),
        mu=rng.uniform(0, 3, k),
        V=rng.normal(size=(k * d, p)),
        s=rng.normal(size=p),
    )


def any_of(rng: np.random.Generator, values: Any) -> Any:
    return values[int(rng.integers(len(values)))]


def problems(rng: np.random.Generator, folder: Path) -> None:
    """An InterfaceProblem with an argument of another kind, and what is done with it."""
    arguments = good(rng)
    arguments[any_of(rng, [*arguments, "areas", "coordinates", "chart"])] = any_of(rng, JUNK)
    problem = co.InterfaceProblem(**arguments)
    co.natural_map_residual(problem, any_of(rng, [np.zeros(problem.q.shape), *JUNK]))


def solves(rng: np.random.Generator, folder: Path) -> None:
    """Solves of sound and degenerate problems by every method, with one setting of another kind."""
    problem = co.InterfaceProblem(**good(rng))
    settings: dict[str, Any] = dict(
        tol=10.0 ** rng.integers(-16, -3), time_limit=LIMIT, max_iterations=200
    )
    method: Any = any_of(rng, list(METHODS))
    spoilt = any_of(rng, ["", "", "", *SETTINGS])
    if spoilt == "method":
        method = any_of(rng, JUNK)
    elif spoilt:
        settings[spoilt] = any_of(rng, JUNK)
    begin = time.process_time()
    try:
        co.solve(problem, method, **settings)
    finally:
        if spoilt != "time_limit" and time.process_time() - begin > LIMIT + SLACK:
            raise TimeoutError(f"{method} took {time.process_time() - begin:.1f} s")


def starts(rng: np.random.Generator, folder: Path) -> None:
    """A start from a spoilt solution."""
    problem = co.InterfaceProblem(**good(rng))
    start = co.solve(problem, max_iterations=1)
    spoilt = replace(start, **{any_of(rng, ["reactions", "multipliers"]): any_of(rng, JUNK)})
    co.solve(problem, any_of(rng, ["auto", "nsgs", "admm"]), start=spoilt, time_limit=LIMIT)


def files(rng: np.random.Generator, folder: Path) -> None:
    """Reading what is no problem, and writing where nothing can be written."""
    path = folder / any_of(rng, ["a.hdf5", "a.dat", "missing/a.hdf5", "."])
    kind = any_of(rng, ["bytes", "fifo", "write", "cut", "type", "external"])
    if kind == "type":
        co.fclib.read(any_of(rng, JUNK))
    if kind == "write":
        co.fclib.write(any_of(rng, [co.InterfaceProblem(**good(rng)), *JUNK]), path)
        return
    target = folder / "x"
    target.unlink(missing_ok=True)
    if kind == "fifo":
        os.mkfifo(target)
    elif kind == "cut":
        sound = folder / "sound.hdf5"
        co.fclib.write(co.InterfaceProblem(np.eye(4), np.zeros((2, 2)), 0.3), sound)
        data = bytearray(sound.read_bytes())
        for _ in range(int(rng.integers(1, 20))):
            data[int(rng.integers(len(data)))] = int(rng.integers(256))
        target.write_bytes(
            bytes(data[: int(rng.integers(len(data)))] if rng.random() < 0.3 else data)
        )
    elif kind == "external":
        import h5py

        with h5py.File(target, "w") as file:
            file["fclib_local"] = h5py.ExternalLink("sound.hdf5", "/fclib_local")
    else:
        text = [
            str(any_of(rng, [2, 3, 1, 0, -1, 1e9, "nan", "x", "10000000000"]))
            for _ in range(int(rng.integers(0, 30)))
        ]
        target.write_bytes(
            any_of(
                rng, [" ".join(text).encode(), rng.bytes(50), b"\x89HDF\r\n\x1a\n" + rng.bytes(50)]
            )
        )
    co.fclib.read(target)


def scenes(rng: np.random.Generator, folder: Path) -> None:
    """Scenes of wrong kinds; two bodies of one name; a path of unlike states."""
    scene = co.scenes.flat_punch(dim=2)
    kind = any_of(rng, PLACES)
    if kind == "material":
        co.Material(any_of(rng, [1.0, *JUNK]), any_of(rng, [0.3, *JUNK]))
    elif kind in ("support", "traction", "body force"):
        maker = {"support": co.Support, "traction": co.Traction, "body force": co.BodyForce}[kind]
        load = maker(*(any_of(rng, ["top", *JUNK]) for _ in range(len(maker.__dataclass_fields__))))
        part = replace(scene.upper, **{any_of(rng, ["supports", "loads"]): (load,)})
        co.reduce(replace(scene, upper=part), elements=1)
    elif kind == "part":
        field = any_of(rng, [own.name for own in fields(scene.upper)])
        co.reduce(
            replace(scene, upper=replace(scene.upper, **{field: any_of(rng, JUNK)})), elements=1
        )
    elif kind == "name":
        co.reduce(replace(scene, upper=replace(scene.upper, name=scene.lower.name)), elements=1)
    elif kind == "replace":
        field = any_of(rng, list(scene.__dataclass_fields__))
        co.reduce(replace(scene, **{field: any_of(rng, JUNK)}), elements=1)
    elif kind == "reduce":
        co.reduce(
            scene, **{any_of(rng, ["elements", "zone", "Q", "solver"]): any_of(rng, [*JUNK, "zz"])}
        )
    else:
        stiff = replace(scene, upper=replace(scene.upper, material=co.Material(7.0, 0.1)))
        co.follow(any_of(rng, [[scene, stiff], [scene, "x"], [], *JUNK]), elements=1)


def commands(rng: np.random.Generator, folder: Path) -> None:
    """The command line."""
    from contactopt.cli import main

    command = any_of(rng, ["run", "run", "list", "benchmark", "report", "solve", "x", ""])
    line = [command, any_of(rng, ["punch-2d", *WORDS])]
    line += [any_of(rng, OPTIONS), any_of(rng, WORDS)] if rng.random() < 0.8 else []
    line += ["--elements", "1"] if command == "run" and "--elements" not in line else []
    line += ["--out", str(folder / "out")] if command == "run" else []
    main(line)


Door = Callable[[np.random.Generator, Path], None]
DOORS: tuple[Door, ...] = (problems, solves, starts, files, scenes, commands)


def judge(seed: int) -> tuple[str, str, str]:
    """The door, how the input ended, and the exception if it is not the project's own."""
    rng = np.random.default_rng(seed)
    door = DOORS[seed % len(DOORS)]
    silent = io.StringIO()
    with (
        tempfile.TemporaryDirectory() as folder,
        contextlib.redirect_stdout(silent),
        contextlib.redirect_stderr(silent),
    ):
        old = os.getcwd()
        os.chdir(folder)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                door(rng, Path(folder))
        except OWN:
            return door.__name__, "refused", ""
        except SystemExit:
            return door.__name__, "refused" if door is commands else "broken", ""
        except BaseException as error:
            place = error.__traceback__
            while place is not None and place.tb_next is not None:
                place = place.tb_next
            line = (
                f"{Path(place.tb_frame.f_code.co_filename).name}:{place.tb_lineno}" if place else ""
            )
            kind = "overrun" if isinstance(error, TimeoutError) else "broken"
            return door.__name__, kind, f"{type(error).__name__} at {line}: {str(error)[:80]}"
        finally:
            os.chdir(old)
    return door.__name__, "answered", ""


@pytest.mark.parametrize("door", range(len(DOORS)))
def test_random_wrong_input(door):
    for seed in range(door, CASES * len(DOORS), len(DOORS)):
        name, ending, what = judge(seed)
        assert ending in ("answered", "refused"), f"seed {seed} ({name}): {what}"
