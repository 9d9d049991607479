"""The command line.

Exit codes: 0 done (run: solved, and to the accuracy asked for), 1 not solved, 2 input that cannot be used, 130 interrupted.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from contactopt.analysis.quantities import QUANTITIES
from contactopt.bodies.ranks import Team, launch, leave, serve, world
from contactopt.bodies.solvers import SOLVERS
from contactopt.errors import InputError
from contactopt.problem.laws import LAWS
from contactopt.problem.operators import FORMS
from contactopt.scenes import PATHS, SCENES
from contactopt.solving.backends import CONIC, QP
from contactopt.solving.methods import METHODS, NATIVE
from contactopt.solving.preconditioners import PRECONDITIONERS

FORCES = {("mm", "MPa"): "N", ("m", "Pa"): "N", ("m", "kPa"): "kN", ("m", "MPa"): "MN", ("in", "psi"): "lbf"}


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit code: 0 solved, 1 not solved, 2 bad input."""
    told = sys.argv[1:] if arguments is None else list(arguments)
    options = make_parser().parse_args(told)
    return _answered(lambda: _execute(options, told))


def _execute(options: argparse.Namespace, told: list[str]) -> int:
    """One command, on all ranks where mpiexec started several."""
    if (comm := world()) is None:
        ranks = getattr(options, "ranks", None)
        return int(options.command(options) if ranks is None else launch(ranks, told))
    if comm.rank:
        serve(comm)
        return 0
    team = Team(comm)
    try:
        return leave(_answered(lambda: _on_ranks(options, team)))
    finally:
        team.dismiss()


def _answered(command: Callable[[], int]) -> int:
    """The exit code of a command; what ends it is said in one sentence."""
    try:
        return command()
    except InputError as error:
        print(f"contactopt: {error}", file=sys.stderr)
        return 2
    except MemoryError:
        print("contactopt: this needs more memory than there is; take fewer elements.", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("contactopt: interrupted", file=sys.stderr)
        return 130


def make_parser() -> argparse.ArgumentParser:
    """Commands and options."""
    parser = argparse.ArgumentParser("contactopt", description="Frictional contact as mathematical programs.")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    run = commands.add_parser("run", help="solve a scene, write its summary, figures and fields")
    run.set_defaults(command=_run)
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
        "--accuracy", type=float, metavar="X", help="refine until the quantity's relative error is below X"
    )
    run.add_argument("--quantity", metavar="NAME", help="what --accuracy bounds: " + ", ".join(QUANTITIES))
    run.add_argument("--tol", type=float, metavar="T", help="bound on the natural-map residual (1e-8)")
    run.add_argument(
        "--ranks", type=int, metavar="N", help="processes among which the bodies are dealt out (needs mpi4py)"
    )
    new = commands.add_parser("new", help="write a scene file to start from, an example that runs")
    new.set_defaults(command=_new)
    new.add_argument("file", metavar="FILE", help="name of the file, ends in .toml; an existing one is not overwritten")
    bench = commands.add_parser("bench", help="execute the runs of an experiment file")
    bench.set_defaults(command=_bench)
    bench.add_argument("file", metavar="FILE", help="experiment, TOML (see contactopt.benchmark)")
    bench.add_argument("--out", metavar="DIR", help="where results go (default: out/bench/NAME)")
    bench.add_argument("--jobs", type=int, metavar="N", help="worker processes (one per core)")
    bench.add_argument("--resume", action="store_true", help="go on with an interrupted campaign")
    bench.add_argument(
        "--filter", action="append", default=[], metavar="COL=PATTERN", help="problem, method, setting, ..."
    )
    bench.add_argument("--scheduler", metavar="ADDRESS", help="of a Dask cluster, instead of local processes")
    report = commands.add_parser("report", help="rebuild the benchmark reports from their tables, without solving")
    report.set_defaults(command=_report)
    report.add_argument("names", nargs="*", metavar="NAME", help="of the experiments to run (all)")
    report.add_argument("--experiments", default="experiments/campaigns", metavar="DIR", help="(experiments/campaigns)")
    report.add_argument("--reports", default="reports", metavar="DIR", help="where tables and reports are (reports)")
    report.add_argument(
        "--run", default="", choices=("quick", "full"), help="run the experiments first; quick: in out/"
    )
    report.add_argument("--jobs", type=int, metavar="N", help="worker processes (one per core)")
    show = commands.add_parser("list", help="scenes, methods, preconditioners and backends")
    show.set_defaults(command=_list)
    return parser


def _on_ranks(options: argparse.Namespace, team: Team) -> int:
    """`run` on rank 0 with the bodies dealt out to all ranks."""
    if options.command is not _run:
        raise InputError("only the command 'run' uses several ranks; start the others without mpiexec.")
    if options.ranks not in (None, team.size):
        raise InputError(f"--ranks {options.ranks} was asked for, but mpiexec started {team.size} ranks.")
    code = _run(options, team)
    print(f"{team.size} ranks, {team.traffic.messages} messages, {team.traffic.length} bytes")
    return code


