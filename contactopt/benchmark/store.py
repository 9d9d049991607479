"""Results on disk: `rows.jsonl`, one line per finished run, appended in one write while a campaign
runs, `rows.parquet`, the same at its end, and `experiment.toml`. Killed at any moment, at most the
last line is torn; it is cut off when the file is opened again.
"""

from __future__ import annotations

import base64
import fcntl
import json
import logging
import os
import tempfile
import warnings
from collections.abc import Iterator, Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any
from zipfile import BadZipFile

import numpy as np

from contactopt.benchmark.keys import COLUMNS, ENDS
from contactopt.defaults import TOL, install
from contactopt.errors import InputError
from contactopt.files.writing import check_folder, whole_file
from contactopt.problem import Status

if TYPE_CHECKING:
    import pandas as pd

SCHEMA = 1  # of COLUMNS; a reader refuses newer ones

STATUSES = {status.label: status.sentence for status in Status} | ENDS
WORDS = {"int": "a whole number", "str": "a text", "float": "a number", "bool": "true or false"}
TYPES = {"int": "int64", "str": "str", "float": "float64", "bool": "bool"}  # in a table
UNKNOWN = {"int": 0, "str": "", "float": np.nan, "bool": False}  # what stands for no value yet
# columns that load() works out, or that older rows do not have
LATER = "error", "calibration", "states", "bridge_seconds"
ANSWERS = "answers.npz"  # beside the table
ABSENT = "absent"  # status of the row of a method that is not there
_log = logging.getLogger(__name__)


def require(*modules: str, extra: str = "benchmark") -> None:
    """InputError, with what to install, if one of these packages is missing."""
    missing = [name for name in modules if find_spec(name) is None]
    if missing:
        raise InputError(f"benchmarks need {', '.join(missing)}; {install(extra)}.")


