"""What can go wrong around a campaign: killed processes, full disks, bad plug-ins, strange names
and numbers.
"""

import contextlib
import json
import os
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from contactopt import InputError, benchmark, solve
from contactopt.benchmark import pool, problems, process, store, worker
from contactopt.benchmark.experiment import read_experiment, read_layout
from contactopt.benchmark.measure import Task
from contactopt.benchmark.report_page import report_campaign
from contactopt.benchmark.runs import MethodSpec, Run
from contactopt.benchmark.store import lines
from contactopt.cli import main
from contactopt.linear.convolution import Convolution
from contactopt.methods.backends import child
from tests.test_benchmark import SMALL, bench, count, run, written

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
    assert "Traceback" not in text and rows[-1].startswith("contactopt: ") and words in rows[-1], (
        text
    )


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


# The page

STRANGE = ["<b>bold", "x | y", "$\\frac{$ and $a$", "[a](", "`", "a\nb"]


@pytest.mark.slow
def test_strange_texts_are_shown_as_they_are(tmp_path):
    """The same texts as title, text, captions, finding and names of solvers and problems, in tables
    and figures.
    """
    rows = [json.loads(line) for line in _rows(tmp_path)]
    for number, row in enumerate(rows):
        name = STRANGE[number % len(STRANGE)]
        row |= {
            "method": name,
            "name": name,
            "label": name,
            "problem": name,
            "family": name,
            "machine": name,
        }
    folder = tmp_path / "reports" / "strange"
    folder.mkdir(parents=True)
    table = tmp_path / "rows.jsonl"
    table.write_text("".join(json.dumps(row) + "\n" for row in rows))
    benchmark.save(benchmark.load(table), folder / "rows.csv")
    text = f'name = "strange"\ntitle = {json.dumps(STRANGE[0])}\nfindings = "found.py"\n'
    for kind in ("success_table", "performance_profile"):
        text += f'[[figures]]\nkind = "{kind}"\ncaption = {json.dumps(" ".join(STRANGE))}\n'
    written(tmp_path, f"def findings(table):\n    return {STRANGE!r}\n", "found.py")
    experiment = written(tmp_path, text)
    benchmark.report.build([experiment], tmp_path / "reports")
    page = report_campaign(folder, experiment).read_text()
    assert "<b>bold" not in page and "&lt;b&gt;bold" in page and "data:image/png" in page


def _rows(folder: Path) -> list[str]:
    """Real rows, as many as there are strange texts."""
    path = written(folder, SMALL.replace("repeats = 2", f"repeats = {len(STRANGE)}"), "real.toml")
    filters = ["problem=rigid*", "method=auto"]
    benchmark.run_campaign(path, folder / "real", jobs=1, quiet=True, filters=filters)
    return (folder / "real" / "rows.jsonl").read_text().splitlines()


# Plug-ins of every bad kind

BAD = """
import os, subprocess, sys, time
import numpy as np
from contactopt import Solution, Status
from contactopt.benchmark import method

def right(problem):
    from contactopt.methods.driver import solve
    return solve(problem, tol=1e-10).reactions

@method
def forks(problem):
    os.fork()
    return right(problem)

@method
def lets_the_child_answer(problem):
    if os.fork():
        os._exit(0)
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
def no_status(problem):
    return Solution(right(problem), np.zeros(len(problem.s)), "solved", 0.0, 1, "x")

@method
def shares_memory(problem):
    import mmap
    kept = [mmap.mmap(-1, 10**8) for _ in range(50)]
    return right(problem)

@method
def chatters(problem):
    while True:
        os.write(1, b"x" * 10**6)

@method
def honest(problem, number=0):
    return right(problem)
"""
ENDS = {
    "forks": "solved",
    "lets_the_child_answer": "crashed",
    "leaves": "crashed",
    "interrupts": "error",
    "complex_numbers": "error",
    "text": "error",
    "too_many": "error",
    "no_status": "error",
    "shares_memory": "out_of_memory",
    "chatters": "killed",
    "honest": "solved",
}


