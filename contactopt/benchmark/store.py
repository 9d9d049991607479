"""Results on disk: one JSON line per finished run, appended in one write; consolidated to Parquet, CSV for small tables.

A campaign's folder holds `rows.jsonl` (appended while it runs), `rows.parquet` (the same, consolidated at its end) and
`experiment.toml`. Killed at any moment, at most the last line is torn; it is cut off when the file is opened again.
"""

from __future__ import annotations

import base64
import fcntl
import json
import os
import tempfile
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from contactopt.errors import InputError
from contactopt.problem import Status

if TYPE_CHECKING:
    import pandas as pd

SCHEMA = 1  # of COLUMNS; a reader refuses newer ones

# column -> (type, what it is)
COLUMNS: dict[str, tuple[str, str]] = {
    "schema": ("int", "version of these columns"),
    "key": ("str", "of the run: problem, method, backend versions, setting, start and repeat"),
    "experiment": ("str", "name of the experiment"),
    "problem": ("str", "name with parameters"),
    "family": ("str", "the problem's name: scene, FCLib file or generated family"),
    "parameters": ("str", "of the problem, JSON; load() adds them as columns problem.NAME"),
    "fingerprint": ("str", "digest of the problem's data"),
    "contacts": ("int", "number of contacts"),
    "dim": ("int", "2 or 3"),
    "plates": ("int", "balance rows"),
    "rank": ("float", "of Q; nan unless the experiment asks to diagnose, as are the next four"),
    "condition": ("float", "of Q on its range"),
    "guaranteed_mu": (
        "float",
        "the alternating iteration contracts for every load below this largest friction coefficient",
    ),
    "alternating_mu": ("float", "it does not for some load at this one (all contacts slip one way); the least such"),
    "tresca_mu": ("float", "the same for the Tresca iteration"),
    "method": ("str", "name with the settings given"),
    "name": ("str", "the method's name"),
    "settings": ("str", "given to the method, JSON; load() adds them as columns method.NAME"),
    "label": ("str", "the method with all its settings"),
    "backend": ("str", "QP and conic backends with versions, or native"),
    "law": ("str", "the problem solved: coulomb, or associated (convex relaxation)"),
    "setting": ("str", "default, low, mid, high, or a number"),
    "tolerance": ("float", "bound on the certificate by which success is judged; 1e-8 at default"),
    "time_limit": ("float", "of the run [s]"),
    "start": ("str", "cold or warm"),
    "repeat": ("int", "0, 1, ..."),
    "status": ("str", "how the run ended: a key of STATUSES"),
    "message": ("str", "details"),
    "claimed": ("bool", "the method called its answer a solution"),
    "success": ("bool", "law_residual <= tolerance within the time limit"),
    "iterations": ("float", "outer iterations; nan if unknown"),
    "residual": ("float", "natural-map residual of Coulomb's problem, recomputed; inf without a finite answer"),
    "law_residual": ("float", "the same for the method's own law"),
    "error": ("float", "|r - r_ref| / |r_ref|, r_ref the answer of least residual <= 1e-8 to this problem"),
    "build_seconds": ("float", "building the problem, wall; once per process"),
    "solve_seconds": ("float", "the method's own time, wall: certificates along the way not counted"),
    "call_seconds": ("float", "wall time of the whole call"),
    "cpu_seconds": ("float", "CPU time of the whole call, all threads"),
    "peak_mb": ("float", "largest resident memory of the process during the call [MB]"),
    "base_mb": ("float", "resident memory before it [MB]"),
    "history": ("str", "JSON: residual after each outer iteration, and the seconds until then; thinned to 100"),
    "versions": ("str", "of Python, contactopt, NumPy and SciPy"),
    "machine": ("str", "processor and number of cores"),
    "time": ("str", "UTC, end of the run"),
}
STATUSES = {s.label: s.sentence for s in Status} | {
    "solved": "the certificate is at most the tolerance",
    "false_claim": "called a solution by the method, but its certificate is above the tolerance",
    "not_finite": "the answer holds numbers that are not finite",
    "refused": "the method does not take this problem",
    "error": "the method raised an exception",
    "crashed": "the method ended its process",
    "killed": "still running at the hard time limit",
    "out_of_memory": "asked for more memory than the limit",
    "not_built": "the problem itself could not be built",
}
REFERENCE = 1e-8  # largest residual of a reference solution


def require(*modules: str) -> None:
    """InputError with what to install if one of the benchmark layer's own dependencies is missing."""
    missing = [name for name in modules if find_spec(name) is None]
    if missing:
        raise InputError(f"benchmarks need {', '.join(missing)}; install with: pip install 'contactopt[benchmark]'")


