"""The page of a result: what is on it is what was computed, it stands alone."""

import base64
import gzip
import html
import json
import re
import shutil
from dataclasses import replace

import numpy as np
import pytest
from browser import CHROMIUM, Browser
from scipy.spatial import KDTree

from contactopt import InputError, cli, run, scenes
from contactopt.coupling.back_to_bodies import recover
from contactopt.figures.view_page import certificate_words, write_page


def decoded(packed):
    kind = {"f4": "<f4", "i4": "<i4", "u2": "<u2"}[packed["type"]]
    values = np.frombuffer(base64.b64decode(packed["data"]), kind).reshape(packed["shape"])
    return values if kind != "<u2" else packed["low"] + packed["step"] * values


def data_of(file):
    packed = re.search(r'<script type="text/plain" id="data">(.*?)</script>', file.read_text())[1]
    return json.loads(gzip.decompress(base64.b64decode(packed)))


@pytest.fixture(scope="module")
def cycle(tmp_path_factory):
    """The folder of three runs, and the load path of the last one."""
    made = tmp_path_factory.mktemp("cycle")
    run(scenes.flat_punch(2, elements=4), made / "flat", figures=(), html=True)
    run(scenes.flat_punch(3, elements=3), made / "solid", figures=(), html=True)
    result = run("cattaneo-2d", made / "path", steps=1, elements=8, figures=(), html=True)
    return made, result.path


@pytest.fixture(scope="module")
def folder(cycle):
    return cycle[0]


def surface_area(points, cells):
    first, second, third = points[cells].transpose(1, 0, 2)
    return np.linalg.norm(np.cross(second - first, third - first), axis=1).sum() / 2


@pytest.mark.parametrize("degree", [1, 2])
def test_the_bodies_on_the_page_are_those_of_the_result(degree, tmp_path):
    result = run(
        scenes.flat_punch(3, elements=3 - degree), tmp_path, figures=(), html=True, degree=degree
    )
    data = data_of(tmp_path / "view.html")
    for fields in result.fields:
        (body,) = (body for body in data["bodies"] if body["name"] == fields.name)
        points = decoded(body["points"])
        cells = np.concatenate([decoded(body["cells"]), decoded(body["cut_cells"])])
        # with those in the middle of edges and those inside
        assert np.allclose(points, fields.mesh.p.T, rtol=1e-6)
        x, y, z = np.ptp(fields.mesh.p, axis=1)
        # of the block, once
        assert surface_area(points, cells) == pytest.approx(2 * (x * y + y * z + z * x), rel=1e-5)
        assert np.allclose(decoded(body["values"]["von_mises"])[0], fields.von_mises, rtol=1e-5)
        assert np.allclose(decoded(body["move"])[0], fields.displacement.T, rtol=1e-5, atol=1e-9)
        assert decoded(body["values"]["stress_xz"]).shape == (1, len(points))
        assert decoded(body["edges"]).max() < len(points) > decoded(body["lines"]).max()


def test_the_inside_of_large_bodies_is_left_out(tmp_path, monkeypatch):
    monkeypatch.setattr("contactopt.figures.page_data.MOST_INSIDE", 10)
    result = run(scenes.flat_punch(3, elements=2), tmp_path, figures=(), html=True)
    for body in data_of(tmp_path / "view.html")["bodies"]:
        (fields,) = (fields for fields in result.fields if fields.name == body["name"])
        surface = fields.mesh.p.T[np.unique(fields.mesh.facets[:, fields.mesh.boundary_facets()])]
        points = decoded(body["points"])
        assert np.allclose(np.sort(points, axis=0), np.sort(surface, axis=0), rtol=1e-6)
        assert not decoded(body["inside"]).size
        x, y, z = np.ptp(surface, axis=0)
        # in the two planes of symmetry the latter
        cells = [decoded(body[name]) for name in ("cells", "cut_cells")]
        assert surface_area(points, cells[0]) == pytest.approx(2 * x * y + y * z + z * x, rel=1e-5)
        assert surface_area(points, cells[1]) == pytest.approx(y * z + z * x, rel=1e-5)