def _run(options: argparse.Namespace, team: Team | None = None) -> int:
    from contactopt.runner import run

    out = options.out or f"out/{Path(options.scene).stem}"
    changes = {
        name: getattr(options, name)
        for name in ("mu", "force", "degree", "simplices")
        if getattr(options, name) is not None
    }
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
        elements=options.elements,
        accuracy=options.accuracy,
        quantity=options.quantity,
        note=lambda text: print(f"  {text}", file=sys.stderr, flush=True),
        team=team,
        **changes,
    )
    s = result.summary
    print(f"{s['scene']}: {s['dofs']} unknowns, {s['contact_nodes']} contact nodes, mu = {s['mu']:g}")
    print(f"{s['status']}: {result.solution.message}; {s['outer_iterations']} iterations, residual {s['residual']:.1e}")
    if s["q"] == "implicit":
        print(f"Q by {s['products']} products, never formed")
    native = s["normal_backend"] == s["tangential_backend"] == NATIVE
    by = f", normal problem by {s['normal_backend']}, tangential by {s['tangential_backend']}"
    print(f"method {s['method']}" + ("" if native else by))
    length, stress = result.scene.units
    force = FORCES.get((length, stress), f"{stress} {length}^2")
    approach = "none (no plate)" if s["approach"] is None else f"{s['approach']:.6g} {length}"
    print(
        f"normal force {s['normal_force']:.6g} {force}, approach {approach}, "
        f"largest pressure {s['max_pressure']:.6g} {stress}"
    )
    if s["contact_half_width"] is not None:
        print(
            f"contact half-width {s['contact_half_width']:.6g} {length}, "
            f"stick half-width {s['stick_half_width']:.6g} {length}"
        )
    if result.estimate is not None:
        _print_estimate(result.estimate)
    print(
        f"{s['seconds']['total']:.1f} s: " + ", ".join(f"{k} {v:.2f}" for k, v in s["seconds"].items() if k != "total")
    )
    extra = "" if result.path is None else " path.png, history.csv, path.npz,"
    print(f"files in {out}: summary.json, deformed.png, pressure.png,{extra} interface.npz, *.vtu")
    return 0 if result.solution.solved and (result.estimate is None or result.estimate.reached) else 1


def _new(options: argparse.Namespace) -> int:
    from contactopt.scenes.example import write_example

    write_example(Path(options.file))
    print(f"{options.file} is an example that runs: contactopt run {options.file}")
    return 0


def _print_estimate(estimate: Any) -> None:
    error = "unknown" if estimate.error is None else f"{estimate.error:.1e}"
    print(f"{estimate.quantity} {estimate.value:.6g}, estimated relative error {error}, asked for {estimate.target:g}:")
    print(f"  {estimate.message}")
    for level in estimate.levels:
        print(
            f"  {level.elements} elements, {level.splits} splits: {level.unknowns} unknowns, "
            f"{level.value:.6g}, {level.seconds:.2f} s"
        )


def _bench(options: argparse.Namespace) -> int:
    from contactopt.benchmark.campaign import run_campaign
    from contactopt.benchmark.store import load

    try:
        folder = run_campaign(
            options.file,
            options.out,
            jobs=options.jobs,
            resume=options.resume,
            filters=options.filter,
            scheduler=options.scheduler,
        )
    except KeyboardInterrupt:
        print("contactopt: interrupted; finished runs are kept, go on with --resume", file=sys.stderr)
        return 130
    table = load(folder)
    print(f"{len(table)} runs: " + ", ".join(f"{n} {status}" for status, n in table["status"].value_counts().items()))
    print(f"results in {folder}: rows.parquet (read them with contactopt.benchmark.load)")
    return 0


def _report(options: argparse.Namespace) -> int:
    from contactopt.benchmark.campaign import run_reports

    paths = sorted(Path(options.experiments).glob("*.toml"))
    page = run_reports(paths, options.reports, options.run, options.names, options.jobs)
    print(f"reports in {page.parent}, all of them in {page}")
    return 0


def _list(options: argparse.Namespace) -> int:
    print("scenes")
    for name, (_, _, what, *_) in SCENES.items():
        print(f"  {name:26} {what}" + (" (load path)" if name in PATHS else ""))
    print("laws of contact")
    for name, (_, _, what) in LAWS.items():
        print(f"  {name:20} {what}")
    print("methods")
    for name, (_, _, what) in METHODS.items():
        print(f"  {name:20} {what}")
    print("forms of the interface operator Q: " + ", ".join(FORMS))
    print("solvers of the bodies: auto, " + ", ".join(SOLVERS))
    print("preconditioners of the interface operator")
    for name, (_, _, what) in PRECONDITIONERS.items():
        print(f"  {name:20} {what}")
    for title, table in (("QP backends (normal; tangential in 2D)", QP), ("conic backends (tangential in 3D)", CONIC)):
        print(title)
        for backend in table.values():
            missing = f"not installed: pip install {backend.package}"
            print(f"  {backend.name:12} {f'installed, {backend.version}' if backend.installed else missing}")
    return 0
