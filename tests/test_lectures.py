"""The lectures can be taught with: few words, one idea, a figure."""

import re
from pathlib import Path

import pytest
import test_how_tos

jupytext = pytest.importorskip("jupytext")

EXPERIMENTS = Path(__file__).parents[1] / "experiments"
SITE = EXPERIMENTS / "site"
NUMBERS = range(1, 13)
WORDS, CODE_LINES, MINUTES = 25, 8, (55, 95)


@pytest.fixture
def lectures(monkeypatch):
    monkeypatch.syspath_prepend(str(SITE))
    import lectures

    return lectures


def words(text):
    """The words of a slide, without formulas, programs and the rules of tables."""
    text = re.sub(r"```.*?```|\$\$.*?\$\$|\$.*?\$|^\|[-| ]*\|$", " ", text, flags=re.S | re.M)
    return re.findall(r"[^\W\d_][\w'-]*", text)


@pytest.mark.parametrize("number", NUMBERS)
def test_a_slide_has_one_idea_and_notes_with_timing_and_a_question(number, lectures):
    one = lectures.lecture(number)
    assert 8 <= len(one.slides) + 2 <= 12 and one.story.count(".") == 1
    minutes = 0
    for slide in one.slides:
        assert len(words(slide.text)) <= WORDS, (slide.title, len(words(slide.text)))
        assert len(words(slide.title)) <= 10, slide.title
        assert slide.text or slide.figure
        code = re.findall(r"```python\n(.*?)```", slide.text, re.S)
        assert all(len(block.splitlines()) <= CODE_LINES for block in code)
        assert max([0, *map(len, "".join(code).splitlines())]) <= 48
        timing = re.match(r"(\d+) min\. ", slide.notes)
        assert timing and "Ask: " in slide.notes and slide.notes.endswith("?"), slide.title
        minutes += int(timing[1])
    assert MINUTES[0] <= minutes <= MINUTES[1], minutes
    assert sum(bool(slide.figure) for slide in one.slides) >= 2 or number in (3,)


@pytest.mark.parametrize("number", NUMBERS)
def test_what_a_lecture_names_exists(number, lectures):
    one = lectures.lecture(number)
    assert all((SITE / "museum" / f"{room}.md").exists() for room in one.rooms)
    assert all((EXPERIMENTS / f"{name}.py").exists() for name in one.sources)
    for slide in one.slides:
        if slide.figure:
            name, k = slide.figure
            text = (EXPERIMENTS / f"{name}.py").read_text()
            drawn = len(re.findall(r"plt\.subplots\(|plt\.figure\(|^Slider\(", text, re.M))
            assert name in one.sources and 1 <= k <= drawn


def test_every_room_belongs_to_a_lecture(lectures):
    import museum

    assert {room for number in NUMBERS for room in lectures.lecture(number).rooms} == set(
        museum.ROOMS
    )


def test_the_page_for_lecturers_has_every_lecture_and_dois_of_the_right_form(lectures):
    page = lectures.index(SITE)
    assert [int(n) for n in re.findall(r'href="../lectures/(\d+).html"', page)] == list(NUMBERS)
    named = re.findall(r"\[doi:(\S+)\]\(https://doi\.org/(\S+)\)", page)
    assert len(named) >= 12 and page.count("doi.org") == len(named)
    assert all(re.fullmatch(r"10\.\d{4}/\S+", doi) and doi == target for doi, target in named)
    assert all(f"| {chapter} | " in page for chapter in range(1, 8))


@pytest.mark.slow
def test_the_seminar_project_runs_as_it_stands(tmp_path, monkeypatch, capsys):
    test_how_tos.test_a_page_runs_as_it_stands("seminar", tmp_path, monkeypatch, capsys)
    assert (tmp_path / "out" / "bench" / "held_back" / "report.html").exists()
