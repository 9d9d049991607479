"""The test set: its problems, tags, reference answers and files."""

import json
import re
import tomllib
from importlib import resources

import cvxpy as cp
import numpy as np
import pytest
import qpsolvers
import scipy.sparse as sp

from contactopt import all_solutions, fclib, natural_map_residual, solve
from contactopt.benchmark import read_experiment, testset
from contactopt.benchmark.families import FAMILIES
from contactopt.benchmark.sequences import Sequence, certificate, states_of
from contactopt.benchmark.testset.programs import PROGRAMS, convex_program, write_cbf, write_npz
from contactopt.benchmark.testset.tags import invariants
from contactopt.cli import main
from contactopt.errors import InputError
from contactopt.problem import infeasibility

SETS = {number: testset.problems(testset=number) for number in testset.SETS}
ALL = [one for found in SETS.values() for one in found]
SMALL = [one for one in ALL if one.tier == "small" and one.reference]
UNSOLVABLE = [one for one in SMALL if not one.tags["feasible"]]
SAMPLE = SMALL[:: max(1, len(SMALL) // 20)]


def name(one):
    return one.name


def test_the_command_line_knows_all_tiers_programs_and_tags():
    text = resources.files("contactopt.cli").joinpath("command_line.toml").read_text()
    command = tomllib.loads(text)["commands"]["problems"]
    assert command["arguments"]["--tier"]["choices"] == list(testset.TIERS)
    assert command["arguments"]["--program"]["choices"] == list(PROGRAMS)
    assert all(re.search(rf"\b{tag}\b", command["epilog"]) for tag in testset.TAGS)


def test_the_set_is_large_and_has_all_tiers_and_kinds():
    assert len({one.name for one in ALL}) == len(ALL)  # no problem is in both
    for number, found in SETS.items():
        assert len(found) >= 200
        assert {one.tier for one in found} == set(testset.TIERS)
        tags = ("dim=2", "dim=3", "symmetric=false", "feasible=false", "solutions>1")
        for condition in (*tags, "form=dense", "form=sparse", "form=products"):
            assert testset.problems("small", [condition], number), condition


def test_most_of_set_2_has_no_plates_and_its_sequences_are_long():
    alone = testset.problems("small", ["states=1", "feasible=true"])
    assert sum(one.tags["motions"] == 0 for one in alone) >= 0.5 * len(alone)
    sequences = [one for one in testset.problems("small") if one.tags["states"] > 1]
    assert len(sequences) == 60 and all(20 <= one.tags["states"] <= 100 for one in sequences)
    names = {one.name for one in sequences}
    assert {name.replace("warm=False", "warm=True") for name in names} == {
        name for name in names if "warm=True" in name
    }


def zeros_solve(one):
    states = states_of(one.load())
    return min(certificate(p, 0 * p.q, np.zeros(len(p.s))) for p in states) < 1e-2


def test_zero_forces_solve_no_problem_of_a_sample_of_set_2():
    assert not [one.name for one in testset.problems("small")[::25] if zeros_solve(one)]


@pytest.mark.slow
def test_zero_forces_solve_no_small_problem_of_set_2():
    assert not [one.name for one in testset.problems("small") if zeros_solve(one)]


def answers_along(sequence):
    made, last = [], None
    for state in sequence.states:
        last = solve(state, tol=1e-11, start=last if sequence.warm else None)
        made.append(last.reactions)
    return made


def test_slip_along_a_load_path_adds_up_to_the_motion_of_its_end():
    given = {"of": "punch-3d", "elements": 3, "mu": 0.4}
    path = FAMILIES["load_path"](steps=20, **given)
    found = answers_along(path)
    none = np.zeros(0)
    slip = sum(p.displacements(r, none)[:, 1:] for p, r in zip(path.states, found))
    end = FAMILIES["held"](**given)  # the plate is back where it only presses
    np.testing.assert_allclose(slip, end.displacements(found[-1], none)[:, 1:], atol=1e-9)
    alone = solve(end, tol=1e-11).reactions
    assert np.linalg.norm(found[-1] - alone) > 0.05 * np.linalg.norm(alone)  # it has a history


def test_a_packing_that_settles_moves_on_from_its_last_velocities():
    given = {"dim": 2, "bodies": 9, "mu": 0.3}
    sequence = FAMILIES["settling"](steps=6, warm=True, **given)
    first = FAMILIES["packing"](**given)
    np.testing.assert_allclose(sequence.states[0].q, first.q)
    states, found = sequence.states, answers_along(sequence)
    none = np.zeros(0)
    u = [p.displacements(r, none) for p, r in zip(states, found)]
    weight = [after.q[:, 1] - moved[:, 1] for after, moved in zip(states[1:], u)]
    np.testing.assert_allclose(weight, np.tile(weight[0], (5, 1)), atol=1e-9)
    assert min(moved[:, 0].min() for moved in u) > -1e-9  # nothing overlaps


def test_a_sequence_is_judged_by_its_worst_state():
    sequence = FAMILIES["growing_friction"](of="packing", bodies=9, steps=5)
    assert isinstance(sequence, Sequence) and sequence.q.shape == (5 * sequence.contacts, 2)
    assert [p.mu[0] for p in sequence.states] == pytest.approx([0.16, 0.32, 0.48, 0.64, 0.8])
    found = answers_along(sequence)
    assert certificate(sequence, np.concatenate(found), None) < 1e-10
    found[3] = 1.1 * found[3]
    worst = natural_map_residual(sequence.states[3], found[3])
    assert certificate(sequence, np.concatenate(found), None) == worst > 1e-3
    with pytest.raises(InputError, match="fit"):
        certificate(sequence, found[0], None)


def test_every_small_problem_has_a_reference():
    assert len(SMALL) == sum(one.tier == "small" for one in ALL)
    confirmed = [
        one
        for one in SMALL
        if "distance of forces" in one.reference
        and max(one.reference["certificates"].values()) <= 1e-12
    ]
    assert len(confirmed) >= 0.9 * (len(SMALL) - len(UNSOLVABLE))
    for one in (*confirmed, *UNSOLVABLE):
        solved = "infeasible" if not one.tags["feasible"] else "solved"
        assert one.reference["auto"] == solved, one.name


def test_two_answers_agree_where_the_solution_is_proved_unique():
    unique = [
        one
        for one in SMALL
        if (one.tags["unique_below"] or 0) > one.tags["mu"]
        and "distance of forces" in one.reference
        and one.tags["condition"] < 1e6
    ]
    assert len(unique) >= 30
    for one in unique:
        assert one.reference["distance of forces"] < 1e-7, one.name


@pytest.mark.parametrize("one", SAMPLE, ids=name)
def test_a_problem_made_anew_is_the_stored_one(one):
    problem, stored = one.load(), one.reference["invariants"]
    for key, value in invariants(problem).items():
        assert value == pytest.approx(stored[key], rel=1e-6, abs=1e-9), key
    assert (problem.dim, problem.contacts) == (one.tags["dim"], one.tags["contacts"])
    assert len(states_of(problem)) == one.tags.get("states", 1)
    unique = (one.tags["unique_below"] or 0) > one.tags["mu"]
    if unique and "forces" in one.reference and one.tags["states"] == 1:
        found = solve(problem, tol=1e-10)
        assert np.linalg.norm(found.reactions) == pytest.approx(one.reference["forces"], rel=1e-6)


@pytest.mark.parametrize("one", UNSOLVABLE, ids=name)
def test_a_ray_proves_that_there_is_no_solution(one):
    problem = one.load().explicit()
    proof = infeasibility(problem)
    e = np.zeros(problem.q.shape)
    e[:, 0] = proof.weights
    assert np.all(proof.weights >= 0)
    g = (problem.Q.T @ e.ravel() + problem.V @ proof.motions).reshape(e.shape)
    size = np.abs(problem.Q).max() * np.abs(e).max() + np.abs(problem.V @ proof.motions).max(
        initial=0
    )
    assert np.all(g[:, 0] + problem.mu * np.linalg.norm(g[:, 1:], axis=1) <= 1e-9 * size)
    assert np.abs(problem.V.T @ e.ravel()).max(initial=0) <= 1e-9 * np.abs(e).max()
    assert problem.q.ravel() @ e.ravel() + problem.s @ proof.motions < -1e-9 * proof.margin


@pytest.mark.parametrize(
    "one", [one for one in SMALL if (one.tags["solutions"] or 0) > 1], ids=name
)
def test_all_solutions_are_different_and_certified(one):
    problem = one.load()
    found = all_solutions(problem)
    assert len(found) == one.tags["solutions"]
    forces = np.array([s.reactions.ravel() for s in found])
    assert all(natural_map_residual(problem, s.reactions, s.multipliers) < 1e-8 for s in found)
    distance = np.linalg.norm(forces[:, None] - forces, axis=2) + np.eye(len(found))
    assert distance.min() > 1e-4


@pytest.mark.parametrize("shape, weight", [("stack", 4), ("wall", 32), ("arch", 0), ("chain", 0)])
def test_rigid_blocks_rest_and_carry_their_weight(shape, weight):
    problem = FAMILIES["rigid_blocks"](shape=shape, size=4, mu=0.9)
    found = solve(problem, tol=1e-10)
    u = problem.displacements(found.reactions, found.multipliers)
    assert np.abs(u).max() < 1e-8  # nothing moves
    floor = problem.coordinates[1] == 0
    if weight:
        assert found.reactions[floor, 0].sum() == pytest.approx(weight, rel=1e-7)


def test_redundant_points_do_not_change_the_motion():
    few, many = (FAMILIES["rigid_blocks"](size=5, points=n, tilt=0.4) for n in (2, 5))
    moved = []
    for problem in (few, many):
        found = solve(problem, tol=1e-11)
        u = problem.displacements(found.reactions, found.multipliers)
        moved.append(u.reshape(5, -1, 2)[:, [0, -1]])
    assert np.abs(moved[0]).max() > 1e-3
    np.testing.assert_allclose(*moved, atol=1e-6)


def test_coriolis_forces_do_no_work():
    still, turning = (FAMILIES["packing"](dim=2, bodies=9, spin=spin) for spin in (0.0, 0.3))
    assert still.symmetric and not turning.symmetric
    W = turning.explicit().Q
    assert np.linalg.eigvalsh(W + W.T).min() > -1e-12


def read_cbf(path):
    """A small reader of CBF, version 1, as a cvxpy problem and its variable."""
    words = iter(path.read_text().split())
    blocks, sizes = {}, {}
    for word in words:
        if word in ("VAR", "CON"):
            sizes[word], cones = int(next(words)), int(next(words))
            blocks[word] = [(next(words), int(next(words))) for _ in range(cones)]
        elif word in ("OBJACOORD", "ACOORD", "BCOORD"):
            width = 2 if word == "ACOORD" else 1
            blocks[word] = [
                (*(int(next(words)) for _ in range(width)), float(next(words)))
                for _ in range(int(next(words)))
            ]
    assert blocks["VAR"] == [("F", sizes["VAR"])]
    x = cp.Variable(sizes["VAR"])
    c, b = np.zeros(sizes["VAR"]), np.zeros(sizes["CON"])
    for j, value in blocks["OBJACOORD"]:
        c[j] = value
    for i, value in blocks["BCOORD"]:
        b[i] = value
    i, j, value = zip(*blocks["ACOORD"])
    y = sp.csr_array((value, (i, j)), shape=(sizes["CON"], sizes["VAR"])) @ x + b
    constraints, at = [], 0
    for cone, size in blocks["CON"]:
        part, at = y[at : at + size], at + size
        if cone == "QR":  # 2 y_0 y_1 >= |y_2...|^2
            long = cp.hstack([part[0] - part[1], np.sqrt(2) * part[2:]])
            constraints.append(cp.SOC(part[0] + part[1], long))
        else:
            made = {"L=": lambda y: y == 0, "L+": lambda y: y >= 0}
            made["Q"] = lambda y: cp.SOC(y[0], y[1:])
            constraints.append(made[cone](part))
    assert at == sizes["CON"]
    return cp.Problem(cp.Minimize(c @ x), constraints), x


@pytest.mark.parametrize(
    "make, given",
    [
        ("half_plane", {"contacts": 12, "coupling": 0.2}),
        ("rigid_bodies", {"bodies": 8, "contacts": 6, "seed": 1}),
        ("packing", {"dim": 3, "bodies": 12}),
        ("meshed_blocks", {"blocks": 3, "elements": 5}),
    ],
)
def test_other_solvers_find_our_forces_in_the_files_of_subproblems(make, given, tmp_path):
    problem = FAMILIES[make](**given)
    found = solve(problem, tol=1e-11).reactions
    parts = {"normal": found[:, 0], "tangential": found[:, 1:].ravel(), "tresca": found.ravel()}
    for kind in PROGRAMS:
        program = convex_program(problem, kind, found)
        write_cbf(program, tmp_path / "a.cbf")
        written, x = read_cbf(tmp_path / "a.cbf")
        least = written.solve(solver="CLARABEL", tol_gap_rel=1e-10, tol_gap_abs=1e-10)
        size = abs(least) + 1e-3
        assert least == pytest.approx(program.value(x.value[:-1]), abs=1e-5 * size)
        if kind in parts:  # the forces that solve Coulomb's problem are as good as any
            assert program.value(parts[kind]) == pytest.approx(least, abs=1e-6 * size)
        if problem.dim == 2 or kind == "normal":
            write_npz(program, tmp_path / "a.npz")
            again = qpsolvers.Problem.load(str(tmp_path / "a.npz"))
            answer = qpsolvers.solve_problem(again, solver="proxqp", eps_abs=1e-10)
            assert program.value(answer.x) == pytest.approx(least, abs=1e-6 * size)
        else:
            with pytest.raises(InputError, match="cbf"):
                write_npz(program, tmp_path / "a.npz")


def test_a_relaxation_is_not_coulombs_problem_where_bodies_slip(tmp_path):
    problem = FAMILIES["half_plane"](contacts=12, coupling=0.4, mu=0.1)
    found = solve(problem, tol=1e-11)
    assert (np.abs(problem.displacements(found.reactions, found.multipliers)[:, 1]) > 1e-4).any()
    program = convex_program(problem, "associated", found.reactions)
    write_cbf(program, tmp_path / "a.cbf")
    least = read_cbf(tmp_path / "a.cbf")[0].solve(solver="CLARABEL")
    assert least < program.value(found.reactions.ravel()) - 1e-6


def test_programs_refuse_what_has_none():
    with pytest.raises(InputError, match="unsymmetric"):
        turning = FAMILIES["packing"](dim=2, bodies=9, spin=0.3)
        convex_program(turning, "normal", np.zeros(turning.q.shape))


def test_the_command_lists_shows_and_writes(tmp_path, capsys):
    pytest.importorskip("h5py")
    assert main(["problems", "list", "--tier", "small", "--tag", "dim=3"]) == 0
    assert "problems: " in capsys.readouterr().out
    assert main(["problems", "show", "squeezed(size=4, mu=0.5)"]) == 0
    assert "proof that there is no solution" in capsys.readouterr().out
    assert main(["problems", "show", "springs(nodes=1, mu=1*", "--testset", "1"]) == 0
    assert capsys.readouterr().out.count("solution ") == 3
    assert main(["problems", "write", "springs(nodes=2*", "--out", str(tmp_path)]) == 0
    assert len(list(tmp_path.glob("*.hdf5"))) == 2
    assert fclib.read(next(tmp_path.glob("*.hdf5"))).contacts == 2
    options = ["--as", "cbf", "--program", "normal", "--out", str(tmp_path)]
    assert main(["problems", "write", "springs(nodes=2*", *options]) == 0
    assert len(list(tmp_path.glob("*_normal.cbf"))) == 2
    steps = "growing_friction(of=packing, dim=2*seed=7*cold*"
    assert main(["problems", "write", steps.replace("cold", "False"), "--out", str(tmp_path)]) == 0
    assert len(list(tmp_path.glob("growing*.hdf5"))) == 20
    capsys.readouterr()
    for wrong in (
        ["list", "nothing"],
        ["show"],
        ["list", "--tag", "size=3"],
        ["list", "--tag", "?"],
    ):
        assert main(["problems", *wrong]) == 2
        assert capsys.readouterr().err.count("\n") == 1


def text_of(problem):
    """A problem in the dense text format of Siconos."""
    sizes = [problem.dim, problem.contacts, 0] + [problem.q.size] * 4
    values = [np.asarray(problem.explicit().Q).T.ravel(), problem.q.ravel(), problem.mu]
    return "\n".join([*map(str, sizes), *(repr(float(x)) for x in np.concatenate(values))])


def test_a_folder_of_files_joins_by_one_line(tmp_path):
    folder = tmp_path / "theirs"
    folder.mkdir()
    problem = FAMILIES["springs"](nodes=2)
    for i in range(3):
        (folder / f"block-{i}.dat").write_text(text_of(problem))
    assert [one.name for one in testset.problems(testset=str(folder))] == [
        "block-0",
        "block-1",
        "block-2",
    ]
    file = tmp_path / "mine.toml"
    file.write_text('[[problems]]\nfclib = "theirs/*.dat"\ntier = "medium"\n')
    found = testset.problems("medium", ["dim=2"], testset=str(file))
    assert len(found) == 3 and found[0].reference is None
    np.testing.assert_allclose(found[0].load().explicit().Q, problem.Q)
    # and an experiment takes both
    experiment = tmp_path / "experiment.toml"
    experiment.write_text(
        'name = "x"\n[[problems]]\ntestset = "mine.toml"\n[[problems]]\ntestset = "1"\n'
        'tier = "small"\ntags = "dim=2, solutions>1"\n[[methods]]\nmethod = "auto"\n'
    )
    names = [spec.label for spec in read_experiment(experiment).problems]
    assert "block-1" in names
    assert "springs(nodes=1, mu=1, joined=0.05)" in names
    file.write_text('[[problems]]\nfamily = "springs"\ntier = "tiny"\n')
    testset.problem_set.read_set.cache_clear()
    with pytest.raises(InputError, match="tier"):
        testset.problems(testset=str(file))


def test_the_stored_file_is_small_and_names_problems_of_the_set():
    for number, found in SETS.items():
        file = testset.problem_set.HERE / f"set_{number}.json"
        assert file.stat().st_size < 300_000
        assert set(json.loads(file.read_text())) <= {one.name for one in found}
