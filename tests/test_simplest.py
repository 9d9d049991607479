"""What may be left out of a scene: symmetries that are there are found, those that are not there are not."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import skfem
from turned import moved, turn

import contactopt
from contactopt import InputError, Material, Part, Plate, Rigid, Scene, Support, Traction, cli, scenes, simplify
from contactopt.analysis.quantities import approach, elastic_energy
from contactopt.analysis.solve_scene import Options, Solved, solve_scene
from contactopt.scenes.meshes import rename, simplices, tensor_mesh

SOFT, STIFF = Material(5.0, 0.3), Material(20.0, 0.2)
TIGHT = Options(tol=1e-12)


def punch(
    dim: int = 2,
    force: dict[str, float] | None = None,
    mu: float | Callable = 0.3,
    support: tuple[Support, ...] = (Support("bottom"),),
    loads: tuple = (),
    cells: int = 4,
) -> Scene:
    """A block pressed on a larger one, all of both; the middle is at x = 3 (and y = 1)."""
    up, middle = "xyz"[dim - 1], np.array([3.0, 1.0])[: dim - 1]
    force = {c: 0.0 for c in "xyz"[: dim - 1]} | {up: -10.0} if force is None else force

    def box(half: tuple[float, ...], low: float, high: float, across: int, rows: int) -> skfem.Mesh:
        ticks = [np.linspace(m - h, m + h, across + 1) for m, h in zip(middle, half)]
        return tensor_mesh(*ticks, np.linspace(low, high, rows + 1))

    block = rename(box((2.0, 1.0), 0.0, 2.0, 2 * cells, cells), contact=f"{up}-", top=f"{up}+")
    ground = rename(
        box((4.0, 2.0), -3.0, 0.0, 4 * cells, cells), contact=f"{up}+", bottom=f"{up}-", left="x-", right="x+"
    )
    plate = Plate("top", force)
    under = np.all(np.abs(_middles(ground, "contact")[: dim - 1] - middle[:, None]) < [[2.0], [1.0]][: dim - 1], axis=0)
    ground = ground.with_boundaries({"contact": ground.boundaries["contact"][under]})
    return Scene(
        "punch",
        Part("block", block, SOFT, (), (plate, *loads)),
        Part("ground", ground, STIFF, support),
        mu,
        kind="plane-strain" if dim == 2 else "solid",
    )


def _middles(mesh: skfem.Mesh, boundary: str) -> np.ndarray:
    return mesh.p[:, mesh.facets[:, mesh.boundaries[boundary]]].mean(axis=1)


def numbers(solved: Solved) -> np.ndarray:
    """Energy, approach, total force, largest pressure: of the whole, whatever part is modelled."""
    problem, r = solved.reduction.problem, solved.solution.reactions
    own = approach(problem, solved.solution)
    energy = elastic_energy(solved.reduction, solved.solution)
    return np.array([energy, own or 0.0, r[:, 0].sum(), (r[:, 0] / problem.areas).max()])


def halves(scene: Scene) -> list:
    return [each for each in simplify(scene, solve=False).found if each.name == "mirror symmetry"]


def test_half_of_a_punch_has_the_answer_of_the_whole():
    whole = punch()
    found = simplify(whole, solve=False)
    assert [each.name for each in found.found] == ["mirror symmetry"]
    assert "x = 3" in found.found[0].what and found.scene.copies == 2
    assert "needs no more than one half of the bodies" in str(found)
    one, other = solve_scene(whole, options=TIGHT), solve_scene(found.scene, options=TIGHT)
    assert np.allclose(numbers(one), numbers(other), rtol=1e-8)
    left, right = (each.reduction.problem for each in (one, other))
    pressure = {round(x, 9): p for x, p in zip(left.coordinates[0], one.solution.reactions[:, 0] / left.areas)}
    for x, p in zip(right.coordinates[0], other.solution.reactions[:, 0] / right.areas):
        assert p == pytest.approx(pressure[round(x, 9)], rel=1e-8)


def test_quarter_of_a_solid():
    whole = punch(3, cells=2)
    found = halves(whole)
    assert [each.scene.copies for each in found] == [2, 4]
    one, other = solve_scene(whole, options=TIGHT), solve_scene(found[-1].scene, options=TIGHT)
    assert np.allclose(numbers(one), numbers(other), rtol=1e-8)
    assert other.reduction.dofs < one.reduction.dofs / 3


@pytest.mark.parametrize(
    "scene, reason",
    [
        (punch(force={"x": 1.0, "y": -10.0}), "the plate on 'top'"),
        (punch(support=(Support("bottom"), Support("left", {"x": 0.0}))), "the support on 'left'"),
        (punch(loads=(Traction("x+", (0.0, 0.1)),)), "the traction on 'x+'"),
        (punch(mu=lambda x: 0.3 + 0.1 * (x[0] > 3)), "the friction of contact"),
    ],
    ids=["plate", "support", "traction", "friction"],
)
def test_what_spoils_a_symmetry_is_named(scene, reason):
    found = simplify(scene, solve=False)
    assert not found.found and found.scene is scene
    assert any(reason in note for note in found.notes), found.notes


@pytest.mark.parametrize(
    "scene",
    [
        punch(support=(Support("bottom", {"y": 0.0}), Support("left", {"x": 0.1}), Support("right", {"x": -0.1}))),
        punch(loads=(Traction("x+", (0.1, 0.2)), Traction("x-", (-0.1, 0.2)))),
        punch(mu=lambda x: 0.3 + 0.1 * np.abs(x[0] - 3)),
    ],
    ids=["support", "traction", "friction"],
)
def test_pairs_of_images_keep_a_symmetry(scene):
    (half,) = halves(scene)
    one, other = solve_scene(scene, options=TIGHT), solve_scene(half.scene, options=TIGHT)
    assert np.allclose(numbers(one), numbers(other), rtol=1e-8)


def test_gaps_are_compared():
    block = punch().upper
    for gap, count in ((lambda x: 0.01 * (x[0] - 3) ** 2, 1), (lambda x: 0.01 * (x[0] - 2.9) ** 2, 0)):
        assert len(halves(Scene("ball", block, Rigid("floor", (0.0, 1.0), gap), 0.2))) == count


def test_a_body_that_is_not_symmetric_is_told_from_one_that_is():
    scene = punch()
    skewed = replace(scene.lower.mesh, doflocs=scene.lower.mesh.p + 1e-3 * (scene.lower.mesh.p[0] > 6.99))
    assert not halves(replace(scene, lower=replace(scene.lower, mesh=skewed)))


def test_a_plane_across_no_axis_is_told():
    """Supports speak of the components of space, so that such a plane cannot hold a half."""
    found = simplify(moved(punch(), turn(30.0)), solve=False)
    assert not found.found and any("0.866 x + 0.5 y = 2.598" in note for note in found.notes), found.notes


def test_halves_of_meshes_of_any_kind():
    """Triangles that cross the plane are clipped; the answer is that of a mesh of the same size."""
    rng = np.random.default_rng(1)
    scene = punch(cells=6)

    def shaken(part: Part) -> Part:
        mesh = simplices(part.mesh)
        inner = np.setdiff1d(np.arange(mesh.p.shape[1]), np.unique(mesh.facets[:, mesh.boundary_facets()]))
        p = mesh.p.copy()
        p[:, inner] += 0.05 * rng.uniform(-1, 1, (2, len(inner)))
        return replace(part, mesh=replace(mesh, doflocs=p))

    whole = scene.with_parts(shaken)
    (half,) = halves(whole)
    assert "clipped" in half.why
    for part in (half.scene.upper, half.scene.lower):
        mesh = part.build_mesh(1, None)
        assert mesh.p[0].min() == pytest.approx(3.0, abs=1e-12)
        corners = mesh.p[:, mesh.t]
        area = np.abs(np.linalg.det(np.moveaxis(corners[:, 1:] - corners[:, :1], 2, 0))).sum() / 2
        assert area == pytest.approx({"block": 4.0, "ground": 12.0}[part.name], rel=1e-12)
    assert np.allclose(numbers(solve_scene(whole)), numbers(solve_scene(half.scene)), rtol=0.05)


def test_solids_are_clipped_without_gaps():
    whole = punch(3, cells=3).with_parts(lambda part: replace(part, mesh=simplices(part.mesh)))
    found = halves(whole)
    assert len(found) == 2
    for part, volume in ((found[-1].scene.upper, 4.0), (found[-1].scene.lower, 24.0)):
        mesh = part.build_mesh(1, None)
        corners = mesh.p[:, mesh.t]
        assert np.abs(np.linalg.det(np.moveaxis(corners[:, 1:] - corners[:, :1], 2, 0))).sum() / 6 == pytest.approx(
            volume, rel=1e-12
        )
        inner = skfem.MeshTet(mesh.p, mesh.t).boundary_facets()
        assert len(mesh.boundaries["symmetry x"]) and np.isin(mesh.boundaries["symmetry x"], inner).all()


def test_bodies_that_are_each_others_images():
    arch = scenes.arch(elements=4)
    (half,) = halves(arch)
    assert (
        len(half.scene.parts) == 5 and len(half.scene.pairs) == 4
    )  # four stones, of which one is cut, and one abutment
    one, other = solve_scene(arch, options=TIGHT), solve_scene(half.scene, options=TIGHT)
    assert numbers(one)[0] == pytest.approx(numbers(other)[0], rel=1e-8)
    forces = {pair.name: one.solution.reactions[pair.contacts, 0].sum() for pair in one.reduction.problem.pairs}
    for pair in other.reduction.problem.pairs:
        assert other.solution.reactions[pair.contacts, 0].sum() == pytest.approx(2 * forces[pair.name], rel=1e-8)


def test_a_contact_in_the_plane_is_told():
    found = simplify(scenes.arch(stones=6, elements=2), solve=False)
    assert not found.found and any("lies in this plane itself" in note for note in found.notes)


def prism(axis: int = 1, held: bool = True, push: float = 0.0) -> Scene:
    """The plane punch as a solid: its section is across the axis, whose ends are held on rollers."""
    plane = punch(force={"x": 1.0, "y": -10.0})
    components = "xyz"
    across = [components[other] for other in range(3) if other != axis]

    def solid(part: Part) -> Part:
        flat = part.mesh
        depth = np.linspace(0.0, 1.5, 3)
        mesh = skfem.MeshHex.init_tensor(*[np.unique(np.round(row, 12)) for row in flat.p], depth)
        p = np.empty_like(mesh.p)
        p[[other for other in range(3) if other != axis]], p[axis] = mesh.p[:2], mesh.p[2]
        sides = {name: flat.p[:, flat.facets[:, facets]].mean(axis=1) for name, facets in flat.boundaries.items()}
        made = replace(mesh, doflocs=p)
        middle = made.p[:, made.facets].mean(axis=1)
        section = np.delete(middle, axis, axis=0)

        def on(points: np.ndarray) -> np.ndarray:
            apart = np.abs(section[:, :, None] - points[:, None]).max(axis=0).min(axis=1)
            return np.flatnonzero((apart < 1e-9) & (np.abs(middle[axis] % 0.75 - 0.375) < 1e-9))

        ends = {end: np.flatnonzero(np.abs(middle[axis] - at) < 1e-9) for end, at in (("near", 0.0), ("far", 1.5))}
        made = made.with_boundaries({name: on(points) for name, points in sides.items()} | ends)
        rollers = tuple(Support(end, {components[axis]: 0.0}) for end in ends) if held else ()
        loads = tuple(replace(load, force=dict(zip(across, load.force.values()))) for load in part.loads)
        if push and loads:
            loads = (*loads, Traction("x+", tuple(push * (other == axis) for other in range(3))))
        supports = tuple(replace(each, displacement=None) for each in part.supports)
        return replace(part, mesh=made, supports=(*supports, *rollers), loads=loads)

    return replace(plane, kind="solid", upper=solid(plane.upper), lower=solid(plane.lower))


def test_a_solid_that_is_a_plate_between_rollers_is_in_plane_strain():
    solid, plane = prism(), punch(force={"x": 1.0, "y": -10.0})
    found = simplify(solid, solve=False)
    assert [each.name for each in found.found] == ["plane strain"] and found.scene.kind == "plane-strain"
    whole, section = (solve_scene(scene, options=TIGHT) for scene in (solid, found.scene))
    exact = solve_scene(replace(plane, thickness=1.5), options=TIGHT)
    assert np.allclose(numbers(section), numbers(exact), rtol=1e-8)
    assert np.allclose(numbers(whole), numbers(section), rtol=1e-8)


@pytest.mark.parametrize(
    "scene, reason", [(prism(held=False), "the ends of body"), (prism(push=1.0), "along the axis")]
)
def test_a_prism_that_is_not_in_plane_strain(scene, reason):
    found = simplify(scene, solve=False)
    assert "plane strain" not in [each.name for each in found.found]
    assert any(reason in note for note in found.notes), found.notes


def pillar(shift: float = 0.0, sides: int = 16) -> Scene:
    """A round pillar on a round floor, of hexahedra made by turning a section; `shift` moves the pillar off the axis."""

    def turned_about(radius: float, low: float, high: float, top: str, bottom: str, move: float) -> skfem.Mesh:
        angle = 2 * np.pi * np.arange(sides) / sides
        rings = [np.zeros((2, 1)), *(r * np.stack([np.cos(angle), np.sin(angle)]) for r in (radius / 2, radius))]
        flat = np.concatenate(rings, axis=1)
        first, after = 1 + np.arange(sides), 1 + np.roll(np.arange(sides), -1)
        inner = np.stack([np.zeros(sides, dtype=int), first, after])
        outer = np.concatenate(
            [np.stack([first, first + sides, after + sides]), np.stack([first, after + sides, after])], 1
        )
        cells = np.concatenate([inner, outer], axis=1)
        heights, m = np.linspace(low, high, 4), flat.shape[1]
        p = np.concatenate([np.concatenate([flat, np.full((1, m), z)]) for z in heights], axis=1)
        tets = []
        for layer in range(3):
            a, b, c = np.sort(cells, axis=0) + layer * m
            tets += [np.stack([a, b, c, c + m]), np.stack([a, b, b + m, c + m]), np.stack([a, a + m, b + m, c + m])]
        mesh = skfem.MeshTet(p + np.array([[move], [0.0], [0.0]]), np.concatenate(tets, axis=1))
        return mesh.with_boundaries({top: lambda x: np.isclose(x[2], high), bottom: lambda x: np.isclose(x[2], low)})

    upper = Part(
        "pillar", turned_about(1.0, 0.0, 2.0, "top", "contact", shift), SOFT, (), (Plate("top", {"z": -10.0}),)
    )
    lower = Part("floor", turned_about(2.0, -2.0, 0.0, "contact", "bottom", 0.0), STIFF, (Support("bottom"),))
    return Scene("pillar", upper, lower, 0.3, kind="solid")


def test_bodies_of_revolution_need_a_section_only():
    found = simplify(pillar(), solve=False)
    assert found.found[0].name == "axisymmetry" and found.scene.kind == "axisymmetric"
    assert {c for part in found.scene.parts for c in part.build_mesh(1, None).boundaries} >= {
        "top",
        "axis of revolution",
    }
    solid, section = (numbers(solve_scene(scene)) for scene in (pillar(), found.scene))
    assert section[2] == pytest.approx(10.0)
    assert np.allclose(solid[:2], section[:2], rtol=0.1)  # the solid has a polygon for a circle, of 97 % of its area
    assert not [each for each in simplify(pillar(0.05), solve=False).found if each.name == "axisymmetry"]


def test_blocks_that_stick_are_tied_and_the_assumption_is_checked():
    stack = scenes.stack(tilt=8.0, mu=0.3)
    found = simplify(stack)
    assert "tied contacts" in [each.name for each in found.found]
    ties = found["tied contacts"]
    assert ties.scene is not None and ties.check is not None and ties.after[1] < ties.before[1]
    one, other = (solve_scene(scene, options=TIGHT) for scene in (stack, ties.scene))
    assert np.allclose(numbers(one), numbers(other), rtol=1e-6)
    assert "as was assumed" in ties.check(other)
    slippery = simplify(scenes.stack(tilt=8.0, mu=0.16)).found
    assert not [each for each in slippery if each.name == "tied contacts"]


def test_ties_that_would_slip_are_told():
    steep = scenes.stack(tilt=8.0, mu=0.3)
    ties = simplify(steep)["tied contacts"]
    tilted = scenes.stack(tilt=20.0, mu=0.6)
    loads = {part.name: part.loads for part in tilted.parts if isinstance(part, Part)}
    other = ties.scene.with_parts(
        lambda part: replace(part, loads=loads[part.name]) if isinstance(part, Part) else part
    )
    other = replace(
        other, contacts=tuple(replace(pair, mu=0.6) if pair.law == "coulomb" else pair for pair in other.contacts)
    )
    assert "would slip" in ties.check(solve_scene(other))


def test_friction_that_does_nothing_is_left_out():
    found = simplify(scenes.press_fit(mu=0.4))
    assert found["frictionless contacts"].error < 1e-6
    assert "slide by at most" in found["frictionless contacts"].check(solve_scene(found["frictionless contacts"].scene))
    different = simplify(scenes.cylinder(mu=0.4, rigid="cylinder"))
    assert "frictionless contacts" not in [each.name for each in different.found]


@pytest.mark.parametrize("rigid", [None, "cylinder", "foundation"])
def test_half_spaces_instead_of_large_bodies(rigid):
    scene = scenes.cylinder(mu=0.0, elements=24, rigid=rigid)
    found = simplify(scene)["half-spaces"]
    exact = scene.reference.peak
    pressure = numbers(solve_scene(found.scene))[3]
    assert abs(pressure / exact - 1) < found.error + 2e-3
    assert found.after[0] < found.before[0]


def test_thin_bodies_are_no_half_spaces():
    found = simplify(scenes.cylinder(mu=0.0, foundation_height=7.0, elements=24))
    assert "half-spaces" not in [each.name for each in found.found]
    assert any("half-widths from the contact" in note for note in found.notes), found.notes


def test_a_report_reads_well_and_names_are_known():
    found = simplify(punch())
    assert "mirror symmetry" in repr(found) and "<table>" in found._repr_html_() and str(found).count("\n") > 3
    with pytest.raises(InputError, match="no simplification 'plane strain'; found were: mirror symmetry"):
        found["plane strain"]
    with pytest.raises(InputError, match="must be a Scene"):
        simplify("punch-2d")
    assert not simplify(scenes.hertz_half_space()).found
    with pytest.raises(InputError, match="no boundary named 'wall'"):
        simplify(punch(support=(Support("wall"),)))


def test_the_command_says_what_may_be_left_out_and_run_applies_it(tmp_path, capsys):
    assert cli.main(["simplify", "arch", "--set", "elements=2"]) == 0
    assert "needs no more than one half of the bodies" in capsys.readouterr().out
    run = ["run", "arch", "--elements", "2", "--no-figures", "--simplest", "--out", str(tmp_path / "half")]
    assert cli.main(run) == 0
    told = capsys.readouterr()
    assert "needs no more than one half" in told.err and "arch" in told.out


def test_a_load_path_is_not_simplified():
    with pytest.raises(InputError, match="load path"):
        contactopt.run("cattaneo-2d", simplest=True)


def test_rollers_at_a_contact_are_no_planes_of_symmetry():
    """A whole block between rollers: after a cut in x its walls would be taken for mirrors, and resultants halved."""
    scene = prism(held=False, axis=1)
    walls = scene.with_parts(
        lambda part: replace(part, supports=(*part.supports, Support("near", {"y": 0.0})), loads=part.loads)
    )
    straight = walls.with_parts(
        lambda part: replace(part, loads=tuple(replace(load, force={"x": 0.0, "z": -10.0}) for load in part.loads))
    )
    found = simplify(straight, solve=False)
    assert not found.found and any("is not cut" in note for note in found.notes)


def test_shear_goes_along_to_half_spaces():
    scene = scenes.cattaneo(2, elements=24)
    found = simplify(scene)["half-spaces"]
    whole, made = (solve_scene(each) for each in (scene, found.scene))
    totals = [np.abs(each.solution.reactions.sum(axis=0)) for each in (whole, made)]
    assert np.allclose(*totals, rtol=1e-3) and totals[0][1] > 0.1 * totals[0][0]
