"""The chapters as source notebooks of an nbgrader course, and with their solutions.

    python -m experiments.course.nbgrader FOLDER

writes FOLDER/CHAPTER/CHAPTER.ipynb; copy the chapters into the folder `source` of the course. The
cells carry the metadata of version 3 that nbgrader reads: a cell for the answer, whose solution
`nbgrader generate_assignment` removes, and a locked cell that grades it. An exercise is worth as
many points as its level. The machine that grades needs this repository on its PYTHONPATH.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

import jupytext

from experiments.course.grader import exercise

KERNEL = {"display_name": "Python 3", "language": "python", "name": "python3"}
CELL = re.compile(r'^(answer = .*?)  # (.*)\ncheck\("(\d\.\d+)", answer\)\n', re.M)
GRADED = """from experiments.course.grader import check, grade

check("{number}", answer)
verdict = grade("{number}", answer)
assert verdict.right, verdict.sentence"""


def solved(text: str) -> str:
    """A chapter with the solutions in place of the answers."""

    def answered(cell: re.Match) -> str:
        return f'{exercise(cell[3]).solution.strip()}\ncheck("{cell[3]}", answer)\n'

    return CELL.sub(answered, text)


def source_notebook(text: str) -> str:
    """A chapter as the source of an assignment."""
    book = jupytext.reads(text, "py:percent")
    book.metadata["kernelspec"] = KERNEL
    cells = []
    for cell in book.cells:
        cells.append(cell)
        found = CELL.match(cell.source + "\n") if cell.cell_type == "code" else None
        if not found:
            continue
        line, asks, number = found.groups()
        task, place = exercise(number), number.replace(".", "-")
        graded = cell.copy()
        # nbgrader puts `answer = ...` of the course's configuration in place of what it removes
        cell.source = (
            f"{line}  # {asks}\n### BEGIN SOLUTION\n{task.solution.strip()}\n### END SOLUTION"
        )
        cell.metadata = {"nbgrader": mark(f"answer-{place}", solution=True)}
        graded.source, graded["id"] = GRADED.format(number=number), f"grade-{place}"
        points = mark(f"grade-{place}", grade=True, locked=True) | {"points": task.level}
        graded.metadata = {"nbgrader": points}
        cells.append(graded)
    book.cells = cells
    return jupytext.writes(book, "ipynb")


def mark(place: str, *, grade: bool = False, solution: bool = False, locked: bool = False) -> dict:
    """The metadata of one cell."""
    kinds = {"grade": grade, "solution": solution, "locked": locked, "task": False}
    return {"schema_version": 3, "grade_id": place, **kinds}


def main(folder: str) -> None:
    for path in sorted(Path(__file__).parent.glob("chapter_*.py")):
        target = Path(folder, path.stem, f"{path.stem}.ipynb")
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(source_notebook(path.read_text()))
        print(target)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python -m experiments.course.nbgrader FOLDER")
    main(sys.argv[1])
