"""The search through all kinds of simplification, the exact ones first."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from contactopt.analysis.solve_scene import Options, Solved
from contactopt.analysis.zone import solve_zone
from contactopt.errors import InputError
from contactopt.scenes.scene import Scene
from contactopt.simplification import joints, large_bodies
from contactopt.simplification.constants import MOST, PROVED, SHARE, WORST
from contactopt.simplification.findings import Simplification, Simplified
from contactopt.simplification.mirrors import mirrored
from contactopt.simplification.proof import certificate_of_whole
from contactopt.simplification.solids import section
from contactopt.simplification.whole import sizes_of, whole_of

Found = tuple[list[Simplification], list[str]]


def simplify(scene: Scene, solve: bool = True) -> Simplified:
    """Say what may be left out of a scene before it is solved, why, and with which error.

    Parameters
    ----------
    scene
        Of elastic and rigid bodies. Scenes of half-spaces are returned as they are.
    solve
        Whether to solve the part that stands for the scene, which proves that it does (contactopt.simplification.proof), and
        to solve the scene once on a coarse mesh, which shows contacts that neither open nor slip, contacts whose
        friction hardly acts, and contacts that are small beside their bodies. Without it only symmetries are looked for,
        and nothing is called exact. A mesh that is given is not made coarser.

    Returns
    -------
    Simplified
        A report that prints as text, with the simplified scenes.

    Raises
    ------
    InputError
        For something else than a scene, and for a scene that cannot be modelled.
    """
    found, notes, part = _exact(scene, Options() if solve else None)
    if whole_of(scene) is None:
        return Simplified(scene, scene, (), ("Half-spaces have no mesh, and nothing that could be left out.",))
    left = [each.scene for each in found if each.folds and each.scene is not None]
    rest = left[-1] if left else scene
    if solve:
        offers = [each if each.folds else _measured(scene, each) for each in found]
        more, told = _solved(rest, part)
        found, notes = [*offers, *more], [*notes, *told]
    return Simplified(scene, rest, tuple(found), tuple(notes))


def proved_part(scene: Scene, options: Options) -> tuple[Simplified, Solved | None]:
    """What is left of a scene after all simplifications that are proved to be exact, and its solution.

    Parameters
    ----------
    scene
        What to solve.
    options
        How to solve it; its `note` is told what was found.

    Returns
    -------
    tuple
        The report, whose `scene` is the given one where nothing was proved, and the solution of that part on its own mesh;
        None in place of it where nothing was proved.

    Raises
    ------
    InputError
        As simplify().
    """
    found, notes, part = _exact(scene, options)
    used = [each for each in found if each.folds]
    rest = used[-1].scene if used else None
    made = Simplified(scene, rest or scene, tuple(used), tuple(notes))
    for text in (made.needs, *notes):
        options.note(text)
    return made, part


def _exact(scene: Scene, options: Options | None) -> tuple[list[Simplification], list[str], Solved | None]:
    """Symmetries and sections, proved where there are options to solve with, and the solution of the last part."""
    if not isinstance(scene, Scene):
        raise InputError(f"the scene must be a Scene; got {type(scene).__name__}.")
    notes: list[str] = []
    offers: list[Simplification] = []
    for found, told in _chains(scene):
        offers += [each for each in found if not each.folds and each.name not in [offer.name for offer in offers]]
        chain = [each for each in found if each.folds]
        notes += [note for note in told if note not in notes]
        if not chain:
            continue
        if options is None:
            return [*chain, *offers], notes, None
        chain, told, part = _proved(scene, chain, options)
        notes += told
        if chain:
            return [*chain, *offers], notes, part
    return offers, notes, None


def _chains(scene: Scene) -> Iterator[Found]:
    """Simplifications that follow each other: those of a section of the bodies, and those of the bodies themselves."""
    whole = whole_of(scene)
    if whole is None:
        return
    found, notes = section(whole)
    if found and found[0].folds and found[0].scene is not None:
        flat = whole_of(found[0].scene)
        assert flat is not None
        more, told = mirrored(flat)
        yield [*found, *more], [*notes, *told]
        found, notes = [], []
    more, told = mirrored(whole)
    yield [*found, *more], [*notes, *told]


def _proved(
    scene: Scene, chain: list[Simplification], options: Options
) -> tuple[list[Simplification], list[str], Solved | None]:
    """As much of a chain as is proved by the certificate of the whole, and the solution of what is left."""
    notes: list[str] = []
    unknowns = sizes_of(scene)[0]
    while chain:
        last = chain[-1]
        assert last.scene is not None
        part = solve_zone(last.scene, options=options)
        if unknowns > MOST:
            text = f"The whole has {unknowns} unknowns, too many to be assembled: that the part stands for it is not proved."
            return chain, [*notes, text], part
        if part.solution.solved:
            zone = part.zones[-2] if part.zones else scene.zone
            folds = [fold for each in chain for fold in each.folds]
            value = certificate_of_whole(scene, last.scene.elements, zone, part, folds)
            if value <= PROVED:
                return [replace(each, proof=value) for each in chain], notes, part
            why = f"what follows for the whole does not solve it (its certificate is {value:.1e})"
        else:
            why = f"the part was not solved ({part.solution.message})"
        notes.append(f"{last.what} This looked exact, but {why}; so it is left out.")
        chain = chain[:-1]
    return [], notes, None


def _measured(scene: Scene, each: Simplification) -> Simplification:
    """A section with the error that it makes on these meshes."""
    if each.scene is None:
        return each
    whole, part = (joints.coarse(made) for made in (scene, each.scene))
    solved = whole.solution.solved and part.solution.solved
    return replace(each, error=joints.change(whole, part) if solved else None)


def _solved(scene: Scene, known: Solved | None) -> Found:
    """What one solve on a coarse mesh shows; a mesh that is given was solved for the proof."""
    solved = known if known is not None and scene.given else joints.coarse(scene)
    if not solved.solution.solved:
        return [], [
            f"The scene was not solved on a coarse mesh ({solved.solution.message}); contacts were not looked at."
        ]
    before = sizes_of(scene)
    found = [*_joints(scene, solved, before)]
    if scene.kind == "axisymmetric":
        return found, []  # a section costs less than the square of points of a half-space
    spot = large_bodies.spot_of(solved)
    if isinstance(spot, str):
        return found, [f"Half-spaces are no model of this scene: {spot}."] if len(scene.pairs) == 1 else []
    if spot.error > WORST:
        size = f"{spot.size / spot.half_width:.3g} half-widths"
        return found, [
            f"Half-spaces would make an error of about {spot.error:.0%} in the peak pressure: the bodies end {size} from the contact."
        ]
    made = large_bodies.as_half_spaces(scene, spot)
    why = (
        f"The bodies end no nearer than {spot.size / spot.half_width:.3g} half-widths from the contact, and the gap rises by at most "
        f"{spot.slope:.2g} per length inside it. The error is that of the peak pressure and the half-width; the approach is "
        "another one, because it depends on the whole bodies."
    )
    what = "Half-spaces without a mesh stand for the bodies; their frame is the contact's own."
    offer = Simplification("half-spaces", what, why, before, sizes_of(made), made, error=spot.error)
    return [*found, offer], []


def _joints(scene: Scene, solved: Solved, before: tuple[int, int]) -> list[Simplification]:
    tied, smooth = joints.joints(solved)
    if len(tied) == len(scene.pairs) == 1:
        tied = ()
    found = []
    friction: dict[str, Any] = {pair.name: pair.mu for pair in scene.pairs}
    for names, law, name in ((tied, "tied", "tied contacts"), (smooth, "frictionless", "frictionless contacts")):
        if not names:
            continue
        made = joints.with_law(scene, names, law)
        other = joints.coarse(made)
        if not other.solution.solved:
            continue
        error = joints.change(solved, other)
        listed = ", ".join(f"'{each}'" for each in names)
        if law == "tied":
            what = f"The {'contact' if len(names) == 1 else 'contacts'} {listed} can be tied."
            why = f"On a coarse mesh they stay closed and use no more than {SHARE:.0%} of their friction bound at any node."
            check = joints.verdict_on_ties(names, friction)
        else:
            what = f"Friction can be left out at the {'contact' if len(names) == 1 else 'contacts'} {listed}."
            why = "On a coarse mesh no tangential traction is more than a hundredth of the largest pressure."
            check = joints.verdict_on_smooth(names)
        why += " The error is the largest change of energy, contact forces and largest pressures on that mesh."
        found.append(Simplification(name, what, why, before, sizes_of(made), made, error=error, check=check))
    return found
