"""Commands and options."""

from __future__ import annotations

import argparse

import contactopt
from contactopt.benchmark.keys import help_text
from contactopt.cli import commands
from contactopt.cli.completion import NAMES, SHELLS
from contactopt.cli.test_set import add_options
from contactopt.run_options import OPTIONS

EPILOG = """Examples:
  contactopt run punch-2d                  solve a scene; write its numbers into out/punch-2d
  contactopt run punch-2d --set width=30   the same with another value of an argument of the scene
  contactopt show punch-2d                 describe a scene: arguments, and what is known exactly
  contactopt simplify arch                 say what may be left out of a scene
  contactopt view out/punch-2d             turn the result into a page to explore, and open it

contactopt COMMAND --help shows the options of a command.
"""
RUN_EPILOG = """\
Words: Q is the compliance of the bodies at the contact. A QP (quadratic program) has a quadratic
cost and linear constraints; a conic program may also bound the length of a vector. A backend is a
solver that others wrote. The natural-map residual is the certificate: it says how well the laws
of contact and friction are fulfilled."""
JOBS = "number of processes (default: one for each core)"
# command -> what it does
COMMANDS = {
    "run": "solve a scene, and write its summary, its figures and its fields",
    "view": "turn the folder of a run into a page to explore, and open it",
    "show": "describe a scene: a sketch, its sizes, its"
    " arguments, its source, and what is known exactly",
    "check": "say and draw what a scene is before it is solved: what holds and loads its bodies,"
    " gaps and normals of its surfaces, and what the run will cost",
    "mesh": "mesh a part from a CAD file (.step, .iges, .brep), or read a mesh file; list and draw"
    " its bodies and boundaries",
    "simplify": "say what may be left out of a scene, why it"
    " may be left out, and which error that makes",
    "export": "write a scene for another code: a deck of CalculiX with its contacts, or its"
    " interface problem for FCLib",
    "new": "write an example of a scene file, to start from",
    "schema": "print the JSON schema of scene files, with which editors complete and check them",
    "bench": "compare methods: make all runs that an experiment"
    " file describes, and a report about them",
    "report": "make the reports of comparisons again from their tables, without solving anything",
    "problems": "list, show or write the problems of a test set: list, show NAME, write NAME",
    "list": "list everything that is chosen by its name: scenes, laws, methods, solvers, backends",
    "completion": "print a script with which a shell completes"
    " commands, options and names of scenes",
}


