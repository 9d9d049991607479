"""The search through all kinds of simplification, the exact ones first."""

from collections.abc import Iterator
from dataclasses import replace

from contactopt.errors import InputError
from contactopt.scenes.scene import Scene
from contactopt.simplification.constants import MOST, PROVED
from contactopt.simplification.findings import Found, Simplification, Simplified
from contactopt.simplification.joints import coarse, offered_joints
from contactopt.simplification.mirrors import mirrored
from contactopt.simplification.proof import certificate_of_whole
from contactopt.simplification.sections import section
from contactopt.simplification.whole import Whole, has_meshes, whole_of
from contactopt.solving.solve_scene import Options, Solved
from contactopt.solving.zone import solve_zone


def simplify(scene: Scene, solve: bool = True) -> Simplified:
    """Say what may be left out of a scene before it is solved, why, and with which error.

    Parameters
    ----------
    scene : Of elastic and rigid bodies. Scenes of half-spaces are returned as they are.
    solve : Whether to solve the part that stands for the scene, which proves that it does
        (contactopt.simplification.proof), and to solve the scene once on a coarse mesh, which shows
        contacts that neither open nor slip, and contacts whose friction hardly acts. Without it
        only symmetries are looked for, and nothing is called exact. A mesh that is given is not
        made coarser.

    Returns
    -------
    A report that prints as text, with the simplified scenes.

    Raises
    ------
    InputError : For something other than a scene, and for a scene that cannot be modelled.
    """
    if not isinstance(scene, Scene):
        raise InputError(f"the scene must be a Scene; got {type(scene).__name__}.")
    if not has_meshes(scene):
        told = "Bodies without a mesh have nothing that could be left out."
        return Simplified(scene, scene, (), (told,))
    if not solve:
        found, notes = next(_chains(whole_of(scene)))
        return Simplified(scene, found[-1].scene if found else scene, tuple(found), tuple(notes))
    made, part = proved_part(scene, Options())
    if part is None or not scene.given:
        part = coarse(made.scene)
    if not part.solution.solved:
        why = part.solution.message
        told = f"The scene was not solved on a coarse mesh ({why}); contacts were not looked at."
        return replace(made, notes=(*made.notes, told))
    return replace(made, found=(*made.found, *offered_joints(made.scene, part)))


def proved_part(scene: Scene, options: Options) -> tuple[Simplified, Solved | None]:
    """What all proved simplifications leave of a scene, solved on its own mesh, or None."""
    notes: list[str] = []
    chain: list[Simplification] = []
    part = None
    for found, told in _chains(whole_of(scene)) if has_meshes(scene) else ():
        chain, more, part = _proved(scene, found, options)
        notes += [note for note in (*told, *more) if note not in notes]
        if chain:
            break
    made = Simplified(scene, chain[-1].scene if chain else scene, tuple(chain), tuple(notes))
    for text in (made.needs, *notes):
        options.note(text)
    return made, part


def _chains(whole: Whole) -> Iterator[Found]:
    """Simplifications that follow each other, at first those of a section, if there is one."""
    for name, part in whole.parts.items():
        for support in part.supports:
            if support.boundary not in whole.meshes[name].boundaries:
                where = f"the support on '{support.boundary}' of body '{name}'"
                yield [], [f"Symmetries are not looked for, because {where} holds no face."]
                return
    found, notes = section(whole)
    if found:
        more, told = mirrored(whole_of(found[0].scene))
        yield [*found, *more], [*notes, *told]
    more, told = mirrored(whole)
    yield more, [*notes, *told]


def _proved(
    scene: Scene, chain: list[Simplification], options: Options
) -> tuple[list[Simplification], list[str], Solved | None]:
    """As much of a chain as the certificate of the whole proves, and its solution."""
    notes: list[str] = []
    unknowns = chain[0].before[0] if chain else 0
    while chain:
        last = chain[-1]
        part = solve_zone(last.scene, options=options)
        if unknowns > MOST:
            text = (
                f"The whole has {unknowns} unknowns, too many to be assembled: that the part stands"
                " for it is not proved."
            )
            return chain, [*notes, text], part
        why = f"the part was not solved ({part.solution.message})"
        if part.solution.solved:
            zone = part.zones[-2] if part.zones else scene.zone
            folds = [fold for each in chain for fold in each.folds]
            value = certificate_of_whole(scene, last.scene.elements, zone, part, folds)
            if value <= PROVED:
                return [replace(each, proof=value) for each in chain], notes, part
            why = f"what follows for the whole does not solve it (its certificate is {value:.1e})"
        notes.append(f"{last.what} This looked exact, but {why}; so it is left out.")
        chain = chain[:-1]
    return [], notes, None