class Store:
    """The appending end, for one campaign at a time (file lock). Use as a context manager."""

    def __init__(self, folder: Path, resume: bool):
        """InputError if the folder holds results and `resume` is not set, or if another campaign writes there."""
        folder.mkdir(parents=True, exist_ok=True)
        self.path = folder / "rows.jsonl"
        self.descriptor = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o644)
        try:
            fcntl.flock(self.descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            os.close(self.descriptor)
            raise InputError(
                f"another campaign is writing into '{folder}'; wait for it or choose another --out."
            ) from error
        if os.fstat(self.descriptor).st_size and not resume:
            os.close(self.descriptor)
            raise InputError(f"'{folder}' holds results already; add --resume to go on, or choose another --out.")
        self._cut_torn_tail()

    def __enter__(self) -> Store:
        return self

    def __exit__(self, *error: object) -> None:
        os.close(self.descriptor)

    def _cut_torn_tail(self) -> None:
        end, block = os.fstat(self.descriptor).st_size, 1 << 16
        while end > 0:
            begin = max(0, end - block)
            newline = os.pread(self.descriptor, end - begin, begin).rfind(b"\n")
            if newline >= 0:
                end = begin + newline + 1
                break
            end = begin
        os.ftruncate(self.descriptor, end)

    def finished(self) -> set[str]:
        """Keys of the runs that have a row."""
        return {row["key"] for row in lines(self.path)}

    def append(self, row: dict[str, Any]) -> None:
        data = (json.dumps(row) + "\n").encode()
        while data:  # a second write only if the disk is full or a signal came
            data = data[os.write(self.descriptor, data) :]


def lines(path: Path) -> Iterator[dict[str, Any]]:
    """The rows of a rows.jsonl; lines that are not whole are left out."""
    with open(path, "rb") as file:
        for line in file:
            try:
                row = json.loads(line)
            except ValueError:
                continue
            if row.get("schema", 0) > SCHEMA:
                raise InputError(
                    f"'{path}' was written by a newer version (schema {row['schema']}); update contactopt."
                )
            yield row


def pack(reactions: np.ndarray) -> str:
    return base64.b64encode(np.ascontiguousarray(reactions, dtype=float).tobytes()).decode()


def unpack(text: str) -> np.ndarray:
    return np.frombuffer(base64.b64decode(text))


def load(path: str | Path) -> pd.DataFrame:
    """The table of a campaign: its folder, or a rows.jsonl, .parquet or .csv. One row per run, columns as COLUMNS.

    Parameters of the problem and settings of the method are added as columns problem.NAME and method.NAME.
    Raises InputError if there is no table, or one of a newer schema.
    """
    require("pandas", "pyarrow")
    import pandas as pd

    path = Path(path)
    if path.is_dir():
        found = [path / f"rows.{kind}" for kind in ("jsonl", "parquet", "csv") if (path / f"rows.{kind}").exists()]
        if not found:
            raise InputError(f"'{path}' holds no results (rows.jsonl, rows.parquet or rows.csv).")
        path = found[0]
    try:
        if path.suffix == ".jsonl":
            table = _from_lines(path)
        elif path.suffix == ".parquet":
            table = pd.read_parquet(path)
        else:
            texts = {name: "str" for name, (kind, _) in COLUMNS.items() if kind == "str"}
            table = pd.read_csv(
                path, dtype=texts, keep_default_na=False, na_values={n: ["", "nan"] for n in COLUMNS if n not in texts}
            )
    except (OSError, ValueError) as error:
        raise InputError(f"cannot read the results '{path}': {error}") from error
    if len(table) and int(table["schema"].max()) > SCHEMA:
        raise InputError(f"'{path}' was written by a newer version; update contactopt.")
    for source, prefix in (("parameters", "problem"), ("settings", "method")):
        if source in table:
            given = pd.DataFrame([json.loads(text or "{}") for text in table[source]], index=table.index)
            table = table.join(given.add_prefix(f"{prefix}."))
    return table


def _from_lines(path: Path) -> pd.DataFrame:
    import pandas as pd

    rows = {row["key"]: row for row in lines(path)}  # one per run
    best: dict[str, dict[str, Any]] = {}
    for row in rows.values():
        if row["residual"] <= REFERENCE and row.get("answer"):
            known = best.get(row["fingerprint"])
            if known is None or row["residual"] < known["residual"]:
                best[row["fingerprint"]] = row
    reference = {fingerprint: unpack(row["answer"]) for fingerprint, row in best.items()}
    for row in rows.values():
        answer, row["error"] = row.pop("answer", ""), np.nan
        if answer and row["fingerprint"] in reference:
            exact = reference[row["fingerprint"]]
            size = float(np.linalg.norm(exact))
            row["error"] = float(np.linalg.norm(unpack(answer) - exact)) / size if size > 0 else np.nan
    types = {"int": "int64", "str": "str", "float": "float64", "bool": "bool"}
    table = pd.DataFrame(list(rows.values()), columns=list(COLUMNS))
    return table.astype({name: types[kind] for name, (kind, _) in COLUMNS.items()})


def save(table: pd.DataFrame, path: str | Path, columns: list[str] | None = None) -> None:
    """Write a table as .parquet or .csv, complete or not at all; `columns` of COLUMNS, all by default."""
    path = Path(path)
    chosen = table[[c for c in (columns or COLUMNS) if c in table]]
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(suffix=path.suffix, dir=path.parent)
    os.close(handle)
    try:
        if path.suffix == ".parquet":
            chosen.to_parquet(name, index=False)
        else:
            chosen.to_csv(name, index=False, float_format="%.6g")
        os.chmod(name, 0o644)
        os.replace(name, path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise
