"""The driver of every method: clock, stopping rule, history, limits, certificate."""

import logging
import time
from collections.abc import Callable, Generator, Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from contactopt.checks import check_number
from contactopt.defaults import TOL
from contactopt.errors import BackendError, InputError
from contactopt.linear.budget import TooDear, finish
from contactopt.linear.deadline import TimeUp, until
from contactopt.linear.operators import Interface, form, has_entries
from contactopt.methods import (
    NoSolution,
    Repeated,
    default_method,
    exchanged,
    find_method,
    solvers_of,
    solves,
)
from contactopt.methods.auto import Auto
from contactopt.methods.method import Iterate, Known, Method, at_rest, dimensionless_start
from contactopt.methods.newton import Newton
from contactopt.methods.notes import collected, note, with_notes
from contactopt.methods.recorder import LEAST_PROOF, Limits, Recorder
from contactopt.methods.small import solve_small
from contactopt.problem import (
    Infeasible,
    InterfaceProblem,
    Solution,
    Status,
    check_problem,
    dimensionless,
    infeasibility,
    isotropic,
    natural_map_residual,
)
from contactopt.problem.feasibility import held_apart
from contactopt.problem.unbalanced_loads import check_equilibrium, resisted

CLOSE = 1e-4  # residual up to which a problem that was not solved has a solution near by
FAR = 0.1  # residual above which a method that works for long may be at one without a solution
NEAR = 1e-5  # residual from which Newton's method takes a step or two more
DOUBT, DEARER = 3, 0.25  # iterates before the proof is first looked for, and more per unknown
log = logging.getLogger(__name__)
EXACT, POLISHED = 1e-13, 8  # certificate of forces that surfaces may exchange, and steps to it
USUAL = Auto()  # which solves every law


def solve(
    problem: InterfaceProblem,
    method: str | Method | None = None,
    tol: float = TOL,
    *,
    max_iterations: int = 500,
    time_limit: float = np.inf,
    change_tol: float | None = None,
    start: Solution | None = None,
    progress: Callable[[int, float], None] | None = None,
    **settings: Any,
) -> Solution:
    """Solve an interface problem; the answer's status is `solved` only if its certificate is at
    most `tol`.

    A problem that has no solution ends `infeasible`, with a proof, where one is found. A backend
    that fails while solving gives a status, too, with the last iterate (of `auto`: the best one).

    Parameters
    ----------
    problem : what to solve
    method : a name (see `contactopt list`) with its `settings`, or a method object; None: `auto`,
        or `alternating` if the settings name a backend
    tol : bound on natural_map_residual(problem, reactions, multipliers) [-]
    max_iterations : of the method
    time_limit : from the call on [s]; what cannot be interrupted, such as one factorisation, is
        waited for
    change_tol : bound of the paper's criterion |r_t - r_t previous| / |r_t| (1e-5 there); None: not
        used. If it is met first, the iteration ends with status `settled` unless the certificate
        agrees
    start : a solution of a problem of the same size, to start from instead of cold
    progress : called with (iteration, residual) after each outer iteration; its attribute `watch`,
        if it has one, with the reactions and multipliers
    settings : of a method that is given by its name

    Returns
    -------
    Solution : reactions (k, dim) [force], multipliers (p,) [length], status, certificate and
        history

    Raises
    ------
    InputError : on arguments that make no sense, an unknown or missing backend, a method that does
        not solve the problem's law, or a load that pulls the bodies apart
    """
    check_problem(problem)
    check_number("tol", tol, low=0.0)
    check_number("max_iterations", max_iterations, low=0.0)
    if change_tol is not None:
        check_number("change_tol", change_tol, low=0.0)
    if not isinstance(time_limit, (int, float, np.number)) or not time_limit >= 0:
        raise InputError(f"time_limit must be a number of seconds, at least 0; got {time_limit!r}.")
    chosen = _method_for(problem, method, settings)
    # what a few milliseconds may need, and a small problem needs no more than one call
    small = progress is None and change_tol is None and max_iterations >= 1
    small = small and time_limit >= LEAST_PROOF and chosen == USUAL
    solution, swept = solve_small(problem, tol, start) if small else (None, None)
    if solution is not None and not exchanged.may(problem):
        return solution
    limits = Limits(tol, change_tol, max_iterations, time_limit, progress)
    with collected() as notes:
        if solution is None:
            solution = _run(problem, chosen, limits, start, swept)
        if solution.solved and exchanged.may(problem):
            finer = replace(limits, tol=EXACT, max_iterations=POLISHED, progress=None)
            solution = exchanged.least_friction(problem, _polished(problem, solution, finer), tol)
    return with_notes(problem, solution, notes)


