"""What can go wrong around a campaign: killed processes, full disks, hostile plug-ins, strange names and numbers."""

import json
import os
import pickle
import resource
import shutil
import signal
import socket
import subprocess
import sys
import time
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from contactopt import InputError, benchmark
from contactopt.benchmark import pool, store, wire
from contactopt.benchmark.experiment import read_experiment
from contactopt.benchmark.report import page_of, read_layout
from contactopt.benchmark.store import lines
from contactopt.cli import main
from contactopt.solving.backends import child
from tests.test_benchmark import SMALL, count, run, written

BAD_NAMES = [
    "..",
    ".",
    "...",
    "",
    "a/b",
    "/tmp/x",
    "../evil",
    "a\\b",
    "C:x",
    "a\nb",
    "\x07",
    " a",
    "nul",
    "COM1.txt",
    "x" * 200,
]
SCENE = '[[problems]]\nscene = "punch-2d"\nelements = 4\n'


def one_line(text: str, words: str = "") -> None:
    """A sentence of the program, not a traceback."""
    rows = text.strip().splitlines()
    assert "Traceback" not in text and rows[-1].startswith("contactopt: ") and words in rows[-1], text


# Names and links


@pytest.mark.parametrize("name", BAD_NAMES)
def test_names_that_lead_elsewhere_are_refused_wherever_they_are_read(tmp_path, name):
    text = SMALL.replace('name = "small"', f"name = {json.dumps(name)}")
    path = written(tmp_path, text)
    with pytest.raises(InputError, match="name"):
        read_experiment(path)
    with pytest.raises(InputError, match="name"):
        read_layout(path)


def test_a_report_named_dots_removes_and_writes_nothing(tmp_path, monkeypatch, capsys):
    """out/full/.. is the folder `out`, which is not the campaign's to empty."""
    (tmp_path / "campaigns").mkdir()
    (tmp_path / "out").mkdir()
    precious = tmp_path / "out" / "precious"
    precious.write_text("mine")
    monkeypatch.chdir(tmp_path)
    for name in ("..", "../../precious"):
        written(tmp_path / "campaigns", SMALL.replace('"small"', f'"{name}"'), "small.toml")
        before = sorted(tmp_path.rglob("*"))
        assert main(["report", "--run", "full", "--experiments", "campaigns"]) == 2
        one_line(capsys.readouterr().err, "name")
        assert main(["bench", "campaigns/small.toml"]) == 2
        assert sorted(tmp_path.rglob("*")) == before and precious.read_text() == "mine"


def test_links_in_the_output_are_not_followed(tmp_path, monkeypatch):
    """Each file and folder that a report writes is a link to something precious beforehand."""
    text = SMALL + '[[figures]]\nkind = "performance_profile"\ncaption = "All."\n'
    (tmp_path / "campaigns").mkdir()
    path = written(tmp_path / "campaigns", text.replace("repeats = 2", "repeats = 1"), "small.toml")
    outside = tmp_path / "outside"
    outside.mkdir()
    monkeypatch.chdir(tmp_path)
    names = (
        "rows.csv",
        "report.md",
        "figure-1.png",
        "benchmarks.html",
        "experiment.toml",
        "rows.parquet",
        "rows.jsonl",
    )
    for name in names:
        (outside / name).write_text("mine")
    arguments = ["report", "--run", "full", "--experiments", "campaigns", "--jobs", "1"]
    for parent in ("reports", "out/full"):
        Path(parent).mkdir(parents=True, exist_ok=True)
        Path(parent, "small").symlink_to(outside)
        assert main(arguments) == 2
        Path(parent, "small").unlink()
    shutil.rmtree("out")
    for parent in ("reports/small", "out/full/small"):
        Path(parent).mkdir(parents=True)
        for name in names[:-1]:
            Path(parent, name).symlink_to(outside / name)
    Path("reports/benchmarks.html").symlink_to(outside / "benchmarks.html")
    assert main(arguments) == 0
    assert {file.read_text() for file in outside.iterdir()} == {"mine"} and len(list(outside.iterdir())) == len(names)
    Path("out/full/small/rows.jsonl").unlink()
    Path("out/full/small/rows.jsonl").symlink_to(outside / "rows.jsonl")
    with pytest.raises(InputError, match="link"):
        benchmark.run_campaign(path, "out/full/small", resume=True, quiet=True)


