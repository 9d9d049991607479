"""The page of a campaign: all runs, escaped, and usable in a browser."""

import pandas as pd
import pytest
from browser import CHROMIUM, Browser

from contactopt import InputError
from contactopt.benchmark.report_page import refusals, report_campaign
from contactopt.benchmark.store import load, save
from contactopt.cli import main
from tests.test_benchmark import SMALL, written
from tests.test_page import data_of


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    folder = tmp_path_factory.mktemp("campaign")
    out = folder / "out"
    assert main(["bench", str(written(folder, SMALL)), "--out", str(out), "--jobs", "1", "-q"]) == 0
    return out


def test_a_campaign_ends_with_a_page_of_all_its_runs(campaign):
    rows, table = data_of(campaign / "report.html")["rows"], load(campaign)
    assert len(rows) == len(table)
    for row, (_, run) in zip(rows, table.iterrows()):
        assert (row["method"], row["status"], row["success"]) == (
            run["method"],
            run["status"],
            bool(run["success"]),
        )
        assert row["residual"] == pytest.approx(run["residual"], rel=1e-3)
    assert any(len(row.get("history", ())) == 3 for row in rows)


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


@pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium")
def test_a_browser_sorts_and_filters_the_runs_and_draws_one(campaign):
    with Browser(campaign / "report.html", 400) as browser:
        browser.wait("document.querySelectorAll('#convergence .main-svg').length > 0")
        cells = (
            "[...document.querySelectorAll('#runs tbody tr')].map((row) =>"
            " row.children[{}].innerText)"
        )
        head = "[...document.querySelectorAll('#runs th button')].map((button) => button.innerText)"
        column = browser.ask(head).index("cpu seconds")
        browser.ask(f"document.querySelectorAll('#runs th button')[{column}].click()")
        times = [float(text) for text in browser.ask(cells.format(column))]
        assert times == sorted(times) and len(times) == len(load(campaign))
        method = browser.ask("document.querySelector('#filter-method').options[1].value")
        browser.ask(
            "{const s = document.querySelector('#filter-method'); s.selectedIndex = 1;"
            " s.dispatchEvent(new Event('change'))}"
        )
        assert set(browser.ask(cells.format(browser.ask(head).index("method")))) == {method}
        browser.ask("document.querySelector('#runs tbody tr').focus()")
        browser.press("Enter")
        assert browser.ask("document.querySelectorAll('tr.chosen').length") == 1
        assert browser.ask("document.getElementById('convergence').data.length") <= 1
        browser.ask("{const b = document.getElementById('log-x'); b.click()}")
        assert browser.ask("document.getElementById('speed').layout.xaxis.type") == "linear"
        assert browser.ask("document.documentElement.scrollWidth <= window.innerWidth")
        assert not browser.faults
