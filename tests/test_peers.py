"""Solvers of others in another Python: found or absent, timed there, judged here."""

import pickle
import sys
from dataclasses import replace

import numpy as np
import pytest

import contactopt
from contactopt import InputError, InterfaceProblem, benchmark, natural_map_residual
from contactopt.benchmark import peers
from contactopt.benchmark.families import FAMILIES
from contactopt.benchmark.peers import Peer
from contactopt.problem.laws.coulomb import Coulomb
from experiments.peers import cone_solvers, pinocchio_admm, siconos_numerics
from tests.test_benchmark import run, written

TOY = """
import sys
from contactopt.benchmark import Peer, method

def version():
    return "7"

def prepare(problem, tol, settings):
    import time
    time.sleep(0.3)  # which is not timed
    return problem, settings

def solve(prepared):
    import time
    import numpy as np
    problem, settings = prepared
    if settings["trouble"] == "hangs":
        time.sleep(60)
    if settings["trouble"] == "dies":
        import os
        os._exit(3)
    if settings["trouble"] == "raises":
        raise ValueError("no")
    print("words of the solver")
    k = len(problem["q"])
    blocks = np.array([problem["data"][i] for i in range(len(problem["data"]))])
    assert (problem["indices"] == np.arange(k)).all() and problem["q"].shape == (k, 3)
    r = np.zeros((k, 3))
    r[:, 0] = np.maximum(0, -problem["q"][:, 0] / blocks[:, 0, 0])
    return r, settings["trouble"] != "doubts", 5

PEER = Peer("Toy", "pip install toy", ["no-python", sys.executable], version, prepare, solve)
GONE = Peer("Gone", "pip install gone", ["no-python"], version, prepare, solve)

@method(peer=PEER)
def toy(problem, tol=1e-8, time_limit=1.0, trouble=""):
    return PEER.answer(problem, tol, time_limit, trouble=trouble)

@method(peer=GONE)
def gone(problem, tol=1e-8, time_limit=1.0):
    return GONE.answer(problem, tol, time_limit)
"""

SEPARATE = """
from contactopt.benchmark import problem
from contactopt.benchmark.sequences import Sequence
from contactopt import InterfaceProblem
from contactopt.problem.laws.coulomb import Coulomb
import numpy as np

@problem
def separate():
    Q, q = np.diag([1.0, 2.0, 3.0, 4.0]), np.array([[-100.0, 0.0], [5.0, 0.0]])
    return InterfaceProblem(Q, q, Coulomb(np.full(2, 0.5)))

@problem
def several():
    return Sequence((separate(),) * 5)
"""


@pytest.mark.slow
def test_a_peer_is_timed_where_it_runs_and_its_failures_cost_a_row_each(tmp_path):
    written(tmp_path, TOY, "toy.py")
    written(tmp_path, SEPARATE, "separate.py")
    table = run(
        tmp_path,
        """
        name = "toys"
        plugins = ["toy.py", "separate.py"]
        time_limit = 1.0
        repeats = 2
        [[problems]]
        family = ["separate", "several"]
        [[methods]]
        method = "toy"
        trouble = ["", "doubts", "raises", "dies", "hangs"]
        [[methods]]
        method = "gone"
        optional = true
        """,
    )
    along, table = table[table["states"] == 5], table[table["states"] == 1]
    assert (along["repeat"] == 0).all() and (table["repeat"] == 1).any()
    bridged = along[along["method"] == "toy(trouble='')"]
    assert bridged["success"].all() and (bridged["bridge_seconds"] > 1.2).all()  # which is no limit
    first = table[table["repeat"] == 0].set_index("method")
    status = first["status"].to_dict()
    assert status["toy(trouble='')"] == "solved" and first.loc["toy(trouble='')", "claimed"]
    assert status["toy(trouble='doubts')"] == "solved"  # the certificate decides
    assert not first.loc["toy(trouble='doubts')", "claimed"]
    assert status["toy(trouble='raises')"] == "error" and status["toy(trouble='dies')"] == "error"
    assert status["toy(trouble='hangs')"] == "time_limit"
    good = table[table["method"] == "toy(trouble='')"]
    assert (good["bridge_seconds"] > 0.2).all()  # to prepare is part of the bridge
    assert (good["call_seconds"] < 0.2).all() and (good["iterations"] == 5).all()
    assert set(table["backend"]) == {"Toy 7"}
    left = benchmark.load(tmp_path / "out", absent=True)
    (absent,) = left[left["status"] == "absent"].to_dict("records")
    assert absent["method"] == "gone" and "pip install gone" in absent["message"]
    assert len(left) == len(table) + len(along) + 1