@pytest.mark.slow
def test_plugins_of_every_bad_kind_get_the_rows_that_they_deserve(tmp_path, monkeypatch):
    """Between them stand honest runs, which must be certified whatever the plug-in before did to
    their process.
    """
    largest = []
    whole = process.Process._wait
    monkeypatch.setattr(process, "MOST_WORDS", 1e6)
    monkeypatch.setattr(process, "BEAT", 0.02)

    def cut(self, *given):
        largest.append(os.fstat(self.noise.fileno()).st_size)
        return whole(self, *given)

    monkeypatch.setattr(process.Process, "_wait", cut)
    written(tmp_path, BAD, "bad.py")
    text = """
        name = "bad"
        plugins = ["bad.py"]
        time_limit = 5.0
        memory_limit = 1.0
        settings = ["mid"]
    """
    text += SCENE
    for number, name in enumerate(name for name in ENDS if name != "honest"):
        text += f'[[methods]]\nmethod = "{name}"\n'
        text += f'[[methods]]\nmethod = "honest"\nnumber = {number}\n' if number % 2 else ""
    table = run(tmp_path, text)
    assert (
        len(table) == len(read_experiment(written(tmp_path, text)).methods)
        and table["key"].is_unique
    )
    ends = {name: set(rows["status"]) for name, rows in table.groupby("name")}
    assert ends == {name: {status} for name, status in ENDS.items()}
    assert table["fingerprint"].nunique() == 1
    assert (table["success"] == (table["residual"] <= 1e-6)).all()
    assert max(largest) < 1e9, "what a solver prints is thrown away beyond a bound"


@pytest.mark.slow
def test_a_hanging_plugin_costs_about_its_time_limit(tmp_path):
    """The first run of the method also costs its warm-up; those that follow cost their limit and a
    start.
    """
    name = f"hangs_{os.getpid()}"
    source = (
        f"import time\nfrom contactopt.benchmark import method\n@method\ndef {name}(problem,"
        " n=0):\n    time.sleep(1e4)\n"
    )
    written(tmp_path, source, "mine.py")
    spec = problems.ProblemSpec("family", "rigid_bodies", {"bodies": 3, "contacts": 4})
    plugins = (str(tmp_path / "mine.py"),)
    seconds = []
    with pool.Worker() as worker:
        for number in range(3):
            method = MethodSpec(name, {"n": number})
            task = Task(Run(spec, method, "mid", 1e-6, 0), "x", plugins, 0.5, 4.0, 100, 0)
            row = worker.run(task)
            seconds.append(row["call_seconds"])
            assert row["status"] == "killed" and "still running after 1.05 s" in row["message"]
        hard, start = 1.05, time.monotonic()
        worker.solver.start()
        worker.solver.ask(100.0, "look", os.getpid)
        start = time.monotonic() - start
    assert (
        seconds[0] < pool.PLUGIN_WARM_UP + hard + 4 * start + 10.0
        and max(seconds[1:]) < hard + 2 * start + 10.0
    )


@pytest.mark.slow
def test_nothing_that_a_solver_started_outlives_the_campaign(tmp_path):
    """A child in a session of its own, and its child, whose parent is gone."""
    source = """
import os, subprocess, sys, time
from pathlib import Path
import numpy as np
from contactopt.benchmark import method

@method
def leaves_children(problem):
    code = "import os, time; os.fork() and os._exit(0)"
    code += "; print(os.getpid(), flush=True); time.sleep(1e4)"
    options = {"start_new_session": True, "stdout": subprocess.PIPE}
    own = subprocess.Popen([sys.executable, "-c", code], **options)
    Path(__file__).with_name("numbers").open("a").write(own.stdout.readline().decode())
    return np.zeros(problem.q.shape)
"""
    written(tmp_path, source, "mine.py")
    text = 'name = "x"\nplugins = ["mine.py"]\n[[problems]]\nfamily = "rigid_bodies"\n'
    run(tmp_path, text + '[[methods]]\nmethod = "leaves_children"\n')
    numbers = tmp_path / "numbers"
    assert numbers.exists() and not [n for n in numbers.read_text().split() if lives(int(n))]


def lives(number: int) -> bool:
    """Whether a process is there and not a dead one that nobody has asked for yet."""
    import psutil

    with contextlib.suppress(psutil.NoSuchProcess):
        return psutil.Process(number).status() != psutil.STATUS_ZOMBIE
    return False


