"""Commands and options."""

from __future__ import annotations

import argparse

import contactopt
from contactopt.analysis.places import PLACED
from contactopt.analysis.quantities import QUANTITIES
from contactopt.benchmark.keys import help_text
from contactopt.bodies.solvers import SOLVERS
from contactopt.cli import commands
from contactopt.figures.style import FORMATS
from contactopt.problem.operators import FORMS
from contactopt.scenes import SCENES
from contactopt.solving.methods import METHODS
from contactopt.solving.preconditioners import PRECONDITIONERS

EPILOG = """Examples:
  contactopt run punch-2d                      solve a scene, write numbers, figures and fields into out/punch-2d
  contactopt run punch-2d --set width=30       with another value of an argument of the scene
  contactopt show punch-2d                     what a scene is, its arguments, and what is known exactly
  contactopt view out/punch-2d                 the result as a page to explore
"""


def make_parser() -> argparse.ArgumentParser:
    """Commands and options."""
    parser = argparse.ArgumentParser(
        "contactopt",
        description="Frictional contact as mathematical programs.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"contactopt {contactopt.__version__}")
    common = argparse.ArgumentParser(add_help=False)
    loudness = common.add_mutually_exclusive_group()
    loudness.add_argument("-q", "--quiet", action="store_true", help="no progress, results only")
    loudness.add_argument("-v", "--verbose", action="count", default=0, help="also the steps taken; -vv their details")
    found = parser.add_subparsers(required=True, metavar="COMMAND")

    def add(name: str, what: str, command: commands.Command) -> argparse.ArgumentParser:
        made = found.add_parser(name, help=what, description=what[0].upper() + what[1:] + ".", parents=[common])
        made.set_defaults(command=command)
        return made

    _run(add("run", "solve a scene, write its summary, figures and fields", commands.run))
    view = add("view", "make a page to explore from the folder of a run, and open it", commands.view)
    view.add_argument("folder", metavar="DIR", help="a folder that contactopt run wrote")
    view.add_argument("--out", metavar="FILE", help="where the page goes (default: DIR/view.html)")
    view.add_argument("--no-open", action="store_true", help="do not open the browser")
    show = add("show", "say what a scene is: sketch, sizes, arguments, source, what is exact", commands.show)
    show.add_argument("scene", metavar="SCENE", help="a scene file (.toml), or " + ", ".join(SCENES))
    show.add_argument("--set", metavar="NAME=VALUE", action="append", default=[], help="an argument of the scene")
    new = add("new", "write a scene file to start from, an example that runs", commands.new)
    new.add_argument("file", metavar="FILE", help="name of the file, ends in .toml; an existing one is not overwritten")
    _bench(add("bench", "execute the runs of an experiment file", commands.bench))
    _report(add("report", "rebuild the benchmark reports from their tables, without solving", commands.report))
    add("list", "scenes, methods, preconditioners and backends", commands.listing)
    completion = add("completion", "print a script that completes commands, options and scenes", commands.completion)
    completion.add_argument("shell", choices=("bash", "zsh", "fish"))
    return parser


def _run(run: argparse.ArgumentParser) -> None:
    run.add_argument("scene", metavar="SCENE", help="a scene file (.toml), or " + ", ".join(SCENES))
    run.add_argument("--out", metavar="DIR", help="where files go (default: out/SCENE)")
    run.add_argument("--method", help=", ".join(METHODS) + " (auto, or alternating if a backend is named)")
    run.add_argument("--normal", metavar="BACKEND", help="QP backend of the normal problem")
    run.add_argument("--tangential", metavar="BACKEND", help="QP (2D, axisymmetric) or conic (3D) backend")
    run.add_argument("--q", metavar="FORM", help=", ".join(FORMS) + ": Q as an array or by its products")
    run.add_argument(
        "--preconditioner", metavar="NAME", help=", ".join(PRECONDITIONERS) + ", none; selects --q implicit"
    )
    run.add_argument("--solver", metavar="NAME", help="of the bodies: auto, " + ", ".join(SOLVERS))
    run.add_argument("--mu", type=float, metavar="X", help="friction coefficient")
    run.add_argument("--force", type=float, metavar="N", help="total normal force")
    run.add_argument("--degree", type=int, metavar="1|2", help="linear or quadratic displacement (the scene's own)")
    run.add_argument("--simplices", action="store_true", default=None, help="triangles or tetrahedra, not bricks")
    run.add_argument("--elements", type=int, metavar="N", help="elements across the contact half-width")
    run.add_argument(
        "--set",
        metavar="NAME=VALUE",
        action="append",
        default=[],
        help="any argument of the scene, as contactopt show SCENE lists them; may be given several times",
    )
    run.add_argument(
        "--accuracy", type=float, metavar="X", help="refine until the quantity's relative error is below X"
    )
    run.add_argument(
        "--quantity",
        metavar="NAME",
        help="what --accuracy bounds: " + ", ".join((*QUANTITIES, *PLACED)) + "; of one pair NAME:PAIR",
    )
    run.add_argument("--adaptive", action="store_true", help="refine only where the quantity needs it")
    run.add_argument(
        "--max-unknowns", type=int, metavar="N", help="of a mesh, at which the search for an accuracy ends"
    )
    run.add_argument("--time-limit", type=float, metavar="S", help="seconds at which the search for an accuracy ends")
    run.add_argument(
        "--max-memory", type=float, metavar="GB", help="memory at which the search for an accuracy ends (2)"
    )
    run.add_argument(
        "--ranks", type=int, metavar="N", help="processes among which the bodies are dealt out (needs mpi4py)"
    )
    run.add_argument("--tol", type=float, metavar="T", help="bound on the natural-map residual (1e-8)")
    pictures = run.add_mutually_exclusive_group()
    pictures.add_argument(
        "--figures", metavar="FORMAT", nargs="+", default=["png"], choices=FORMATS, help="of " + ", ".join(FORMATS)
    )
    pictures.add_argument("--no-figures", dest="figures", action="store_const", const=[], help="draw no figures")
    run.add_argument("--html", action="store_true", help="write view.html too, the result as a page to explore")
    run.add_argument("--json", action="store_true", help="print the summary as JSON, and nothing else")


def _bench(bench: argparse.ArgumentParser) -> None:
    bench.formatter_class = argparse.RawDescriptionHelpFormatter
    bench.epilog = help_text()
    bench.add_argument("file", metavar="FILE", help="experiment, a TOML file whose keys are listed below")
    bench.add_argument("--out", metavar="DIR", help="where results go (default: out/bench/NAME)")
    bench.add_argument("--jobs", type=int, metavar="N", help="worker processes (one per core)")
    bench.add_argument("--resume", action="store_true", help="go on with an interrupted campaign")
    bench.add_argument(
        "--filter", action="append", default=[], metavar="COL=PATTERN", help="problem, method, setting, ..."
    )
    bench.add_argument("--scheduler", metavar="ADDRESS", help="of a Dask cluster, instead of local processes")


def _report(report: argparse.ArgumentParser) -> None:
    report.add_argument(
        "names",
        nargs="*",
        metavar="NAME",
        help="of the experiments to run (all), or folders of finished campaigns, whose reports are written into them",
    )
    report.add_argument("--experiments", default="experiments/campaigns", metavar="DIR", help="(experiments/campaigns)")
    report.add_argument("--reports", default="reports", metavar="DIR", help="where tables and reports are (reports)")
    report.add_argument(
        "--run", default="", choices=("quick", "full"), help="run the experiments first; quick: in out/"
    )
    report.add_argument("--jobs", type=int, metavar="N", help="worker processes (one per core)")
