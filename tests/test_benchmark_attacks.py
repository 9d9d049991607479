"""Plug-ins that reach for the campaign itself cost at most their own row."""

import json
import time

import pytest

from tests.test_benchmark import run, written

ATTACKS = """
import os, shutil, subprocess, sys, tempfile, threading, time
from enum import StrEnum
from pathlib import Path
import numpy as np
import contactopt.benchmark.sequences
import contactopt.methods.driver
from contactopt.benchmark import Answer, method
from contactopt.benchmark.peers import PeerAnswer

solve = contactopt.methods.driver.solve
right = lambda problem: solve(problem, tol=1e-10).reactions
# every file is loaded before anything runs
for place in (contactopt.benchmark.sequences, contactopt.methods.driver):
    place.natural_map_residual = lambda *given: 0.0
Word = StrEnum("Word", {"solved": "solved"})
HERE = Path(__file__).parent

class Unreadable:
    def __array__(self, *given, **named):
        raise LookupError

def pipes():
    return [int(name) for name in os.listdir("/proc/self/fd") if int(name) > 2]

def says(data):
    for number in pipes():
        try:
            os.write(number, data)
        except OSError:
            pass

@method
def lies(problem):
    return np.zeros(problem.q.shape)

@method
def says_garbage(problem):
    says(bytes(7) + b"\\x05hello")
    return right(problem)

@method
def promises_a_long_answer(problem):
    says(bytes(3) + b"\\x7f" * 5)
    return right(problem)

@method
def closes_the_pipe(problem):
    for number in pipes():
        try:
            os.close(number)
        except OSError:
            pass
    time.sleep(1e4)

@method
def leaves_soon(problem):
    threading.Timer(0.1, os._exit, [0]).start()
    return right(problem)

@method
def raises_its_own_exit(problem):
    raise type("Leave", (SystemExit,), {"__str__": lambda own: 1 / 0})

@method
def has_words_of_its_own(problem):
    return Answer(Word.solved, reactions=right(problem))

@method
def is_absent(problem):
    return Answer("absent")

@method
def has_a_strange_history(problem):
    return Answer("solved", reactions=right(problem), history={"a": 1})

@method
def has_unreadable_forces(problem):
    return Unreadable()

@method
def has_a_time_of_its_own(problem):
    begin = time.process_time()
    while problem.q.size > 10 and time.process_time() - begin < 0.15:
        pass
    names = ("call_seconds", "cpu_seconds", "peak_mb", "base_mb")
    return PeerAnswer("solved", reactions=right(problem), measured=dict.fromkeys(names, 1e-9))

@method
def speaks_half_characters(problem):
    raise FileNotFoundError(os.fsdecode(b"\\xff"))

@method
def fills_the_disk(problem):
    file = tempfile.NamedTemporaryFile(delete=False)
    (HERE / "left").write_text(file.name)
    file.truncate(10**11)
    return right(problem)

@method
def removes_the_results(problem):
    shutil.rmtree(HERE / "out", ignore_errors=True)
    return right(problem)

@method
def is_nice(problem):
    os.nice(19)
    threading.Thread(target=time.sleep, args=[1e4], daemon=True).start()
    return right(problem)

RESPAWNS = '''
import os, sys, time
end = time.monotonic() + 60
while time.monotonic() < end:
    with open(sys.argv[1], "a") as file:
        file.write(".")
    if os.fork():
        os._exit(0)
    os.setsid()
    time.sleep(0.02)
'''

@method
def respawns(problem, leaves=False):
    if problem.q.size > 10:
        program = [sys.executable, "-c", RESPAWNS, HERE / f"respawned{leaves}"]
        subprocess.Popen(program, start_new_session=True)
        time.sleep(0.5)
        leaves and os._exit(0)
    return right(problem)

@method
def honest(problem):
    assert os.getpriority(os.PRIO_PROCESS, 0) == os.getpriority(os.PRIO_PROCESS, os.getppid())
    assert threading.active_count() == 1
    return right(problem)
"""
ENDS = {
    "lies": "false_claim",
    "says_garbage": "crashed",
    "promises_a_long_answer": "killed",
    "closes_the_pipe": "crashed",
    "raises_its_own_exit": "error",
    "has_words_of_its_own": "solved",
    "is_absent": "error",
    "has_a_strange_history": "error",
    "has_unreadable_forces": "error",
    "has_a_time_of_its_own": "solved",
    "speaks_half_characters": "error",
    "fills_the_disk": "error",
    "removes_the_results": "solved",
    "is_nice": "solved",
    "respawns": "solved",
    "respawns(leaves=True)": "crashed",
    "honest": "solved",
    "auto": "solved",
}


@pytest.mark.slow
def test_each_attack_costs_its_own_row(tmp_path):
    """The file also replaces the certificate by one that is always zero, while it is loaded."""
    written(tmp_path, ATTACKS, "attacks.py")
    text = f"""
        name = "attacks"
        plugins = ["attacks.py"]
        settings = ["mid"]
        time_limit = 2.0
        [[problems]]
        family = "rigid_bodies"
        bodies = 4
        contacts = 10
        [[methods]]
        method = {json.dumps(["leaves_soon", *(name for name in ENDS if "(" not in name)])}
        [[methods]]
        method = "respawns"
        leaves = true
    """
    table = run(tmp_path, text).set_index("method")
    respawned = {file: file.stat().st_size for file in tmp_path.glob("respawned*")}
    ends = dict(table["status"])
    assert ends.pop("leaves_soon") in ("solved", "crashed")
    assert ends == ENDS
    assert (table["success"] == (table["status"] == "solved")).all()
    assert table.loc["has_a_time_of_its_own", "cpu_seconds"] > 0.14
    assert not (tmp_path / (tmp_path / "left").read_text()).exists()
    time.sleep(0.5)
    assert {file: file.stat().st_size for file in respawned} == respawned and len(respawned) == 2
