"""What each command does with its options: each function returns the exit code."""

from __future__ import annotations

import argparse
import json
import sys
import tomllib
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

from contactopt.cards import count
from contactopt.checks import overheard
from contactopt.errors import InputError
from contactopt.files.toml_table import parse
from contactopt.screen import progress

if TYPE_CHECKING:
    from contactopt.runner import Result


def _arguments_of(texts: list[str]) -> dict[str, Any]:
    """The values of NAME=VALUE texts: numbers, true, false and lists as in TOML, all else texts."""
    found: dict[str, Any] = {}
    for text in texts:
        name, sign, value = text.partition("=")
        name = name.strip()
        name = name if "." in name else name.replace("-", "_")
        if not sign or not name:
            raise InputError(f"--set needs NAME=VALUE, as in --set width=30; got {text!r}.")
        try:
            found[name] = parse(f"value = {value}")["value"]
        except tomllib.TOMLDecodeError:
            found[name] = value
    return found


def _changes(options: argparse.Namespace) -> dict[str, Any]:
    """The arguments of the scene on the command line; InputError for one that is given twice."""
    names = ("mu", "force", "degree", "simplices", "elements")
    changes = {name: getattr(options, name) for name in names if getattr(options, name) is not None}
    given = _arguments_of(options.set)
    if twice := sorted(set(given) & set(changes)):
        raise InputError(f"{twice[0]!r} is given twice, by --set and by --{twice[0]}.")
    return changes | given


def run(options: argparse.Namespace) -> int:
    """Solve a scene, write its files and print its numbers. The exit code is 0 if it is solved."""
    from contactopt.run_options import OPTIONS
    from contactopt.runner import run

    out = options.out or f"out/{Path(options.scene).stem}"
    silent = options.quiet or options.json
    given = {name: getattr(options, name) for name in OPTIONS} | _changes(options)
    with progress(Path(options.scene).stem, quiet=silent, lines=options.verbose > 0) as shown:
        result = run(options.scene, out, note=shown.note, **given)
    if options.json:
        print(json.dumps(result.summary, indent=2))
    else:
        _print_result(result, out)
    reached = result.estimate is None or result.estimate.reached
    return 0 if result.solution.solved and reached else 1


def _print_result(result: Result, out: str) -> None:
    from contactopt.figures.output import SINGLE
    from contactopt.outcome import pair_rows, remark_rows, summary_rows, time_words, titled
    from contactopt.screen import in_tables

    s = result.summary
    print(in_tables(titled(s), pair_rows(s), summary_rows(s) | remark_rows(s)))
    if (estimate := result.estimate) is not None:
        if estimate.guarantee is not None:
            print(estimate.guarantee.sentence)
        for one in estimate.levels:
            print(f"  {one.mesh}: {one.unknowns} unknowns, {one.value:.6g}, {one.seconds:.2f} s")
    print(time_words(s))
    names = sorted(file.name for file in Path(out).iterdir())
    single = [name for name in names if SINGLE.search(name)]
    listed = ", ".join(name for name in names if name not in single)
    print(f"files in {out}: {listed}" + (f", {len(single)} of single states" if single else ""))


def view(options: argparse.Namespace) -> int:
    """Write the page of a run and open it in the browser."""
    from contactopt.figures.view_page import write_page

    page = write_page(options.folder, options.out or Path(options.folder) / "view.html")
    return _shown(page, options, f"{page} is the result as a page; open it in a browser")


def _shown(page: Path, options: argparse.Namespace, words: str) -> int:
    """Open a page, unless that is not wanted, and say where it is."""
    import webbrowser

    if not options.no_open:
        webbrowser.open(page.resolve().as_uri())
    print(words)
    return 0


def show(options: argparse.Namespace) -> int:
    """Print what a scene is: sketch, sizes, arguments and source."""
    from contactopt.figures.sheet import describe

    print(describe(options.scene, _arguments_of(options.set)))
    return 0


