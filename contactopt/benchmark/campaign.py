"""A campaign: the unfinished runs of an experiment, executed and stored one by one."""

import os
import sys
from collections import Counter
from collections.abc import Iterable, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

from contactopt.benchmark.cluster import run_on_cluster, shard_of
from contactopt.benchmark.experiment import Experiment, NothingToRun, read_apart
from contactopt.benchmark.measure import Task, absent_row, calibration
from contactopt.benchmark.pool import History, run_locally
from contactopt.benchmark.report_page import report_campaign
from contactopt.benchmark.reports import build, layouts, publish
from contactopt.benchmark.store import ANSWERS, Store, lines, load, require, save, save_answers
from contactopt.checks import check_count
from contactopt.errors import InputError
from contactopt.files.writing import remove_files, whole_file
from contactopt.screen import Lines, progress

WRITTEN = ("rows.jsonl", "rows.parquet", "experiment.toml", ANSWERS)  # by a campaign


def run_campaign(
    experiment: str | Path | Experiment,
    out: str | Path | None = None,
    *,
    jobs: int | None = None,
    resume: bool = False,
    filters: Sequence[str] = (),
    quiet: bool = False,
    shard: str = "",
    scheduler: str = "",
) -> Path:
    """Execute the runs of an experiment that are not finished yet.

    Parameters
    ----------
    experiment : An experiment file, or what `read_experiment` made of it.
    out : The folder of the results; by default out/bench/NAME.
    jobs : Number of worker processes; by default one per core.
    resume : Whether to go on where an interrupted campaign stopped. No finished run is repeated.
    filters : "COLUMN=PATTERN" on problem, method, setting or repeat; all must match.
    quiet : Whether no progress is shown.
    shard : "i/n": only the runs of every n-th problem from the i-th on, by default in
        out/bench/NAME-i-of-n. `contactopt report --merge` joins the shards.
    scheduler : The address of a Dask scheduler, whose workers make the runs instead of `jobs`
        processes here.

    Returns
    -------
    The folder of the results.

    Raises
    ------
    InputError : On an experiment that cannot be run, filters that no run matches, results in the
        folder without `resume`, and a folder that cannot be written to.
    """
    require("pandas", "psutil", "pyarrow")
    e = experiment if isinstance(experiment, Experiment) else read_apart(experiment)
    jobs = jobs if jobs is not None else os.cpu_count() or 1
    check_count("jobs", jobs)
    runs = e.runs(filters)
    if not runs:
        raise InputError("no run matches the filters.")
    runs = shard_of(runs, shard) if shard else runs
    name = e.name + (f"-{shard.replace('/', '-of-')}" if shard else "")
    folder = Path("out/bench", name) if out is None else Path(out)
    for sentence in () if quiet else dict.fromkeys(e.skipped):  # once for each reason
        print(f"left out: {sentence}", file=sys.stderr)
    calibration()  # before others compute here
    limits = (e.time_limit, e.memory_limit, e.max_iterations, e.seed, e.diagnose)
    with Store(folder, resume) as store:
        if e.path.is_file():
            with whole_file(folder / "experiment.toml") as file:
                file.write_bytes(e.path.read_bytes())
        finished = store.finished()
        for row in (absent_row(e.name, *left) for left in e.absent):
            if row["key"] not in finished:
                store.append(row)
        left = [run for run in runs if run.key not in finished]
        tasks = [Task(run, e.name, e.plugins, *limits) for run in left]
        bar = progress(e.name, len(runs), len(runs) - len(tasks), quiet)
        known = History(lines(store.path))
        made = (
            run_on_cluster(scheduler, tasks, known)
            if scheduler
            else run_locally(tasks, jobs, known)
        )
        with closing(made) as rows, bar as shown:
            _keep(rows, store, shown)
        store.keep_own()
        save(load(store.path, absent=True), folder / "rows.parquet")
        save_answers(folder)
    return folder


def _keep(rows: Iterable[dict[str, Any] | None], store: Store, shown: Lines) -> None:
    """Store the rows as they come, and show the progress."""
    failed: Counter[str] = Counter()
    for row in filter(None, rows):
        store.append(row)
        if not row["success"]:
            failed[row["status"]] += 1
        shown.count(", ".join(f"{n} {status}" for status, n in failed.most_common()))


def run_reports(
    experiments: Sequence[str | Path],
    reports: str | Path,
    version: str = "",
    names: Sequence[str] = (),
    jobs: int | None = None,
) -> Path:
    """Rebuild all reports from their tables.

    Experiments whose problems or methods are all missing here are left out, with a note.

    Parameters
    ----------
    experiments : The experiment files.
    reports : The folder of the reports, with the table of each.
    version : '': solve nothing. 'full': run the experiments first and renew their tables in
        `reports`. 'quick': run their quick versions, with tables and reports in out/quick, so that
        `reports` stays as it is.
    names : Stems of the experiment files to run; all by default.
    jobs : As for `run_campaign`.

    Returns
    -------
    The folder of the reports.

    Raises
    ------
    InputError : On an unknown version or name, two experiments of one name, and as `run_campaign`
        and `build` raise it.
    """
    paths = [Path(path) for path in experiments]
    missing = set(names) - {path.stem for path in paths}
    if missing:
        known = ", ".join(sorted(path.stem for path in paths)) or "none"
        raise InputError(
            f"there is no experiment {', '.join(sorted(missing))}, and no folder of that name that"
            f" holds the results of a campaign; the experiments are {known}."
        )
    if version not in ("", "quick", "full"):
        raise InputError(f"unknown version {version!r}; choose quick or full.")
    work = Path("out", version)
    target = work / "reports" if version == "quick" else Path(reports)
    if version:
        layouts(paths)  # two of one name would mix their results
        for path in paths:
            if path.stem in names or not names:
                _renew(path, version == "quick", work, target, jobs)
    for layout in build(paths, target):
        if any(entry["kind"] == "leader_table" for entry in layout.figures):
            report_campaign(target / layout.name, layout.path)
    return target


def _renew(path: Path, quick: bool, work: Path, target: Path, jobs: int | None) -> None:
    """Run an experiment again in a folder of `work`, and put its small table into `target`."""
    try:
        experiment = read_apart(path, quick)
    except NothingToRun as error:
        print(f"left out: {error}", file=sys.stderr)
        return
    folder = work / experiment.name
    remove_files(folder, WRITTEN)
    publish(path, run_campaign(experiment, folder, jobs=jobs), target)