def test_half_models_are_shown_whole(folder):
    data = data_of(folder / "solid" / "view.html")
    assert sorted(data["mirrors"]) == [[0, 0.0], [1, 0.0]]  # a quarter of the block
    low, high = np.array(data["box"])
    assert np.allclose(low[:2], -high[:2])
    assert data_of(folder / "flat" / "view.html")["mirrors"] == [[0, 0.0]]


def test_what_touches_is_drawn_touching(tmp_path):
    """With displacements magnified, drawn surfaces that touch have no gap."""
    result = run("press-fit", tmp_path, figures=(), html=True)
    data, s = data_of(tmp_path / "view.html"), 100.0
    (pair,) = result.scene.pairs
    assert np.abs(result.reduction.gap).max() > 1e-3 and data["scale"] > 1
    drawn = {}
    for body in data["bodies"]:
        x, u, d = (decoded(body[key]) for key in ("points", "move", "lift"))
        drawn[body["name"]] = x[:, :2], x[:, :2] + s * u[-1] + (s - 1) * d[0]
    apart = []
    for name in pair.bodies:
        x, moved = drawn[name]
        near = KDTree(x).query(result.problem.coordinates.T)[1]
        apart.append(moved[near])
    normals = result.reduction.frames[:, 0]
    gap = np.einsum("ki,ki->k", normals, apart[0] - apart[1])
    true = result.problem.displacements(result.solution.reactions, result.solution.multipliers)
    assert np.abs(gap - s * true[:, 0]).max() < 0.02 * s * np.abs(result.reduction.gap).max()


def test_every_state_of_a_path_is_on_the_page(cycle):
    folder, path = cycle
    data = data_of(folder / "path" / "view.html")
    (pair,) = data["contacts"]
    assert data["states"] == len(path.states)
    names = [part.name for part in path.reduction.scene.parts]
    for number, state in enumerate(path.states):
        r, areas = state.solution.reactions, path.reduction.problem.areas
        assert np.allclose(
            decoded(pair["states"]["pressure"])[number], r[:, 0] / areas, rtol=1e-5, atol=1e-9
        )
        stick, slip = path.history["stick_nodes"][number], path.history["slip_nodes"][number]
        status = decoded(pair["states"]["status"])[number]
        assert (np.sum(status == 1), np.sum(status == 2)) == (stick, slip)
        bound, along = (decoded(pair["states"][name])[number] for name in ("bound", "along"))
        assert np.allclose(bound[status == 2], np.abs(along[status == 2]), rtol=1e-5)
        gap, slip = (decoded(pair["states"][name])[number] for name in ("gap", "slip"))
        assert np.allclose(gap, state.displacements[:, 0], atol=1e-9)
        assert np.allclose(slip, np.abs(state.slip[:, 0]), rtol=1e-4, atol=1e-9)
        force = np.einsum("kad,ka->kd", path.reduction.frames, r) / areas[:, None]
        assert np.allclose(
            decoded(pair["states"]["vector"])[number, :, :2], force, rtol=1e-4, atol=1e-7
        )
        for fields, body in zip(
            path.fields(number), sorted(data["bodies"], key=lambda b: names.index(b["name"]))
        ):
            assert fields.name == body["name"] and data["moving"]
            for packed, exact in (
                (body["move"], fields.displacement.T),
                (body["values"]["von_mises"], fields.von_mises),
            ):
                assert np.abs(decoded(packed)[number] - exact).max() <= packed["step"]
                assert packed["step"] == pytest.approx(np.ptp(decoded(packed)) / 65535, rel=1e-4)
    assert np.allclose(data["history"]["shear_force"], path.history["shear_force"])
    assert np.allclose(path.fields(-1)[0].stress, recover(path.reduction, path.solution)[0].stress)