@pytest.mark.slow
def test_problems_of_plugins_are_checked(tmp_path):
    written(
        tmp_path,
        """
import numpy as np
from contactopt import InterfaceProblem
from contactopt.benchmark import problem

@problem
def is_none():
    return None

@problem
def exits():
    raise SystemExit(0)
""",
        "mine.py",
    )
    families = "".join(f'[[problems]]\nfamily = "{name}"\n' for name in ("is_none", "exits"))
    table = run(
        tmp_path,
        f'name = "x"\nplugins = ["mine.py"]\n{families}{SCENE}[[methods]]\nmethod = "auto"\n',
    )
    status = dict(zip(table["family"], table["status"]))
    assert status == {"is_none": "not_built", "exits": "not_built", "punch-2d": "solved"}
    assert table["message"].str.len().min() > 0


@pytest.mark.parametrize(
    ("source", "words"),
    [
        ("raise SystemExit(3)\n", "SystemExit"),
        ("from contactopt.benchmark import method\nmethod(3)\n", "must be a function"),
        ("from contactopt.benchmark import method\nmethod(len, name=3)\n", "name"),
        (
            (
                "from contactopt.benchmark import"
                " problem\n@problem(name='half_plane')\ndef f(): pass\n"
            ),
            "half_plane",
        ),
        ("def (", "SyntaxError"),
    ],
)
def test_plugin_files_that_cannot_be_loaded_are_one_sentence(tmp_path, source, words):
    written(tmp_path, source, "mine.py")
    with pytest.raises(InputError, match=words):
        read_experiment(written(tmp_path, 'plugins = ["mine.py"]' + SMALL))


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
        (
            "bodies = 4",
            "bodies = {from = 2, to = 900, steps = 800}\nseed = {from = 1, to = 999, steps = 900}",
            "runs",
        ),
        ('["auto", "nsgs"]', "[3]", "name"),
    ],
)
def test_absurd_numbers_are_refused_in_one_sentence_before_any_work(
    tmp_path, capsys, old, new, words
):
    assert old in SMALL
    path = written(tmp_path, SMALL.replace(old, new))
    begin = time.process_time()
    assert main(["bench", str(path), "--out", str(tmp_path / "out")]) == 2
    one_line(capsys.readouterr().err, words)
    assert time.process_time() - begin < 5 and not (tmp_path / "out").exists()


def test_absurd_numbers_of_workers(tmp_path, capsys):
    for jobs in ("0", "-1"):
        assert (
            main(
                [
                    "bench",
                    str(written(tmp_path, SMALL)),
                    "--jobs",
                    jobs,
                    "--out",
                    str(tmp_path / "out"),
                ]
            )
            == 2
        )
        one_line(capsys.readouterr().err, "jobs")


# Disks


def ended(path: Path, out: Path, *more: str, **settings) -> subprocess.CompletedProcess:
    return subprocess.run(bench(path, out, *more), capture_output=True, text=True, **settings)


@pytest.mark.slow
def test_malformed_rows_are_made_again(tmp_path):
    path, out = written(tmp_path, SMALL), tmp_path / "out"
    good = run(tmp_path, SMALL)
    rows = (out / "rows.jsonl").read_text().splitlines()
    first = json.loads(rows[0])
    bad = ["3", "[]", "null", "{}", '"x"', "[" * 100_000, '{"key": "', "\x00"]
    (out / "rows.jsonl").write_text("\n".join([*bad, *rows[2:], '{"torn']))
    assert ended(path, out, "--resume").returncode == 0
    table = benchmark.load(out)
    assert len(table) == len(good) and set(table["key"]) == set(good["key"])
    (out / "rows.jsonl").write_text(json.dumps(first | {"schema": 99}) + "\n")
    result = ended(path, out, "--resume")
    assert result.returncode == 2
    one_line(result.stderr, "newer version")


@pytest.mark.slow
def test_answers_of_another_size_are_not_compared(tmp_path):
    run(tmp_path, SMALL, filters=["problem=rigid*"])
    path = tmp_path / "out" / "rows.jsonl"
    rows = [json.loads(line) for line in path.read_text().splitlines()]
    rows[0]["answer"], rows[0]["residual"] = store.pack(np.zeros(3)), 1e-9
    path.write_text("".join(json.dumps(row) + "\n" for row in rows))
    assert benchmark.load(path)["error"].isna().sum() in (1, len(rows), len(rows) - 1)
    rows[0]["answer"] = "not base64"  # told with its line, and left out
    path.write_text("".join(json.dumps(row) + "\n" for row in rows))
    assert len(benchmark.load(path)) == len(rows) - 1


