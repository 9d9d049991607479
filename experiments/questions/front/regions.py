"""Which error is the largest? Hertz's contact along a line, on a body that is too small.

The error of a reading is a sum of four: model (the limit of this body, less the known answer), mesh
(fitted, the solver's error taken away, less that limit), reading (that of the nodes, less the
fitted one) and tolerance (less the reading of the exact solution on the mesh).
"""

from __future__ import annotations

from experiments.questions.front.bodies import flat_model, line
from experiments.questions.front.measured import TIGHT, Row, read, solved

SIZE, MESHES, FINE = 10.0, (2, 3, 4, 6, 8, 12, 16, 24, 32), 24
TOLERANCES = (1e-1, 3e-2, 1e-2, 3e-3, 1e-3, 1e-4)
QUANTITIES = ("peak", "width")


def regions() -> list[Row]:
    """The four errors over mesh and tolerance, of Gauss-Seidel's method, which stops at either."""
    known = line()
    exact = {"peak": known.exact.peak, "width": known.exact.half_width}
    limit = read(solved(flat_model(known, 2, SIZE), FINE, TIGHT, "auto"), "fitted")
    scene, rows = flat_model(known, 1, SIZE), []
    for mesh in MESHES:
        tight = solved(scene, mesh, TIGHT, "auto")
        settled = {name: read(tight, name) for name in ("fitted", "nodes")}
        for tol in TOLERANCES:
            found = solved(scene, mesh, tol, "nsgs")
            for reading, own in settled.items():
                now = read(found, reading)
                for q in QUANTITIES:
                    parts = {
                        "model": limit[q] / exact[q] - 1,
                        "mesh": (settled["fitted"][q] - limit[q]) / exact[q],
                        "reading": (own[q] - settled["fitted"][q]) / exact[q],
                        "tolerance": (now[q] - own[q]) / exact[q],
                    }
                    row: Row = {"mesh": mesh, "tolerance": tol, "reading": reading, "quantity": q}
                    rows.append(row | {f"{key} error": value for key, value in parts.items()})
    return rows
