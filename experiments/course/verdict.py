"""What is told about an answer."""

from __future__ import annotations

from dataclasses import dataclass
from math import floor, log10, trunc

TIE = 1e-6  # relative error of answers that are computed by an iteration, for which ties are missed
CLOSE = 1e-3  # relative error of numbers, and certificate of forces, that still counts as right


@dataclass(frozen=True)
class Verdict:
    """Whether an answer is right, the kind of its error, what to tell, and the worst contact."""

    right: bool
    kind: str
    sentence: str
    contact: int | None = None


RIGHT = Verdict(True, "right", "right.")
DIGITS = Verdict(False, "digits", "nearly right: the first digits are. Give three digits, rounded.")


def wrong(kind: str, sentence: str, contact: int | None = None) -> Verdict:
    return Verdict(False, kind, f"not right yet. {sentence}", contact)


def rounded(x: float, digits: int) -> float:
    """x with so many digits; half a unit, also if the computer has a little less, is rounded up."""
    return float(f"{x * (1 + TIE):.{digits}g}")


def shortened(x: float, digits: int) -> tuple[float, float]:
    """x with so many digits: rounded, and cut off."""
    size = 10.0 ** (digits - 1 - floor(log10(abs(x)))) if x else 1.0
    return rounded(x, digits), trunc(x * size) / size