def _method_for(
    problem: InterfaceProblem, method: str | Method | None, settings: Mapping[str, Any]
) -> Method:
    """The method object; InputError if it is none, or does not solve the problem's law."""
    if method is None and not settings:
        return USUAL
    if method is None or isinstance(method, str):
        method = find_method(method or default_method(settings), **settings)
    elif not callable(getattr(method, "iterate", None)):
        raise InputError(
            f"method must be a name or an object with a function `iterate`; got {method!r}."
        )
    elif settings:
        raise InputError(
            f"settings {', '.join(settings)} belong to a method given by name; set them on the"
            " method object."
        )
    if not solves(method, problem.law):
        raise InputError(
            f"the method {method!r} does not solve the law {type(problem.law).__name__}; "
            f"these do: {', '.join(solvers_of(problem.law))}."
        )
    return method


def _polished(problem: InterfaceProblem, solution: Solution, limits: Limits) -> Solution:
    """The solution after a few of Newton's steps: forces that the bodies hardly feel need more
    digits than others.
    """
    dear = form(problem.Q) != "array" or problem.contacts > exchanged.FEW
    if dear or solution.residual <= limits.tol:
        return solution
    finer = _run(problem, Newton(), limits, solution, None)
    if not finer.residual < solution.residual:
        return solution
    values = "reactions", "multipliers", "residual", "displacements"
    return replace(solution, **{name: getattr(finer, name) for name in values})


def _run(
    problem: InterfaceProblem,
    method: Method,
    limits: Limits,
    start: Solution | None,
    swept: np.ndarray | None,
) -> Solution:
    """`swept`: where the first sweeps ended, which need no repetition."""
    begin = time.perf_counter()
    if problem.contacts == 0:
        return _without_contacts(problem, method, limits.tol)
    check_equilibrium(problem)
    if not getattr(method, "unsymmetric", False) and not problem.symmetric:
        raise InputError(
            f"method '{type(method).__name__.lower()}' minimises an energy, which an unsymmetric Q"
            " does not have; use auto or proximal."
        )
    if not getattr(method, "sparse" if form(problem.Q) == "sparse" else "implicit", False):
        problem = problem.explicit()
    held, basis, loose = resisted(problem)
    if loose:
        note(log, loose)
    scaled, scales = dimensionless(isotropic(held))
    scales = replace(scales, stretch=problem.law.stretch(problem.dim), basis=basis)
    if swept is not None:
        scaled.__dict__["swept"] = swept / scales.force
    first = None if start is None else dimensionless_start(start, problem, scales)
    recorder = Recorder(problem, scales, limits, first or at_rest(scaled))
    try:
        ended, message, proof = _follow(method.iterate(scaled, first), scaled, recorder)
    except TooDear as too_dear:
        too_dear.reached = recorder.best[:3]
        raise
    if not recorder.history:
        recorder.certify([])
    if getattr(method, "wanders", False) or recorder.lost:
        recorder.return_to_best()
    status = Status.SOLVED if recorder.residual <= limits.tol else ended or Status.INFEASIBLE
    if proof is None and status is not Status.SOLVED and recorder.residual > CLOSE:
        proof = infeasibility(problem, max(recorder.left(), LEAST_PROOF))
    checks = time.perf_counter() - begin - recorder.clock - recorder.certified
    if proof is not None:
        message, status = proof.sentence, Status.INFEASIBLE
    return Solution(
        recorder.reactions,
        recorder.multipliers,
        status,
        recorder.residual,
        len(recorder.history),
        repr(method),
        tuple(recorder.history),
        {"solve": recorder.clock, "certificate": recorder.certified, "checks": checks},
        message or status.sentence,
        proof=proof,
        displacements=recorder.displacements,
    )


