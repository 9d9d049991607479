"""The command `problems`: list, show and write the problems of a test set."""

from __future__ import annotations

import argparse
import re
import sys
from collections import Counter
from collections.abc import Iterator
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from contactopt.cards import count
from contactopt.errors import InputError

if TYPE_CHECKING:
    from contactopt.benchmark.testset import Problem
    from contactopt.problem import InterfaceProblem


def problems(options: argparse.Namespace) -> int:
    """List, show or write problems of a test set."""
    from contactopt.benchmark import testset

    found = testset.problems(options.tier or "", options.tag, options.testset)
    if options.names:
        found = [one for one in found if any(_fits(one.name, name) for name in options.names)]
    if not found:
        raise InputError("no problem has that name, tier and tags; see `contactopt problems list`.")
    if options.action != "list" and not options.names:
        raise InputError(f"name the problems to {options.action}, as in 'punch-2d*'; '*' is all.")
    ACTIONS[options.action](found, options)
    return 0


def _fits(name: str, pattern: str) -> bool:
    return name == pattern or fnmatchcase(name, pattern)


def _list(found: list[Problem], options: argparse.Namespace) -> None:
    for one in found:
        stored = one.known.get("tags", {})
        words = [
            f"{key}={stored[key]}" for key in ("dim", "contacts", "states", "form") if key in stored
        ]
        words += ["unsymmetric"] if stored.get("symmetric") is False else []
        words += ["no solution"] if stored.get("feasible") is False else []
        print(f"{one.tier:7}{one.name:74} {' '.join(words)}".rstrip())
    tiers = Counter(one.tier for one in found)
    print(f"{count(len(found), 'problem')}: {', '.join(f'{n} {t}' for t, n in tiers.items())}")


def _show(found: list[Problem], options: argparse.Namespace) -> None:
    for one in found:
        print(f"{one.name}\ntier: {one.tier}")
        print("tags: " + ", ".join(f"{key}={value}" for key, value in one.tags.items()))
        for key, value in (one.reference or {"reference answer": "none stored"}).items():
            print(f"{key}: {value}")
        _print_solutions(one)
        print()


def _print_solutions(one: Problem) -> None:
    """All solutions of a small problem that has several, or the proof that there is none."""
    from contactopt.benchmark.sequences import states_of

    tags = one.tags
    if not tags["feasible"]:
        _print_proof(states_of(one.load())[-1])
    elif (tags.get("solutions") or 0) > 1 and tags["contacts"] <= 8:  # with few forces to print
        from contactopt.methods.enumeration import all_solutions

        for number, solution in enumerate(all_solutions(states_of(one.load())[0]), 1):
            forces = np.array2string(solution.reactions.ravel(), precision=6, suppress_small=True)
            print(f"solution {number}: forces {forces}, certificate {solution.residual:.1e}")


def _print_proof(problem: InterfaceProblem) -> None:
    from contactopt.problem import infeasibility

    proof = infeasibility(problem)
    if proof is None:
        return
    print(f"proof that there is no solution: {proof.sentence}")
    print(
        "  weights y of the contacts, and motions z: every r in the cones with V'r + s = 0 has\n"
        "  (Q'e + Vz)'r <= 0 with e = (y, 0), but y'u_n >= 0 would need it to be at least"
        f" {proof.margin:.6g}"
    )
    for name, values in (("y", proof.weights), ("z", proof.motions)):
        print(f"  {name} = {np.array2string(values, precision=6, threshold=60)}")


def _write(found: list[Problem], options: argparse.Namespace) -> None:
    out = Path(options.out)
    out.mkdir(parents=True, exist_ok=True)
    for one in found:
        stem = out / re.sub(r"[^\w.-]+", "_", one.name).strip("_")
        try:
            for path in _written(one, stem, options.format, options.program):
                print(path)
        except InputError as error:
            print(f"left out: {one.name}: {error}", file=sys.stderr)


def _written(one: Problem, stem: Path, form: str, kinds: list[str] | None) -> Iterator[Path]:
    """The files of one problem, written."""
    from contactopt import fclib
    from contactopt.benchmark.sequences import states_of
    from contactopt.benchmark.testset import programs
    from contactopt.methods.driver import solve

    states = states_of(one.load())
    writers = {"npz": programs.write_npz, "cbf": programs.write_cbf}
    for number, problem in enumerate(states, 1):  # a file for each state of a sequence
        name = stem.name + (f"_{number:03}" if len(states) > 1 else "")
        if form == "fclib":
            path = stem.with_name(f"{name}.hdf5")
            fclib.write(problem.explicit(), path, one.name)
            yield path
            continue
        answer = solve(problem, tol=1e-10)  # subproblems need exact forces
        if not answer.solved:
            raise InputError(f"it was not solved ({answer.status}).")
        for kind in kinds or programs.PROGRAMS:
            if form == "npz" and problem.dim == 3 and kind != "normal" and not kinds:
                continue  # no quadratic program
            path = stem.with_name(f"{name}_{kind}.{form}")
            writers[form](programs.convex_program(problem, kind, answer.reactions), path)
            yield path


ACTIONS = {"list": _list, "show": _show, "write": _write}
