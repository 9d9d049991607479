"""The rooms of the museum: what a page answers in the browser is what contactopt answers."""

import itertools
import json
import re
from pathlib import Path

import numpy as np
import pytest
from browser import CHROMIUM, Browser

import contactopt
from contactopt import InterfaceProblem, Status, all_solutions, analytic, models, solve
from contactopt.methods.cone import cone_program
from contactopt.methods.preconditioners.circulant import seminorm
from contactopt.methods.tresca_iteration import TrescaProblem

EXPERIMENTS = Path(__file__).parents[1] / "experiments"
SITE = EXPERIMENTS / "site"
ROOMS = sorted(path.stem for path in (SITE / "museum").glob("*.md"))
POSITIONS, SAME = 100, 1e-9
browser_needed = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium to open the pages with")
# pages whose sections with such a statement name the room that shows it
STATING = ("site/mathematics.md", "tutorials/no_one_or_three_solutions.py")
STATEMENT = re.compile(r"\bunique|(?:one|no|several|two|three) solutions?\b|converg")


@pytest.fixture
def museum(monkeypatch):
    monkeypatch.syspath_prepend(str(SITE))
    import museum

    return museum


@pytest.fixture
def answered(museum, tmp_path):
    """What a room answers at random positions of its sliders: pairs of position and answers."""

    def ask(name):
        museum.write(tmp_path)
        rng = np.random.default_rng(7)
        with Browser(tmp_path / f"{name}.html", 400, 800) as page:
            page.wait("window.sliders")
            sliders = page.ask("window.sliders")
            positions = [
                {
                    key: float(low + step * rng.integers(round((high - low) / step) + 1))
                    for key, (_, low, high, step, _) in sliders.items()
                }
                for _ in range(POSITIONS)
            ]
            answers = page.ask(f"{json.dumps(positions)}.map(window.answers)")
            assert not page.faults
        assert len(answers) == POSITIONS
        return list(zip(positions, answers, strict=True))

    return ask


def same(a, b, least=1.0):
    """Equal to 1e-9 of the largest of b, or of `least`."""
    a, b = np.asarray(a, dtype=float), np.asarray(b, dtype=float)
    size = max(least, np.abs(b).max(initial=0.0))
    return a.shape == b.shape and bool(np.all(np.abs(a - b) <= SAME * size))


def ordered(forces):
    """Solutions (number, components), those with a small first normal force first."""
    forces = np.array(forces) + 0.0
    return forces[np.lexsort(np.round(forces, 8).T[::-1])]


def same_solutions(forces, problem):
    found = [one.reactions.ravel() for one in all_solutions(problem)]
    return same(ordered(forces), ordered(found))


def coupled(p, tangential=1.0):
    return np.array([[1.0, p["coupling"]], [p["coupling"], tangential]])


def string(k):
    """Compliance of a stretched string at k inner nodes, and their places."""
    x = np.arange(1, k + 1) / (k + 1)
    return np.minimum.outer(x, x) * (1 - np.maximum.outer(x, x)), x


@browser_needed
def test_one_node(answered):
    counts = set()
    for p, a in answered("one_node"):
        problem = InterfaceProblem(coupled(p), [[p["q_n"], p["q_t"]]], p["mu"])
        assert same_solutions(a["forces"], problem), p
        threshold = contactopt.diagnose(problem).guaranteed.unique
        assert same(a["threshold"], threshold)
        assert len(a["forces"]) == 1 or p["mu"] >= threshold
        counts.add(len(a["forces"]))
    assert counts == {1, 3}


def two_nodes(p):
    Q = np.eye(4) + 0.3 * (np.eye(4, k=2) + np.eye(4, k=-2))
    Q[[0, 1, 2, 3], [1, 0, 3, 2]] = p["own"]
    Q[[0, 3], [3, 0]], Q[[1, 2], [2, 1]] = p["cross"], -p["cross"]
    return InterfaceProblem(Q, [[p["q_n"], p["q_t1"]], [p["q_n"], p["q_t2"]]], p["mu"])


