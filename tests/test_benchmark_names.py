"""Names and texts of campaigns lead nowhere else, and are shown as they are."""

import json
from pathlib import Path

import pytest

from contactopt import InputError, benchmark
from contactopt.benchmark.experiment import read_experiment, read_layout
from contactopt.benchmark.report_page import report_campaign
from contactopt.cli import main
from tests.test_benchmark import SMALL, written
from tests.test_benchmark_faults import one_line

BAD_NAMES = [
    "..",
    ".",
    "...",
    "",
    "a/b",
    "/tmp/x",
    "../evil",
    "a\\b",
    "C:x",
    "a\nb",
    "\x07",
    " a",
    "nul",
    "COM1.txt",
    "x" * 200,
]


# Names and links


@pytest.mark.parametrize("name", BAD_NAMES)
def test_names_that_lead_elsewhere_are_refused_wherever_they_are_read(tmp_path, name):
    text = SMALL.replace('name = "small"', f"name = {json.dumps(name)}")
    path = written(tmp_path, text)
    with pytest.raises(InputError, match="name"):
        read_experiment(path)
    with pytest.raises(InputError, match="name"):
        read_layout(path)


def test_a_report_named_dots_removes_and_writes_nothing(tmp_path, monkeypatch, capsys):
    """out/full/.. is the folder `out`, which is not the campaign's to empty."""
    (tmp_path / "campaigns").mkdir()
    (tmp_path / "out").mkdir()
    precious = tmp_path / "out" / "precious"
    precious.write_text("mine")
    monkeypatch.chdir(tmp_path)
    for name in ("..", "../../precious"):
        written(tmp_path / "campaigns", SMALL.replace('"small"', f'"{name}"'), "small.toml")
        before = sorted(tmp_path.rglob("*"))
        assert main(["report", "--run", "full", "--experiments", "campaigns"]) == 2
        one_line(capsys.readouterr().err, "name")
        assert main(["bench", "campaigns/small.toml"]) == 2
        assert sorted(tmp_path.rglob("*")) == before and precious.read_text() == "mine"


# The page

STRANGE = ["<b>bold", "x | y", "$\\frac{$ and $a$", "[a](", "`", "a\nb"]


@pytest.mark.slow
def test_strange_texts_are_shown_as_they_are(tmp_path):
    """The same texts as title, text, captions, finding and names of solvers and problems."""
    rows = [json.loads(line) for line in _rows(tmp_path)]
    for number, row in enumerate(rows):
        name = STRANGE[number % len(STRANGE)]
        row |= {
            "method": name,
            "name": name,
            "label": name,
            "problem": name,
            "family": name,
            "machine": name,
        }
    folder = tmp_path / "reports" / "strange"
    folder.mkdir(parents=True)
    table = tmp_path / "rows.jsonl"
    table.write_text("".join(json.dumps(row) + "\n" for row in rows))
    benchmark.save(benchmark.load(table), folder / "rows.csv")
    text = f'name = "strange"\ntitle = {json.dumps(STRANGE[0])}\nfindings = "found.py"\n'
    for kind in ("success_table", "performance_profile"):
        text += f'[[figures]]\nkind = "{kind}"\ncaption = {json.dumps(" ".join(STRANGE))}\n'
    written(tmp_path, f"def findings(table):\n    return {STRANGE!r}\n", "found.py")
    experiment = written(tmp_path, text)
    benchmark.report.build([experiment], tmp_path / "reports")
    page = report_campaign(folder, experiment).read_text()
    assert "<b>bold" not in page and "&lt;b&gt;bold" in page and "data:image/png" in page


def _rows(folder: Path) -> list[str]:
    """Real rows, as many as there are strange texts."""
    path = written(folder, SMALL.replace("repeats = 2", f"repeats = {len(STRANGE)}"), "real.toml")
    filters = ["problem=rigid*", "method=auto"]
    benchmark.run_campaign(path, folder / "real", jobs=1, quiet=True, filters=filters)
    return (folder / "real" / "rows.jsonl").read_text().splitlines()