# The page


class _Page(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []

    def handle_starttag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))


STRANGE = [
    "<script>alert(1)</script>",
    "<img src=x onerror=alert(1)>",
    "[a](javascript:alert(1))",
    "![a](http://example.org/a.png)",
    '[a](http://example.org "x" onclick=alert(1))',
    "</section></html><iframe src=//example.org>",
    "<a href='javascript:alert(1)'>a</a>",
    "[a]( data:text/html,alert)",
    "x | y `<svg onload=alert(1)>`",
    "$\\frac{$ and $a$",
]


def test_the_page_of_a_strange_experiment_cannot_run_script(tmp_path, monkeypatch):
    """The same texts as title, text, captions, finding and names of solvers and problems, in tables and figures."""
    rows = [json.loads(line) for line in _rows(tmp_path)]
    for number, row in enumerate(rows):
        name = STRANGE[number % len(STRANGE)]
        row |= {"method": name, "name": name, "label": name, "problem": name, "family": name, "machine": name}
    folder = tmp_path / "reports" / "strange"
    folder.mkdir(parents=True)
    table = tmp_path / "rows.jsonl"
    table.write_text("".join(json.dumps(row) + "\n" for row in rows))
    benchmark.save(benchmark.load(table), folder / "rows.csv")
    text = f'name = "strange"\ntitle = {json.dumps(" ".join(STRANGE))}\ntext = {json.dumps(chr(10).join(STRANGE))}\n'
    text += 'findings = "found.py"\n'
    for kind in ("success_table", "time_table", "performance_profile", "convergence", "speed_accuracy"):
        text += f'[[figures]]\nkind = "{kind}"\ncaption = {json.dumps(" ".join(STRANGE))}\n'
    written(tmp_path, f"def findings(table):\n    return {STRANGE!r}\n", "found.py")
    page = benchmark.report.build([written(tmp_path, text)], tmp_path / "reports").read_text()
    seen = _Page()
    seen.feed(page)
    kinds = {tag for tag, _ in seen.tags}
    assert not kinds & {"script", "iframe", "svg", "object", "embed", "form", "base", "link"} and "img" in kinds
    for _, attributes in seen.tags:
        assert not [name for name in attributes if name.startswith("on")]
        assert attributes.get("src", "data:image/png;").startswith("data:image/png;")
        assert attributes.get("href", "#").startswith(("#", "http://", "https://"))
    assert "&lt;script&gt;alert(1)" in page, "what was written is still to be read, as text"
    assert "<script" not in (folder / "report.md").read_text()
    layout = read_layout(tmp_path / "experiment.toml")
    assert "<script" not in page_of([(layout, folder, "<script>alert(1)</script>")])


def _rows(folder: Path) -> list[str]:
    """Real rows, as many as there are strange texts."""
    path = written(folder, SMALL.replace("repeats = 2", f"repeats = {len(STRANGE)}"), "real.toml")
    filters = ["problem=rigid*", "method=auto"]
    benchmark.run_campaign(path, folder / "real", jobs=1, quiet=True, filters=filters)
    return (folder / "real" / "rows.jsonl").read_text().splitlines()


# Plug-ins of every bad kind