def fold(Q):
    """The smallest mu at which the determinant of a combination of states is zero; each is a
    polynomial of degree two.
    """
    least, points = np.inf, (0.0, 0.5, 1.0)
    for states in itertools.product(("open", "stick", 1, -1), repeat=2):
        values = []
        for mu in points:
            columns, rows = [], []
            for i, state in enumerate(states):
                if state == "stick":
                    columns += [Q[:, 2 * i], Q[:, 2 * i + 1]]
                    rows += [2 * i, 2 * i + 1]
                elif state != "open":
                    columns.append(Q[:, 2 * i] - state * mu * Q[:, 2 * i + 1])
                    rows.append(2 * i)
            values.append(np.linalg.det(np.column_stack(columns)[rows]) if rows else 1.0)
        for root in np.roots(np.polyfit(points, values, 2)):
            if abs(root.imag) <= 1e-6 * abs(root) and 0 < root.real < 1e6:
                least = min(least, root.real)
    return least


@browser_needed
def test_two_nodes(answered):
    counts = set()
    for p, a in answered("two_nodes"):
        problem = two_nodes(p)
        assert same_solutions(a["forces"], problem), p
        known = contactopt.diagnose(problem)
        assert np.isclose(a["threshold"], fold(problem.Q), rtol=1e-6), p
        assert known.guaranteed.unique <= a["threshold"] * (1 + 1e-9)
        assert a["threshold"] <= known.uniform_slip.unique * (1 + 1e-9)
        assert len(a["forces"]) == 1 or p["mu"] >= a["threshold"]
        counts.add(len(a["forces"]))
    assert {1, 3} <= counts and all(count % 2 for count in counts)


@browser_needed
def test_dragged_plate(answered):
    missing = 0
    for p, a in answered("dragged_plate"):
        plate = [[0.0], [1.0]], [p["s"]]
        problem = InterfaceProblem(coupled(p), [[p["q_n"], 0.0]], p["mu"], *plate)
        forces = np.array([max(p["coupling"] * p["s"] - p["q_n"], 0.0), -p["s"]])
        if p["mu"] * forces[0] >= abs(p["s"]):
            assert same(a["forces"], forces), p
            assert same(solve(problem).reactions[0], forces), p
        else:
            missing += 1
            answer = solve(problem, "newton", max_iterations=50)
            assert a["forces"] is None and not answer.solved, p
    assert 10 < missing < 90


@browser_needed
def test_cobweb(answered):
    for p, a in answered("cobweb"):
        problem = InterfaceProblem(coupled(p, p["q_tt"]), [[p["q_n"], p["q_t"]]], p["mu"])
        assert same_solutions(a["forces"], problem)
        r, _ = TrescaProblem("proxqp", problem).solve(np.array([p["start"]]), np.zeros((1, 2)))
        assert same(a["nextBound"], p["mu"] * r[0, 0]), p
        program = cone_program(problem, "clarabel", "clarabel")

        def slip(sigma, p=p, program=program, problem=problem):
            r, lam = program(np.array([p["mu"] * sigma]))
            return abs(problem.displacements(r, lam)[0, 1])

        assert same(a["nextSlip"], slip(p["start"])), p
        if a["slips"]:  # the slopes are those of the program
            speeds = [
                a["slips"] * problem.displacements(s.reactions, s.multipliers)[0, 1]
                for s in all_solutions(problem)
                if s.reactions[0, 0] > 1e-9
            ]
            speed = max(speeds)
            slope = (slip(1.00001 * speed) - slip(0.99999 * speed)) / (2e-5 * speed)
            assert np.isclose(slope, a["slopeCone"], rtol=1e-3, atol=1e-3), p
            assert same(a["slopeTresca"], a["slips"] * p["mu"] * p["coupling"])
            assert (a["slopeTresca"] < 1) == (a["slopeCone"] < 1)


