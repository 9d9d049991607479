"""The command line: `contactopt run SCENE` and `contactopt list`."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from contactopt.backends import CONIC, QP
from contactopt.errors import InputError
from contactopt.methods import METHODS, NATIVE
from contactopt.scenes import SCENES


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit code: 0 solved, 1 not solved, 2 bad input."""
    options = _parser().parse_args(arguments)
    try:
        return int(options.command(options))
    except InputError as error:
        print(f"contactopt: {error}", file=sys.stderr)
        return 2


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser("contactopt", description="Frictional contact as mathematical programs.")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    run = commands.add_parser("run", help="solve a scene, write its summary, figures and fields")
    run.set_defaults(command=_run)
    run.add_argument("scene", metavar="SCENE", help=", ".join(SCENES))
    run.add_argument("--out", metavar="DIR", help="where files go (default: out/SCENE)")
    run.add_argument("--method", help=", ".join(METHODS) + " (auto, or alternating if a backend is named)")
    run.add_argument("--normal", metavar="BACKEND", help="QP backend of the normal problem")
    run.add_argument("--tangential", metavar="BACKEND", help="QP (2D, axisymmetric) or conic (3D) backend")
    run.add_argument("--mu", type=float, metavar="X", help="friction coefficient")
    run.add_argument("--force", type=float, metavar="N", help="total normal force")
    run.add_argument("--elements", type=int, metavar="N", help="elements across the contact half-width")
    run.add_argument("--tol", type=float, default=1e-8, metavar="T", help="bound on the natural-map residual (1e-8)")
    show = commands.add_parser("list", help="scenes, methods, preconditioners and backends")
    show.set_defaults(command=_list)
    return parser


def _run(options: argparse.Namespace) -> int:
    from contactopt.runner import run

    out = options.out or f"out/{options.scene}"
    changes = {name: getattr(options, name) for name in ("mu", "force") if getattr(options, name) is not None}
    result = run(
        options.scene,
        out,
        method=options.method,
        normal=options.normal,
        tangential=options.tangential,
        tol=options.tol,
        elements=options.elements,
        note=lambda text: print(f"  {text}", file=sys.stderr, flush=True),
        **changes,
    )
    s = result.summary
    print(f"{s['scene']}: {s['dofs']} unknowns, {s['contact_nodes']} contact nodes, mu = {s['mu']:g}")
    print(f"{s['status']}: {result.solution.message}; {s['outer_iterations']} iterations, residual {s['residual']:.1e}")
    native = s["normal_backend"] == s["tangential_backend"] == NATIVE
    by = f", normal problem by {s['normal_backend']}, tangential by {s['tangential_backend']}"
    print(f"method {s['method']}" + ("" if native else by))
    approach = "none (no plate)" if s["approach"] is None else f"{s['approach']:.6g} mm"
    print(f"normal force {s['normal_force']:.6g} N, approach {approach}, largest pressure {s['max_pressure']:.6g} MPa")
    print(f"contact half-width {s['contact_half_width']:.6g} mm, stick half-width {s['stick_half_width']:.6g} mm")
    print(
        f"{s['seconds']['total']:.1f} s: " + ", ".join(f"{k} {v:.2f}" for k, v in s["seconds"].items() if k != "total")
    )
    print(f"files in {out}: summary.json, deformed.png, pressure.png, interface.npz, *.vtu")
    return 0 if result.solution.solved else 1


def _list(options: argparse.Namespace) -> int:
    from contactopt.preconditioners import PRECONDITIONERS

    print("scenes")
    for name, (_, what) in SCENES.items():
        print(f"  {name:12} {what}")
    print("methods")
    for name, (_, _, what) in METHODS.items():
        print(f"  {name:20} {what}")
    print("preconditioners of the interface operator")
    for name, (_, what) in PRECONDITIONERS.items():
        print(f"  {name:20} {what}")
    for title, table in (("QP backends (normal; tangential in 2D)", QP), ("conic backends (tangential in 3D)", CONIC)):
        print(title)
        for backend in table.values():
            missing = f"not installed: pip install {backend.package}"
            print(f"  {backend.name:12} {f'installed, {backend.version}' if backend.installed else missing}")
    return 0
