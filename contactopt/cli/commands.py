"""What each command does with its options; returns the exit code."""

from __future__ import annotations

import argparse
import json
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

from contactopt.cards import count
from contactopt.errors import InputError
from contactopt.methods.method import NATIVE
from contactopt.readings.resultants import resultant_words

FORCES = {
    ("mm", "MPa"): "N",
    ("m", "Pa"): "N",
    ("m", "kPa"): "kN",
    ("m", "MPa"): "MN",
    ("in", "psi"): "lbf",
}
Command = Callable[[argparse.Namespace], int]


def _arguments_of(texts: list[str]) -> dict[str, Any]:
    """The values of NAME=VALUE texts.

    A value is a number, true, false or a list as in TOML; anything else is a text.
    """
    found: dict[str, Any] = {}
    for text in texts:
        name, sign, value = text.partition("=")
        name = name.strip().replace("-", "_")
        if not sign or not name.isidentifier():
            raise InputError(f"--set needs NAME=VALUE, as in --set width=30; got {text!r}.")
        try:
            found[name] = tomllib.loads(f"value = {value}")["value"]
        except tomllib.TOMLDecodeError:
            found[name] = value
    return found


def _changes(options: argparse.Namespace) -> dict[str, Any]:
    """The arguments of the scene that the command line gives; InputError for one that is given
    twice.
    """
    names = ("mu", "force", "degree", "simplices", "elements")
    changes = {name: getattr(options, name) for name in names if getattr(options, name) is not None}
    given = _arguments_of(options.set)
    if twice := sorted(set(given) & set(changes)):
        raise InputError(f"{twice[0]!r} is given twice, by --set and by --{twice[0]}.")
    return changes | given


def scene_asked(options: argparse.Namespace) -> Any:
    """Make the scene of the command `run`.

    Parameters
    ----------
    options : The options of the command.

    Returns
    -------
    The scene; of a load path its last state.
    """
    from contactopt.runner import scene_of

    return scene_of(options.scene, **_changes(options))


def run(options: argparse.Namespace) -> int:
    """Solve a scene, write its files and print its numbers.

    Parameters
    ----------
    options : The options of the command `run`.

    Returns
    -------
    The exit code: 0 if it is solved, to the accuracy asked for, else 1.

    Raises
    ------
    InputError : If an argument of the scene is given twice, or as `contactopt.run` raises it.
    """
    from contactopt.runner import run

    out = options.out or f"out/{Path(options.scene).stem}"
    silent = options.quiet or options.json
    result = run(
        options.scene,
        out,
        method=options.method,
        normal=options.normal,
        tangential=options.tangential,
        preconditioner=options.preconditioner,
        Q=options.q,
        solver=options.solver,
        tol=options.tol,
        accuracy=options.accuracy,
        quantity=options.quantity,
        adaptive=options.adaptive,
        simplest=options.simplest,
        max_unknowns=options.max_unknowns,
        time_limit=options.time_limit,
        max_memory=options.max_memory,
        figures=tuple(options.figures),
        html=options.html,
        note=lambda text: None if silent else print(f"  {text}", file=sys.stderr, flush=True),
        team=options.team,
        **_changes(options),
    )
    if options.json:
        print(json.dumps(result.summary, indent=2))
    else:
        _print_result(result, out)
        if options.team is not None:
            print(
                f"{options.team.size} ranks, {options.team.traffic.messages} messages,"
                f" {options.team.traffic.length} bytes"
            )
    return (
        0 if result.solution.solved and (result.estimate is None or result.estimate.reached) else 1
    )


def _print_result(result: Any, out: str) -> None:
    s = result.summary
    contacts = count(s["contact_nodes"], "contact node")
    print(f"{s['scene']}: {count(s['dofs'], 'unknown')}, {contacts}, mu = {s['mu']:g}")
    steps = count(s["outer_iterations"], "iteration")
    print(f"{s['status']}: {result.solution.message}; {steps}, residual {s['residual']:.1e}")
    if s["q"] == "implicit":
        print(f"Q by {s['products']} products with vectors")
    native = s["normal_backend"] == s["tangential_backend"] == NATIVE
    by = f", normal problem by {s['normal_backend']}, tangential by {s['tangential_backend']}"
    print(f"method {s['method']}" + ("" if native else by))
    length, stress = result.scene.units
    force = FORCES.get((length, stress), f"{stress} {length}^2")
    approach = "" if s["approach"] is None else f"approach {s['approach']:.6g} {length}, "
    print(
        f"sum of normal forces {s['normal_force']:.6g} {force}, {approach}"
        f"largest pressure {s['max_pressure']:.6g} {stress}"
    )
    for name, words in resultant_words(s).items():
        print(f"force on the upper body of '{name}': {words} {force}")
    if s["contact_half_width"] is not None:
        print(
            f"contact half-width {s['contact_half_width']:.6g} {length}, "
            f"stick half-width {s['stick_half_width']:.6g} {length}"
        )
    for remark in s["remarks"]:
        print(f"note: {remark}")
    if result.estimate is not None:
        _print_estimate(result.estimate)
    seconds = s["seconds"]
    print(
        f"{seconds['total']:.1f} s: "
        + ", ".join(f"{k} {v:.2f}" for k, v in seconds.items() if k != "total")
    )
    print(f"files in {out}: {', '.join(sorted(file.name for file in Path(out).iterdir()))}")