def mesh(options: argparse.Namespace) -> int:
    """Mesh a part of a CAD program, or read a mesh file; say and draw what it holds."""
    from contactopt.figures.check_page import write_mesh_page
    from contactopt.figures.mesh_words import mesh_words
    from contactopt.meshes.cad import ENDINGS, mesh_part
    from contactopt.meshes.mesh_files import load_bodies

    path = Path(options.file)
    if path.suffix.lower() in ENDINGS:
        part, path = path, Path(options.out or path.with_suffix(".msh"))
        fine = dict(options.fine)
        names = {new: old.split(",") for new, old in options.name}
        mesh_part(part, path, options.size, fine, names, options.order)
    with overheard() as told:
        meshes, refused = load_bodies(path)
    refused += told
    text, named = mesh_words(path, meshes)
    print("\n".join([text, *(f"# note: {note}" for note in refused)]))
    if options.no_page or not meshes:
        return 0 if meshes else 2
    page = Path(f"out/{path.stem}-mesh.html")
    write_mesh_page(str(path), named, text, refused, page)
    words = f"# {page} shows the bodies and their boundaries; open it in a browser"
    return _shown(page, options, words)


def simplify(options: argparse.Namespace) -> int:
    from contactopt.runner import scene_of
    from contactopt.simplification import simplify

    scene = scene_of(options.scene, **_arguments_of(options.set))
    print(simplify(scene, solve=not options.no_solve))
    return 0


def limit(options: argparse.Namespace) -> int:
    """Say between which factors on a load friction holds; the exit code is 1 if it is unknown."""
    from contactopt.holding import limit

    changes = _arguments_of(options.set)
    with progress(
        Path(options.scene).stem, quiet=options.quiet, lines=options.verbose > 0
    ) as shown:
        found = limit(options.scene, options.load, note=shown.note, **changes)
    print(found)
    return int(found.factor != found.factor)


def check(options: argparse.Namespace) -> int:
    """Say what is known of a scene before it is solved, and write it as a page."""
    from contactopt.figures.check_page import write_check_page
    from contactopt.figures.scene_check import check_scene
    from contactopt.runner import states_of

    with overheard() as told:
        states, solve = states_of(options.scene, **_arguments_of(options.set))
    found = check_scene(states, solve, told)
    print(found.text)
    if options.no_page:
        return 0
    page = write_check_page(found, options.out or f"out/{Path(options.scene).stem}-check.html")
    words = f"{page} shows bodies, boundaries, loads and pairs; open it in a browser"
    return _shown(page, options, words)


def export(options: argparse.Namespace) -> int:
    """Write a scene for another code: a deck of CalculiX, a file of FCLib, or its matrices."""
    from contactopt.files.writing import whole_file
    from contactopt.runner import scene_of

    scene = scene_of(options.scene, **_arguments_of(options.set))
    ending = {"calculix": ".inp", "fclib": ".hdf5", "npz": ".npz", "mtx": "-matrices"}[options.to]
    path = Path(options.out or f"out/{Path(options.scene).stem}{ending}")
    if options.to == "calculix":
        from contactopt.bodies.calculix_deck import deck

        text = deck(scene, options.factor)
        with whole_file(path) as file:
            file.write_text(text)
        told = f"a deck of CalculiX: ccx {path.with_suffix('')}"
    elif options.to in ("npz", "mtx"):
        from contactopt.coupling.matrices import write_matrices
        from contactopt.coupling.reduction import reduce_bodies

        write_matrices(reduce_bodies(scene), path, options.to)
        told = "its matrices, which the page 'Bring your own matrices' explains"
    else:
        from contactopt.coupling.reduction import reduce
        from contactopt.fclib import write

        problem = reduce(scene).explicit()
        write(problem, path, scene.name)
        told = f"its interface problem for FCLib, {count(problem.contacts, 'contact')}"
    print(f"{path} is {told}")
    return 0


