"""Siconos' text format of friction-contact problems: dense, sparse-block and sparse storage.

All numbers are separated by white space: dim, contacts, storage, rows, columns, the matrix, then q
(dim numbers per contact) and mu (one per contact). What follows is ignored.
"""

import re
from pathlib import Path

import numpy as np
import scipy.sparse as sp

from contactopt.cards import count as said
from contactopt.errors import InputError
from contactopt.linear.operators import Interface
from contactopt.problem import InterfaceProblem

DENSE, BLOCKS, SPARSE = range(3)  # storages


class _Numbers:
    """The words of a text, taken in turn as numbers; InputError if there are too few."""

    def __init__(self, words: list[str]):
        self.words, self.at = words, 0

    def floats(self, count: int) -> np.ndarray:
        if count < 0 or count > len(self.words) - self.at:
            left = len(self.words) - self.at
            raise InputError(f"it announces {said(count, 'number')} where the text has {left} more")
        self.at += count
        return np.array(self.words[self.at - count : self.at], dtype=float)

    def integers(self, count: int) -> np.ndarray:
        values = self.floats(count)
        if not np.all((values == np.rint(values)) & (np.abs(values) < 2**53)):
            raise InputError("it holds a size or an index that is not a whole number")
        return values.astype(np.int64)

    def integer(self) -> int:
        return int(self.integers(1)[0])


def read_text(path: Path) -> InterfaceProblem:
    """The problem in a text file of Siconos, in the units of the file, without a balance.

    InputError if the sizes or the storage that the file names do not exist or do not fit, and
    ValueError if what should be a number is none.
    """
    text = path.read_text(encoding="ascii", errors="replace")
    head = text.split(maxsplit=5)
    dim, contacts, storage, rows, columns = (_Numbers(head[:5]).integers(5)).tolist()
    if dim not in (2, 3):
        raise InputError(f"its dimension is {dim}, not 2 or 3")
    if contacts < 0 or rows != dim * contacts or columns != rows:
        raise InputError(
            f"its matrix is {rows} by {columns}, which does"
            f" not fit contacts, {contacts} of them, in {dim} dimensions"
        )
    rest = head[5] if len(head) > 5 else ""
    if storage == SPARSE:
        W, numbers = _listing(rest, rows)
    elif storage in (DENSE, BLOCKS):
        numbers = _Numbers(rest.split())
        W = _dense(numbers, rows) if storage == DENSE else _blocks(numbers, rows)
    else:
        raise InputError(f"its storage is {storage}, not 0, 1 or 2")
    q = numbers.floats(rows).reshape(contacts, dim)
    return InterfaceProblem(compact(W), q, numbers.floats(contacts))


def compact(W: Interface) -> Interface:
    """An array for a matrix of which more than a third of the entries are there; else as given."""
    full = sp.issparse(W) and 3 * W.nnz >= W.shape[0] * W.shape[1]
    return np.asarray(W.toarray()) if full else W


def _dense(numbers: _Numbers, n: int) -> np.ndarray:
    if numbers.integers(2).tolist() != [n, n]:
        raise InputError("the matrix has another size than announced")
    return numbers.floats(n * n).reshape(n, n).T


def _blocks(numbers: _Numbers, n: int) -> sp.csr_array:
    """Blocks of compressed rows: block ends, pointers, indices, then each with its entries."""
    count, *shape = numbers.integers(3).tolist()
    ends = [numbers.integers(size) for size in shape]
    for end in ends:
        if np.any(np.diff(end, prepend=0) < 0) or (end[-1] if len(end) else 0) != n:
            raise InputError("its block sizes do not add up to the size of the matrix")
    filled = numbers.integers(2).tolist()
    pointers, columns = numbers.integers(filled[0]), numbers.integers(filled[1])[:count]
    if len(columns) < count or np.any(np.diff(pointers) < 0) or len(pointers) > shape[0] + 1:
        raise InputError("its block rows are inconsistent")
    if len(pointers) == 0 or pointers[0] != 0 or pointers[-1] != count:
        raise InputError("its block rows do not hold the announced number of blocks")
    if np.any((columns < 0) | (columns >= shape[1])):
        raise InputError("a block lies outside the matrix")
    rows = np.repeat(np.arange(len(pointers) - 1), np.diff(pointers))
    tops, lefts = (np.concatenate([[0], end[:-1]]) for end in ends)
    heights, widths = np.diff(ends[0], prepend=0)[rows], np.diff(ends[1], prepend=0)[columns]
    sizes = heights * widths
    starts = np.arange(count) + np.cumsum(sizes) - sizes
    words = numbers.floats(int(sizes.sum()) + count)
    if not np.array_equal(words[starts], np.arange(count)):
        raise InputError("its blocks are not numbered in turn")
    values = np.delete(words, starts)
    inside = np.arange(len(values)) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    height = np.repeat(heights, sizes)
    i = np.repeat(tops[rows], sizes) + inside % height
    j = np.repeat(lefts[columns], sizes) + inside // height
    return sp.csr_array(sp.coo_array((values, (i, j)), shape=(n, n)))


def _listing(text: str, n: int) -> tuple[sp.csr_array, _Numbers]:
    """The listing that CSparse prints, by columns or as triplets, and the numbers after it."""
    lines = iter(text.splitlines())
    for line in lines:
        found = re.search(r"(\d+)-by-(\d+), nzmax: *(-?\d+),? nnz: *(-?\d+)", line)
        if found:
            break
    else:
        raise InputError("its sparse matrix has no header line")
    size, count = [int(found[1]), int(found[2])], int(found[4])
    if size != [n, n] or not 0 <= count <= len(text) // 4:
        raise InputError(
            f"its sparse matrix announces {size[0]} by {size[1]}"
            f" with {count} entries, which does not fit"
        )
    listed = "triplet" in line
    entries: list[tuple[int, int, float]] = []
    column = -1
    while len(entries) < count:
        words = next(lines, "end").replace(":", " ").split()
        if words[:1] == ["col"]:
            column = int(words[1])
        elif listed and len(words) == 3:
            entries.append((int(words[0]), int(words[1]), float(words[2])))
        elif not listed and len(words) == 2 and column >= 0:
            entries.append((int(words[0]), column, float(words[1])))
        elif words:
            raise InputError(
                "its sparse matrix has fewer entries than it announces, or a line that is none"
            )
    rest = list(lines)
    # empty columns at the end
    while rest and (rest[0].lstrip().startswith("col") or not rest[0].strip()):
        rest.pop(0)
    i, j, x = zip(*entries) if entries else ((), (), ())
    where = np.array(i, dtype=int), np.array(j, dtype=int)
    matrix = sp.coo_array((np.array(x, dtype=float), where), shape=(n, n))
    return sp.csr_array(matrix), _Numbers(" ".join(rest).split())
