"""Plug-ins that play games with a benchmark cost at most their own row."""

import json
import logging

import numpy as np
import pytest

from contactopt import benchmark
from contactopt.benchmark.experiment import read_experiment
from contactopt.benchmark.ranking import points
from contactopt.benchmark.store import Store, lines
from tests.test_benchmark import SMALL, run, written

GAMES = """
import glob, os, subprocess, sys, time
import numpy as np
from contactopt import solve
from contactopt.benchmark import Answer, method
from contactopt.benchmark.families import FAMILIES

known = {}

def busy(seconds, clock=time.process_time):
    begin = clock()
    while clock() - begin < seconds:
        pass

@method
def remembers(problem):
    key = problem.q.tobytes()
    if len(key) > 100 and key not in known:
        busy(0.15)
    known[key] = True
    return solve(problem).reactions

@method
def sleeps(problem):
    time.sleep(0.15)
    return solve(problem).reactions

@method
def forks(problem):
    if problem.q.size > 10:
        child = os.fork()
        if not child:
            busy(0.15)
            os._exit(0)
        os.waitpid(child, 0)
    return solve(problem).reactions

@method
def leaves_a_child(problem):
    if problem.q.size > 10:
        loop = "import time\\nwhile time.process_time() < 0.15: pass"
        subprocess.Popen([sys.executable, "-c", loop])
        time.sleep(0.3)
    return solve(problem).reactions

@method
def says_its_own_time(problem):
    busy(0.15 if problem.q.size > 10 else 0.0)
    no_time = dict(call_seconds=1e-9, cpu_seconds=1e-9)
    return Answer("solved", reactions=solve(problem).reactions, measured=no_time)

@method
def stops_the_clock(problem):
    busy(0.15 if problem.q.size > 10 else 0.0)
    time.perf_counter = time.process_time = lambda: 0.0
    return solve(problem).reactions

@method
def spoils(problem):
    import contactopt.methods.driver as driver
    problem.q[:] = 7.0
    driver.natural_map_residual = None
    return np.zeros(problem.q.shape)

@method
def forges(problem):
    for file in glob.glob("FOLDER/rows.*"):
        with open(file, "a") as rows:
            rows.write('{"forged": 1}\\\\n')
    return solve(problem).reactions
"""


@pytest.fixture(scope="module")
def games(tmp_path_factory):
    folder = tmp_path_factory.mktemp("games")
    written(folder, GAMES.replace("FOLDER", str(folder / "out")), "games.py")
    names = [line[4:].partition("(")[0] for line in GAMES.splitlines() if line.startswith("def ")]
    names.remove("busy")
    table = run(
        folder,
        f"""
        name = "games"
        plugins = ["games.py"]
        settings = ["mid"]
        repeats = 2
        time_limit = 5.0
        [[problems]]
        family = "rigid_bodies"
        bodies = 4
        contacts = 10
        [[methods]]
        method = {json.dumps([*names, "auto"])}
        """,
    )
    return folder, names, table


@pytest.mark.slow
def test_no_game_with_the_clock_saves_time(games):
    _, _, table = games
    cpu = points(table).set_index("method")["counted"]
    for game in ("remembers", "sleeps", "forks", "leaves_a_child", "says_its_own_time"):
        assert cpu[game] > 0.14, (game, cpu[game])
    assert cpu["stops_the_clock"] > 0.14
    assert cpu["auto"] < 0.1


@pytest.mark.slow
def test_games_cost_no_row_of_others(games):
    folder, names, table = games
    assert (table.groupby("method").size() == 2).all() and len(table) == 2 * len(names) + 2
    rows = table[table["method"] == "auto"]
    assert (rows["status"] == "solved").all() and rows["residual"].nunique() == 1
    assert (table.loc[table["method"] == "spoils", "status"] != "solved").all()
    text = (folder / "out" / "rows.jsonl").read_text()
    assert "forged" not in text and len(text.splitlines()) == len(table)