@pytest.mark.slow
def test_a_full_disk_is_one_sentence_and_loses_nothing(tmp_path):
    """No file may grow beyond a size that ends within the rows; with room again the campaign goes
    on.
    """
    path, out = written(tmp_path, SMALL.replace("repeats = 2", "repeats = 4")), tmp_path / "out"
    expected = {r.key for r in read_experiment(path).runs()}
    for size in (10, 20_000):
        limit = lambda size=size: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))  # noqa: E731
        result = ended(path, out, "--resume", preexec_fn=limit)
        assert result.returncode == 2
        one_line(result.stderr, "cannot write")
        assert not list(out.glob(".contactopt-*")) and not (out / "rows.parquet").exists()
    text = (out / "rows.jsonl").read_bytes()
    assert 0 < len(text) <= 20_000 and text.endswith(b"\n")
    assert ended(path, out, "--resume").returncode == 0
    keys = [row["key"] for row in lines(out / "rows.jsonl")]
    assert len(keys) == len(set(keys)) and set(keys) == expected


def test_folders_that_cannot_be_written(tmp_path, capsys):
    path = written(tmp_path, SMALL)
    (tmp_path / "file").write_text("")
    for out in (
        "/proc/nothing",
        str(tmp_path / "file"),
        str(tmp_path / "file" / "below"),
        "/dev/full",
    ):
        assert main(["bench", str(path), "--out", out, "--jobs", "1"]) == 2
        one_line(capsys.readouterr().err, "write")


# Kills


@pytest.mark.slow
def test_killed_processes_cost_their_own_run_only(tmp_path):
    """SIGKILL to the processes that run methods, then to the whole campaign, at random moments."""
    path, out = written(tmp_path, SMALL.replace("repeats = 2", "repeats = 30")), tmp_path / "out"
    expected = read_experiment(path).runs()
    rng = np.random.default_rng(5)
    command = bench(path, out, "--resume")
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    killed = 0
    for rounds in range(3):
        process = subprocess.Popen(command, start_new_session=True, **quiet)
        before, begin = count(out), time.monotonic()
        while process.poll() is None and count(out) == before and time.monotonic() - begin < 120:
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
    slow = pool.History(rows)  # runs that a busy machine made so long that they are not repeated
    least = {r.key for r in expected if not slow.repeated(r)}
    assert len(keys) == len(set(keys)) and least <= set(keys) <= {r.key for r in expected}
    failed = [row for row in rows if not row["success"]]
    assert (
        len(failed) <= killed
        and {row["status"] for row in failed} <= {"out_of_memory"}
        and killed >= 2
    )


GROWN = []


