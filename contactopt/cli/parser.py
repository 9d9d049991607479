"""Commands and options."""

from __future__ import annotations

import argparse

import contactopt
from contactopt.benchmark.keys import help_text
from contactopt.bodies.solvers import SOLVERS
from contactopt.cli import commands
from contactopt.cli.completion import SHELLS
from contactopt.figures.style import FORMATS
from contactopt.linear.operators import FORMS
from contactopt.methods import METHODS
from contactopt.methods.preconditioners import PRECONDITIONERS
from contactopt.readings.quantities import NAMES
from contactopt.scenes import SCENES

EPILOG = """Examples:
  contactopt run punch-2d                      solve a scene; write numbers, figures and fields into out/punch-2d
  contactopt run punch-2d --set width=30       the same with another value of an argument of the scene
  contactopt show punch-2d                     describe a scene: its arguments, and what is known exactly
  contactopt simplify arch                     say what may be left out of a scene
  contactopt view out/punch-2d                 turn the result into a page to explore, and open it

contactopt COMMAND --help shows the options of a command.
"""

RUN_EPILOG = """Words: Q is the compliance of the bodies at the contact. A QP (quadratic program) has a quadratic cost and linear
constraints; a conic program may also bound the length of a vector. A backend is a solver that
others wrote. The
natural-map residual is the certificate: it says how well the laws of contact and friction are fulfilled."""


def make_parser() -> argparse.ArgumentParser:
    """Build the parser of the command line, with all commands and options.

    Returns
    -------
    The parser. What it reads has the function to execute in its attribute `command`.
    """
    parser = argparse.ArgumentParser(
        "contactopt",
        description=(
            "Computes contact and friction between elastic bodies, and certifies the answer."
        ),
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--version", action="version", version=f"contactopt {contactopt.__version__}"
    )
    common = argparse.ArgumentParser(add_help=False)
    loudness = common.add_mutually_exclusive_group()
    loudness.add_argument(
        "-q", "--quiet", action="store_true", help="print the results and no progress"
    )
    loudness.add_argument(
        "-v",
        "--verbose",
        action="count",
        default=0,
        help="also print the steps; -vv prints their details",
    )
    found = parser.add_subparsers(required=True, metavar="COMMAND")

    def add(name: str, what: str, command: commands.Command) -> argparse.ArgumentParser:
        made = found.add_parser(
            name, help=what, description=what[0].upper() + what[1:] + ".", parents=[common]
        )
        made.set_defaults(command=command)
        return made

    _run(
        add("run", "solve a scene, and write its summary, its figures and its fields", commands.run)
    )
    view = add(
        "view", "turn the folder of a run into a page to explore, and open it", commands.view
    )
    view.add_argument("folder", metavar="DIR", help="a folder that `contactopt run` wrote")
    view.add_argument("--out", metavar="FILE", help="name of the page (default: DIR/view.html)")
    view.add_argument(
        "--no-open", action="store_true", help="make the page, but do not open it in the browser"
    )
    show = add(
        "show",
        "describe a scene: a sketch, its sizes, its arguments, its source, and what is known"
        " exactly",
        commands.show,
    )
    show.add_argument(
        "scene", metavar="SCENE", help="a scene file (.toml), or " + ", ".join(SCENES)
    )
    show.add_argument(
        "--set",
        metavar="NAME=VALUE",
        action="append",
        default=[],
        help="give an argument of the scene another value",
    )
    simple = add(
        "simplify",
        "say what may be left out of a scene, why it may be left out, and which error that makes",
        commands.simplify,
    )
    simple.add_argument(
        "scene", metavar="SCENE", help="a scene file (.toml), or " + ", ".join(SCENES)
    )
    simple.add_argument(
        "--set",
        metavar="NAME=VALUE",
        action="append",
        default=[],
        help="give an argument of the scene another value",
    )
    simple.add_argument(
        "--no-solve",
        action="store_true",
        help="look only for symmetries, without the proof that takes a solution",
    )
    new = add("new", "write an example of a scene file, to start from", commands.new)
    new.add_argument(
        "file",
        metavar="FILE",
        help="name of the file, which must end in .toml; an existing file is not overwritten",
    )
    _bench(
        add(
            "bench",
            "compare methods: make all runs that an experiment file describes, and a report about"
            " them",
            commands.bench,
        )
    )
    _report(
        add(
            "report",
            "make the reports of comparisons again from their tables, without solving anything",
            commands.report,
        )
    )
    add(
        "list",
        "list everything that is chosen by its name: scenes, laws, methods, solvers, backends",
        commands.listing,
    )
    completion = add(
        "completion",
        "print a script with which a shell completes commands, options and names of scenes",
        commands.completion,
    )
    completion.add_argument("shell", choices=SHELLS)
    return parser


