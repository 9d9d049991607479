"""Figures and tables against numbers worked out by hand; reports from tables alone."""

import re
import shutil
from pathlib import Path

import numpy as np
import pytest

import contactopt.methods.driver
from contactopt import InputError, benchmark
from contactopt.benchmark import report_figures as figures
from contactopt.benchmark import reports as made_reports
from contactopt.benchmark import tables
from contactopt.benchmark.experiment import read_layout
from contactopt.benchmark.report_figures import fitted_exponent
from contactopt.benchmark.store import COLUMNS
from contactopt.cli import main
from tests.test_benchmark import SMALL, written

pd = pytest.importorskip("pandas")

CAMPAIGNS = Path(__file__).parents[1] / "experiments" / "campaigns"
REPORTS = Path(__file__).parents[1] / "reports"


def table(**columns) -> pd.DataFrame:
    """Rows with the given columns; the others as in a successful run."""
    size = max(len(v) for v in columns.values())
    usual = {
        "setting": "mid", "tolerance": 1e-6, "start": "cold", "repeat": 0, "success": True,
        "claimed": True, "status": "solved", "residual": 1e-7, "time_limit": 10.0,
        "problem": "p", "method": "m",
    }  # fmt: skip
    return pd.DataFrame({name: [value] * size for name, value in usual.items()} | columns)


def lines(figure) -> dict[str, np.ndarray]:
    return {line.get_label(): line.get_xydata() for ax in figure.axes for line in ax.get_lines()}


def test_a_method_that_fails_once_in_its_repeats_has_failed():
    rows = table(repeat=[0, 1, 2], solve_seconds=[1.0, 1.0, 1.0], success=[True, False, True])
    assert "m (0)" in lines(figures.performance_profile(rows))


def test_exponents_of_growth():
    n = np.array([10.0, 20, 40, 80, 160])
    assert abs(fitted_exponent(n, 3e-6 * n**1.5) - 1.5) < 1e-12
    assert np.isnan(fitted_exponent(n[:2], n[:2]))
    # a constant cost that hides the power at small sizes
    late = np.where(n < 40, 1e-2, 1e-5 * n**2)
    assert abs(fitted_exponent(n, late) - 2) < 1e-12


def test_the_pareto_front_is_drawn_through_what_nothing_beats():
    points = np.array([[1, 5], [2, 3], [3, 4], [3.5, 3.5], [4, 1], [1, 6]])
    rows = table(method=list("abcdef"), solve_seconds=points[:, 0], residual=1e-8 * points[:, 1])
    front = lines(figures.speed_accuracy(rows))["Pareto front"]
    np.testing.assert_allclose(front * [1, 1e8], [[1, 5], [2, 3], [4, 1]])


def test_time_table_counts_failures_at_the_time_limit():
    rows = table(
        method=["a", "a", "b", "b"],
        solve_seconds=[0.001, 0.003, 0.001, 5.0],
        success=[True, True, True, False],
    )
    out = tables.time_table(rows).set_index("method")
    a = np.sqrt(0.002 * 0.004) - 0.001
    b = np.sqrt(0.002 * 10.001) - 0.001
    np.testing.assert_allclose(out.loc["a", "shifted mean"], a)
    np.testing.assert_allclose(out.loc["b", "shifted mean"], b)
    np.testing.assert_allclose(out.loc["b", "over the least"], b / a)
    assert out.loc["b", "solved"] == "1 of 2" and out.loc["b", "median"] == 0.001


def test_success_table_tells_right_claims_from_successes():
    rows = table(
        setting=["mid", "high", "mid", "high"],
        tolerance=[1e-6, 1e-9, 1e-6, 1e-9],
        success=[True, False, True, False],
        claimed=[True, True, True, False],
        status=["solved", "false_claim", "solved", "killed"],
    )
    row = tables.success_table(rows).iloc[0]
    assert row["mid [%]"] == 100 and row["high [%]"] == 0 and row["right claim [%]"] == 75
    assert row["failures"] == "1 false_claim, 1 killed"
    assert list(tables.success_table(rows).columns[2:4]) == ["mid [%]", "high [%]"]


def test_speed_accuracy_marks_what_missed_its_tolerance():
    rows = table(
        setting=["low", "mid", "high"],
        tolerance=[1e-3, 1e-6, 1e-9],
        solve_seconds=[1.0, 2.0, 3.0],
        residual=[1e-4, 1e-7, 1e-8],
        success=[True, True, False],
    )
    drawn = figures.speed_accuracy(rows).axes[0].get_lines()
    filled = next(line for line in drawn if line.get_label() == "m")
    hollow = next(line for line in drawn if line.get_markerfacecolor() == "white")
    np.testing.assert_allclose(filled.get_xydata(), [[1.0, 1e-4], [2.0, 1e-7]])
    np.testing.assert_allclose(hollow.get_xydata(), [[3.0, 1e-8]])