def new(options: argparse.Namespace) -> int:
    """Write an example of a scene file."""
    from contactopt.scenes.example import write_example

    write_example(Path(options.file))
    print(f"{options.file} is an example that runs: contactopt run {options.file}")
    return 0


def schema(options: argparse.Namespace) -> int:
    """Print the JSON schema of scene files."""
    print(files("contactopt.scenes").joinpath("scene_schema.json").read_text("utf-8"), end="")
    return 0


def bench(options: argparse.Namespace) -> int:
    """Execute the runs of an experiment file and write their report."""
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
            shard=options.shard,
            scheduler=options.scheduler,
        )
    except KeyboardInterrupt:
        print(
            "contactopt: interrupted; finished runs are kept, go on with --resume", file=sys.stderr
        )
        return 130
    table = load(folder)
    runs = count(len(table), "run")
    counted = table["status"].value_counts().items()
    print(f"{runs}: {', '.join(f'{n} {status}' for status, n in counted)}")
    for sentence in refusals(table):
        print(f"  {sentence}")
    print(f"results in {folder}: rows.parquet (read them with contactopt.benchmark.load)")
    with progress("report", quiet=options.quiet):
        page = report_campaign(folder, options.file)
    print(f"report: {page}")
    return 0


def report(options: argparse.Namespace) -> int:
    """Rebuild the reports of benchmarks from their tables."""
    from contactopt.benchmark.campaign import run_reports
    from contactopt.benchmark.report_page import report_campaign

    given = [Path(name) for name in options.names]
    folders = [path for path in given if path.is_dir() and any(path.glob("rows.*"))]
    if folders and len(folders) == len(options.names) and not options.run:
        pages = []
        with progress("reports", len(folders), quiet=options.quiet) as shown:
            for folder in folders:
                page = report_campaign(folder, others=options.merge, figures=options.figures)
                pages.append(f"report: {page}")
                shown.count()
        print("\n".join(pages))
        return 0
    if options.merge or options.figures:
        raise InputError("--merge and --figures are for the folder of a campaign; name it first.")
    paths = sorted(Path(options.experiments).glob("*.toml"))
    folder = run_reports(paths, options.reports, options.run, options.names, options.jobs)
    print(f"reports in {folder}")
    return 0


def list_names(options: argparse.Namespace) -> int:
    """Print everything that can be chosen by its name."""
    from contactopt.cli.completion import NAMES, table
    from contactopt.methods.backends import CONIC, QP

    paths = table("scenes", "PATHS")
    scenes = table("scenes", "SCENES").items()
    _print_names("scenes", {name: what + " (load path)" * (name in paths) for name, what in scenes})
    _print_names("materials of scene files", NAMES["material"])
    _print_names("laws of contact", table("problem.laws", "LAWS"))
    _print_names("methods", table("methods", "METHODS"))
    print("forms of the interface operator Q: " + ", ".join(NAMES["Q"]))
    print("solvers of the bodies: " + ", ".join(["auto", *table("bodies.solvers", "SOLVERS")]))
    of_Q = table("methods.preconditioners", "PRECONDITIONERS")
    _print_names("preconditioners of the interface operator", of_Q)
    for title, backends in (
        ("QP backends (normal; tangential in 2D)", QP),
        ("conic backends (tangential in 3D)", CONIC),
    ):
        print(title)
        for backend in backends.values():
            here = f"installed, {backend.version}" if backend.installed else ""
            print(f"  {backend.name:12} {here or f'not installed: pip install {backend.package}'}")
    return 0


def _print_names(title: str, names: Mapping[str, str]) -> None:
    print(title)
    wide = max(map(len, names))
    for name, what in names.items():
        print(f"  {name:{wide}} {what}")


def completion(options: argparse.Namespace) -> int:
    """Print the completion script of a shell."""
    from contactopt.cli.completion import script

    print(script(options.parser, options.shell))
    return 0