HOSTILE = """
import os, pickle, sys, time
import numpy as np
import contactopt, contactopt.problem, contactopt.problem.certificate
from contactopt import Solution, Status
from contactopt.benchmark import method, measure, wire

def nothing_is_wrong(*arguments, **settings):
    return 0.0

for module in (contactopt.problem, contactopt.problem.certificate, measure):  # wherever this file is loaded
    module.natural_map_residual = nothing_is_wrong

def right(problem):
    from contactopt.solving.driver import solve
    return solve(problem, tol=1e-10).reactions

@method
def patches(problem):
    np.linalg.norm = nothing_is_wrong
    return Solution(np.ones(problem.q.shape), np.zeros(len(problem.s)), Status.SOLVED, 0.0, 1, "patches")

@method
def changes_its_problem(problem):
    for array in (problem.Q, problem.q):
        array.flags.writeable = True
        array[:] = 0.0
    return np.zeros(problem.q.shape)

@method
def forks(problem):
    os.fork()
    return right(problem)

@method
def forks_unseen(problem):
    number = os.getpid()
    os.getpid = lambda: number
    os.fork()
    return right(problem)

@method
def lets_the_child_answer(problem):
    if os.fork():
        os._exit(0)
    return right(problem)

def sockets():
    for name in os.listdir("/proc/self/fd"):
        try:
            if os.readlink(f"/proc/self/fd/{name}").startswith("socket"):
                yield int(name)
        except OSError:
            pass

class Evil:
    def __reduce__(self):
        return os.system, ("touch " + os.path.join(os.path.dirname(__file__), "evil"),)

def framed(data):
    return len(data).to_bytes(8, "big") + data

@method
def sends_code(problem):
    for number in sockets():
        os.write(number, framed(pickle.dumps(("token", "answer", Evil()))))
    return right(problem)

@method
def sends_noise(problem):
    for number in sockets():
        os.write(number, os.urandom(1000))
    return right(problem)

@method
def answers_early(problem):
    for number in sockets():
        os.write(number, framed(pickle.dumps(("0" * 16, "answer", {"status": "solved"}))))
    return right(problem)

@method
def begins_a_message(problem):
    for number in sockets():
        os.write(number, (1000).to_bytes(8, "big") + b"x")
    time.sleep(60)

@method
def closes_all(problem):
    os.closerange(3, 1000)
    return right(problem)

@method
def leaves(problem):
    os._exit(0)

@method
def interrupts(problem):
    raise KeyboardInterrupt

@method
def complex_numbers(problem):
    return right(problem) * (1 + 1j)

@method
def text(problem):
    return "solved"

@method
def too_many(problem):
    return np.zeros(10**6)

@method
def objects(problem):
    return np.full(problem.q.shape, Evil(), dtype=object)

@method
def no_status(problem):
    return Solution(right(problem), np.zeros(len(problem.s)), "solved", 0.0, 1, "x")

@method
def honest(problem, number=0):
    return right(problem)
"""
ENDS = {
    "patches": "false_claim",
    "changes_its_problem": "error",
    "forks": "solved",
    "forks_unseen": "solved",
    "lets_the_child_answer": "crashed",
    "sends_code": "error",
    "sends_noise": "error",
    "answers_early": "error",
    "begins_a_message": "killed",
    "closes_all": "crashed",
    "leaves": "crashed",
    "interrupts": "crashed",
    "complex_numbers": "error",
    "text": "error",
    "too_many": "error",
    "objects": "error",
    "no_status": "error",
    "honest": "solved",
}


def test_plugins_of_every_bad_kind_get_the_rows_that_they_deserve(tmp_path, monkeypatch):
    """Between them stand honest runs, which must be certified whatever the plug-in before did to their process."""
    monkeypatch.setattr(pool, "WARM_UP_LIMIT", 0.0)
    written(tmp_path, HOSTILE, "hostile.py")
    text = """
        name = "hostile"
        plugins = ["hostile.py"]
        time_limit = 1.5
        settings = ["mid"]
    """
    text += SCENE
    for number, name in enumerate(name for name in ENDS if name != "honest"):
        text += f'[[methods]]\nmethod = "{name}"\n'
        text += f'[[methods]]\nmethod = "honest"\nnumber = {number}\n' if number % 2 else ""
    table = run(tmp_path, text)
    assert len(table) == len(read_experiment(written(tmp_path, text)).methods) and table["key"].is_unique
    ends = {name: set(rows["status"]) for name, rows in table.groupby("name")}
    # Two copies of a process that write at the same time may garble each other's message; the row says so then.
    assert ends.pop("forks_unseen") <= {ENDS["forks_unseen"], "error"}
    assert ends == {name: {status} for name, status in ENDS.items() if name != "forks_unseen"}
    assert table["fingerprint"].nunique() == 1 and not (tmp_path / "evil").exists()
    assert (table["success"] == (table["residual"] <= 1e-6)).all()