def test_acary_and_cadoux_cycle_although_the_solution_is_unique():
    problem = InterfaceProblem([[1, 0.75], [0.75, 0.6]], [[-0.25, 0.85]], 1.0)
    assert len(all_solutions(problem)) == 1
    assert solve(problem, "acary_cadoux").status is Status.CYCLING


def blackboard(problem, g, r, v):
    """Costs of forces and of displacements, as contactopt.models writes them."""
    dual, primal = (models.tresca(problem, form=form) for form in ("dual", "primal"))
    for program in (dual, primal):
        program.parameters["g"].value = np.full(problem.contacts, g)
    dual.variables["r"].value = np.reshape(r, dual.variables["r"].shape)
    values = {"u": np.array(v), "z": np.array(v) - problem.q.ravel(), "lambda": np.zeros(0)}
    for variable in (*primal.problem.variables(), *dual.problem.variables()):
        if variable.value is None:
            variable.value = values[variable.name()]
    return float(dual.problem.objective.value), float(primal.problem.objective.value)


@browser_needed
def test_dual_gap(answered):
    G, x = string(4)
    for number, (p, a) in enumerate(answered("dual_gap")):
        q = np.column_stack([0.02 - p["press"] * x * (1 - x), p["push"] * x])
        problem = InterfaceProblem(np.kron(G, coupled(p)), q, 1.0)
        r, v = np.reshape(a["r"], (4, 2)), np.reshape(a["v"], (4, 2))
        assert r[:, 0].min() >= 0 <= v[:, 0].min() and abs(r[:, 1]).max() <= p["g"]
        exact, _ = TrescaProblem("proxqp", problem).solve(np.full(4, p["g"]), r)
        costs = [f.ravel() @ (problem.Q @ f.ravel() / 2 + q.ravel()) for f in (r, exact)]
        assert same(a["dual"], -costs[0]), p
        assert a["dual"] - SAME <= -costs[1] <= a["primal"] + SAME
        assert same(a["gap"], a["primal"] - a["dual"])
        if number < 20:
            dual, primal = blackboard(problem, p["g"], a["r"], a["v"])
            assert same(-a["dual"], dual) and same(a["primal"], primal)


def frictionless(Q, q):
    k = len(q)
    whole = np.kron(Q, np.diag([1.0, 0.0])) + np.kron(np.eye(k), np.diag([0.0, 1.0]))
    problem = InterfaceProblem(whole, np.column_stack([q, 0 * q]), 0.0)
    return solve(problem, tol=1e-12).reactions[:, 0]


@browser_needed
def test_penalty(answered):
    Q, x = string(6)
    least = np.linalg.eigvalsh(Q)[0]
    for p, a in answered("penalty"):
        q, kappa = p["gap"] - p["press"] * x * (1 - x), 10 ** p["log"]
        soft = Q + np.eye(6) / kappa
        exact, r = frictionless(Q, q), np.zeros(6)
        assert same(a["exact"], exact) and same(a["penalty"], frictionless(soft, q)), p
        for _ in range(int(p["corrections"]) + 1):
            error = np.linalg.norm(r - exact)
            r = frictionless(soft, q - r / kappa)
            assert np.linalg.norm(r - exact) <= error / (1 + kappa * least) + 1e-9
        assert same(a["multiplier"], r), p
        assert same(a["overlapPenalty"], max(a["penalty"]) / kappa)
        assert a["overlapPenalty"] > 0 or not np.any(exact)


@browser_needed
def test_stick_zone(answered):
    slid = 0
    for p, a in answered("stick_zone"):
        arguments = p["P"], p["R"], p["E"], p["mu"], p["T"]
        if a["slides"]:
            slid += 1
            with pytest.raises(contactopt.InputError, match="slide"):
                analytic.hertz_line_tangential(*arguments)
            continue
        exact = analytic.hertz_line_tangential(*arguments)
        places = np.array(a["x"])
        assert same(a["a"], exact.half_width, 0) and same(a["c"], exact.stick_half_width)
        assert same(a["peak"], exact.peak, 0) and same(a["pressure"], exact.pressure(places))
        assert same(a["shear"], exact.shear(places)), p
    assert 10 < slid < 90