def test_bodies_of_long_paths_stay_and_the_page_says_so(tmp_path, monkeypatch):
    monkeypatch.setattr("contactopt.figures.output.MOST_NUMBERS", 1000)
    run("cattaneo-2d", tmp_path, steps=1, elements=6, figures=(), html=True)
    text, data = (tmp_path / "view.html").read_text(), data_of(tmp_path / "view.html")
    assert not data["moving"] and len(decoded(data["bodies"][0]["move"])) == 1
    assert "The bodies are those of the last state" in text
    assert not list(tmp_path.glob("*-state*.vtu"))


def test_the_page_stands_alone_and_is_small(folder):
    for file in folder.glob("*/view.html"):
        text = file.read_text()
        assert "default-src 'none'" in text and len(text) < 4e6
        assert not re.search(r'(src|href)\s*=\s*"?(https?:)?//', text)


def test_names_reach_the_page_as_text_only(tmp_path):
    base = scenes.flat_punch(2, elements=4)
    hostile = replace(base, name="</script><script>alert(1)</script>", units=("<b>", "<i>"))
    run(hostile, tmp_path, figures=(), html=True)
    text = (tmp_path / "view.html").read_text()
    assert "<script>alert" not in text and "<b>" not in text
    assert "</script><script>alert(1)" not in text
    assert data_of(tmp_path / "view.html")["units"] == ["<b>", "<i>", "<i> <b>^2"]


def test_view_makes_the_page_of_an_earlier_run(tmp_path, capsys, monkeypatch):
    opened = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    result = run(scenes.flat_punch(2, elements=4), tmp_path, figures=())
    assert cli.main(["view", str(tmp_path)]) == 0 and "view.html" in capsys.readouterr().out
    page = result.view(tmp_path / "other.html")
    assert data_of(page) == data_of(tmp_path / "view.html") and len(opened) == 2
    assert cli.main(["view", str(tmp_path / "nothing")]) == 2
    said = capsys.readouterr().err
    assert "is not the folder of a finished run (there is no summary.json in it); make" in said
    (tmp_path / "summary.json").write_text("{\n  'a': 1}")
    assert cli.main(["view", str(tmp_path)]) == 2
    assert "(its summary.json is damaged in line 2)" in capsys.readouterr().err


def damaged(data: bytes, way: str, rng: np.random.Generator) -> bytes:
    """A file cut short, with bytes flipped, emptied, or with a JSON value of another type."""
    if way == "cut":
        return data[: int(rng.integers(len(data)))]
    if way == "flipped":
        changed = bytearray(data)
        for place in rng.integers(len(data), size=20):
            changed[place] ^= int(rng.integers(1, 256))
        return bytes(changed)
    if way == "empty":
        return b""
    summary = json.loads(data)
    values = [None, "x", -1, 1e400, [], {}, [[]], {"x": 1}, True]
    summary[str(rng.choice(sorted(summary)))] = values[int(rng.integers(len(values)))]
    return json.dumps(summary).encode()