def test_problems_of_plugins_cannot_reach_the_campaign(tmp_path):
    """A problem is checked where it is held; nothing that it brings along is run or believed."""
    written(
        tmp_path,
        """
import os
import numpy as np
from contactopt import InterfaceProblem
from contactopt.benchmark import problem

class Array(np.ndarray):
    def __reduce__(self):
        return os.system, ("touch " + os.path.join(os.path.dirname(__file__), "evil"),)

@problem
def brings_code():
    p = InterfaceProblem(np.eye(2), [[-1.0, 0.0]], 0.5)
    object.__setattr__(p, "s", p.s.view(Array))
    return p

@problem
def is_none():
    return None

@problem
def claims_a_fingerprint():
    p = InterfaceProblem(np.eye(2), [[-1.0, 0.0]], 0.5)
    p.__dict__["fingerprint"] = "a lie"
    return p

@problem
def is_inconsistent():
    p = InterfaceProblem(np.eye(2), [[-1.0, 0.0]], 0.5)
    object.__setattr__(p, "Q", np.full((2, 2), np.nan))
    return p

@problem
def exits():
    raise SystemExit(0)
""",
        "mine.py",
    )
    names = ["brings_code", "is_none", "claims_a_fingerprint", "is_inconsistent", "exits"]
    families = "".join(f'[[problems]]\nfamily = "{name}"\n' for name in names)
    table = run(tmp_path, f'name = "x"\nplugins = ["mine.py"]\n{families}{SCENE}[[methods]]\nmethod = "auto"\n')
    status = dict(zip(table["family"], table["status"]))
    solved = {name for name, word in status.items() if word == "solved"}
    assert solved == {"claims_a_fingerprint", "punch-2d"} and set(status.values()) == {"solved", "not_built"}
    assert "a lie" not in set(table["fingerprint"]) and not (tmp_path / "evil").exists()
    assert table["message"].str.len().min() > 0


@pytest.mark.parametrize(
    ("source", "words"),
    [
        ("import os\nos._exit(0)\n", "exit code 0"),
        ("raise SystemExit(3)\n", "SystemExit"),
        ("from contactopt.benchmark import method\nmethod(3)\n", "must be a function"),
        ("from contactopt.benchmark import method\nmethod(len, name=3)\n", "name"),
        ("from contactopt.benchmark import method\n@method(law='x')\ndef f(p): pass\n", "law"),
        ("from contactopt.benchmark import problem\n@problem(name='half_plane')\ndef f(): pass\n", "half_plane"),
        ("def (", "SyntaxError"),
    ],
)
def test_plugin_files_that_cannot_be_loaded_are_one_sentence(tmp_path, source, words):
    written(tmp_path, source, "mine.py")
    with pytest.raises(InputError, match=words):
        read_experiment(written(tmp_path, 'plugins = ["mine.py"]' + SMALL))


def test_messages_from_processes_hold_data_only():
    data = {"a": [1, 2.5, "x", None, True], "r": np.arange(6.0).reshape(2, 3), "n": np.float64(3)}
    again = wire.read(pickle.dumps(data, protocol=5))
    assert again["a"] == data["a"] and np.array_equal(again["r"], data["r"]) and again["n"] == 3
    for evil in (os.system, eval, print, subprocess.Popen, np.load, np.lib.format.read_array, benchmark.save):
        with pytest.raises(wire.ForeignMessage):
            wire.read(pickle.dumps(evil))
    for broken in (b"", b"\x80", pickle.dumps(data)[:-5], b"cos\nsystem\n(S'true'\ntR."):
        with pytest.raises(wire.ForeignMessage):
            wire.read(broken)