@browser_needed
def test_seminorm(answered):
    for p, a in answered("seminorm"):
        m = int(p["m"])
        column = seminorm(m)
        symbol = np.fft.fft(column).real[: m + 1]
        assert same(a["column"], column) and same(a["symbol"], symbol)
        assert same(a["at"], symbol[a["j"]]) and same(a["rowSum"], column.sum())
        pairs = (np.pi / (2 * m * np.sin(np.pi * np.arange(1, 2 * m) / (2 * m)))) ** 2
        energies = np.fft.fft([pairs.sum(), *-pairs]).real[: m + 1]  # of all pairs of nodes
        assert same(a["full"], energies)
        assert (abs(column.sum()) < 1e-12) == (m & (m - 1) == 0)
        if m & (m - 1) == 0:  # two bounds that do not depend on m
            assert 1.2 < a["low"] <= a["high"] < 5


@browser_needed
def test_non_monotone(answered):
    signs = set()
    for p, a in answered("non_monotone"):
        slips, normal = np.array([p["u_1"], p["u_2"]]), np.array([p["r_1"], p["r_2"]])
        assert same(a["shear"], -np.sign(slips) * p["mu"] * normal)
        assert same(a["product"], -np.diff(a["shear"])[0] * -np.diff(slips)[0])
        if slips[0] * slips[1] > 0:  # along the loop friction opposes the slip of the law
            way = np.linspace(*slips, 1001)
            force = -np.sign(way[0]) * p["mu"] * normal[:, None] * np.ones(1001)
            work = np.trapezoid(force[0], way) + np.trapezoid(force[1], way[::-1])
            assert same(a["loop"], work), p
        signs.add(a["product"] > 1e-12)
    assert signs == {True, False}


def test_the_bounds_of_the_symbol_do_not_grow():
    for m in 2 ** np.arange(1, 15):
        ratio = np.fft.fft(seminorm(m)).real[1 : m + 1] * m / (np.pi * np.arange(1, m + 1))
        assert 1.2 < ratio.min() <= ratio.max() < 5


@browser_needed
def test_certified_and_wrong(answered):
    for p, a in answered("certified_and_wrong"):
        assert same(a["mu"], 1 - 10 ** -p["digits"]) and a["q_n"] == -(1 - a["mu"])
        problem = InterfaceProblem([[1, -1], [-1, 2]], [[a["q_n"], p["q_t"]]], a["mu"])
        forces = np.array([[p["r_n"], a["mu"] * p["r_n"]]])
        residual = contactopt.natural_map_residual(problem, forces)
        assert same(a["certificate"], residual, 0) or same(a["certificate"], residual, 1e-6), p
        assert a["solution"] == 1.0
        if p["digits"] < 5:
            (only,) = all_solutions(problem)
            assert np.isclose(only.reactions[0, 0], 1.0)
            change = contactopt.sensitivity(problem, only).forward(q=[[1.0, 0.0]]).reactions
            assert same(a["derivative"], change[0, 0])


ON_SCREEN = """(() => {
  const box = (id) => document.getElementById(id).getBoundingClientRect();
  const parts = ["verdict", "figures", "sliders", "rows"].map(box);
  return [Math.min(...parts.map((b) => b.top)), Math.max(...parts.map((b) => b.bottom))];
})()"""