def version():
    return "1"


def prepare(problem, tol, settings):
    assert problem["q"].flags.writeable  # arrays of its own in each run
    if settings["end"]:
        raise SystemExit
    return problem


def solve(problem):
    import numpy as np

    return np.maximum(0, -problem["q"]), True, float(problem["start"].sum())


def test_a_problem_goes_to_a_peer_once_and_again_to_a_new_process(monkeypatch):
    monkeypatch.setattr(peers, "MOST_HELD", 2)
    sent = []

    peer = Peer("Toy", "", [sys.executable], version, prepare, solve)
    monkeypatch.setattr(
        peers.pickle, "dump", lambda x, *a, dump=pickle.dump: (sent.append(x[1]), dump(x, *a))
    )
    made = [
        InterfaceProblem(np.eye(2), np.array([[-n, 0.0]]), Coulomb(np.array([0.5])))
        for n in (1.0, 2.0, 3.0)
    ]
    for index, new in [(0, 1), (0, 0), (1, 1), (0, 0), (2, 1), (0, 1)]:
        begin = np.full((1, 2), 2.0 + index)
        answer = peer.answer(made[index], 1e-8, 9.0, (2,), begin, end=False)
        assert (sent.pop() is not None) == new
        assert answer.reactions.ravel().tolist() == [1.0 + index, 0.0]
        assert answer.iterations > 0
    with pytest.raises(RuntimeError, match="ended"):
        peer.answer(made[0], 1e-8, 9.0, (2,), end=True)
    assert sent.pop() is None
    assert peer.answer(made[0], 1e-8, 9.0, (2,), end=False).reactions[0, 0] == 1.0
    assert sent.pop() is not None
    peer.process.kill()
    peer.process.wait()


def test_a_plane_problem_reaches_a_peer_in_space_and_without_units():
    seen = {}

    def ask(request):
        for name, (kind, shape, data) in request[1].items():
            seen[name] = np.frombuffer(data, kind).reshape(shape)
        return {"error": "seen"}

    peer = Peer("Toy", "", [], str, str, str)
    peer._ask = ask
    Q, q = np.diag([1e-9, 2e-9]), np.array([[-1e3, 2e3]])
    answer = peer.answer(InterfaceProblem(Q, q, Coulomb(np.array([0.3]))), 1e-8, 1.0)
    assert answer.status == "error" and seen["q"].shape == (1, 3) and seen["q"][0, 2] == 0.0
    assert 0.1 < np.abs(seen["q"]).max() < 10.0 and 0.1 < seen["data"].max() < 10.0
    # a solver of the plane gets the problem as it is, and none in space
    peer.answer(InterfaceProblem(Q, q, Coulomb(np.array([0.3]))), 1e-8, 1.0, (2, 3))
    assert seen["q"].shape == (1, 2) and seen["data"].shape == (1, 2, 2)
    space = InterfaceProblem(np.eye(3), np.zeros((1, 3)), Coulomb(np.array([0.3])))
    with pytest.raises(InputError, match="plane"):
        peer.answer(space, 1e-8, 1.0, (2,))


@pytest.mark.slow
@pytest.mark.parametrize(
    "module, name, solver",
    [
        (siconos_numerics, "siconos", "NSN_AC"),
        (pinocchio_admm, "pinocchio", "ADMM"),
        *((cone_solvers, "cone", solver) for solver in cone_solvers.SOLVERS),
    ],
)
def test_solvers_of_others_find_the_certified_answer(module, name, solver):
    call = getattr(module, name)
    for problem in (
        FAMILIES["rigid_bodies"](bodies=10, contacts=6, mu=0.3),
        FAMILIES["packing"](dim=2, bodies=9, mu=0.3),
    ):
        try:
            module.PEER.found()
            answer = call(problem, 1e-9, 10.0, solver=solver)
        except InputError as absent:
            pytest.skip(str(absent))
        assert answer.reactions.shape == problem.q.shape
        reached = 1e-4 if name == "cone" else 1e-6  # cone solvers end at accuracies of their own
        assert natural_map_residual(problem, answer.reactions) <= reached
        assert answer.measured["cpu_seconds"] > 0
        again = call(problem, 1e-9, 10.0, start=answer.reactions, solver=solver)
        assert again.iterations <= answer.iterations
        assert natural_map_residual(problem, again.reactions) <= reached
    plates = FAMILIES["half_plane"](contacts=8)
    assert len(plates.s) and contactopt.solve(plates).solved
    with pytest.raises(InputError, match="plates"):
        call(plates, 1e-8, 10.0, solver=solver)


