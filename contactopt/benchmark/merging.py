"""Rows of several campaigns in one table. What others say of an answer is not believed: problems
are built again here, in a process of their own, and certificates computed from them.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from contactopt.benchmark import worker
from contactopt.benchmark.families import FAMILIES
from contactopt.benchmark.pool import BUILD_LIMIT
from contactopt.benchmark.problems import ProblemSpec, named
from contactopt.benchmark.process import Ended, Process, one_line
from contactopt.benchmark.sequences import Sequence as States
from contactopt.benchmark.sequences import certificate
from contactopt.benchmark.store import ABSENT, answers, load
from contactopt.cards import count
from contactopt.errors import InputError
from contactopt.files.toml_table import read_table
from contactopt.problem import InterfaceProblem
from contactopt.scenes import SCENES

if TYPE_CHECKING:
    import pandas as pd

MEMORY_LIMIT = 4.0  # GB to build a problem of others
CLAIMS = ["problem", "family", "parameters"]  # what a row says of its problem


def joined(folder: Path, others: Sequence[str | Path]) -> tuple[pd.DataFrame, list[str]]:
    """The rows of a campaign and those of others, and sentences about what was recomputed.

    Rows of the same experiment on other problems are a shard of it. Methods of all others are told
    apart by their file.
    """
    import pandas as pd

    own = load(folder, absent=True).assign(source=folder.resolve().name)
    tables, said = [own], []
    for other in map(Path, others):
        rows, found = _recomputed(load(other, absent=True), other, _files_of(folder))
        # a limit of others must not lengthen the failures of ours
        rows["time_limit"] = rows["time_limit"].clip(upper=own["time_limit"].max())
        there, made = rows[rows["status"] != ABSENT], own[own["status"] != ABSENT]
        same = set(there["experiment"]) == set(made["experiment"])
        if not same or set(there["problem"]) & set(made["problem"]):
            known = rows["method"].isin(own["method"])
            rows["method"] = rows["method"].where(~known, rows["method"] + f" ({other.stem})")
        tables.append(rows.assign(source=other.stem))
        said += found
    return pd.concat(tables, ignore_index=True), said


def _recomputed(
    rows: pd.DataFrame, path: Path, files: dict[str, ProblemSpec]
) -> tuple[pd.DataFrame, list[str]]:
    """Rows with certificates from their answers; a sentence for each reason to leave out others."""
    found, builder = answers(path), Process()
    claims = rows[np.isfinite(rows["residual"])]
    why, certificates = dict.fromkeys(claims.index, ""), dict.fromkeys(claims.index, np.inf)
    try:
        for claim, group in claims.groupby(CLAIMS, sort=False):
            problem = _built(builder, [str(part) for part in claim], files)
            for index in group.index:
                answer = found.get(str(rows["key"].get(index))) if "key" in rows else None
                if isinstance(problem, str):
                    why[index] = problem
                elif answer is None:
                    why[index] = "no answer travels with it"
                else:
                    try:
                        certificates[index] = _certificate(problem, answer)
                    except (ValueError, TypeError) as error:  # InputError, too
                        why[index] = one_line(error)
    finally:
        builder.kill()
    kept = [index for index, reason in why.items() if not reason]
    before = rows.loc[kept, "success"]
    residual = rows.loc[kept, "residual"] = [certificates[index] for index in kept]
    in_time = ~(rows.loc[kept, "solve_seconds"] > rows.loc[kept, "time_limit"])
    success = (np.array(residual) <= rows.loc[kept, "tolerance"]) & in_time
    rows.loc[kept, "success"] = success
    rows.loc[success.index[success], "status"] = "solved"
    rows.loc[before.index[before & ~success], "status"] = "false_claim"
    said = [
        f"'{path}': {len(kept)} certificates were recomputed from their answers;"
        f" {int((before & ~success).sum())} of these rows claimed a success that is none. Times are"
        " taken over as they stand there."
    ]
    said += [
        f"'{path}': {count(number, 'row is', 'rows are')} left out, since no certificate can be"
        f" recomputed: {reason}."
        for reason, number in Counter(filter(None, why.values())).most_common()
    ]
    left_out = [index for index, reason in why.items() if reason]
    return rows.drop(index=left_out).reset_index(drop=True), said


def _certificate(problem: InterfaceProblem | States, answer: np.ndarray) -> float:
    r, lam = np.split(np.ravel(answer), [problem.q.size])
    return certificate(problem, r, lam if lam.size else None)


def _built(
    builder: Process, claim: list[str], files: dict[str, ProblemSpec]
) -> InterfaceProblem | States | str:
    """The problem of a row, as CLAIMS, or why it cannot be built here."""
    label, name, parameters = claim
    try:
        kind = "family" if name in FAMILIES else "scene" if name in SCENES else "fclib"
        spec = ProblemSpec(kind, name, json.loads(parameters))
        if spec.label != label:
            return f"'{label}' is not what its parameters say"
        if kind == "fclib" and label not in files:
            return f"'{label}' is a problem of a plug-in, or its file is not here"
        made: Any = builder.ask(
            BUILD_LIMIT, "build", worker.build, files.get(label, spec), (), False, MEMORY_LIMIT
        )
    except (ValueError, TypeError, AttributeError) as error:
        return f"the parameters of '{label}' cannot be read: {one_line(error)}"
    except Ended as end:
        return f"'{label}': {end.status} while the problem was built"
    return made if isinstance(made, str) else made[0]


def _files_of(folder: Path) -> dict[str, ProblemSpec]:
    """The FCLib files that the campaign's experiment names and that are here, by label."""
    found: dict[str, ProblemSpec] = {}
    with suppress(InputError):
        for entry in read_table(folder / "experiment.toml", "experiment").data["problems"]:
            for name in np.atleast_1d(entry.get("fclib", [])):
                with suppress(InputError):
                    specs = named("fclib", str(name), {}, folder)
                    found |= {spec.label: spec for spec in specs}
    return found