@pytest.mark.slow
@browser_needed
@pytest.mark.parametrize("size", [(1280, 720), (400, 800)])
@pytest.mark.parametrize("name", ROOMS)
def test_picture_sliders_and_numbers_share_the_screen(name, size, museum, tmp_path):
    museum.write(tmp_path)
    with Browser(tmp_path / f"{name}.html", *size) as page:
        page.wait("window.sliders")
        for number in range(page.ask("document.querySelectorAll('button').length")):
            page.ask(f"document.querySelectorAll('button')[{number}].click()")
            top, bottom = page.ask(ON_SCREEN)
            assert top >= 0 and bottom <= size[1], (number, top, bottom)
            letters = page.ask("getComputedStyle(document.querySelector('svg text')).fontSize")
            scale = "(s => s.getBoundingClientRect().width / s.viewBox.baseVal.width)"
            shown = page.ask(f"{scale}(document.querySelector('#figures svg'))")
            assert float(letters.removesuffix("px")) * shown >= 11.5


@pytest.mark.slow
@browser_needed
@pytest.mark.parametrize("name", ROOMS)
def test_a_room_can_be_read_and_used(name, museum, tmp_path):
    museum.write(tmp_path)
    file = tmp_path / f"{name}.html"
    assert file.stat().st_size < 200_000
    assert not re.search(r"""(src|href)=["'][^"']*//|@import|fetch\(|console\.""", file.read_text())
    with Browser(file, 400, 800) as page:
        page.wait("window.sliders")
        assert page.ask("document.documentElement.scrollWidth") <= 400
        assert page.ask("[...document.querySelectorAll('input')].every(x => x.labels.length == 1)")
        assert page.ask("[...document.querySelectorAll('svg')].every(x => x.ariaLabel.length > 20)")
        before = page.ask("document.getElementById('sliders').innerText")
        page.ask("document.querySelector('input').focus()")
        for kind in ("keyDown", "keyUp") * 3:
            arrow = {"key": "ArrowRight", "code": "ArrowRight", "windowsVirtualKeyCode": 39}
            page.call("Input.dispatchKeyEvent", type=kind, **arrow)
        assert page.ask("document.getElementById('sliders').innerText") != before
        for number in range(page.ask("document.querySelectorAll('button').length")):
            button = f"document.querySelectorAll('button')[{number}]"
            page.ask(f"{button}.click()")
            assert not re.search("NaN|undefined", page.ask("document.body.innerText"))
            promised = page.ask(f"{button}.textContent")
            verdict = page.ask("document.getElementById('verdict').textContent")
            for word, count in {"No": "No", "Three": "3", "Nine": "9"}.items():
                if promised.startswith(f"{word} solution"):
                    assert verdict.startswith(f"{count} solution"), f"{promised}: {verdict}"
        assert not page.faults


def test_every_room_is_in_the_index(museum):
    assert sorted(museum.ROOMS) == ROOMS
    index = museum.index(SITE)
    for name in ROOMS:
        assert f"## {museum.title(name)}\n" in index and f"museum/{name}.html" in index
        assert f"`tests/{Path(__file__).name}`" in (SITE / "museum" / f"{name}.md").read_text()
        assert f"def test_{name}(" in Path(__file__).read_text()


def test_every_link_to_the_museum_finds_its_room(museum):
    rooms = {museum.anchor(name) for name in ROOMS}
    pages = [*SITE.glob("*.md"), *(EXPERIMENTS / "tutorials").glob("*.py")]
    links = {
        link for page in pages for link in re.findall(r"museum\.md#([\w-]+)", page.read_text())
    }
    assert links == rooms, "a link without a room, or a room to which no page links"


@pytest.mark.parametrize("name", STATING)
def test_statements_about_solutions_name_their_room(name):
    text = re.sub(r"^# ?", "", (EXPERIMENTS / name).read_text(), flags=re.M)
    if name.endswith(".md"):
        text = (EXPERIMENTS / name).read_text()
    for section in re.split(r"^#+ ", text, flags=re.M)[1:]:
        if STATEMENT.search(section) and not section.startswith(("Exercises", "The programs")):
            assert "museum.md#" in section, section.splitlines()[0]