def grow(size: int) -> int:
    """Keep so many bytes for ever; the number of the process."""
    GROWN.append(np.ones(size // 8))
    time.sleep(0.4)
    return os.getpid()


@pytest.mark.slow
def test_a_process_that_grows_goes_on():
    """The library of processes would recycle one that grew by 300 MB in more than a second, and a
    call at that moment was told as a crash, or waited for ever.
    """
    grown = process.Process()
    try:
        numbers = {grown.ask(60, "grow", grow, 150 * 10**6) for _ in range(6)}
    finally:
        grown.kill()
    assert len(numbers) == 1


def test_a_worker_says_nothing_to_the_pythons_of_others(monkeypatch):
    """A peer in another Python would take packages of this one for its own."""
    monkeypatch.delenv("PYTHONPATH", raising=False)
    made = process.Process()
    try:
        assert made.ask(60, "look", os.getenv, "PYTHONPATH") is None
    finally:
        made.kill()


def test_a_half_space_goes_to_other_processes_by_its_kernel():
    """No array is made of its Q, so that its size is no limit."""
    (spec,) = problems.named(
        "family", "by_products", {"of": "hertz-half-space", "elements": 16}, Path(".")
    )
    builder = process.Process()
    try:
        made, facts = builder.ask(60, "build", worker.build, spec, (), False, 4.0)
    finally:
        builder.kill()
    assert facts["contacts"] == made.contacts and made.q.size > worker.MOST_ROWS
    assert isinstance(made.Q, Convolution) and solve(made).solved
    x = np.random.default_rng(0).normal(size=made.q.size)
    assert np.array_equal(made.Q @ x, spec.build({}).Q @ x)


@pytest.fixture
def deadly_pipes():
    """As gmsh leaves it: a broken pipe would end this process."""
    before = signal.signal(signal.SIGPIPE, signal.SIG_DFL)
    yield
    signal.signal(signal.SIGPIPE, before)


@pytest.mark.slow
def test_a_process_killed_while_nobody_asks_it_is_started_again(monkeypatch, deadly_pipes):
    """A builder that dies between two problems costs no run, and one that is killed once while it
    builds costs none either.
    """
    with pool.Worker() as worker:
        first = worker.builder.ask(60.0, "look", os.getpid)
        os.kill(first, signal.SIGKILL)
        os.waitid(os.P_PID, first, os.WEXITED | os.WNOWAIT)
        assert worker.builder.ask(60.0, "look", os.getpid) != first
        ask, deaths = process.Process.ask, [process.Ended("build", "out_of_memory", process.KILLED)]

        def once(self, limit, phase, *given):
            if phase == "build" and deaths:
                raise deaths.pop()
            return ask(self, limit, phase, *given)

        monkeypatch.setattr(process.Process, "ask", once)
        spec = problems.ProblemSpec("family", "rigid_bodies", {"bodies": 3, "contacts": 4})
        run = Run(spec, MethodSpec("auto"), "mid", 1e-6, 0)
        assert worker.run(Task(run, "x", (), 5.0, 4.0, 100, 0))["success"] and not deaths


@pytest.mark.slow
@pytest.mark.parametrize("kills", [2, 3])
def test_a_solver_killed_while_it_starts_is_started_again(monkeypatch, kills):
    """Twice may be chance; a process that never lives to say a word ends the campaign with one
    sentence.
    """
    starts = []

    deadly, whole = "import os; os.kill(os.getpid(), 9)  # {} {}", process.PROGRAM

    class Killed(process.Process):
        def start(self):
            if not self.running:
                starts.append(1)
                monkeypatch.setattr(process, "PROGRAM", deadly if len(starts) <= kills else whole)
            super().start()

    made = Killed()
    try:
        if kills < 3:
            assert made.ask(60.0, "look", os.getpid) > 0
        else:
            with pytest.raises(process.Ended) as error:
                made.ask(60.0, "look", os.getpid)
            assert error.value.phase == process.START
    finally:
        made.kill()


def solvers(campaign: int) -> list[int]:
    """The worker processes of a campaign."""
    import psutil

    with contextlib.suppress(psutil.Error):
        return [
            own.pid
            for own in psutil.Process(campaign).children()
            if "benchmark.process" in " ".join(own.cmdline())
        ]
    return []


@pytest.mark.slow
def test_a_plug_in_counts_for_the_registry_that_runs_its_file(tmp_path):
    """Nothing is left in the module: not by a second registry, and not by a file that is imported
    in a plain way.
    """
    from contactopt.benchmark.plugins import Registry

    file = tmp_path / "mine.py"
    file.write_text(
        "from contactopt.benchmark import method, problem\n@method(name='own')\ndef mine(p):"
        " return p.q\n@problem(name='other')\ndef family(n=1): return n\n"
    )
    first, second = Registry(), Registry()
    first.load([file, file])
    mine = first.methods.get("own")
    assert mine is not None and first.problems["other"]() == 1
    assert "own" not in second.methods and not second.problems
    names = {}
    exec(compile(file.read_text(), file, "exec"), names)
    assert (
        callable(names["mine"]) and "own" not in second.methods and list(first.methods) == ["own"]
    )


def test_writing_to_a_dead_process_is_an_error_whatever_a_library_did_to_the_signal(deadly_pipes):
    process = subprocess.Popen(
        [sys.executable, "-c", ""], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    process.stdin.write(b"word")  # stays in the buffer until the pipe is closed
    os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOWAIT)
    child._stop(process)
    assert process.stdin.closed
