"""Bodies on ranks of their own: the same answers to the last digit, few and short messages, and no
rank left alone.
"""

import json
import os
import subprocess
import sys
import threading
import time
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import psutil
import pytest

from contactopt import InputError, reduce, scenes, solve
from contactopt.bodies.launch import OUTCOME, launch, mpiexec
from contactopt.cli import main
from contactopt.methods.preconditioners import degrees
from contactopt.scenes.slices import sliced

ROOT = Path(__file__).parents[1]
PATIENCE = 300  # seconds; a test that needs them hangs

COMPARISON = """
import json, sys
import numpy as np
from dataclasses import replace
import contactopt
from contactopt import scenes
from contactopt.bodies.ranks import Team, serve, spread, world
from contactopt.scenes import PATHS
from contactopt.scenes.slices import sliced

comm = world()
if comm.rank:
    serve(comm)
    sys.exit()

def torn(elements, zone):
    raise contactopt.InputError(f"torn on a rank of {comm_size()}.")

def comm_size():
    from contactopt.bodies.ranks import world
    return f"{world().size}, this is {world().rank}"

team = Team(comm)
try:
    flat = lambda **more: replace(scenes.flat_punch(2, elements=8), **more)
    cases = {
        "explicit": ("punch-2d", dict(elements=8)),
        "implicit": ("punch-2d", dict(elements=8, Q="implicit")),
        "multigrid": ("punch-3d", dict(elements=4, solver="multigrid")),
        "axisymmetric with a zone": ("sphere", dict(elements=8)),
        "three bodies, mortar": ("arch", {}),
        "load path": ("cattaneo-2d", dict(elements=4)),
        "slices": (sliced(flat(), "foundation", 3), {}),
    }
    found = {}
    for case, (scene, options) in cases.items():
        one = contactopt.run(scene, **options)
        before = (team.traffic.messages, team.traffic.length)
        many = contactopt.run(scene, team=team, **options)
        found[case] = {
            "same": bool(np.array_equal(one.solution.reactions, many.solution.reactions)),
            "steps": (one.solution.iterations, many.solution.iterations),
            "residuals": (one.solution.residual, many.solution.residual),
            "stress": max(
                float(np.abs(a.stress - b.stress).max()) for a, b in zip(one.fields, many.fields)
            ),
            "messages": team.traffic.messages - before[0],
        }
        if one.path is not None:
            a, b = one.path.history["external_work"], many.path.history["external_work"]
            found[case]["work"] = float(np.abs(a - b).max() / np.abs(a).max())
    found["traffic"] = []
    for height in (80.0, 640.0):  # of the foundation: more unknowns within, the same contacts
        scene = scenes.flat_punch(2, elements=8, foundation_height=height)
        problem = contactopt.reduce(spread(scene, team), Q="implicit")
        problem.Q @ np.ones(len(problem.Q.diagonal))
        before = (team.traffic.messages, team.traffic.length)
        problem.Q @ np.ones(len(problem.Q.diagonal))
        sent = (team.traffic.messages - before[0], team.traffic.length - before[1])
        bodies = contactopt.reduce_bodies(scene).bodies
        found["traffic"].append((*sent, sum(body.unknowns for body in bodies)))
    for quantity in ("energy", "pressure", "von_mises:foundation", "approach"):
        aim = dict(elements=4, accuracy=0.2, quantity=quantity, adaptive=quantity != "approach")
        one, many = (contactopt.run("punch-2d", team=own, **aim).estimate for own in (None, team))
        found[f"adaptive {quantity}"] = [
            [level.value for level in made.levels] for made in (one, many)
        ]
        found[f"errors {quantity}"] = one.error, many.error
    for scene, upper in (("punch-2d", "punch"), ("cattaneo-2d", "upper")):
        names = ("E", f"nu:{upper}", f"force:{upper}:y", "mu")
        pair = [contactopt.run(scene, elements=4, team=own) for own in (None, team)]
        for quantity in ("energy", "approach"):
            made = [contactopt.gradient(own, quantity, names) for own in pair]
            found[f"gradient {scene} {quantity}"] = [
                [*own.by.values(), own.onesided({name: 1.0 for name in names})] for own in made
            ]
    bad = flat(lower=replace(flat().lower, mesh=torn))
    try:
        contactopt.run(bad, team=team)
    except contactopt.InputError as error:
        found["sentence"] = str(error)
finally:
    team.dismiss()
try:
    contactopt.gradient(pair[1], "energy", ("E",))
except contactopt.InputError as error:
    found["dismissed"] = str(error)
print(json.dumps(found))
"""


