"""What may be left out of a scene: symmetries that are there are found."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import skfem
from turned import moved, turn

import contactopt
from contactopt import Material, Part, Plate, Rigid, Scene, Support, Traction, scenes, simplify
from contactopt.bodies import views
from contactopt.bodies.fields import Region
from contactopt.meshes.polar import ring
from contactopt.meshes.structured import rename, simplices, tensor_mesh
from contactopt.readings.plate_motions import approach
from contactopt.readings.quantities import elastic_energy
from contactopt.simplification import images
from contactopt.solving.solve_scene import Options, Solved, solve_scene

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
        box((4.0, 2.0), -3.0, 0.0, 4 * cells, cells),
        contact=f"{up}+",
        bottom=f"{up}-",
        left="x-",
        right="x+",
    )
    plate = Plate("top", force)
    under = np.all(
        np.abs(_middles(ground, "contact")[: dim - 1] - middle[:, None])
        < [[2.0], [1.0]][: dim - 1],
        axis=0,
    )
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
    own = approach(solved.reduction, solved.solution)
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
    pressure = {
        round(x, 9): p
        for x, p in zip(left.coordinates[0], one.solution.reactions[:, 0] / left.areas)
    }
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


@pytest.mark.parametrize("scene", [
    punch(support=(Support("bottom", {"y": 0.0}), Support("left", {"x": 0.1}),
     Support("right", {"x": -0.1}))),
    punch(loads=(Traction("x+", (0.1, 0.2)), Traction("x-", (-0.1, 0.2)))),
    punch(mu=lambda x: 0.3 + 0.1 * np.abs(x[0] - 3)),
], ids=["support", "traction", "friction"])  # fmt: skip
def test_pairs_of_images_keep_a_symmetry(scene):
    (half,) = halves(scene)
    one, other = solve_scene(scene, options=TIGHT), solve_scene(half.scene, options=TIGHT)
    assert np.allclose(numbers(one), numbers(other), rtol=1e-8)


def test_gaps_are_compared():
    block = punch().upper
    for gap, count in (
        (lambda x: 0.01 * (x[0] - 3) ** 2, 1),
        (lambda x: 0.01 * (x[0] - 2.9) ** 2, 0),
    ):
        assert len(halves(Scene("ball", block, Rigid("floor", (0.0, 1.0), gap), 0.2))) == count


def test_a_plane_across_no_axis_is_told():
    """Supports speak of the components of space, so that such a plane cannot hold a half."""
    found = simplify(moved(punch(), turn(30.0)), solve=False)
    assert not found.found, found.notes
    assert any("0.866 x + 0.5 y = 3; turn it" in note for note in found.notes), found.notes


def test_nothing_is_cut():
    """Meshes that are not their own images, or whose elements the plane crosses, stay whole."""
    rng = np.random.default_rng(1)

    def shaken(part: Part) -> Part:
        mesh = simplices(part.mesh)
        inner = np.setdiff1d(
            np.arange(mesh.p.shape[1]), np.unique(mesh.facets[:, mesh.boundary_facets()])
        )
        p = mesh.p.copy()
        p[:, inner] += 0.05 * rng.uniform(-1, 1, (2, len(inner)))
        return replace(part, mesh=replace(mesh, doflocs=p))

    assert not halves(punch(cells=6).with_parts(shaken))
    odd = tensor_mesh(np.linspace(-1, 1, 6), np.linspace(0, 1, 3))
    block = Part(
        "block",
        rename(odd, contact="y-", top="y+"),
        SOFT,
        loads=(Plate("top", {"x": 0.0, "y": -1.0}),),
    )
    found = simplify(Scene("odd", block, Rigid("floor"), 0.3), solve=False)
    assert not found.found and "runs through elements" in found.notes[0]


def tube(bore: float = 0.0, degrees: float = 0.0) -> Scene:
    """A tube under a plate: its bore so far off the middle, or all of it turned by so much."""
    made = ring(np.linspace(0.5, 1.0, 5), np.linspace(0, 2 * np.pi, 33) + np.deg2rad(degrees))
    flat = skfem.MeshQuad(made.p[:, : made.nvertices], made.t)
    off = np.array([[bore], [0.0]]) * (1 - np.linalg.norm(flat.p, axis=0)) * 2
    mesh = skfem.MeshQuad(flat.p + off, flat.t).with_boundaries(
        {
            "bore": lambda x: np.linalg.norm(x, axis=0) < 0.6,
            "contact": lambda x: (np.linalg.norm(x, axis=0) > 0.9) & (x[1] > 0.3),
        }
    )
    plate = Rigid("plate", (0.0, 1.0), lambda x: 1 - x[1], {"x": 0.0, "y": -0.1})
    return Scene("tube", plate, Part("tube", mesh, SOFT, (Support("bore"),)), 0.2)


def test_round_bodies_that_are_nearly_symmetric_stay_whole():
    assert len([each for each in simplify(tube()).found if each.exact]) == 1
    for scene in (tube(bore=0.0025), tube(bore=1e-6), tube(degrees=0.2)):
        found = simplify(scene)
        assert found.scene is scene and not any(each.exact for each in found.found)


def bumpy(height: float, wide: float = 0.01, mu: Callable | float = 0.2) -> Scene:
    """A rigid disc on the wide top of a block."""
    mesh = rename(
        tensor_mesh(np.linspace(-3, 3, 121), np.linspace(-3, 0, 4)), contact="y+", bottom="y-"
    )

    def gap(x: np.ndarray) -> np.ndarray:
        return x[0] ** 2 / 20 - height * np.exp(-(((x[0] - 1.234) / wide) ** 2))

    disc = Rigid("disc", (0.0, 1.0), gap, {"x": 0.0, "y": -1e-4})
    return Scene("bumpy", disc, Part("block", mesh, SOFT, (Support("bottom"),)), mu)


def test_asperities_and_patches_that_few_contacts_see_are_seen():
    assert simplify(bumpy(0.0)).found[0].exact
    slippery = bumpy(0.0, mu=lambda x: np.where(np.abs(x[0] - 0.075) < 0.01, 0.0, 0.2))
    for scene in (bumpy(0.2), bumpy(0.2, 5e-3), bumpy(1e-6), slippery):
        assert not [each for each in simplify(scene).found if each.exact], scene


@pytest.mark.parametrize(
    "scene",
    [
        bumpy(0.1, 0.05),
        punch(mu=lambda x: 0.02 + 0.3 * (x[0] > 3)),
        punch(force={"x": 1.0, "y": -10.0}),
    ],
    ids=["gap", "friction", "force"],
)
def test_the_whole_refuses_what_a_comparison_would_have_missed(scene, monkeypatch):
    """With blind comparisons the proof still finds every asymmetry."""
    monkeypatch.setattr(images, "equal_functions", lambda *a: True)
    if scene.name == "punch":

        def blind(self, part, image):
            loads = enumerate(getattr(part, "loads", ()))
            return {(part.name, i) for i, load in loads if isinstance(load, Plate)}

        monkeypatch.setattr(images._Comparison, "_plates", blind)
    found = simplify(scene)
    assert found.scene is scene and not [each for each in found.found if each.exact]
    assert any("does not solve it" in note for note in found.notes), found.notes
    result = contactopt.run(scene, simplest=True, figures=())
    assert result.scene.copies == 1 and result.solution.solved


def test_stress_at_the_plane_is_that_of_the_whole():
    """No shear is left across the plane of symmetry."""
    for degree in (1, 2):
        whole = replace(punch(), degree=degree)
        one, other = (
            solve_scene(scene, options=TIGHT)
            for scene in (whole, simplify(whole, solve=False).scene)
        )
        for number in range(2):
            fields, stresses = [], []
            for each in (one, other):
                body = each.reduction.bodies[number]
                U = each.reduction.displaced(each.solution)[number]
                made, recovered = views.fields(body, U), views.stress_map(body, Region())
                plane, there = (np.abs(x[0] - 3.0) < 1e-9 for x in (made.mesh.p, recovered.places))
                fields.append(made.stress[plane][np.argsort(made.mesh.p[1, plane])])
                stresses.append(recovered.stress(U)[there][np.argsort(recovered.places[1, there])])
            for left, right in (fields, stresses):
                assert np.allclose(left, right, atol=1e-9 * np.abs(left).max())
                assert np.abs(right[:, 3]).max() == 0.0


def test_bodies_that_are_each_others_images():
    arch = scenes.arch(elements=4)
    (half,) = halves(arch)
    assert (
        len(half.scene.parts) == 5 and len(half.scene.pairs) == 4
    )  # four stones, of which one is cut, and one abutment
    one, other = solve_scene(arch, options=TIGHT), solve_scene(half.scene, options=TIGHT)
    assert numbers(one)[0] == pytest.approx(numbers(other)[0], rel=1e-8)
    forces = {
        pair.name: one.solution.reactions[pair.contacts, 0].sum()
        for pair in one.reduction.problem.pairs
    }
    for pair in other.reduction.problem.pairs:
        assert other.solution.reactions[pair.contacts, 0].sum() == pytest.approx(
            2 * forces[pair.name], rel=1e-8
        )


def test_a_contact_in_the_plane_is_told():
    found = simplify(scenes.arch(stones=6, elements=2), solve=False)
    assert not found.found and any("lies in this plane itself" in note for note in found.notes)


def prism(axis: int = 1, held: bool = True, push: float = 0.0) -> Scene:
    """The plane punch as a solid: its section is across the axis, with rollers at both ends."""
    plane = punch(force={"x": 1.0, "y": -10.0})
    components = "xyz"
    across = [components[other] for other in range(3) if other != axis]

    def solid(part: Part) -> Part:
        flat = part.mesh
        depth = np.linspace(0.0, 1.5, 3)
        mesh = skfem.MeshHex.init_tensor(*[np.unique(np.round(row, 12)) for row in flat.p], depth)
        p = np.empty_like(mesh.p)
        p[[other for other in range(3) if other != axis]], p[axis] = mesh.p[:2], mesh.p[2]
        sides = {
            name: flat.p[:, flat.facets[:, facets]].mean(axis=1)
            for name, facets in flat.boundaries.items()
        }
        made = replace(mesh, doflocs=p)
        middle = made.p[:, made.facets].mean(axis=1)
        section = np.delete(middle, axis, axis=0)

        def on(points: np.ndarray) -> np.ndarray:
            apart = np.abs(section[:, :, None] - points[:, None]).max(axis=0).min(axis=1)
            return np.flatnonzero((apart < 1e-9) & (np.abs(middle[axis] % 0.75 - 0.375) < 1e-9))

        ends = {
            end: np.flatnonzero(np.abs(middle[axis] - at) < 1e-9)
            for end, at in (("near", 0.0), ("far", 1.5))
        }
        made = made.with_boundaries({name: on(points) for name, points in sides.items()} | ends)
        rollers = tuple(Support(end, {components[axis]: 0.0}) for end in ends) if held else ()
        loads = tuple(
            replace(load, force=dict(zip(across, load.force.values()))) for load in part.loads
        )
        if push and loads:
            loads = (*loads, Traction("x+", tuple(push * (other == axis) for other in range(3))))
        supports = tuple(replace(each, displacement=None) for each in part.supports)
        return replace(part, mesh=made, supports=(*supports, *rollers), loads=loads)

    return replace(plane, kind="solid", upper=solid(plane.upper), lower=solid(plane.lower))


def test_rollers_at_a_contact_are_no_planes_of_symmetry():
    """Walls would be taken for mirrors after a cut in x, and resultants halved."""
    scene = prism(held=False, axis=1)
    walls = scene.with_parts(
        lambda part: replace(
            part, supports=(*part.supports, Support("near", {"y": 0.0})), loads=part.loads
        )
    )
    straight = walls.with_parts(
        lambda part: replace(
            part, loads=tuple(replace(load, force={"x": 0.0, "z": -10.0}) for load in part.loads)
        )
    )
    found = simplify(straight, solve=False)
    assert not found.found and any("is not cut" in note for note in found.notes)