# Numbers


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("repeats = 2", "repeats = 1000000000", "whole number"),
        ("repeats = 2", "repeats = 100000", "runs"),
        ("repeats = 2", "repeats = 2\nseed = 4294967296", "seed"),
        ("repeats = 2", f"repeats = 2\nseed = -{10**30}", "seed"),
        ("repeats = 2", "repeats = 2\nmax_iterations = 1e9", "max_iterations"),
        ("repeats = 2", 'repeats = 2\nsettings = ["mid", "mid"]', "twice"),
        ("repeats = 2", "repeats = 2\nplugins = [3]", "plugins"),
        ("repeats = 2", "repeats = 2\nplugins = {a = 1}", "plugins"),
        ("limit = 10.0", "limit = 1e300", "time_limit"),
        ("limit = 10.0", "limit = inf", "time_limit"),
        ("limit = 10.0", 'limit = "long"', "time_limit"),
        ("limit = 10.0", "limit = 10.0\nmemory_limit = 1e-9", "memory_limit"),
        ("limit = 10.0", "limit = 10.0\nmemory_limit = 1e30", "memory_limit"),
        ("mu = [0.2, 0.5]", "mu = {from = 0.1, to = 1.0, steps = 1000000000}", "runs"),
        ("mu = [0.2, 0.5]", "mu = {from = 0.1, to = nan, steps = 3}", "'to'"),
        ("mu = [0.2, 0.5]", 'mu = {from = "a", to = 1.0, steps = 3}', "'from'"),
        ("mu = [0.2, 0.5]", "mu = [[0.2], 0.5]", "'mu'"),
        ("mu = [0.2, 0.5]", "mu = 2020-01-01", "'mu'"),
        ("elements = 4", f"elements = {10**30}", "elements"),
        ("bodies = 4", "bodies = {from = 2, to = 900, steps = 800}\nseed = {from = 1, to = 999, steps = 900}", "runs"),
        ('["auto", "nsgs"]', "[3]", "name"),
    ],
)
def test_absurd_numbers_are_refused_in_one_sentence_before_any_work(tmp_path, capsys, old, new, words):
    assert old in SMALL
    path = written(tmp_path, SMALL.replace(old, new))
    begin = time.process_time()
    assert main(["bench", str(path), "--out", str(tmp_path / "out")]) == 2
    one_line(capsys.readouterr().err, words)
    assert time.process_time() - begin < 5 and not (tmp_path / "out").exists()


def test_absurd_numbers_of_workers(tmp_path, capsys):
    for jobs in ("0", "-1", "1000000000"):
        assert main(["bench", str(written(tmp_path, SMALL)), "--jobs", jobs, "--out", str(tmp_path / "out")]) == 2
        one_line(capsys.readouterr().err, "jobs")


# Disks


def bench(path: Path, out: Path, *more: str, **settings) -> subprocess.CompletedProcess:
    command = [sys.executable, "-m", "contactopt", "bench", str(path), "--out", str(out), "--jobs", "2", *more]
    return subprocess.run(command, capture_output=True, text=True, **settings)


def test_malformed_rows_are_made_again(tmp_path):
    path, out = written(tmp_path, SMALL), tmp_path / "out"
    good = run(tmp_path, SMALL)
    rows = (out / "rows.jsonl").read_text().splitlines()
    first = json.loads(rows[0])
    spoilt = [
        json.dumps(first | change) for change in ({"residual": "x"}, {"key": 3}, {"repeat": 10**30}, {"schema": None})
    ]
    bad = ["3", "[]", "null", "{}", '"x"', "[" * 100_000, '{"key": "', "\x00", *spoilt]
    (out / "rows.jsonl").write_text("\n".join([*bad, *rows[2:], '{"torn']))
    assert bench(path, out, "--resume").returncode == 0
    table = benchmark.load(out)
    assert len(table) == len(good) and set(table["key"]) == set(good["key"])
    (out / "rows.jsonl").write_text(json.dumps(first | {"schema": 99}) + "\n")
    result = bench(path, out, "--resume")
    assert result.returncode == 2
    one_line(result.stderr, "newer version")


