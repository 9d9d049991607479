"""The lectures are made of the chapters and tutorials, without a second copy of a sentence; the
page for lecturers keeps its promises. tests/test_site.py looks at the slides in the browser.
"""

import html
import re
from pathlib import Path

import pytest
import test_how_tos

jupytext = pytest.importorskip("jupytext")

EXPERIMENTS = Path(__file__).parents[1] / "experiments"
SITE = EXPERIMENTS / "site"
NUMBERS = range(1, 13)


@pytest.fixture
def lectures(monkeypatch):
    monkeypatch.syspath_prepend(str(SITE))
    import lectures

    return lectures


@pytest.fixture
def notebooks(tmp_path):
    """The scripts as notebooks that were not executed."""
    for folder in ("course", "tutorials"):
        (tmp_path / folder).mkdir()
        for path in (EXPERIMENTS / folder).glob("*.py"):
            book = jupytext.reads(path.read_text(), "py:percent")
            (tmp_path / folder / f"{path.stem}.ipynb").write_text(jupytext.writes(book, "ipynb"))
    return tmp_path


def plain(text):
    """What remains of words without mark-up, spaces and line breaks."""
    text = re.sub(r"\]\([^)]*\)", "", re.sub(r"^#", "", text, flags=re.M))
    return re.sub(r"[^\w]", "", text)


@pytest.mark.parametrize("number", NUMBERS)
def test_a_lecture_has_a_title_and_slides_of_its_scripts(number, lectures, notebooks):
    title, scripts, rooms = lectures.LECTURES[number - 1]
    slides = lectures.lecture(number, notebooks)
    assert slides[0].title == title and len(slides) >= 8
    assert all(slide.title and slide.parts for slide in slides)
    text = "".join((EXPERIMENTS / f"{name}.py").read_text() for name, _ in scripts)
    words, shown = plain(text), "".join(part for slide in slides[1:-1] for _, part in slide.parts)
    formulas = re.findall(r"\\\[(.*?)\\\]", shown, re.S)
    assert all(plain(html.unescape(formula)) in words for formula in formulas)
    for sentence in re.findall(r"<li>(.*?)</li>", shown, re.S):
        assert plain(html.unescape(re.sub(r"<.*?>|\\\(|\\\)", "", sentence))) in words, sentence
    if not any(chosen for _, chosen in scripts):
        told = re.split(r"^# ## (?:Exercises|References)", text, flags=re.M)[0]
        assert len(formulas) == told.count("$$") // 2
    assert all((SITE / "museum" / f"{room}.md").exists() for room in rooms)


@pytest.mark.parametrize("number", NUMBERS)
def test_sections_that_a_lecture_borrows_exist(number, lectures):
    for name, chosen in lectures.LECTURES[number - 1][1]:
        text = (EXPERIMENTS / f"{name}.py").read_text()
        assert all(f"# ## {section.lstrip('!')}" in text for section in chosen)


def test_key_sentences_bring_what_they_refer_to(lectures):
    text = "A node hangs. It costs $g = 1. A$ mm. This law is *associated friction*. We stop here."
    found = lectures.key_sentences(text, leads=False)
    assert found[:1] == ["A node hangs."] and found[-1] == "We stop here."
    assert "It costs $g = 1. A$ mm. This law is *associated friction*." in found


def test_the_page_for_lecturers_has_every_lecture_and_dois_of_the_right_form(lectures):
    page = lectures.index(SITE)
    assert [int(n) for n in re.findall(r'href="../lectures/(\d+).html"', page)] == list(NUMBERS)
    named = re.findall(r"\[doi:(\S+)\]\(https://doi\.org/(\S+)\)", page)
    assert len(named) >= 12 and page.count("doi.org") == len(named)
    assert all(re.fullmatch(r"10\.\d{4}/\S+", doi) and doi == target for doi, target in named)
    assert all(f"| {chapter} | " in page for chapter in range(1, 8))


def test_the_seminar_project_runs_as_it_stands(tmp_path, monkeypatch, capsys):
    test_how_tos.test_a_page_runs_as_it_stands("seminar", tmp_path, monkeypatch, capsys)
    assert (tmp_path / "out" / "bench" / "held_back" / "report.html").exists()
