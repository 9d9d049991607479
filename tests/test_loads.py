"""Loads: a pressure against Lame's solutions and on closed surfaces, and what each load answers."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from skfem import MeshHex, MeshQuad, MeshTet, MeshTri
from test_page import data_of, decoded

import contactopt
from contactopt import (
    BodyForce,
    InputError,
    Material,
    Part,
    Plate,
    Pressure,
    Rigid,
    Scene,
    Support,
    Traction,
)
from contactopt.bodies.body import build_body
from contactopt.figures.check_page import _normals, write_check_page
from contactopt.figures.scene_check import check_scene
from contactopt.holding.grown_load import load_rows
from contactopt.scenes.loads import Load
from contactopt.scenes.parameters import parameter
from contactopt.scenes.scene_files import read_scene_file
from contactopt.simplification.search import simplify
from tests.turned import mirror, ring, turn

STEEL = Material(E=210e3, nu=0.3)
IN, OUT, P = 10.0, 20.0, 3.0


def body(mesh, load, kind, supports=(), degree=1):
    """An assembled body under a load."""
    part = Part("b", mesh, STEEL, supports, load, contact="contact")
    scene = Scene("s", part, Rigid("r"), 0.0, kind=kind, degree=degree)
    return build_body(scene, part, 1, None)


def shaken(mesh, seed):
    """A mesh whose nodes are moved a little, with all of its surface named."""
    p = mesh.p + 0.05 * np.random.default_rng(seed).standard_normal(mesh.p.shape)
    mesh = replace(mesh, doflocs=p)
    return mesh.with_boundaries({"all": mesh.boundary_facets(), "contact": mesh.boundary_facets()})


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("base, kind", [
    (MeshTri().refined(2), "plane-strain"), (MeshQuad().refined(1), "plane-stress"),
    (MeshTet().refined(1), "solid"), (MeshHex(), "solid"),
])  # fmt: skip
def test_a_pressure_on_a_closed_surface_has_neither_force_nor_moment(base, kind, degree):
    """The integral of n, and of x times n, is zero on every closed surface."""
    own = body(shaken(base, 3), (Pressure("all", P),), kind, degree=degree)
    f, x = own.load[own.unknowns], own.locations
    size = np.abs(f).sum()
    assert np.abs(f.sum(axis=1)).max() < 1e-13 * size
    moment = np.cross(*(np.pad(a, ((0, 3 - len(a)), (0, 0))).T for a in (x, f))).sum(axis=0)
    assert np.abs(moment).max() < 1e-12 * size


def lame(r, radial):
    """The displacement of a hollow sphere, or of a cylinder in plane strain, under pressure P in
    the hole: Timoshenko, Goodier (1970), articles 28 and 136."""
    E, nu = STEEL.E, STEEL.nu
    if radial == 3:
        k = P * IN**3 / (OUT**3 - IN**3) / E
        return k * ((1 - 2 * nu) * r + (1 + nu) * OUT**3 / (2 * r**2))
    k = P * IN**2 / (OUT**2 - IN**2) * (1 + nu) / E
    return k * ((1 - 2 * nu) * r + OUT**2 / r)


@pytest.mark.parametrize("kind, radial", [("axisymmetric", 3), ("plane-strain", 2)])
def test_a_shell_under_inner_pressure_moves_as_lame_says(kind, radial):
    """A quarter of a ring is a quarter of a cylinder, or, revolved, half a hollow sphere."""
    errors = []
    for count in (8, 16):
        r, a = np.meshgrid(
            np.linspace(IN, OUT, count // 2 + 1), np.linspace(0, np.pi / 2, count + 1)
        )
        p = np.stack([r * np.cos(a), r * np.sin(a)]).reshape(2, -1)
        grid = MeshQuad.init_tensor(np.arange(count + 1.0), np.arange(count // 2 + 1.0))
        across, along = grid.p[1].astype(int), grid.p[0].astype(int)
        made = replace(grid, doflocs=p[:, along * (count // 2 + 1) + across])
        mesh = made.with_boundaries({
            "inside": lambda x: np.linalg.norm(x, axis=0) < IN * 1.001,
            "contact": lambda x: np.linalg.norm(x, axis=0) > OUT * 0.99,
            "left": lambda x: x[0] < 1e-9, "low": lambda x: x[1] < 1e-9,
        })  # fmt: skip
        axes = ("r", "z") if radial == 3 else ("x", "y")
        held = (Support("left", {axes[0]: 0.0}), Support("low", {axes[1]: 0.0}))
        own = body(mesh, (Pressure("inside", P),), kind, held, degree=2)
        U = np.zeros(len(own.load))
        A = own.A[own.free][:, own.free]
        U[own.free] = np.linalg.solve(A.toarray(), own.load[own.free])
        x = own.locations[:, : mesh.nvertices]
        u = np.linalg.norm(U[own.unknowns[:, : mesh.nvertices]], axis=0)
        exact = lame(np.linalg.norm(x, axis=0), radial)
        errors.append(np.abs(u - exact).max() / exact.max())
    assert errors[1] < 3e-3 and errors[1] < 0.27 * errors[0], errors


def test_a_pressure_on_a_flat_face_is_a_traction_and_turns_with_the_body():
    mesh = ring(IN, OUT, 3, 24).with_boundaries({"contact": lambda x: x[0] > 0})
    first = body(mesh, (Pressure("inside", P),), "plane-strain")
    for R in (turn(31.0), mirror(2)):
        moved = replace(mesh, doflocs=R @ mesh.p)
        other = body(moved, (Pressure("inside", P),), "plane-strain")
        assert np.allclose(other.load[other.unknowns], R @ first.load[first.unknowns], atol=1e-12)
    block = (
        MeshQuad()
        .refined(2)
        .with_boundaries({"contact": lambda x: x[1] < 1e-9, "top": lambda x: x[1] > 1 - 1e-9})
    )
    one, two = (
        body(block, (load,), "plane-strain")
        for load in (Pressure("top", P), Traction("top", (0.0, -P)))
    )
    assert np.allclose(one.load, two.load, rtol=0, atol=1e-14)


def block(load, elements=4):
    """A block on a rigid floor."""
    edges = {"low": lambda x: x[1] == 0, "top": lambda x: x[1] == 1,
             "x-": lambda x: x[0] == 0, "x+": lambda x: x[0] == 1}  # fmt: skip
    mesh = MeshQuad.init_tensor(*[np.linspace(0, 1, elements + 1)] * 2).with_boundaries(edges)
    part = Part("block", mesh, Material(5.0, 0.3), (), load, contact="low")
    return Scene("s", part, Rigid("floor"), 0.3)


def test_a_scene_under_pressure_is_solved_halved_and_differentiated():
    both = (Pressure("top", 1.0), Pressure("x-", 0.2), Pressure("x+", 0.2))
    scene = block(both)
    solved = contactopt.run(scene).solution
    assert solved.solved and abs(solved.reactions[:, 0].sum() - 1.0) < 1e-9
    assert simplify(scene).scene.copies == 2
    unequal = simplify(block((both[0], both[1], Pressure("x+", 0.2001))))
    assert unequal.scene.copies == 1 and "the pressure on 'x" in "".join(unequal.notes)
    own = parameter("pressure:block:top", scene)
    assert own.read(scene) == 1.0 and own.put(scene, 2.0).upper.loads[0] == Pressure("top", 2.0)
    with pytest.raises(InputError, match="pressure:BODY:BOUNDARY"):
        parameter("pressure:block:top:y", scene)


def test_a_file_gives_a_pressure_and_its_path(tmp_path):
    file = tmp_path / "scene.toml"
    file.write_text("""
    [bodies.block]
    block = { x = [0, 1], y = [0, 1], elements = [4, 4] }
    material = { E = 5, nu = 0.3 }
    contact = "y-"
    pressures = [{ boundary = "y+", pressure = [1.0, 2.0] }]
    [bodies.floor.rigid]
    [[contacts]]
    upper = "block"
    lower = "floor"
    mu = 0.3
    """)
    states = read_scene_file(file).states
    assert [state.bodies[0].loads for state in states] == [(Pressure("y+", p),) for p in (1.0, 2.0)]
    file.write_text(file.read_text().replace("pressure = [1.0, 2.0]", "value = 1"))
    with pytest.raises(InputError, match="line 6: a pressure needs its value"):
        read_scene_file(file)
    with pytest.raises(InputError, match="the pressure on 'top' of body 'block'"):
        block((Pressure("top", "much"),))


def test_a_free_body_under_a_pressure_that_balances_itself_is_not_told_to_slide():
    mesh = ring(IN, OUT, 3, 32).with_boundaries({"contact": lambda x: x[1] < 0})
    own = Part("ring", mesh, STEEL, (), (Pressure("inside", P),), contact="contact")
    low = MeshQuad.init_tensor(np.linspace(-30, 30, 21), np.linspace(-30, -OUT, 3))
    box = low.with_boundaries({"up": lambda x: x[1] > -20.01, "low": lambda x: x[1] < -29.9})
    lower = Part("box", box, STEEL, (Support("low"),), contact="up")
    problem = contactopt.reduce(Scene("s", own, lower, 0.3))
    assert not problem.s.any() and contactopt.solve(problem).solved


def test_arrows_of_check_are_normal_to_the_boundary():
    mesh = ring(IN, OUT, 3, 24)
    x, n = _normals(mesh, mesh.boundaries["inside"])
    assert np.all(np.sum(n * x, axis=0) < -0.98 * IN)


@dataclass(frozen=True)
class Spin(Load):
    """The centrifugal load of a body that turns around the last axis: a number without a direction
    inside the whole body, and another force at every place.
    """

    what, form, boundary = "spin", "spin:BODY", ""
    size: float  # density times the square of the speed [force / length^4]

    def values(self, components):
        return {"": self.size}

    def with_values(self, values):
        return replace(self, size=values[""])

    def check(self, body, kind):
        pass

    def density(self, x, n):
        force = self.size * np.asarray(x)
        force[-1] = 0.0
        return force


def test_a_load_inside_a_body_may_differ_from_place_to_place(tmp_path):
    """What check draws, what limit calls it, and its resultant; bounds and sections refuse it."""
    scene = block((BodyForce((0.0, -1.0)), Spin(4.0)))
    own = build_body(scene, scene.upper, 1, None)
    assert np.allclose(own.load[own.unknowns].sum(axis=1), (2.0, -1.0))  # the integral of 4 x
    shown = data_of(write_check_page(check_scene((scene,)), tmp_path / "check.html"))
    (arrow,) = (
        item["states"]["vector"] for item in shown["contacts"] if item["name"] == "block: spin"
    )
    assert np.allclose(decoded(arrow), [2.0, 0.0, 0.0])
    assert load_rows(scene) == {
        "block:body_force:x": (0.0, False), "block:body_force:y": (-1.0, False),
        "block:spin": (4.0, False),
    }  # fmt: skip


def test_a_glued_plate_says_what_it_holds():
    """In the directions without a force it is a support, which bears a part of other loads."""
    plate = Plate("end", {"x": 5.0})
    assert plate.words(("x", "y", "z")) == "plate on 'end': x = 5; glued, it holds y, z"
    assert replace(plate, glued=False).words(("x", "y")) == "plate on 'end': x = 5"