@pytest.mark.filterwarnings("error")
def test_damaged_results_become_a_page_or_one_sentence(folder, tmp_path, monkeypatch, capfd):
    """Files cut, flipped, swapped, missing, and values of other types, in all three runs."""
    monkeypatch.setattr("contactopt.figures.view_page.write_html", lambda *given: None)
    rng, refused = np.random.default_rng(2), 0
    ways = ("cut", "flipped", "empty", "swapped", "missing", "type")
    for number in range(54):
        run_folder = folder / ("flat", "solid", "path")[number % 3]
        work = tmp_path / str(number)
        shutil.copytree(run_folder, work, ignore=shutil.ignore_patterns("*.html"))
        files, way = sorted(work.iterdir()), ways[number // 3 % len(ways)]
        file = work / "summary.json" if way == "type" else files[int(rng.integers(len(files)))]
        if way == "swapped":
            file.write_bytes(files[int(rng.integers(len(files)))].read_bytes())
        elif way == "missing":
            file.unlink()
        else:
            file.write_bytes(damaged(file.read_bytes(), way, rng))
        try:
            write_page(work, tmp_path / "page.html")
        except InputError as error:
            refused += 1
            assert "is not the folder of a finished run" in str(error) and "\n" not in str(error)
    assert refused > 18 and capfd.readouterr() == ("", "")


def test_the_certificate_in_words_tells_a_solution_from_an_iterate():
    solved = {"status": "solved", "residual": 1e-12, "message": ""}
    assert certificate_words(solved).startswith(
        "These forces are a solution. The certificate is 1.0e-12"
    )
    stopped = {"status": "stalled", "residual": 1e-3, "message": "it stalled"}
    assert certificate_words(stopped).startswith(
        "This is not a solution, only the last iterate (it stalled)."
    )


def test_an_adaptive_run_shows_its_last_mesh_and_the_sizes_of_all(tmp_path):
    result = run(
        "sphere", tmp_path, accuracy=0.05, quantity="pressure", adaptive=True, figures=(), html=True
    )
    text, data = (tmp_path / "view.html").read_text(), data_of(tmp_path / "view.html")
    for fields, body in zip(
        result.fields, sorted(data["bodies"], key=lambda body: body["name"], reverse=True)
    ):
        assert fields.name == body["name"]
        assert len(decoded(body["lines"])) == fields.mesh.nfacets  # every side of a triangle once
    assert ", ".join(str(level.unknowns) for level in result.estimate.levels) in text
    assert html.escape(result.estimate.message) in text


# pixels of the picture between the colour bars that are not white, how many colours they have, and
# the share of those that are red, as a pressure is
SEEN = """(() => {
  const [left, right, top, bottom] = room().map((value) => Math.round(value * painter.ratio));
  const box = [left, top, right - left, bottom - top];
  const pixels = new Uint32Array(view.getContext("2d").getImageData(...box).data.buffer);
  const own = [...pixels].filter((pixel) => pixel !== 0xffffffff);
  const red = own.filter((pixel) => (pixel & 255) - ((pixel >> 16) & 255) > 60).length;
  return {share: own.length / pixels.length, colours: new Set(own).size, red: red / pixels.length};
})()"""
# words in the picture, drawn again, that do not lie inside it
CUT = """(() => {
  const cut = [], fill = painter.context.fillText;
  painter.context.fillText = function (words, x) {
    const wide = this.measureText(words).width;
    const left = x - {left: 0, center: 0.5, right: 1}[this.textAlign] * wide;
    if (left < 0 || left + wide > view.clientWidth) cut.push(words);
    fill.apply(this, arguments);
  };
  document.getElementById("home").click();
  document.getElementById("reset").click();
  painter.context.fillText = fill;
  return cut;
})()"""
# how many words of the charts lie inside them; -1 if one does not
UNCUT = """(() => {
  const words = [...document.querySelectorAll(".chart text")];
  const inside = (text) => {
    const a = text.getBoundingClientRect(), b = text.closest("svg").getBoundingClientRect();
    const across = a.left >= b.left - 1 && a.right <= b.right + 1;
    return across && a.top >= b.top - 1 && a.bottom <= b.bottom + 1;
  };
  return words.every(inside) ? words.length : -1;
})()"""
CHANGE = (
    "(() => {{ const c = document.getElementById('{}'); c.value = '{}';"
    " c.dispatchEvent(new Event('{}')); }})()"
)
SAME = "painter.pixels.reduce((sum, pixel) => (31 * sum + pixel) | 0, 0)"


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium")
@pytest.mark.parametrize("width", [1280, 400])
@pytest.mark.parametrize("name", ["flat", "solid", "path"])
def test_bodies_and_colours_are_on_the_canvas_at_once(folder, name, width):
    with Browser(exposed(folder / name), width) as browser:
        browser.wait("performance.getEntriesByName('drawn').length > 0")
        seen = browser.ask(SEEN)
        assert seen["share"] > 0.15 and seen["red"] > 0.001, "bodies, and the pressure on them"
        assert browser.ask("document.documentElement.scrollWidth <= window.innerWidth")
        browser.wait("performance.getEntriesByName('charted').length > 0")
        assert browser.ask(UNCUT) > 5
        assert browser.ask("draws") == 1  # what nobody asked to be drawn again is not
        assert browser.ask(CUT) == []
        assert browser.ask("[1200, 0.12345, 2e-9].map(number)") == ["1200", "0.1235", "2e-9"]
        opened, scale = browser.ask(SAME), browser.ask("painter.scale")
        browser.press("b")
        assert scale > browser.ask("painter.scale")  # the contact is enlarged
        assert browser.ask(SEEN)["colours"] > 50  # stresses
        browser.press("c")
        assert browser.ask(SAME) == opened
        browser.ask("document.getElementById('peak').click()")
        assert "pressure" in browser.ask("document.getElementById('values').innerText")
        browser.ask("document.getElementById('view').focus()")
        browser.press("ArrowLeft")
        assert browser.ask(SAME) != opened and not browser.faults


def exposed(folder):
    """The page of a run, whose picture the test can ask."""
    text = (folder / "view.html").read_text()
    mark = 'performance.mark("drawn");'
    assert mark in text
    file = folder / "exposed.html"
    text = text.replace(mark, f"Object.assign(window, {{painter, room}}); {mark}")
    begin = "painter.begin(moving);"
    assert begin in text
    file.write_text(text.replace(begin, f"window.draws = (window.draws || 0) + 1; {begin}"))
    return file


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium")
def test_the_slider_moves_the_bodies_and_any_column_of_the_history_is_drawn(folder):
    with Browser(exposed(folder / "path"), 1000) as browser:
        browser.wait("performance.getEntriesByName('charted').length > 0")
        last = browser.ask(SAME)
        browser.ask(CHANGE.format("state", 0, "input"))
        browser.wait(f"{SAME} !== {last}")
        words = browser.ask("document.getElementById('state-words').innerText")
        assert words.startswith("state 1 of ")
        browser.ask(CHANGE.format("upward", "elastic_energy", "change"))
        # heights of the dots in the chart are linear in the column of the history
        dots = "[...document.querySelectorAll('#path-chart circle')]"
        drawn = np.array(browser.ask(f"{dots}.map((dot) => +dot.getAttribute('cy'))"))[
            :-1
        ]  # without that of the state shown
        energy = data_of(folder / "path" / "view.html")["history"]["elastic_energy"]
        slope, shift = np.polyfit(energy, drawn, 1)
        assert slope < 0 and drawn == pytest.approx(slope * np.array(energy) + shift, abs=1e-6)
        assert not browser.faults


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium")
def test_solids_are_cut_and_mirrored(folder):
    with Browser(exposed(folder / "solid"), 1000) as browser:
        browser.wait("performance.getEntriesByName('drawn').length > 0")
        browser.press("b")
        whole = browser.ask(SEEN)["share"]
        browser.ask("document.getElementById('whole').click()")
        assert browser.ask(SEEN)["share"] < 0.7 * whole  # a quarter of the bodies
        browser.ask("document.getElementById('whole').click()")
        assert browser.ask(SEEN)["share"] == pytest.approx(whole)
        browser.ask(CHANGE.format("cut", 0, "change"))
        browser.ask(CHANGE.format("cut-place", 0.5, "input"))
        browser.wait(f"{SEEN}.share < {0.95 * whole}")
        assert "from x = " in browser.ask("document.getElementById('cut-words').textContent")
        assert not browser.faults