def _follow(
    steps: Iterator[Iterate | Known], scaled: InterfaceProblem, recorder: Recorder
) -> tuple[Status | None, str, Infeasible | None]:
    """Take iterates until they end, or a proof ends them: how, why, and the proof."""
    repeated: Status | None = None
    proof = held_apart(recorder.problem)
    message, doubt = "", DOUBT + DEARER * scaled.q.size
    ended = None if proof is None else Status.INFEASIBLE
    while ended is None:
        begin = time.perf_counter()
        iterate, ended, message, proof = _next(steps, recorder.left(), repeated, recorder.enough)
        recorder.clock += time.perf_counter() - begin
        repeated = None
        if iterate is not None:
            ended = recorder.record(iterate, _counts(scaled.Q))
            if ended in (Status.STALLED, Status.CYCLING) and not recorder.late:
                ended, repeated = None, ended
        if recorder.residual < NEAR:
            finish()
        if ended is None and recorder.residual > FAR and len(recorder.history) > doubt:
            proof, doubt = infeasibility(recorder.problem, recorder.left()), 10 * doubt
            ended = None if proof is None else Status.INFEASIBLE
    return ended, message, proof


def _next(
    steps: Iterator[Iterate | Known], left: float, repeated: Status | None, enough: float
) -> tuple[Iterate | Known | None, Status | None, str, Infeasible | None]:
    """The next iterate, or how and why the iteration ended, with a proof if nothing solves it."""
    try:
        # what overflows is seen below
        with np.errstate(all="ignore"), until(time.perf_counter() + left, enough):
            iterate = next(steps, None) if repeated is None else _turned(steps)
    except NoSolution as found:
        return None, Status.INFEASIBLE, "", found.proof
    except TimeUp:
        return None, Status.TIME_LIMIT, "", None
    except BackendError as error:
        return None, Status.BACKEND_FAILED, str(error), None
    except np.linalg.LinAlgError as error:
        return None, Status.BACKEND_FAILED, f"its linear algebra broke down: {error}", None
    if iterate is None:
        return None, repeated or Status.SETTLED, "", None
    if not (np.isfinite(iterate[0]).all() and np.isfinite(iterate[1]).all()):
        return None, Status.DIVERGED, "", None
    return iterate, None, "", None


def _turned(steps: Iterator[Iterate | Known]) -> Iterate | Known | None:
    """The next iterate of a method told that it repeats itself; None if it ends."""
    try:
        return steps.throw(Repeated()) if isinstance(steps, Generator) else None
    except (Repeated, StopIteration):
        return None


def _counts(Q: Interface) -> dict[str, float]:
    """Products with an operator Q so far and, where a method works on the bodies, V-cycles."""
    if has_entries(Q):
        return {}
    counts: dict[str, float] = {"products": Q.products}
    return counts if Q.coupled is None else counts | {"cycles": Q.coupled.cycles}


def _without_contacts(problem: InterfaceProblem, method: Method, tol: float) -> Solution:
    """Without contacts no force is the solution, unless a plate needs some."""
    r, multipliers = at_rest(problem)
    residual = natural_map_residual(problem, r, multipliers)
    status, message = Status.SOLVED, Status.SOLVED.sentence
    if residual > tol:
        status, message = Status.SETTLED, "no contact could balance the load on the plate"
    return Solution(r, multipliers, status, residual, 0, repr(method), message=message)