def test_stability_map_and_its_thresholds():
    mu, ratio = np.meshgrid([0.1, 1.0, 10.0], [1.0, 100.0])
    rows = table(**{"problem.mu": mu.ravel(), "problem.stiffness_ratio": ratio.ravel()})
    rows["success"] = rows["problem.mu"] < 5
    rows["guaranteed_mu"], rows["alternating_mu"] = (
        np.where(rows["problem.stiffness_ratio"] == 1, 1.0, 0.1),
        np.inf,
    )
    rows["iterations"] = 7.0
    figure = figures.stability_map(rows)
    np.testing.assert_array_equal(
        figure.axes[0].get_images()[0].get_array(), [[1, 1, 0], [1, 1, 0]]
    )
    (line,) = figure.axes[0].get_lines()
    # mu = 1 in the first row, .1 in the second
    np.testing.assert_allclose(line.get_xydata(), [[1, 0], [0, 1]])
    shown = figures.stability_map(rows, value="iterations").axes[0].get_images()[0].get_array()
    assert np.ma.getmaskarray(np.ma.masked_invalid(shown))[:, 2].all() and shown[0, 0] == 7


def test_rows_are_chosen_by_their_columns():
    rows = table(method=["a", "b"], solve_seconds=[1.0, 2.0])
    assert set(tables.select(rows, method=["b"])["method"]) == {"b"}
    with pytest.raises(InputError, match="no column"):
        tables.select(rows, colour="red")
    with pytest.raises(InputError, match="no row"):
        tables.select(rows, method="c")


EXPERIMENT = (
    SMALL.replace(
        "repeats = 2",
        'repeats = 2\nfindings = "mine.py"\ntitle = "A small one"\ntext = "What it is."',
    )
    + """
[quick]
repeats = 1
[[figures]]
kind = "performance_profile"
caption = "A profile of `all`."
[[figures]]
kind = "speed_accuracy"
caption = "What accuracy costs."
where = {family = "rigid_bodies"}
[[figures]]
kind = "success_table"
caption = "Who won."
"""
)


@pytest.fixture(scope="module")
def reported(tmp_path_factory):
    folder = tmp_path_factory.mktemp("report")
    (folder / "campaigns").mkdir()
    written(
        folder / "campaigns",
        "def findings(table):\n    return [f'{len(table)} runs were made.']\n",
        "mine.py",
    )
    written(folder / "campaigns", EXPERIMENT, "small.toml")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        arguments = ["--experiments", "campaigns", "--jobs", "2"]
        assert main(["report", *arguments]) == 2  # there is no table yet
        assert main(["report", "--run", "quick", *arguments]) == 0
        assert not (folder / "reports").exists()
        assert main(["report", "small", "--run", "full", *arguments]) == 0
    return folder


@pytest.mark.slow
def test_a_report_is_rebuilt_without_solving(reported, monkeypatch):
    monkeypatch.chdir(reported)
    text = Path("reports/small/report.md").read_text()
    for made in (*Path("reports/small").glob("figure-*"), Path("reports/small/report.md")):
        made.unlink()

    def forbidden(*arguments, **settings):
        raise AssertionError("a report must not solve")

    monkeypatch.setattr(contactopt.methods.driver, "solve", forbidden)
    assert main(["report", "--experiments", "campaigns"]) == 0
    again = Path("reports/small/report.md").read_text()
    assert again == text and "1. 12 runs were made." in text and "What it is." in text
    for name in re.findall(r"!\[.*?\]\((.*?)\)", text):
        assert Path("reports/small", name).stat().st_size > 1000
    assert text.count("*Figure ") == 2 and text.count("*Table ") == 1
    assert "contactopt report --run full small" in text
    quick = Path("out/quick/reports/small/report.md").read_text()
    assert "1. 6 runs were made." in quick
    csv = benchmark.load("reports/small/rows.csv")
    assert (
        {"versions", "machine", "backend"}
        <= set(csv)
        <= set(COLUMNS) | {f for f in csv if "." in f}
    )


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('kind = "speed_accuracy"', 'kind = "pie"', "figure 2: unknown kind 'pie'"),
        ('caption = "What accuracy costs."', "", "figure 2: it needs a caption"),
        ('where = {family = "rigid_bodies"}', "colour = 1", "figure 2 (speed_accuracy)"),
        ('findings = "mine.py"', 'findings = "yours.py"', "yours.py"),
    ],
)
@pytest.mark.slow
def test_errors_of_a_report_name_the_figure(reported, monkeypatch, capsys, old, new, words):
    monkeypatch.chdir(reported)
    Path("wrong").mkdir(exist_ok=True)
    shutil.copy("campaigns/mine.py", "wrong")
    written(Path("wrong"), EXPERIMENT.replace(old, new), "small.toml")
    assert main(["report", "--experiments", "wrong"]) == 2
    error = capsys.readouterr().err
    assert words in error and "small.toml" in error


