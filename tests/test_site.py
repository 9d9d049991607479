"""The documentation is built from scratch, warnings as errors, tutorials executed."""

import re
import subprocess
import sys
import time
from html import unescape
from itertools import chain
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest
from browser import CHROMIUM, Browser
from test_how_tos import PAGES

import contactopt
from contactopt.methods import METHODS

ROOT = Path(__file__).parents[1]
SITE = ROOT / "experiments" / "site"
CHAPTERS = tuple((SITE.parent / "course").glob("chapter_*.py"))
HOW_TOS = {*PAGES, "your_own_mesh"}
LIMIT = 900.0  # s: three minutes on two idle cores, more where other tests run


@pytest.fixture(scope="module")
def titles() -> dict[str, str]:
    """Name and title of the reports that are there before the build."""
    reports = (ROOT / "reports").glob("*/report.md")
    return {
        report.parent.name: report.read_text().splitlines()[0].removeprefix("# ")
        for report in reports
    }


@pytest.fixture(scope="module")
def built(titles, tmp_path_factory) -> Path:
    """Site of a build in a process of its own."""
    out = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-E"]
    command += ["-d", out / "doctrees", SITE, out / "html"]
    start = time.perf_counter()
    done = subprocess.run(
        [str(c) for c in command], cwd=ROOT, capture_output=True, text=True, timeout=LIMIT
    )
    assert done.returncode == 0, "install the extra `docs`, or mend:\n" + done.stderr[-4000:]
    print(f"built in {time.perf_counter() - start:.0f} s")
    return out / "html"


def pages(site: Path) -> dict[Path, str]:
    return {path: path.read_text() for path in site.rglob("*.html")}


def letters(html: str) -> str:
    """What remains of a page without mark-up, quotes and spaces."""
    return re.sub(r"\W", "", unescape(re.sub("<.*?>", "", html)))


@pytest.mark.slow
def test_every_method_and_public_name_has_its_place(built):
    listed = (built / "generated" / "methods.html").read_text()
    for name, (_, _, what) in METHODS.items():
        page = (built / "generated" / "methods" / f"{name}.html").read_text()
        assert f"{name}.html" in listed and letters(what[1:]) in letters(page)
    reference = (built / "generated" / "api.html").read_text()
    everything = {
        anchor
        for text in pages(built).values()
        for anchor in re.findall(r'id="(contactopt[\w.]*)"', text)
    }
    for name in contactopt.__all__:
        assert f">{name}<" in reference
        thing = getattr(contactopt, name)
        if not hasattr(thing, "__path__") and hasattr(thing, "__qualname__"):
            assert any(anchor.endswith(f".{name}") for anchor in everything), (
                f"{name} is on no page"
            )


@pytest.mark.slow
def test_tutorials_and_chapters_were_executed_and_their_slider_is_there(built):
    for path in (ROOT / "experiments" / "tutorials").glob("*.py"):
        page = (built / "generated" / "tutorials" / f"{path.stem}.html").read_text()
        assert "<img" in page, f"{path.stem}: no figure"
        assert page.count("<details>") == path.read_text().count("<details>") > 0
    assert (
        'class="slider"'
        in (built / "generated" / "course" / "chapter_2_friction_at_one_node.html").read_text()
    )


@pytest.mark.slow
def test_reports_are_included(built, titles):
    text = "".join(
        (built / "generated" / f"{page}.html").read_text() for page in ("accuracy", "performance")
    )
    assert len(titles) > 5
    for name, title in titles.items():
        assert letters(title) in letters(text), title
        assert (built / "generated" / "reports" / f"{name}.html").read_text().count("<table") > 0, (
            name
        )


@pytest.mark.slow
def test_links_lead_somewhere_and_nothing_is_loaded_from_elsewhere(built):
    for path, text in pages(built).items():
        for tag, target in re.findall(r'<(\w+)[^>]*?\s(?:href|src)="([^"#][^"]*)"', text):
            parts = urlsplit(unescape(target))
            # data: a picture within the page
            if (parts.scheme or parts.netloc) and parts.scheme != "data":
                assert tag == "a", f"{path.name} loads {target}"
            elif parts.path and not parts.scheme:
                assert (path.parent / unquote(parts.path)).exists(), (
                    f"{path.name} links to {target}"
                )
    assert (built / "_static" / "mathjax" / "tex-chtml.js").exists()


FITS = """all.map((slide, k) => {
  show(k);
  const main = slide.querySelector("main");
  const parts = [main, ...main.querySelectorAll("main > div")];
  return parts.every((part) => part.scrollHeight <= main.clientHeight + 1);
})"""


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium to open the slides with")
def test_slides_fit_and_their_formulas_and_figures_are_drawn(built):
    files = sorted((built / "lectures").glob("*.html"))
    assert len(files) == 12
    for file in files:
        with Browser(file, 1280, 720) as page:
            page.wait("window.ready")
            assert page.ask("all.length") >= 8
            long = [number for number, fits in enumerate(page.ask(FITS), 1) if not fits]
            assert not long, f"{file.name}: slides {long} are longer than the screen"
            assert page.ask("document.querySelectorAll('main mjx-container').length") > 0
            assert page.ask("document.querySelectorAll('mjx-merror').length") == 0
            pictures = page.ask(
                "[...document.querySelectorAll('figure img')].map((i) => i.naturalWidth)"
            )
            assert pictures and min(pictures) > 100
            assert not page.faults