def environment() -> dict[str, str]:
    one = {name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")}
    return dict(os.environ) | one | {"PYTHONPATH": str(ROOT)}


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    script = tmp_path_factory.mktemp("ranks") / "comparison.py"
    script.write_text(COMPARISON)
    command = [*mpiexec(3), sys.executable, str(script)]
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=PATIENCE, env=environment(), cwd=ROOT
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


CASES = (
    "explicit",
    "implicit",
    "multigrid",
    "axisymmetric with a zone",
    "three bodies, mortar",
    "load path",
    "slices",
)


@pytest.mark.parametrize("case", CASES)
def test_answers_steps_and_certificates_are_those_of_one_process(found, case):
    result = found[case]
    assert result["same"] and result["stress"] == 0.0 and result["messages"] > 0
    assert (
        result["steps"][0] == result["steps"][1]
        and result["residuals"][0] == result["residuals"][1] <= 1e-8
    )


def test_energies_of_a_load_path_are_those_of_one_process(found):
    assert found["load path"]["work"] < 1e-12


@pytest.mark.parametrize("quantity", ["energy", "pressure", "von_mises:foundation", "approach"])
def test_refinement_is_that_of_one_process(found, quantity):
    one, many = found[f"adaptive {quantity}"]
    assert one == many and len(one) > 1
    errors = found[f"errors {quantity}"]  # none where no mesh bounds the quantity
    assert (
        errors[0] == errors[1]
        if errors[0] is None
        else errors[1] == pytest.approx(errors[0], rel=1e-12)
    )


@pytest.mark.parametrize("scene", ["punch-2d", "cattaneo-2d"])
@pytest.mark.parametrize("quantity", ["energy", "approach"])
def test_gradients_are_those_of_one_process(found, scene, quantity):
    one, many = map(np.array, found[f"gradient {scene} {quantity}"])
    assert np.abs(one - many).max() <= 1e-10 * np.abs(one).max() and np.any(one)


def test_messages_do_not_grow_with_the_unknowns_of_the_bodies(found):
    """One product with Q is one order to the other body and its reply, whatever lies inside of the
    body.
    """
    (messages, data, unknowns), (others, more, larger) = found["traffic"]
    assert messages == others == 2 and larger > 1.3 * unknowns
    # two vectors of 34 numbers, and what the order says
    assert abs(data - more) < 16 and data < 1500


def test_what_a_rank_raises_is_raised_on_rank_0(found):
    assert found["sentence"] == "torn on a rank of 3, this is 1."


def test_a_result_whose_ranks_were_dismissed_says_so(found):
    assert "were dismissed" in found["dismissed"]


def test_the_command_line_starts_the_ranks_itself(tmp_path, capfd):
    assert (
        main(["run", "punch-2d", "--elements", "4", "--ranks", "2", "--out", str(tmp_path / "out")])
        == 0
    )
    captured = capfd.readouterr()
    assert "solved" in captured.out and "2 ranks, " in captured.out
    assert (tmp_path / "out" / "summary.json").exists()


def test_a_mistake_ends_all_ranks_with_its_one_sentence(tmp_path, capfd):
    code = main(
        ["run", "punch-2d", "--elements", "0", "--ranks", "2", "--out", str(tmp_path / "out")]
    )
    assert code == main(["run", "punch-2d", "--elements", "0", "--out", str(tmp_path / "out")]) == 2
    first, second = capfd.readouterr().err.strip().splitlines()
    assert first == second and first.startswith("contactopt: ")


def test_one_rank_runs_here_and_starts_no_other(tmp_path, monkeypatch):
    monkeypatch.setattr("contactopt.bodies.launch.subprocess", None)
    assert (
        main(
            [
                "run",
                "punch-2d",
                "--elements",
                "4",
                "--ranks",
                "1",
                "--no-figures",
                "--out",
                str(tmp_path),
            ]
        )
        == 0
    )


@pytest.mark.parametrize(
    ("scene", "ranks", "sentence"),
    [
        ("punch-2d", "1000", "2 elastic bodies"),
        ("punch-2d", "3", "2 elastic bodies"),
        ("punch-2d", "0", "at least 1"),
    ],
)
def test_ranks_that_would_have_nothing_to_do_are_refused_before_they_start(
    scene, ranks, sentence, monkeypatch, capfd
):
    monkeypatch.setattr("contactopt.bodies.launch.subprocess", None)
    assert main(["run", scene, "--ranks", ranks]) == 2
    (line,) = capfd.readouterr().err.strip().splitlines()
    assert sentence in line


def test_many_ranks_on_a_core_are_refused():
    with pytest.raises(InputError, match="ranks are too many for"):
        mpiexec(100_000)


def test_a_rank_starts_no_ranks(monkeypatch):
    monkeypatch.setenv(OUTCOME, "/nowhere")
    monkeypatch.setattr("contactopt.bodies.launch.subprocess", None)
    with pytest.raises(InputError, match="do not see each other"):
        launch(2, ["run", "punch-2d"])


def test_a_stopped_rank_is_waited_for_with_a_word_and_not_for_ever(tmp_path, monkeypatch, capfd):
    monkeypatch.setattr("contactopt.bodies.launch.BEAT", 0.2)
    monkeypatch.setattr("contactopt.bodies.launch.PATIENCE", 1.0)
    stopped = []

    def stop():
        begin = time.monotonic()
        while not stopped and time.monotonic() - begin < PATIENCE:
            time.sleep(0.05)
            for process in psutil.Process().children(recursive=True):
                with suppress(psutil.Error):
                    if (
                        process.environ().get("OMPI_COMM_WORLD_RANK") == "1"
                        and "python" in process.name()
                    ):
                        process.suspend()
                        stopped.append(process.pid)

    thread = threading.Thread(target=stop)
    thread.start()
    begin = time.monotonic()
    code = main(
        ["run", "punch-2d", "--elements", "4", "--ranks", "2", "--out", str(tmp_path / "out")]
    )
    thread.join()
    errors = capfd.readouterr().err
    assert code != 0 and time.monotonic() - begin < 30 and not psutil.pid_exists(stopped[0])
    assert f"kill -CONT {stopped[0]}" in errors and "nothing was written" in errors


def test_the_death_of_a_rank_ends_all(tmp_path):
    command = [
        sys.executable,
        "-m",
        "contactopt",
        "run",
        "punch-3d",
        "--elements",
        "14",
        "--ranks",
        "2",
    ]
    started = subprocess.Popen(
        [*command, "--out", str(tmp_path / "out")],
        stderr=subprocess.PIPE,
        text=True,
        env=environment(),
        cwd=ROOT,
    )

    def second_rank():
        for process in psutil.Process(started.pid).children(recursive=True):
            if "python" in process.name() and process.environ().get("OMPI_COMM_WORLD_RANK") == "1":
                return process
        return None

    begin = time.monotonic()
    while (victim := second_rank()) is None or victim.cpu_times().user < 1.0:  # it is at work
        assert time.monotonic() - begin < PATIENCE and started.poll() is None
        time.sleep(0.05)
    victim.kill()
    _, errors = started.communicate(timeout=PATIENCE)
    assert started.returncode == 137 and "contactopt: a rank was ended by signal 9" in errors
    assert not (tmp_path / "out" / "summary.json").exists()


@pytest.mark.parametrize(("dim", "name"), [(2, "foundation"), (3, "punch")])
def test_slices_tied_to_each_other_are_the_whole_body(dim, name):
    scene = scenes.flat_punch(dim, elements=8 if dim == 2 else 3)
    cut = reduce(sliced(scene, name, 3), Q="explicit")
    whole, pieces = solve(reduce(scene, Q="explicit"), tol=1e-11), solve(cut, tol=1e-11)
    assert pieces.solved and len(cut.pairs) == 3
    error = np.abs(pieces.reactions[cut.pairs[0].contacts] - whole.reactions).max()
    assert error < 1e-9 * np.abs(whole.reactions).max()


@pytest.mark.parametrize("dim", [2, 3])
def test_slices_of_quadratic_simplices_are_the_whole_body(dim):
    """No node of the cut may be left behind, not those in the middle of edges either."""

    def simplices(part):
        def mesh(elements, zone):
            old = part.mesh(elements, zone)
            new = old.to_meshtri() if dim == 2 else old.to_meshtet()
            outer = np.isin(np.arange(new.facets.shape[1]), new.boundary_facets())
            there = {name: np.unique(old.facets[:, own]) for name, own in old.boundaries.items()}
            return new.with_boundaries(
                {
                    name: np.flatnonzero(np.isin(new.facets, at).all(axis=0) & outer)
                    for name, at in there.items()
                }
            )

        return replace(part, mesh=mesh)

    scene = replace(scenes.flat_punch(dim, elements=4 if dim == 2 else 2), degree=2).with_parts(
        simplices
    )
    cut = reduce(sliced(scene, "foundation", 2), Q="explicit")
    whole, pieces = solve(reduce(scene, Q="explicit"), tol=1e-11), solve(cut, tol=1e-11)
    error = np.abs(pieces.reactions[cut.pairs[0].contacts] - whole.reactions).max()
    assert error < 1e-11 * np.abs(whole.reactions).max()


def test_what_cannot_be_sliced_is_refused():
    scene = scenes.flat_punch(2, elements=4)
    with pytest.raises(InputError, match="lies in 2 slices; choose another axis"):
        sliced(scene, "punch", 2, axis=0)
    with pytest.raises(InputError, match="no elastic body named 'floor'"):
        sliced(scene, "floor", 2)
    with pytest.raises(InputError, match="needs at least 500 layers"):
        sliced(scene, "punch", 500)


@pytest.mark.parametrize(
    ("dim", "elements", "count", "options"),
    [
        (2, 16, 4, {"Q": "implicit", "solver": "superlu"}),
        (2, 16, 8, {"Q": "implicit", "solver": "superlu"}),
        (3, 4, 4, {"Q": "implicit", "solver": "superlu"}),
        (2, 16, 4, {"solver": "multigrid"}),
    ],
)
def test_thin_slices_are_solved_from_products_with_q(dim, elements, count, options):
    """The thinnest of eight slices is a hundred times wider than high, and held by tied pairs
    alone.
    """
    scene = scenes.flat_punch(dim, elements=elements)
    problem = reduce(sliced(scene, "foundation", count), **options)
    assert problem.Q.diagonal.min() >= 0.0  # signs of one pair say nothing of another
    pieces = solve(problem, "newton", tol=1e-8, max_iterations=12)
    whole = solve(reduce(scene, Q="explicit"), "newton", tol=1e-11)
    assert pieces.solved
    error = np.abs(pieces.reactions[problem.pairs[0].contacts] - whole.reactions).max()
    assert error < 1e-6 * np.abs(whole.reactions).max()


def test_smooth_motions_grow_with_the_length_of_a_pair_over_its_distance_to_the_next():
    thick, thin = (
        reduce(
            sliced(scenes.flat_punch(2, elements=8, foundation_height=height), "foundation", 2),
            Q="explicit",
        )
        for height in (160.0, 10.0)
    )
    assert degrees(reduce(scenes.flat_punch(2, elements=8))) == [1] == degrees(thick)[:1]
    assert degrees(thin)[1] > degrees(thick)[1]