@pytest.mark.slow
def test_siconos_solvers_of_the_plane_take_the_plane_symmetric_or_not():
    try:
        _, version = siconos_numerics.PEER.found()
    except InputError as absent:
        pytest.skip(str(absent))
    assert version and version != "0"
    A = np.random.default_rng(1).normal(size=(12, 12))
    Q = A @ A.T / 12 + np.eye(12) + 0.4 * (A - A.T)
    skew = InterfaceProblem(Q, A[:6, :2].copy(), Coulomb(np.full(6, 0.3)))
    for solver in siconos_numerics.SOLVERS[2]:
        # on redundant contacts rounding decides whether its Lemke finds a solution
        redundant = FAMILIES["packing"](dim=2, bodies=9, mu=0.3)
        even = replace(skew, Q=(Q + Q.T) / 2) if solver == "LEMKE" else redundant
        for problem in (even, skew)[: 1 if solver == "CPG" else 2]:  # it minimises an energy
            answer = siconos_numerics.siconos(problem, 1e-10, 10.0, solver=solver)
            assert natural_map_residual(problem, answer.reactions) <= 1e-6, solver
    space = FAMILIES["rigid_bodies"](bodies=4, contacts=6, mu=0.3)
    assert siconos_numerics.siconos(space, 1e-8, 10.0, solver="NSGS").status == "solved"
    with pytest.raises(InputError, match="plane"):
        siconos_numerics.siconos(space, 1e-8, 10.0, solver="LEMKE")
    with pytest.raises(InputError, match="choose from"):
        siconos_numerics.siconos(space, 1e-8, 10.0, solver="LEMK")


def test_what_is_not_installed_is_named_with_the_line_that_installs_it():
    peer = Peer("Nothing", "pip install nothing", ["no-such-python", sys.executable], str, str, str)
    peer.version = missing
    with pytest.raises(InputError, match="Nothing is not installed; pip install nothing"):
        peer.found()


def missing():
    import no_such_package

    return no_such_package.__version__


SLOW = """
import time
from contactopt.benchmark import method

@method
def slow(problem, tol=1e-8):
    end = time.process_time() + 1.1
    while time.process_time() < end:
        pass
    return 0 * problem.q

@method
def late(problem, tol=1e-8):
    time.sleep(60)

@method
def swift(problem, tol=1e-8):
    return 0 * problem.q
"""


def alone(folder, text, **options):
    path, out = written(folder, text), folder / "out"
    return benchmark.load(benchmark.run_campaign(path, out, jobs=1, quiet=True, **options))


@pytest.mark.slow
def test_slow_runs_are_not_repeated_and_hopeless_ones_are_not_made(tmp_path):
    written(tmp_path, SLOW, "slow.py")
    written(tmp_path, SEPARATE, "separate.py")
    text = """
        name = "slow"
        plugins = ["slow.py", "separate.py"]
        settings = [1e-3, 1e-6]
        repeats = 2
        time_limit = 2.0
        [[problems]]
        family = "separate"
        [[methods]]
        method = ["slow", "late", "swift"]
        """
    table = alone(tmp_path, text)
    counts = table.groupby(["method", "setting"]).size().to_dict()
    assert {key[0]: n for key, n in counts.items()} == {"slow": 1, "late": 1, "swift": 2}
    late = table[table["method"] == "late"].set_index("setting")
    assert late.loc["0.001", "status"] == "killed"
    assert late.loc["1e-06", "status"] == "time_limit"
    assert "not made" in late.loc["1e-06", "message"]
    again = alone(tmp_path, text, resume=True)
    assert len(again) == len(table) and set(again["key"]) == set(table["key"])