def make_parser() -> argparse.ArgumentParser:
    """Build the parser of the command line, with all commands and options.

    Returns
    -------
    ArgumentParser : what it reads has the function to execute in its attribute `command`
    """
    parser = argparse.ArgumentParser(
        "contactopt",
        description="Computes contact and friction between"
        " elastic bodies, and certifies the answer.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    version = f"contactopt {contactopt.__version__}"
    parser.add_argument("--version", action="version", version=version)
    common = argparse.ArgumentParser(add_help=False)
    loudness = common.add_mutually_exclusive_group()
    _flag(loudness, "-q", "--quiet", help="print the results and no progress")
    loudness.add_argument(
        "-v",
        "--verbose",
        action="count",
        default=0,
        help="also print the steps; -vv prints their details",
    )
    found = parser.add_subparsers(required=True, metavar="COMMAND")
    made = {}
    for name, what in COMMANDS.items():
        description = f"{what[0].upper()}{what[1:]}."
        made[name] = found.add_parser(name, help=what, description=description, parents=[common])
        made[name].set_defaults(command=commands.COMMANDS[name])
    for name in ("run", "show", "check", "simplify", "export"):
        _scene(made[name])
    _run(made["run"])
    _bench(made["bench"])
    _report(made["report"])
    add_options(made["problems"])
    view = made["view"]
    view.add_argument("folder", metavar="DIR", help="a folder that `contactopt run` wrote")
    view.add_argument("--out", metavar="FILE", help="name of the page (default: DIR/view.html)")
    _flag(view, "--no-open", help="make the page, but do not open it in the browser")
    page = made["check"].add_mutually_exclusive_group()
    page.add_argument(
        "--out", metavar="FILE", help="name of the page (default: out/SCENE-check.html)"
    )
    _flag(page, "--no-page", help="print the words alone")
    _flag(made["check"], "--no-open", help="make the page, but do not open it in the browser")
    without = "look only for symmetries, without the proof that takes a solution"
    _flag(made["simplify"], "--no-solve", help=without)
    _export(made["export"])
    _mesh(made["mesh"])
    made["new"].add_argument(
        "file",
        metavar="FILE",
        help="name of the file, which must end in .toml; an existing file is not overwritten",
    )
    made["completion"].add_argument("shell", choices=SHELLS)
    made["completion"].set_defaults(parser=parser)
    return parser


def _flag(
    parser: argparse.ArgumentParser | argparse._MutuallyExclusiveGroup, *names: str, help: str
) -> None:
    parser.add_argument(*names, action="store_true", help=help)


def _scene(parser: argparse.ArgumentParser) -> None:
    """A scene, and other values of its arguments."""
    scenes = f"a scene file (.toml), or {', '.join(NAMES['scene'])}"
    parser.add_argument("scene", metavar="SCENE", help=scenes)
    parser.add_argument(
        "--set",
        metavar="NAME=VALUE",
        action="append",
        default=[],
        help="give an argument of the scene another value; `contactopt show SCENE` lists the"
        " arguments. The option may be given several times",
    )


def _run(run: argparse.ArgumentParser) -> None:
    run.epilog = RUN_EPILOG
    run.add_argument("--out", metavar="DIR", help="folder of the results (default: out/SCENE)")
    run.add_argument("--mu", type=float, metavar="X", help="friction coefficient")
    run.add_argument("--force", type=float, metavar="N", help="total normal force")
    degree = "1: linear elements, 2: quadratic ones (default: what the scene says)"
    run.add_argument("--degree", type=int, metavar="1|2", help=degree)
    simplices = "cut the elements into triangles or tetrahedra"
    run.add_argument("--simplices", action="store_true", default=None, help=simplices)
    across = "number of elements across the half-width of the contact"
    run.add_argument("--elements", type=int, metavar="N", help=across)
    pictures = run.add_mutually_exclusive_group()
    for name, option in OPTIONS.items():
        told = option.metadata
        flag, what = f"--{name.lower().replace('_', '-')}", told["what"]
        if name in NAMES:
            what = f"{what}: {', '.join(NAMES[name])}"
        if told["kind"] is bool:
            run.add_argument(flag, action="store_true", default=None, help=what)
        elif told["kind"] is tuple and name not in NAMES:
            run.add_argument(flag, nargs="+", metavar=told["value"], help=what)
        elif told["kind"] is tuple:
            pictures.add_argument(
                flag, nargs="+", choices=NAMES[name], metavar=told["value"], help=what
            )
            without = f"--no-{name}"
            pictures.add_argument(
                without, dest=name, action="store_const", const=(), help=f"draw no {name}"
            )
        else:
            run.add_argument(flag, dest=name, type=told["kind"], metavar=told["value"], help=what)
    ranks = "number of processes that share the bodies (needs mpi4py)"
    run.add_argument("--ranks", type=int, metavar="N", help=ranks)
    _flag(run, "--json", help="print the summary as JSON and nothing else")


def _export(export: argparse.ArgumentParser) -> None:
    what = "what is written"
    export.add_argument("--to", choices=("calculix", "fclib"), required=True, help=what)
    what = "name of the file (default: out/SCENE.inp or out/SCENE.hdf5)"
    export.add_argument("--out", metavar="FILE", help=what)
    what = "penalty stiffness of CalculiX's contacts, over modulus and element size (default: 100)"
    export.add_argument("--factor", type=float, default=100.0, metavar="X", help=what)


def _mesh(mesh: argparse.ArgumentParser) -> None:
    mesh.add_argument("file", metavar="FILE", help="a CAD file, or a mesh file in any format")
    what = "size of the elements (default: a fifteenth of the smallest body)"
    mesh.add_argument("--size", type=float, metavar="X", help=what)
    what = "a smaller size on a boundary; the option may be given several times"
    mesh.add_argument(
        "--fine", type=_named, metavar="NAME:X", action="append", default=[], help=what
    )
    what = "call boundaries by another name, as in --name flank=plane1,plane2"
    mesh.add_argument(
        "--name", type=_called, metavar="NEW=OLD,...", action="append", default=[], help=what
    )
    what = "1: straight elements, 2: curved ones (default)"
    mesh.add_argument("--order", type=int, choices=(1, 2), default=2, help=what)
    mesh.add_argument("--out", metavar="FILE", help="name of the mesh file (default: FILE.msh)")
    _flag(mesh, "--no-page", help="print the words alone")
    _flag(mesh, "--no-open", help="make the page, but do not open it in the browser")


def _named(text: str) -> tuple[str, float]:
    name, _, size = text.rpartition(":")
    try:
        return name, float(size)
    except ValueError as error:
        said = f"give NAME:SIZE, as in flank:0.1; got {text!r}"
        raise argparse.ArgumentTypeError(said) from error


def _called(text: str) -> tuple[str, str]:
    new, sign, old = text.partition("=")
    if not (new and sign and old):
        raise argparse.ArgumentTypeError(f"give NEW=OLD,..., as in flank=plane1; got {text!r}")
    return new, old


def _bench(bench: argparse.ArgumentParser) -> None:
    bench.formatter_class = argparse.RawDescriptionHelpFormatter
    bench.epilog = help_text()
    what = "the experiment file, in TOML; its keys are listed below"
    bench.add_argument("file", metavar="FILE", help=what)
    what = "folder of the results (default: out/bench/NAME)"
    bench.add_argument("--out", metavar="DIR", help=what)
    bench.add_argument("--jobs", type=int, metavar="N", help=JOBS)
    _flag(bench, "--resume", help="go on after an interruption; finished runs are kept")
    bench.add_argument(
        "--filter",
        action="append",
        default=[],
        metavar="COL=PATTERN",
        help="make only the runs whose column problem, method, setting, ... fits the pattern",
    )


def _report(report: argparse.ArgumentParser) -> None:
    report.add_argument(
        "names",
        nargs="*",
        metavar="NAME",
        help="names of experiments (default: all), or folders that"
        " `contactopt bench` wrote; these get their reports",
    )
    for name, folder, what in (
        ("--experiments", "experiments/campaigns", "the experiment files"),
        ("--reports", "reports", "the tables and reports"),
    ):
        told = f"folder of {what} (default: {folder})"
        report.add_argument(name, default=folder, metavar="DIR", help=told)
    report.add_argument(
        "--run",
        default="",
        choices=("quick", "full"),
        help="make the runs first: all of them (full), or a few, into out/ (quick)",
    )
    what = "add the rows of another campaign, also of another machine: a folder or a rows.csv"
    report.add_argument("--merge", action="append", default=[], metavar="FILE", help=what)
    what = "also write its figures in these formats"
    report.add_argument("--figures", nargs="+", default=[], choices=NAMES["figures"], help=what)
    report.add_argument("--jobs", type=int, metavar="N", help=JOBS)