def _print_estimate(estimate: Any) -> None:
    error = "unknown" if estimate.error is None else f"{estimate.error:.1e}"
    print(
        f"{estimate.quantity} {estimate.value:.6g}, estimated relative error {error}, asked for"
        f" {estimate.target:g}:"
    )
    print(f"  {estimate.message}")
    for level in estimate.levels:
        print(
            f"  {level.mesh}: {level.unknowns} unknowns, {level.value:.6g}, {level.seconds:.2f} s"
        )


def view(options: argparse.Namespace) -> int:
    """Write the page of a run and open it in the browser; returns the exit code 0."""
    import webbrowser

    from contactopt.figures.view_page import write_page

    page = write_page(options.folder, options.out or Path(options.folder) / "view.html")
    if not options.no_open:
        webbrowser.open(page.resolve().as_uri())
    print(f"{page} is the result as a page; open it in a browser")
    return 0


def show(options: argparse.Namespace) -> int:
    """Print what a scene is: sketch, sizes, arguments and source; returns the exit code 0."""
    from contactopt.figures.sheet import describe

    print(describe(options.scene, _arguments_of(options.set)))
    return 0


def simplify(options: argparse.Namespace) -> int:
    from contactopt.runner import scene_of
    from contactopt.simplification import simplify

    print(
        simplify(scene_of(options.scene, **_arguments_of(options.set)), solve=not options.no_solve)
    )
    return 0


def new(options: argparse.Namespace) -> int:
    """Write an example of a scene file; returns the exit code 0."""
    from contactopt.scenes.example import write_example

    write_example(Path(options.file))
    print(f"{options.file} is an example that runs: contactopt run {options.file}")
    return 0


def bench(options: argparse.Namespace) -> int:
    """Execute the runs of an experiment file and write their report; returns the exit code, 130 if
    it was interrupted.
    """
    from contactopt.benchmark.campaign import run_campaign
    from contactopt.benchmark.report_page import refusals, report_campaign
    from contactopt.benchmark.store import load

    try:
        folder = run_campaign(
            options.file,
            options.out,
            jobs=options.jobs,
            resume=options.resume,
            filters=options.filter,
            quiet=options.quiet,
        )
    except KeyboardInterrupt:
        print(
            "contactopt: interrupted; finished runs are kept, go on with --resume", file=sys.stderr
        )
        return 130
    table = load(folder)
    runs = count(len(table), "run")
    print(
        f"{runs}: "
        + ", ".join(f"{n} {status}" for status, n in table["status"].value_counts().items())
    )
    for sentence in refusals(table):
        print(f"  {sentence}")
    print(f"results in {folder}: rows.parquet (read them with contactopt.benchmark.load)")
    page = report_campaign(folder, options.file)
    more = (
        ""
        if page.suffix == ".html"
        else "; a page to explore needs: pip install 'contactopt[view]'"
    )
    print(f"report: {page}{more}")
    return 0


def report(options: argparse.Namespace) -> int:
    """Rebuild the reports of benchmarks from their tables; returns the exit code 0."""
    from contactopt.benchmark.campaign import run_reports
    from contactopt.benchmark.report_page import report_campaign

    folders = [
        Path(name)
        for name in options.names
        if Path(name).is_dir() and any(Path(name).glob("rows.*"))
    ]
    if folders and len(folders) == len(options.names) and not options.run:
        for folder in folders:
            print(f"report: {report_campaign(folder)}")
        return 0
    paths = sorted(Path(options.experiments).glob("*.toml"))
    page = run_reports(paths, options.reports, options.run, options.names, options.jobs)
    print(f"reports in {page.parent}, all of them in {page}")
    return 0


def listing(options: argparse.Namespace) -> int:
    """Print everything that can be chosen by its name; returns the exit code 0."""
    from contactopt.cli.lists import print_lists

    print_lists()
    return 0


def completion(options: argparse.Namespace) -> int:
    """Print the completion script of a shell; returns the exit code 0."""
    from contactopt.cli.completion import script
    from contactopt.cli.parser import make_parser

    print(script(make_parser(), options.shell))
    return 0
