"""What may be left out of a scene before it is solved, what does that save, and which errors does
it make?
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

from experiments.questions.simplest import nearly
from experiments.report import markdown, measure, template

# random scenes; the first argument may be another number, for a quick look at them alone
COUNT = 500
PARTS: dict[str, Callable[[], list[dict[str, Any]]]] = {
    "nearly": lambda: nearly.table(nearly.rows(COUNT)),
    "prices": nearly.prices,
}

if __name__ == "__main__":
    if sys.argv[1:] and sys.argv[1].isdigit():  # so many scenes, for a quick look
        print(markdown(nearly.table(nearly.rows(int(sys.argv[1])))))
    else:
        measure("simplest", "The cheapest model first", template(__file__), PARTS)