@pytest.mark.slow
@pytest.mark.parametrize("path", sorted(CAMPAIGNS.glob("*.toml")), ids=lambda p: p.stem)
def test_committed_reports_follow_from_their_tables(path, tmp_path, monkeypatch):
    """Every experiment can be read in both versions, and its report says what its table says."""
    monkeypatch.setattr(benchmark.report, "_png", lambda figure: b"")
    for quick in (False, True):
        assert benchmark.read_experiment(path, quick=quick).runs()
    name = read_layout(path).name
    folder = REPORTS / name
    if not (folder / "rows.csv").exists():
        pytest.skip("not run yet")
    (tmp_path / name).mkdir()
    shutil.copy(folder / "rows.csv", tmp_path / name)
    benchmark.report.build([path], tmp_path)

    def kept(report: Path) -> str:
        return "\n".join(
            line for line in report.read_text().splitlines() if not line.startswith("Experiment:")
        )

    assert kept(tmp_path / name / "report.md") == kept(folder / "report.md")
    assert all(file.stat().st_size < 1_000_000 for file in folder.iterdir())


@pytest.mark.slow
def test_a_figure_without_rows_is_left_out_with_a_sentence(reported, monkeypatch):
    monkeypatch.chdir(reported)
    Path("filtered").mkdir()
    shutil.copy("campaigns/mine.py", "filtered")
    other = EXPERIMENT.replace('family = "rigid_bodies"}', 'family = "none"}')
    layout = read_layout(written(Path("filtered"), other, "small.toml"))
    text = made_reports.write_report(layout, Path("filtered"), benchmark.load("reports/small"))
    assert "Number 2 (speed_accuracy) is left out: no row with {'family': 'none'}." in text
    assert text.count("*Figure ") == 1 and text.count("*Table ") == 1


FOUND = [
    pytest.param(path, id=path.stem, marks=[pytest.mark.slow] * (path.stem == "small_tier"))
    for path in sorted(CAMPAIGNS.glob("*.toml"))
    if read_layout(path).findings
]


@pytest.mark.parametrize("path", FOUND)
def test_findings_say_what_the_table_lacks(path):
    """Where runs are filtered out, as by `bench --filter`, or no method of a kind is there."""
    layout = read_layout(path)
    table, lacking = benchmark.load(REPORTS / layout.name), 0
    for column in {"setting", "name", "family", "success"} & {*table}:
        for value in table[column].unique()[:1]:
            rows = table[table[column] == value]
            own = [name for name in rows if "." in name and rows[name].isna().all()]
            found = made_reports._findings(layout, rows.drop(columns=own))
            assert found and not re.search(r"\bnan\b", " ".join(found))
            lacking += sum(text.startswith("The table lacks the runs for") for text in found)
    assert lacking


def test_an_experiment_without_figures_gets_the_usual_ones_and_an_optional_one_may_be_missing(
    campaign, tmp_path
):
    shutil.copytree(campaign, tmp_path / "out")
    text = (tmp_path / "out" / "report.md").read_text()
    assert text.count("*Table ") == 3 and text.count("*Figure ") == 2
    extra = (
        '\n[[figures]]\nkind = "success_table"\ncaption = "none"\nwhere = {setting ='
        ' "nowhere"}\noptional = true\n'
    )
    experiment = tmp_path / "out" / "experiment.toml"
    experiment.write_text(
        experiment.read_text()
        + extra
        + extra.replace("nowhere", "default").replace('"none"', '"some"')
    )
    assert main(["report", str(tmp_path / "out")]) == 0
    text = (tmp_path / "out" / "report.md").read_text()
    assert "some" in text and "none" not in text.partition("some")[0]


def test_pandas_alone_recomputes_five_findings_of_the_report(capsys, monkeypatch):
    page = (CAMPAIGNS.parent / "site" / "comparing.md").read_text()
    (program,) = re.findall(r"```python\n(.*?)```", page, re.S)
    monkeypatch.chdir(REPORTS.parent)
    exec(program, {})
    said, report = capsys.readouterr().out, (REPORTS / "small_tier" / "report.md").read_text()
    solvers, alone, along = re.findall(r"(\d+) (?:solvers|problems|runs)", said)
    assert f"{solvers} solvers on {alone} problems and on {along} runs" in report
    leaders = re.findall(r"leader: (.*) (\d+ of \d+) (\S+)", said)
    first = report.partition("*Table 1.")[0].splitlines()
    for name, solved, mean in leaders:
        (cells,) = [row.split(" | ") for row in first if row.split(" | ")[1:2] == [name]]
        assert cells[2] == solved and cells[4] == mean
    assert len(leaders) == 3
    for where, external, own, ratio in re.findall(
        r"(\d) dimensions.*?(\d+) and auto (\d+) in (\S+)", said
    ):
        place = {"2": "in the plane", "3": "in space"}[where]
        (line,) = [text for text in report.splitlines() if f"problems {place} without" in text]
        assert f"reach 1e-6 on {external}, " in line and f"`auto` on {own}." in line
        assert f"CPU time of `auto` is {ratio} times that of the best" in line
    for method, number in re.findall(r"^(\S.*?) +(\d+)$", said, re.M)[-5:]:
        solved = re.search(rf"`{re.escape(method)}` (\d+) and (\d+), ", report)
        assert solved is None or sum(map(int, solved.groups())) == int(number), method
    middle, times, wall = map(float, re.findall(r"\d+\.\d+", said)[-3:])
    assert f"takes {middle:.2g} ms in the median, {times:.2g} times" in report
    assert f"of the calls is {wall:.2f}," in report
