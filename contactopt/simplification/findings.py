"""What may be left out of a scene, as a report with the simplified scenes."""

from collections.abc import Callable
from dataclasses import dataclass, field

from contactopt.cards import card, count, line
from contactopt.errors import InputError
from contactopt.scenes.scene import Scene
from contactopt.simplification.constants import PROVED
from contactopt.simplification.proof import Fold
from contactopt.solving.solve_scene import Solved

PARTS = {2: "half", 4: "quarter", 8: "eighth"}


@dataclass(frozen=True, eq=False)
class Simplification:
    """Something that may be left out of a scene.

    name      'plane strain', 'mirror symmetry', 'tied contacts' or 'frictionless contacts'
    what      one sentence that says what is left out
    why       one or two sentences that say why, and how the error is known
    before, after   (unknowns, contacts that are not tied) of the scene that it is applied to, and
                    of the simplified one, counted from their meshes
    scene     the simplified scene
    folds     how the scene that it is applied to lies on the simplified one, where both have the
              same answer; else empty
    proof     certificate of the whole scene with the answer of the simplified one; None where it
              was not computed
    error     relative error of a simplification that is not exact
    check     function of the solved simplified scene that says in a sentence whether what was
              assumed holds; None where nothing was assumed
    """

    name: str
    what: str
    why: str
    before: tuple[int, int]
    after: tuple[int, int]
    scene: Scene = field(repr=False)
    folds: tuple[Fold, ...] = field(default=(), repr=False)
    proof: float | None = None
    error: float = 0.0
    check: Callable[[Solved], str] | None = field(default=None, repr=False)

    @property
    def exact(self) -> bool:
        """Whether the whole scene's certificate proves that both scenes have the same answer."""
        return self.proof is not None and self.proof <= PROVED

    @property
    def price(self) -> str:
        """The size that remains, and the error, in words."""
        if self.exact:
            error = f"no error: the certificate of the whole scene is {self.proof:.0e}"
        elif self.folds:
            error = "no error, but not proved"
        else:
            error = (
                f"error about {self.error:.1e}"
                if self.error > 1e-10  # a smaller change between two solutions is rounding
                else "no error on the coarse mesh"
            )
        (n, k), (m, c) = self.before, self.after
        return f"{n} -> {count(m, 'unknown')}, {k} -> {count(c, 'contact')}, {error}"

    def __repr__(self) -> str:
        return line("Simplification", self.name, self.price)


@dataclass(frozen=True, eq=False)
class Simplified:
    """What simplify() found.

    given    the scene that was asked about
    scene    the scene after all simplifications that are exact, one after the other; the given one
             if there are none. If nothing was solved, these are the simplifications that
             should be exact
    found    the simplifications; the exact ones come first, and each begins with the scene that the
             one before leaves. The others begin with `scene`
    notes    sentences about what would be a simplification, and what prevents it
    """

    given: Scene
    scene: Scene
    found: tuple[Simplification, ...]
    notes: tuple[str, ...]

    def __getitem__(self, name: str) -> Simplification:
        """The last simplification of that name, which contains those before it."""
        for each in reversed(self.found):
            if each.name == name:
                return each
        known = ", ".join(dict.fromkeys(each.name for each in self.found)) or "none"
        raise InputError(
            f"scene '{self.given.name}' has no simplification {name!r}; found were: {known}."
        )

    @property
    def needs(self) -> str:
        """One sentence: what is enough for this scene."""
        used = [each for each in self.found if each.folds]
        if not used:
            return (
                f"Scene '{self.given.name}' needs all of its"
                " model: nothing can be left out exactly."
            )
        (unknowns, contacts), first = used[-1].after, used[0].before
        doubt = "" if used[-1].exact else ", if the proof holds, which takes its solution"
        return (
            f"Scene '{self.given.name}' needs no more than {_model(self.given, self.scene)}{doubt}:"
            f" {count(unknowns, 'unknown')} instead of {first[0]}, {count(contacts, 'contact')}"
            f" instead of {first[1]}."
        )

    def __str__(self) -> str:
        lines = [self.needs]
        for each in self.found:
            lines += ["", f"{each.name}: {each.what}", f"  {each.why}", f"  {each.price}"]
        return "\n".join([*lines, *(["", *self.notes] if self.notes else [])])

    def __repr__(self) -> str:
        return line(
            "Simplified", self.given.name, *(f"{each.name} ({each.price})" for each in self.found)
        )

    def _repr_html_(self) -> str:
        rows: dict[str, object] = {}
        for number, each in enumerate(self.found, 1):
            rows[f"{number}. {each.name}"] = f"{each.what} {each.why} {each.price}."
        rows |= {f"note {number}": note for number, note in enumerate(self.notes, 1)}
        return card(self.needs, rows)


def _model(given: Scene, scene: Scene) -> str:
    """'one quarter of the bodies', 'one half of a section in plane strain'."""
    whole = "what is modelled" if given.copies > 1 else "the bodies"
    whole = whole if scene.kind == given.kind else "a section in plane strain"
    part = PARTS.get(scene.copies // given.copies)
    return f"one {part} of {whole}" if part else whole


Found = tuple[
    list[Simplification], list[str]
]  # what was found, and sentences on what prevents more