FIRST = "document.querySelector('#search-results li > a')?.getAttribute('href')"


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium to search with")
@pytest.mark.parametrize("subject", ["certificate", "preconditioner", "mortar", "penalty"])
def test_search_finds_a_subject_before_the_symbols(subject, built):
    with Browser(built / "search.html") as page:
        address = (built / "search.html").as_uri()
        page.call("Page.navigate", url=f"{address}?q={subject}")
        page.wait(FIRST)
        assert "generated/api/" not in page.ask(FIRST)


@pytest.fixture
def reference(monkeypatch):
    monkeypatch.syspath_prepend(str(SITE))
    import reference

    return reference


def test_every_room_has_a_page_that_names_its_modules(reference):
    pages = dict(reference.room_pages(ROOT))
    rooms = {
        path.stem
        for path in (ROOT / "contactopt").iterdir()
        if path.suffix == ".py" or (path / "__init__.py").exists()
    }
    rooms -= {"__init__", "__main__"}
    assert rooms == set(reference.purposes(ROOT)) == set(reference.rooms(ROOT)), (
        "give the new room a sentence in the map of CONTRIBUTING.md"
    )
    for room in rooms:
        page = pages[Path("api", f"{room}.md")]
        assert reference.purposes(ROOT)[room] in page
        for path in (ROOT / "contactopt" / room).glob("[a-z]*.py"):
            assert f"automodule:: contactopt.{room}.{path.stem}\n" in page
    for name in re.findall(r"\]\(api/(\w+)\.md\)", pages[Path("api.md")]):
        assert name in rooms


def test_every_entry_of_every_table_is_on_its_page(reference):
    from contactopt.bodies.solvers import SOLVERS
    from contactopt.coupling.coupling import COUPLINGS
    from contactopt.methods.backends import CONIC, QP
    from contactopt.methods.preconditioners import PRECONDITIONERS
    from contactopt.problem.laws import LAWS
    from contactopt.scenes import SCENES

    pages = {str(path): page for path, page in reference.plug_in_pages(SITE)}
    tables = {
        "scenes": SCENES,
        "preconditioners": PRECONDITIONERS,
        "body_solvers": SOLVERS,
        "backends": QP | CONIC,
        "laws": LAWS,
        "couplings": COUPLINGS,
    }
    for name, table in tables.items():
        listed = re.findall(r"^\| `([\w-]+)` \|", pages[f"{name}.md"], re.M)
        assert set(listed) == set(table)


# tests/test_plugins.py runs the page of plug-ins, tests/test_own_mesh_page.py and
# tests/test_how_tos.py run the pages that need files or build on themselves; clusters need Slurm.
RUN_ELSEWHERE = {*HOW_TOS, "add_a_plug_in", "from_a_laptop_to_a_cluster"}


@pytest.mark.slow
@pytest.mark.parametrize(
    "path",
    [path for path in sorted(SITE.glob("*.md")) if path.stem not in RUN_ELSEWHERE],
    ids=lambda path: path.stem,
)
def test_python_on_pages_written_by_hand_runs(path, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # what a page writes stays there
    (tmp_path / "reports").symlink_to(SITE.parents[1] / "reports")
    blocks = re.findall(r"```python\n(.*?)```", path.read_text(), re.S)
    for code in blocks:
        exec(compile(code, path.name, "exec"), {})
    assert bool(blocks) == bool(capsys.readouterr().out), "a program prints what it found"


COLUMNS = 80  # of a program on a page; tables of plug-ins have one line for each entry


def programs():
    """The programs on pages: of pages by hand, tutorials, chapters and the gallery."""
    fences = re.compile(r"```(?:python|toml|sh)\n(?!# in )(.*?)```", re.S)
    for path in SITE.glob("*.md"):
        yield from ((path.name, block) for block in fences.findall(path.read_text()))
    scripts = (SITE.parent / "tutorials").glob("*.py"), CHAPTERS
    for path in chain(*scripts):
        text = re.sub(r"^# ?", "", path.read_text(), flags=re.M)
        yield from ((path.name, block) for block in fences.findall(text))
        yield path.name, "\n".join(re.findall(r"^[^#].*", path.read_text(), re.M))
    for path in (SITE.parent / "gallery").glob("*.py"):
        yield path.name, path.read_text().split('"""', 2)[2]


def test_programs_fit_a_page():
    found = list(programs())
    assert len(found) > 80
    long = [
        (name, line) for name, text in found for line in text.splitlines() if len(line) > COLUMNS
    ]
    assert not long, long
    pages = sorted(map(str, [*SITE.glob("*.md"), *CHAPTERS]))
    formatted = [sys.executable, "-m", "ruff", "format", "--isolated", "--check", "--line-length"]
    subprocess.run([*formatted, str(COLUMNS), *pages], check=True)


def test_what_is_written_by_hand_belongs_to_a_method():
    for path in (SITE / "notes").glob("*.md"):
        assert path.stem in METHODS
        for head in ("**Program.**", "**Cost:**", "**Converges**", "**Fails**"):
            assert path.read_text().count(head) == 1, f"{path.name}: {head}"


def test_docstrings_become_harmless_restructured_text(monkeypatch):
    monkeypatch.syspath_prepend(str(SITE))
    from docstrings import as_rst

    lines = [
        "Bound |r_t| <= mu * r_n_ of `solve`:",
        "r    (k,) force",
        "     more",
        "Prose.",
        "1. one",
        "   and on",
        "2. two",
    ]
    text = "\n".join(as_rst(list(lines)))
    assert r"Bound \|r_t\| <= mu \* r_n\_ of ``solve``:" in text
    assert ".. code-block:: text\n\n    r    (k,) force\n         more\n\nProse." in text
    assert r"1\. one and on" in text and "\n\n" + r"2\. two" in text