def test_answers_of_another_size_are_not_compared(tmp_path):
    run(tmp_path, SMALL, filters=["problem=rigid*"])
    path = tmp_path / "out" / "rows.jsonl"
    rows = [json.loads(line) for line in path.read_text().splitlines()]
    rows[0]["answer"], rows[0]["residual"] = store.pack(np.zeros(3)), 1e-9
    path.write_text("".join(json.dumps(row) + "\n" for row in rows))
    assert benchmark.load(path)["error"].isna().sum() in (1, len(rows), len(rows) - 1)
    rows[0]["answer"] = "not base64"
    path.write_text("".join(json.dumps(row) + "\n" for row in rows))
    with pytest.raises(InputError, match="cannot read"):
        benchmark.load(path)


def test_a_full_disk_is_one_sentence_and_loses_nothing(tmp_path):
    """No file may grow beyond a size that ends within the rows; with room again the campaign goes on."""
    path, out = written(tmp_path, SMALL.replace("repeats = 2", "repeats = 4")), tmp_path / "out"
    expected = {r.key for r in read_experiment(path).runs()}
    for size in (10, 20_000):
        limit = lambda size=size: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))  # noqa: E731
        result = bench(path, out, "--resume", preexec_fn=limit)
        assert result.returncode == 2
        one_line(result.stderr, "cannot write")
        assert not list(out.glob(".contactopt-*")) and not (out / "rows.parquet").exists()
    text = (out / "rows.jsonl").read_bytes()
    assert 0 < len(text) <= 20_000 and text.endswith(b"\n")
    assert bench(path, out, "--resume").returncode == 0
    keys = [row["key"] for row in lines(out / "rows.jsonl")]
    assert len(keys) == len(set(keys)) and set(keys) == expected


def test_folders_that_cannot_be_written(tmp_path, capsys):
    path = written(tmp_path, SMALL)
    (tmp_path / "file").write_text("")
    for out in ("/proc/nothing", str(tmp_path / "file"), str(tmp_path / "file" / "below"), "/dev/full"):
        assert main(["bench", str(path), "--out", out, "--jobs", "1"]) == 2
        one_line(capsys.readouterr().err, "write")


# Kills


def test_killed_processes_cost_their_own_run_only(tmp_path):
    """SIGKILL to the processes that run methods, then to the whole campaign, at random moments."""
    path, out = written(tmp_path, SMALL.replace("repeats = 2", "repeats = 30")), tmp_path / "out"
    expected = {r.key for r in read_experiment(path).runs()}
    rng = np.random.default_rng(5)
    command = [sys.executable, "-m", "contactopt", "bench", str(path), "--out", str(out), "--jobs", "2", "--resume"]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    killed = 0
    for rounds in range(3):
        process = subprocess.Popen(command, start_new_session=True, **quiet)
        before, begin = count(out), time.monotonic()
        while process.poll() is None and count(out) == before and time.monotonic() - begin < 60:
            time.sleep(0.02)
        for _ in range(2):
            time.sleep(rng.uniform(0, 0.1))
            workers = solvers(process.pid)
            if workers:
                os.kill(int(rng.choice(workers)), signal.SIGKILL)
                killed += 1
        if rounds < 2:
            os.killpg(process.pid, signal.SIGKILL)
        assert process.wait(120) == (0 if rounds == 2 else -signal.SIGKILL)
    rows = list(lines(out / "rows.jsonl"))
    keys = [row["key"] for row in rows]
    assert len(keys) == len(set(keys)) and set(keys) == expected
    failed = [row for row in rows if not row["success"]]
    assert len(failed) <= killed and {row["status"] for row in failed} <= {"out_of_memory"} and killed >= 2