LOOKS = """
from contactopt.benchmark import method
from contactopt import InputError, solve

seen = []

@method
def looks(problem):
    kept = sorted(n for n, v in vars(type(problem)).items() if type(v).__name__ == "cached_property"
                  and n in vars(problem))
    kept += sorted(n for n, v in vars(type(problem.law)).items()
                   if type(v).__name__ == "cached_property" and n in vars(problem.law))
    answer = solve(problem)  # which computes what it needs
    assert not kept, kept
    return answer.reactions
"""


@pytest.mark.slow
def test_each_run_gets_a_problem_of_which_nothing_is_computed_yet(tmp_path):
    written(tmp_path, LOOKS, "looks.py")
    text = 'plugins = ["looks.py"]' + SMALL.replace('["auto", "nsgs"]', '"looks"')
    table = run(tmp_path, text, filters=["problem=rigid*"])
    assert len(table) > 1 and (table["status"] == "solved").all(), set(table["message"])


def test_the_key_of_a_run_changes_with_the_source_of_its_plug_in(tmp_path, monkeypatch):
    source = "from contactopt.benchmark import method\n@method\ndef mine(problem):\n    return 0\n"
    written(tmp_path, source, "mine.py")
    text = 'plugins = ["mine.py"]' + SMALL.replace('["auto", "nsgs"]', '["auto", "mine"]')
    path = written(tmp_path, text)

    def keys():
        made = {}
        for one in read_experiment(path).runs():
            made.setdefault(one.method.name, set()).add(one.key)
        return made

    first, again = keys(), keys()
    assert first == again
    written(tmp_path, source.replace("return 0", "return 1"), "mine.py")
    edited = keys()
    assert edited["auto"] == first["auto"] and not edited["mine"] & first["mine"]
    monkeypatch.setattr("contactopt.benchmark.runs._own_version", lambda: "99")
    assert not keys()["auto"] & first["auto"]


def whole_row():
    from contactopt.benchmark.measure import absent_row

    return absent_row("x", "m", "why") | {"key": "k", "status": "solved", "history": "[]"}


BAD = {
    "contacts": "many", "residual": "small", "claimed": 1, "repeat": 1.5, "key": 3,
    "settings": "[1]", "parameters": "{", "answer": "no base64", "history": "{}", "cpu_seconds": [],
}  # fmt: skip


@pytest.mark.parametrize("column", BAD)
def test_a_malformed_row_is_told_with_file_and_line_and_the_rest_is_kept(tmp_path, caplog, column):
    good, path = whole_row(), tmp_path / "rows.jsonl"
    texts = [good, good | {"key": "l", column: BAD[column]}, good | {"key": "m"}]
    path.write_text("".join(json.dumps(row) + "\n" for row in texts))
    with caplog.at_level(logging.WARNING):
        table = benchmark.load(path)
    assert list(table["key"]) == ["k", "m"]
    assert f"'{path}', line 2" in caplog.text


def test_what_others_write_into_the_rows_of_a_campaign_is_taken_out(tmp_path, caplog):
    with Store(tmp_path, resume=False) as store:
        store.append(whole_row())
        with open(store.path, "a") as other:
            other.write(json.dumps(whole_row() | {"key": "forged"}) + "\n")
        store.append(whole_row() | {"key": "second"})
        store.keep_own()
        assert [row["key"] for row in lines(store.path)] == ["k", "second"]
        store.path.unlink()
        store.keep_own()
        assert [row["key"] for row in lines(store.path)] == ["k", "second"]
    assert "changed by something else" in caplog.text


def test_one_that_sleeps_stops_no_ranking_and_is_not_fast():
    import pandas as pd

    from tests.test_ranking import campaign, rows

    table = campaign(np.random.default_rng(0), wall=1.1)
    idle = [row for n in range(300) for row in rows("idle", [(1e-6, 1e-7, 1e-3)], f"p{n % 30}")]
    table = pd.concat([table, pd.DataFrame(idle).assign(call_seconds=0.5)])
    shown = benchmark.tables.leader_table(table).set_index("method")
    assert "rank (95 %)" in shown and shown.loc["idle", "CPU [s]"] == pytest.approx(0.5)
