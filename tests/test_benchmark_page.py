"""The page of a campaign: all runs, escaped, and usable in a browser."""

import re
import shutil

import numpy as np
import pytest
from browser import CHROMIUM, Browser

from contactopt import InputError
from contactopt.benchmark.ranking import points, ranking
from contactopt.benchmark.report_page import refusals, report_campaign
from contactopt.benchmark.store import load, save
from contactopt.cli import main
from tests.test_page import data_of

pd = pytest.importorskip("pandas")


def test_a_campaign_ends_with_a_page_of_all_its_runs(campaign):
    data, table = data_of(campaign / "report.html"), load(campaign)
    names = [problem["name"] for problem in data["problems"]]
    rows = [dict(zip(data["columns"], point)) for point in data["points"]]
    assert sum(row["repeats"] for row in rows) == len(table)
    for row in rows:
        runs = table[
            (table["problem"] == names[row["problem number"]])
            & (table["method"] == data["methods"][row["method number"]])
        ]
        assert row["cpu"] == pytest.approx(runs["cpu_seconds"].median(), rel=1e-3)
        assert row["residual"] == pytest.approx(runs["residual"].max(), rel=1e-3)
        assert row["low"] <= row["cpu"] <= row["high"] and row["claimed"] == runs["claimed"].all()
    assert len(data["histories"]) == len(rows)
    assert data["order"] == ranking(points(table), data["accuracies"][0])["method"].tolist()
    assert np.all(data["takes"]) and data["ours"] == data["methods"]


def test_the_page_needs_no_network_and_no_other_file(campaign):
    text = (campaign / "report.html").read_text()
    assert "http://www.w3.org/2000/svg" in text and len(text) < 300_000
    assert not re.search(r"(src|href)=.?https?:", text) and "default-src 'none'" in text


def test_a_strangers_rows_join_with_their_own_card(campaign, tmp_path):
    """Twice the times of another machine are taken out by the runs that both have made."""
    shutil.copytree(campaign, tmp_path / "own")
    table = load(campaign)
    theirs = table[table["name"] == "auto"]
    times = ["cpu_seconds", "call_seconds"]  # wall time counts where it is the larger by far
    new = theirs.assign(method="mine", name="mine", **0.25 * theirs[times])
    for rows in (theirs, new):
        rows["machine"] = "a machine of others"
    theirs = pd.concat([theirs.assign(**2 * theirs[times]), new])
    save(theirs, tmp_path / "theirs.csv")
    shutil.copy(campaign / "answers.npz", tmp_path)
    command = ["report", str(tmp_path / "own"), "--merge", str(tmp_path / "theirs.csv")]
    assert main(command) == 0
    data = data_of(tmp_path / "own" / "report.html")
    assert set(data["methods"]) == {"auto", "nsgs", "auto (theirs)", "mine"}
    (card,) = [card for card in data["cards"] if card["source"] == "theirs"]
    assert card["times divided by"] == pytest.approx(2.0, rel=1e-3)
    assert card["machine"] == "a machine of others" and card["runs"] == len(theirs)
    times = dict(zip(data["methods"], np.array(data["times"][0], dtype=float).T))
    np.testing.assert_allclose(times["auto (theirs)"], times["auto"], rtol=0.05)
    assert data["order"][0] == "mine"
    assert main(["report", "all", "--merge", str(tmp_path / "theirs.csv")]) == 2


def test_figures_for_a_paper_stand_beside_those_of_the_page(campaign, tmp_path):
    folder = shutil.copytree(campaign, tmp_path / "own")
    assert main(["report", str(folder), "--figures", "pdf"]) == 0
    drawn = {file.stem for file in folder.glob("figure-*.png")}
    assert drawn and drawn == {file.stem for file in folder.glob("figure-*.pdf")}
    assert all(file.read_bytes()[:5] == b"%PDF-" for file in folder.glob("figure-*.pdf"))
    assert main(["report", str(folder)]) == 0
    assert not list(folder.glob("figure-*.pdf"))  # none of an earlier report is left
    assert main(["report", "all", "--figures", "pdf"]) == 2


def test_names_of_a_campaign_are_text(campaign, tmp_path):
    table = load(campaign)
    table["method"] = "</script><img src=x onerror=alert(1)>"
    save(table, tmp_path / "rows.csv")
    text = report_campaign(tmp_path).read_text()
    assert "<img src=x" not in text and "</script><img" not in text


def test_an_empty_folder_is_refused(tmp_path):
    with pytest.raises(InputError, match="holds no results"):
        report_campaign(tmp_path)


def test_every_reason_of_refusal_is_said_once_with_its_number():
    missing = "QP backend 'scs' is not installed; pip install scs"
    table = pd.DataFrame(
        {"status": ["refused"] * 3 + ["solved"], "message": [missing, missing, "no", ""]}
    )
    assert refusals(table) == [f"2 runs were refused: {missing}", "1 run was refused: no"]


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium")
def test_a_browser_sorts_and_filters_the_runs_and_follows_links(campaign):
    with Browser(campaign / "report.html", 400) as browser:
        browser.wait("document.querySelectorAll('#convergence svg').length > 0")
        cells = (
            "[...document.querySelectorAll('#runs tbody tr')].map((row) =>"
            " row.children[{}].innerText)"
        )
        head = "[...document.querySelectorAll('#runs th button')].map((button) => button.innerText)"
        made = ranking(points(load(campaign)), 1e-8).set_index("method")["mean"]
        lead = "[...document.querySelectorAll('#leaders {}')].map((one) => one.innerText)"
        titles, shown = (browser.ask(lead.format(part)) for part in ("th button", "tbody td"))
        lines = [shown[i : i + len(titles)] for i in range(0, len(shown), len(titles))]
        rows = [dict(zip(titles, line)) for line in lines]
        means = {row["method"]: float(row["CPU [s]"]) for row in rows}
        assert means == pytest.approx(made.to_dict(), rel=1e-2)
        for picture in ("profile", "over-mu", "spread"):
            assert browser.ask(f"document.querySelectorAll('#{picture} svg').length") == 1
        column = browser.ask(head).index("CPU [s]")
        browser.ask(f"document.querySelectorAll('#runs th button')[{column}].click()")
        times = [float(text) for text in browser.ask(cells.format(column))]
        assert times == sorted(times) and len(times) == 6
        method = browser.ask("document.querySelector('#filter-method').options[1].value")
        browser.ask(
            "{const s = document.querySelector('#filter-method'); s.selectedIndex = 1;"
            " s.dispatchEvent(new Event('change'))}"
        )
        assert set(browser.ask(cells.format(browser.ask(head).index("method")))) == {method}
        browser.ask("document.querySelectorAll('#leaders tbody a')[1].click()")
        browser.wait("location.hash.startsWith('#solver=')")
        second = browser.ask("document.querySelectorAll('#leaders tbody a')[1].innerText")
        assert browser.ask("document.getElementById('choose-solver').value") == second
        browser.ask("document.querySelectorAll('#of-solver tbody a')[2].click()")
        browser.wait("location.hash.startsWith('#problem=')")
        assert browser.ask("document.getElementById('choose-problem').selectedIndex") == 1
        assert browser.ask("document.querySelectorAll('#speed circle').length") == 2
        browser.ask(
            "{const by = (key) => document.getElementById(`by-${key}`); by('dim').value = '2';"
            " by('family').value = 'punch-2d'; by('family').dispatchEvent(new Event('change'))}"
        )
        assert "2 of 2" in browser.ask(lead.format("tbody tr"))[0]  # both filters count
        assert browser.ask("document.documentElement.scrollWidth <= window.innerWidth")
        assert not browser.faults