@pytest.mark.parametrize("kills", [2, 3])
def test_a_solver_killed_while_it_starts_is_started_again(tmp_path, monkeypatch, kills):
    """Twice may be chance; a process that never lives to say a word ends the campaign with one sentence (exit code 2)."""
    from contactopt.benchmark.process import Process

    whole, starts = Process.start, []

    def start(self):
        fresh = self.process is None
        whole(self)
        if fresh and self.role == "solve":
            starts.append(self.process.pid)
            if len(starts) <= kills:
                os.kill(self.process.pid, signal.SIGKILL)

    monkeypatch.setattr(Process, "start", start)
    path = written(tmp_path, SMALL.replace("repeats = 2", "repeats = 1"))
    arguments = ["bench", str(path), "--out", str(tmp_path / "out"), "--jobs", "1"]
    assert main(arguments) == (0 if kills < 3 else 2)
    if kills < 3:
        rows = list(lines(tmp_path / "out" / "rows.jsonl"))
        assert {row["key"] for row in rows} == {r.key for r in read_experiment(path).runs()}


def solvers(campaign: int) -> list[int]:
    """The processes of a campaign that run methods."""
    found = []
    for task in Path(f"/proc/{campaign}/task").glob("*/children"):
        try:
            for child in task.read_text().split():
                if Path(f"/proc/{child}/cmdline").read_bytes().rstrip(b"\0").endswith(b"solve"):
                    found.append(int(child))
        except OSError:
            continue
    return found


def test_rows_that_were_not_asked_for_or_are_missing_are_told(tmp_path, monkeypatch):
    """Whatever hands out the runs: a campaign whose rows are not those of its runs does not end with success."""
    from contactopt.benchmark import campaign

    path = written(tmp_path, SMALL)
    whole = campaign.run_locally
    monkeypatch.setattr(campaign, "run_locally", lambda tasks, jobs: whole(tasks[1:], jobs))
    with pytest.raises(InputError, match="1 of 12 runs left no row"):
        benchmark.run_campaign(path, tmp_path / "a", jobs=2, quiet=True)
    monkeypatch.setattr(campaign, "run_locally", lambda tasks, jobs: whole([tasks[0], tasks[0]], jobs))
    with pytest.raises(InputError, match="twice"):
        benchmark.run_campaign(path, tmp_path / "b", jobs=1, quiet=True)
    monkeypatch.undo()
    assert len(benchmark.load(benchmark.run_campaign(path, tmp_path / "a", resume=True, quiet=True))) == 12


def test_a_plug_in_counts_for_the_registry_that_runs_its_file(tmp_path):
    """Nothing is left in the module: not by a second registry, and not by a file that is imported in a plain way."""
    from contactopt.benchmark.plugins import Registry

    file = tmp_path / "mine.py"
    file.write_text(
        "from contactopt.benchmark import method, problem\n@method(law='associated')\ndef mine(p): return p.q\n"
        "@problem(name='other')\ndef family(n=1): return n\n"
    )
    first, second = Registry(), Registry()
    first.load([file, file])
    mine = first.find("mine")
    assert mine is not None and mine.law == "associated" and first.problems["other"]() == 1
    assert second.find("mine") is None and not second.problems
    names = {}
    exec(compile(file.read_text(), file, "exec"), names)
    assert callable(names["mine"]) and second.find("mine") is None and list(first.methods) == ["mine"]


def test_writing_to_a_dead_process_is_an_error_whatever_a_library_did_to_the_signal():
    ours, theirs = socket.socketpair()
    theirs.close()
    before = signal.signal(signal.SIGPIPE, signal.SIG_DFL)  # as gmsh leaves it: a broken pipe would end this process
    try:
        with pytest.raises(OSError):
            wire.Channel(ours).send("word" * 10_000)
        process = subprocess.Popen([sys.executable, "-c", ""], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        process.stdin.write(b"word")  # stays in the buffer until the pipe is closed
        os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOWAIT)
        child._stop(process)
    finally:
        signal.signal(signal.SIGPIPE, before)
        ours.close()
    assert process.stdin.closed