class Store:
    """A context manager that appends rows to the table of a campaign. A file lock admits one
    campaign at a time. InputError for results without `resume`, another campaign, or a folder that
    cannot be written.
    """

    def __init__(self, folder: Path, resume: bool):
        self.path = folder / "rows.jsonl"
        check_folder(folder)
        folder.mkdir(parents=True, exist_ok=True)
        self.file = open(self.path, "a+b", buffering=0)  # noqa: SIM115
        wrong = ""
        try:
            fcntl.flock(self.file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            wrong = f"another campaign is writing into '{folder}'; wait for it"
        if not wrong and self.path.stat().st_size and not resume:
            wrong = f"'{folder}' holds results already; add --resume to go on,"
        if wrong:
            self.file.close()
            raise InputError(f"{wrong} or choose another --out.")
        with open(self.path, "rb") as rows:
            whole = sum(len(row) for row in rows if row.endswith(b"\n"))
        self.file.truncate(whole)  # the last line may be torn
        self.own = tempfile.TemporaryFile()  # noqa: SIM115
        self.own.write(self.path.read_bytes())

    def __enter__(self) -> Store:
        return self

    def __exit__(self, *error: object) -> None:
        self.file.close()
        self.own.close()

    def keep_own(self) -> None:
        """Take out of the file, with a warning, what others wrote into it meanwhile."""
        self.own.seek(0)
        own = self.own.read()
        if self.path.is_file() and self.path.read_bytes() == own:
            return
        _log.warning(
            "'%s' was changed by something else while the campaign ran; only the campaign's own"
            " rows are kept",
            self.path,
        )
        with whole_file(self.path) as file:
            file.write_bytes(own)

    def finished(self) -> set[str]:
        """Keys of the runs that have a row."""
        return {row["key"] for row in lines(self.path)}

    def append(self, row: dict[str, Any]) -> None:
        """Write one row, or nothing of it: InputError if the disk is full."""
        row_line = data = (json.dumps(row) + "\n").encode()
        end = os.fstat(self.file.fileno()).st_size
        try:
            while data:  # a second write only if the disk is nearly full or a signal came
                data = data[self.file.write(data) :]
        except OSError as error:
            self.file.truncate(end)
            raise InputError(
                f"cannot write into '{self.path}': {error.strerror}; finished runs are kept, make"
                " room and go on with --resume."
            ) from error
        self.own.write(row_line)


def lines(path: Path) -> Iterator[dict[str, Any]]:
    """The rows of a file rows.jsonl. Lines that are no rows are left out, with a warning.
    InputError on a newer schema.
    """
    with open(path, "rb") as file:
        for number, line in enumerate(file, 1):
            try:
                row = json.loads(line)
            except (ValueError, RecursionError):
                row = None
            if isinstance(row, dict) and _is(row.get("schema"), "int") and row["schema"] > SCHEMA:
                raise InputError(
                    f"'{path}' was written by a newer version"
                    f" (schema {row['schema']}); update contactopt."
                )
            if wrong := _wrong(row):
                _log.warning("'%s', line %d: %s; it is left out", path, number, wrong)
            else:
                yield row


def _wrong(row: object) -> str:
    """What makes a row none of a campaign, "" for nothing."""
    if not isinstance(row, dict):
        return "the line is no row of a campaign"
    for name, (kind, _) in COLUMNS.items():
        if name not in LATER and not _is(row.get(name), kind):
            return f"its '{name}' is missing, or is not {WORDS[kind]}"
    try:
        _unpack(row.get("answer", ""))
        for name, form in (("parameters", dict), ("settings", dict), ("history", list)):
            if row[name] and not isinstance(json.loads(row[name]), form):
                return f"its '{name}' holds no {'table' if form is dict else 'list'}"
    except (ValueError, TypeError, RecursionError):
        return "an entry of it cannot be read"
    return ""


def _is(value: object, kind: str) -> bool:
    """Whether a value is of the kind of a column."""
    kinds = {"int": int, "str": str, "float": int | float, "bool": bool}
    return isinstance(value, kinds[kind]) and (kind == "bool" or not isinstance(value, bool))


def _is_table(value: Any, kind: str) -> bool:
    """Whether a value is a text that holds a table of JSON, or nothing."""
    try:
        return _is(value, kind) and isinstance(json.loads(value or "{}"), dict)
    except (ValueError, RecursionError):
        return False


def pack(reactions: np.ndarray, multipliers: np.ndarray | None = None) -> str:
    """The bytes of forces (k, dim) and then of multipliers (p,) as text, in base64."""
    parts = [np.ravel(part) for part in (reactions, multipliers) if part is not None]
    return base64.b64encode(np.concatenate(parts).astype(float).tobytes()).decode()


def _unpack(text: str) -> np.ndarray:
    return np.frombuffer(base64.b64decode(text))


def save_answers(folder: Path) -> None:
    """Write the answers beside a table: key of the row -> forces and multipliers, flat."""
    with whole_file(folder / ANSWERS) as file, open(file, "wb") as open_file:
        np.savez_compressed(open_file, **_answers_in(folder / "rows.jsonl"))


def answers(path: Path) -> dict[str, np.ndarray]:
    """The answers beside a table, or else those of its lines; InputError for a broken file."""
    folder = path if path.is_dir() else path.parent
    file, rows = folder / ANSWERS, folder / "rows.jsonl"
    if not file.exists():
        return _answers_in(rows) if rows.exists() else {}
    try:
        with np.load(file) as found:
            return dict(found)
    except (OSError, ValueError, TypeError, BadZipFile) as error:
        raise InputError(f"cannot read the answers '{file}': {error}") from error


def _answers_in(path: Path) -> dict[str, Any]:
    return {row["key"]: _unpack(row["answer"]) for row in lines(path) if row.get("answer")}


def load(path: str | Path, absent: bool = False) -> pd.DataFrame:
    """Read the table of a campaign, one row for each run, with the columns COLUMNS.

    Parameters of the problem and settings of the method are added as columns problem.NAME and
    method.NAME.

    Parameters
    ----------
    path : The folder of the campaign, or a rows.jsonl, .parquet or .csv.
    absent : Whether to keep the rows that say why a method is not there.

    Returns
    -------
    The table.

    Raises
    ------
    InputError : If there is no table, if it cannot be read, or if it has a newer schema.
    """
    require("pandas", "pyarrow")
    import pandas as pd

    path = Path(path)
    if path.is_dir():
        files = [path / f"rows.{kind}" for kind in ("jsonl", "parquet", "csv")]
        found = [file for file in files if file.exists()]
        if not found:
            raise InputError(f"'{path}' holds no results (rows.jsonl, rows.parquet or rows.csv).")
        path = found[0]
    try:
        if path.suffix == ".jsonl":
            table = _from_lines(path)
        elif path.suffix == ".parquet":
            table = _of_their_kinds(pd.read_parquet(path), path, "row", 1)
        else:
            table = _from_text(path)
        if len(table) and int(table["schema"].max()) > SCHEMA:
            raise InputError(f"'{path}' was written by a newer version; update contactopt.")
        if "states" not in table:  # it is older than sequences
            table = table.assign(states=1, bridge_seconds=np.nan)
        if not absent:
            table = table[table["status"] != ABSENT].reset_index(drop=True)
        for source, prefix in (("parameters", "problem"), ("settings", "method")):
            if source in table:
                given = pd.DataFrame(
                    [dict(json.loads(text or "{}")) for text in table[source]], index=table.index
                )
                table = table.join(given.add_prefix(f"{prefix}."))
    except InputError:
        raise
    except KeyError as error:
        raise InputError(f"cannot read the results '{path}': it has no column {error}.") from error
    except (OSError, ValueError, TypeError) as error:
        why = getattr(error, "strerror", None) or "it is damaged, or no table of runs"
        raise InputError(f"cannot read the results '{path}': {why}.") from error
    return table


def _from_text(path: Path) -> pd.DataFrame:
    import pandas as pd

    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        table = pd.read_csv(path, dtype=str, keep_default_na=False, on_bad_lines="warn")
    for warning in said:
        _log.warning("'%s': %s", path, str(warning.message).strip())
    return _of_their_kinds(table, path, "line", 2)


def _of_their_kinds(table: pd.DataFrame, path: Path, word: str, first: int) -> pd.DataFrame:
    """The rows with values of the kinds of COLUMNS; a warning names the first of the others."""
    import pandas as pd

    wrong = pd.Series("", index=table.index)
    for name in [name for name in table if name in COLUMNS]:
        kind, column = COLUMNS[name][0], table[name]
        if kind == "str":
            readable = _is_table if name in ("parameters", "settings") else _is
            bad = ~column.map(lambda value, readable=readable: readable(value, "str"))
        elif kind == "bool":
            table[name] = column.map({"True": True, "False": False, True: True, False: False})
            bad = table[name].isna()
        else:
            empty = column.isna() | column.isin(["", "nan"])
            table[name] = pd.to_numeric(column, errors="coerce")
            bad = table[name].isna() & ~empty if kind == "float" else table[name] % 1 != 0
        wrong = wrong.mask(bad & (wrong == ""), f"its '{name}' is not {WORDS[kind]}")
    for index, why in wrong[wrong != ""].items():
        _log.warning("'%s', %s %d: %s; it is left out", path, word, index + first, why)
    table = table[wrong == ""].reset_index(drop=True)
    types = {name: TYPES[COLUMNS[name][0]] for name in table if name in COLUMNS}
    return table.astype(types)


def _from_lines(path: Path) -> pd.DataFrame:
    import pandas as pd

    rows = {row["key"]: {"states": 1} | row for row in lines(path)}  # one per run
    exact: dict[str, np.ndarray] = {}  # the best answer to each problem
    good = [row for row in rows.values() if row["residual"] <= TOL and row.get("answer")]
    for row in sorted(good, key=lambda row: row["residual"]):
        exact.setdefault(row["fingerprint"], _forces(row))
    for row in rows.values():
        found, row["error"] = _forces(row), np.nan
        reference = exact.get(row["fingerprint"])
        if found.size and reference is not None:
            size = float(np.linalg.norm(reference))
            if size > 0 and found.shape == reference.shape:
                row["error"] = float(np.linalg.norm(found - reference)) / size
    table = pd.DataFrame(list(rows.values()), columns=list(COLUMNS))
    return table.astype({name: TYPES[kind] for name, (kind, _) in COLUMNS.items()})


def _forces(row: Mapping[str, Any]) -> np.ndarray:
    """The forces of a row's answer, flat, without the multipliers behind them."""
    return _unpack(row.get("answer", ""))[: row["contacts"] * row["dim"]]


def save(table: pd.DataFrame, path: str | Path, columns: list[str] | None = None) -> None:
    """Write a table as .parquet or .csv, complete or not at all.

    Parameters
    ----------
    table : The rows.
    path : The file, whose ending says the format.
    columns : Some of COLUMNS; all by default.

    Raises
    ------
    InputError : If it cannot be written, as on a full disk.
    """
    path = Path(path)
    chosen = table[[c for c in columns or COLUMNS if c in table]]
    with whole_file(path) as file:
        if path.suffix == ".parquet":
            chosen.to_parquet(file, index=False, compression="zstd")
        else:
            chosen.to_csv(file, index=False, float_format="%.6g")
