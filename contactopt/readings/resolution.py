"""Whether the mesh resolves the contact, of which the certificate says nothing: remarks."""

import numpy as np

from contactopt.checks import place_words
from contactopt.coupling.reduction import Reduction
from contactopt.problem import Solution, part_of
from contactopt.problem.contact_status import contact_status
from contactopt.readings.peaks import Reading

# elements across the half-width of contact; with so few the largest pressure is some percent off
# (reports/accuracy)
FEWEST = 4
# of the median traction, between neighbours on a tie that is joined more than once: right forces on
# a few coarse seams jumped by about 0.3, and alternating ones by 2 and more
JUMP = 1.0


def remarks(reduction: Reduction, solution: Solution) -> tuple[str, ...]:
    """Sentences on couplings without constant pressure, jumping ties, and zones that are small."""
    coupled = tuple(text for made in reduction.couplings for text in made.remarks)
    if not solution.solved:
        return coupled
    few = [
        f"too few contacts of '{name}' touch, {len(own)} of {count}, to show how the pressure is"
        " distributed: refine the meshes there, or ask for an accuracy."
        for (name, count), own in coarse(reduction, solution)
    ]
    return (*coupled, *_jumps(reduction, solution), *few)


def _jumps(reduction: Reduction, solution: Solution) -> list[str]:
    """Sentences on ties whose forces jump by more than JUMP of the median traction."""
    if all(made.tight is None for made in reduction.couplings):
        return []
    problem, found = reduction.problem, []
    local = solution.reactions / problem.areas[:, None]
    tractions = np.einsum("kij,ki->kj", reduction.frames, local)
    usual = float(np.median(np.linalg.norm(tractions, axis=1)))
    for pair, made in zip(problem.pairs, reduction.couplings):
        if made.tight is None or not made.cells.size:
            continue
        own, cells = tractions[pair.contacts], made.cells
        sizes = np.linalg.norm(own[cells] - own[np.roll(cells, 1, axis=0)], axis=2)
        sizes[~made.tight[cells] & ~made.tight[np.roll(cells, 1, axis=0)]] = 0.0
        worst = np.unravel_index(np.argmax(sizes), sizes.shape)
        if sizes[worst] > JUMP * usual:
            where = place_words(made.positions[:, cells[worst]])
            found.append(
                f"the tractions of the tie '{pair.name}' jump by {sizes[worst]:.3g} near ({where}),"
                f" where others join its bodies too, and the median of all is {usual:.3g}: the tie"
                " has too few contacts for both, so that its pressures are not reliable there;"
                " refine the meshes along it."
            )
    return found


def coarse(reduction: Reduction, solution: Solution) -> list[tuple[tuple[str, int], np.ndarray]]:
    """Name, number of contacts and touching ones of pairs whose zone the mesh cannot show."""
    found = []
    for pair in reduction.problem.pairs:
        problem = part_of(reduction.problem, pair)
        r = solution.reactions[pair.contacts]
        touching = np.flatnonzero(contact_status(problem, r).touching)
        images = 2 ** int(np.sum(problem.chart.mirrored))
        strip = 2 * FEWEST if problem.dim == 2 else np.pi * FEWEST**2
        if 0 < len(touching) < problem.contacts and len(touching) * images < strip:
            found.append(((pair.name, problem.contacts), touching + pair.start))
    return found


def smoothed(peak: Reading, largest: float) -> list[str]:
    """One sentence where the largest pressure at a node is not the one that is read around it."""
    if abs(largest - peak.value) <= 0.05 * abs(largest):  # two readings agree
        return []
    return [
        f"the largest pressure at a node is {largest:.4g}, and its"
        f" neighbours suggest {peak.value:.4g}, give or take"
        f" {peak.uncertainty:.2g}: refine the meshes there, or ask for an accuracy."
    ]
