import numpy as np
import pytest
from conftest import one_contact

from contactopt import BackendError, InputError, natural_map_residual, solve
from contactopt.methods.backends import CONIC, QP, Backend, find
from contactopt.methods.backends.conic import Conic

# those that come with the package; the others have an extra, and are tested where they are there
REQUIRED_QP = ("clarabel", "osqp", "proxqp")
REQUIRED_CONIC = ("clarabel",)


@pytest.mark.parametrize("name", sorted(QP))
def test_every_qp_backend_gives_the_same_certified_answer(name, punch):
    if not QP[name].installed:
        assert name not in REQUIRED_QP, f"{name} is missing, which the package requires"
        pytest.skip(f"{name} is not installed")
    best = solve(punch, tol=1e-12, max_iterations=100)
    solution = solve(punch, method="alternating", normal=name, tangential=name, tol=1e-9)
    assert solution.solved
    assert solution.multipliers[0] == pytest.approx(best.multipliers[0], rel=1e-6)
    assert solution.reactions[:, 0].max() == pytest.approx(best.reactions[:, 0].max(), rel=1e-6)


@pytest.mark.parametrize("name", sorted(CONIC))
def test_every_conic_backend_gives_the_same_certified_answer(name, cube):
    if not CONIC[name].installed:
        assert name not in REQUIRED_CONIC, f"{name} is missing, which the package requires"
        pytest.skip(f"{name} is not installed")
    best = solve(cube, tol=1e-11)
    solution = solve(cube, method="alternating", tangential=name, tol=1e-9)
    assert solution.solved
    assert np.allclose(solution.reactions, best.reactions, atol=1e-6 * np.abs(best.reactions).max())


def test_unknown_and_missing_backends_say_what_to_do(monkeypatch):
    with pytest.raises(InputError, match="unknown qp backend 'simplex'; choose from clarabel"):
        find("simplex", QP)
    with pytest.raises(InputError, match="pip install nowhere-solver"):
        find("nowhere", {"nowhere": Backend("nowhere", "qp", "nowhere_solver", "nowhere-solver")})
    with pytest.raises(InputError, match="unknown qp backend"):
        solve(one_contact((0.8, 1.0), 0.1), method="alternating", normal="simplex")


def fake(monkeypatch, answer):
    """Make proxqp answer with `answer(problem)`."""
    import qpsolvers

    class Answer:
        y, found = None, True

        def __init__(self, x):
            self.x = x

    monkeypatch.setattr(
        qpsolvers, "solve_problem", lambda problem, *_, **__: Answer(answer(problem))
    )


@pytest.mark.parametrize(
    "answer,words",
    [
        (lambda p: np.full(len(p.q), np.nan), "proxqp.*no answer"),
        (lambda p: None, "proxqp.*no answer"),
        (lambda p: 1 / 0, "proxqp.*failed: division by zero"),
    ],
)
def test_a_backend_that_fails_is_a_status_that_names_it(monkeypatch, punch, answer, words):
    fake(monkeypatch, answer)
    solution = solve(punch, method="alternating")
    assert solution.status.label == "backend_failed" and not solution.solved
    assert __import__("re").search(words, solution.message)
    assert solution.reactions.shape == punch.q.shape and np.all(np.isfinite(solution.reactions))


def test_a_backend_that_lies_is_asked_again_and_then_reported(monkeypatch, punch):
    """What comes back is checked against the problem: here a vector that no crossover can save."""
    asked = []
    fake(monkeypatch, lambda p: asked.append(p) or np.full(len(p.q), 5.0))
    monkeypatch.setattr("contactopt.methods.kernels.semismooth.STEPS", 1)
    solution = solve(punch, "alternating", max_iterations=3)
    assert solution.status.label == "backend_failed" and "proxqp" in solution.message
    assert "twice" in solution.message
    assert len(asked) == 2
    assert (
        solution.residual
        == natural_map_residual(punch, solution.reactions, solution.multipliers)
        > 1e-3
    )


def numbers(setting):
    """A setting, or those of a table of settings in their order."""
    return list(setting.values()) if isinstance(setting, dict) else [setting]


def test_tighter_settings_are_tighter():
    for table in (QP, CONIC):
        for backend in table.values():
            loose, tight = backend.settings, backend.tightened().settings
            assert all(
                np.all(np.ravel(numbers(tight[key])) <= numbers(loose[key])) for key in loose
            )
            assert tight != loose or backend.name == "quadprog"


def test_indefinite_tangential_compliance_is_refused():
    with pytest.raises(BackendError, match="not positive semidefinite"):
        Conic.using("clarabel", None, np.diag([1.0, -1.0]))