def _run(run: argparse.ArgumentParser) -> None:
    run.epilog = RUN_EPILOG
    run.add_argument("scene", metavar="SCENE", help="a scene file (.toml), or " + ", ".join(SCENES))
    run.add_argument("--out", metavar="DIR", help="folder of the results (default: out/SCENE)")
    run.add_argument(
        "--method", help=", ".join(METHODS) + " (default: auto; alternating if a backend is named)"
    )
    run.add_argument("--normal", metavar="BACKEND", help="QP backend that finds the normal forces")
    run.add_argument(
        "--tangential",
        metavar="BACKEND",
        help="backend that finds the friction forces: QP (2D, axisymmetric) or conic (3D)",
    )
    run.add_argument(
        "--q",
        metavar="FORM",
        help=", ".join(FORMS)
        + ": Q as an array (explicit), or known by its products only (implicit)",
    )
    run.add_argument(
        "--preconditioner",
        metavar="NAME",
        help="an approximate inverse of Q: "
        + ", ".join(PRECONDITIONERS)
        + ", none; it implies --q implicit",
    )
    run.add_argument(
        "--solver",
        metavar="NAME",
        help="solver of the bodies' linear systems: auto, " + ", ".join(SOLVERS),
    )
    run.add_argument("--mu", type=float, metavar="X", help="friction coefficient")
    run.add_argument("--force", type=float, metavar="N", help="total normal force")
    run.add_argument(
        "--degree",
        type=int,
        metavar="1|2",
        help="1: linear elements, 2: quadratic ones (default: what the scene says)",
    )
    run.add_argument(
        "--simplices",
        action="store_true",
        default=None,
        help="cut the elements into triangles or tetrahedra",
    )
    run.add_argument(
        "--elements",
        type=int,
        metavar="N",
        help="number of elements across the half-width of the contact",
    )
    run.add_argument(
        "--set",
        metavar="NAME=VALUE",
        action="append",
        default=[],
        help=(
            "give an argument of the scene another value; `contactopt show SCENE` lists the"
            " arguments. The option may be given several times"
        ),
    )
    run.add_argument(
        "--accuracy",
        type=float,
        metavar="X",
        help="refine the mesh until the estimated relative error of a quantity is below X",
    )
    run.add_argument(
        "--quantity", metavar="NAME", help="the quantity of --accuracy: " + ", ".join(NAMES)
    )
    run.add_argument(
        "--adaptive",
        action="store_true",
        help="with --accuracy: refine the mesh only where the quantity needs it",
    )
    run.add_argument(
        "--simplest",
        action="store_true",
        help=(
            "first leave out all that makes no error; `contactopt simplify SCENE` says what this is"
        ),
    )
    run.add_argument(
        "--max-unknowns",
        type=int,
        metavar="N",
        help="with --accuracy: no mesh has more displacement unknowns",
    )
    run.add_argument(
        "--time-limit",
        type=float,
        metavar="S",
        help="with --accuracy: the search ends after so many seconds",
    )
    run.add_argument(
        "--max-memory",
        type=float,
        metavar="GB",
        help="with --accuracy: the search takes no more memory (default: 2)",
    )
    run.add_argument(
        "--ranks",
        type=int,
        metavar="N",
        help="number of processes that share the bodies (needs mpi4py)",
    )
    run.add_argument(
        "--tol",
        type=float,
        metavar="T",
        help="largest natural-map residual that counts as solved (default: 1e-8)",
    )
    pictures = run.add_mutually_exclusive_group()
    pictures.add_argument(
        "--figures",
        metavar="FORMAT",
        nargs="+",
        default=["png"],
        choices=FORMATS,
        help="formats of the figures: " + ", ".join(FORMATS) + " (default: png)",
    )
    pictures.add_argument(
        "--no-figures", dest="figures", action="store_const", const=[], help="draw no figures"
    )
    run.add_argument(
        "--html", action="store_true", help="also write view.html, the result as a page to explore"
    )
    run.add_argument(
        "--json", action="store_true", help="print the summary as JSON and nothing else"
    )


def _bench(bench: argparse.ArgumentParser) -> None:
    bench.formatter_class = argparse.RawDescriptionHelpFormatter
    bench.epilog = help_text()
    bench.add_argument(
        "file", metavar="FILE", help="the experiment file, in TOML; its keys are listed below"
    )
    bench.add_argument(
        "--out", metavar="DIR", help="folder of the results (default: out/bench/NAME)"
    )
    bench.add_argument(
        "--jobs", type=int, metavar="N", help="number of processes (default: one for each core)"
    )
    bench.add_argument(
        "--resume", action="store_true", help="go on after an interruption; finished runs are kept"
    )
    bench.add_argument(
        "--filter",
        action="append",
        default=[],
        metavar="COL=PATTERN",
        help="make only the runs whose column problem, method, setting, ... fits the pattern",
    )
    bench.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="address of a Dask cluster that makes the runs instead of local processes",
    )


def _report(report: argparse.ArgumentParser) -> None:
    report.add_argument(
        "names",
        nargs="*",
        metavar="NAME",
        help=(
            "names of experiments (default: all), or folders that `contactopt bench` wrote; these"
            " get their reports"
        ),
    )
    report.add_argument(
        "--experiments",
        default="experiments/campaigns",
        metavar="DIR",
        help="folder of the experiment files (default: experiments/campaigns)",
    )
    report.add_argument(
        "--reports",
        default="reports",
        metavar="DIR",
        help="folder of the tables and reports (default: reports)",
    )
    report.add_argument(
        "--run",
        default="",
        choices=("quick", "full"),
        help="make the runs first: all of them (full), or a few, into out/ (quick)",
    )
    report.add_argument(
        "--jobs", type=int, metavar="N", help="number of processes (default: one for each core)"
    )
