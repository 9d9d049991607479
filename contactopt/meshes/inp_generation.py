"""Places of the nodes of input files, *SYSTEM, and nodes and elements that are made from others:
*NGEN, *NFILL, *NCOPY, *ELGEN and *ELCOPY. Each function is a method of contactopt.meshes.inp.Scope.

Source: Abaqus keywords reference manual.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import Rotation

from contactopt.defaults import EQUAL
from contactopt.errors import InputError
from contactopt.meshes.inp_text import Block, Later, Row, bare, set_of

if TYPE_CHECKING:
    from contactopt.meshes.inp import Scope


def motion(block: Block, rows: list[Row]) -> Callable[[np.ndarray], np.ndarray]:
    """The motion of places (n, 3) along the first row, then around the axis of the second."""
    values = [[block.real(line, word) for word in words] for line, words in rows]
    if len(values) > 2 or len((values or [[]])[0]) > 3 or (len(values) == 2 and len(values[1]) < 7):
        raise block.fail("a motion has three shifts, then two points and an angle")
    shift, centre, turn = np.zeros(3), np.zeros(3), Rotation.identity()
    if values:
        shift[: len(values[0])] = values[0]
    if len(values) > 1:
        centre, last = np.reshape(values[1][:6], (2, 3))
        length = np.linalg.norm(last - centre)
        if not length:
            raise block.fail("the two points of the axis are the same", rows[1][0])
        turn = Rotation.from_rotvec(np.radians(values[1][6]) * (last - centre) / length)
    return lambda x: np.asarray(turn.apply(x + shift - centre) + centre if len(x) else x)


def system(scope: Scope, block: Block) -> None:
    """Read the coordinates of nodes from now on in another system of coordinates."""
    values = [[block.real(line, word) for word in words] for line, words in block.rows]
    first, second = [*values, [], []][:2]
    if len(first) not in (0, 3, 6) or len(second) not in (0, 3) or len(values) > 2:
        raise block.fail("*SYSTEM needs three or six coordinates, and three more or none")
    origin, turn = np.array(first[:3] or [0.0] * 3), Rotation.identity()
    if len(first) == 6:
        x = np.array(first[3:]) - origin
        z = np.cross(x, np.array(second) - origin) if second else np.array([0.0, 0.0, 1.0])
        x = x if second else x * [1, 1, 0]
        if not np.any(x) or not np.any(z):
            raise block.fail("the axes of *SYSTEM have no direction")
        x, z = x / np.linalg.norm(x), z / np.linalg.norm(z)
        turn = Rotation.from_matrix(np.stack([x, np.cross(z, x), z], axis=1))
    scope.frame = origin, turn


def places(scope: Scope, block: Block, rows: list[list[float]]) -> np.ndarray:
    """Places (n, 3) from coordinates, which may be those of a cylinder, in the frame."""
    x = np.array(rows, dtype=float).reshape(-1, 3)
    kind = block.options.get("system", "R").upper()
    if kind == "C":
        angle = np.radians(x[:, 1])
        x[:, :2] = (x[:, 0] * [np.cos(angle), np.sin(angle)]).T
    elif kind not in ("R", "RC"):
        raise block.fail(f"coordinates of SYSTEM={kind} are not known here; write them as R")
    origin, turn = scope.frame
    return np.asarray(turn.apply(x) + origin if len(x) else x)


def _whole(block: Block, line: int, words: list[str], defaults: list[int | None]) -> list[int]:
    """Whole numbers of a row; those that are left out have defaults."""
    if len(words) > len(defaults):
        raise block.fail("it has too many numbers", line)
    given = [*words, *[""] * len(defaults)]
    if any(not word and usual is None for word, usual in zip(given, defaults)):
        raise block.fail("a number is missing", line)
    return [block.whole(line, word) if word else usual or 0 for word, usual in zip(given, defaults)]


def _node(scope: Scope, block: Block, line: int, tag: int) -> np.ndarray:
    if tag not in scope.nodes:
        raise block.fail(f"there is no node {tag}", line, Later)
    return np.array(scope.nodes[tag])


def _put(scope: Scope, block: Block, tags: list[int], places: np.ndarray, name: str) -> None:
    """Add nodes, to a set if it has a name."""
    if any(tag < 1 for tag in tags):
        raise block.fail("numbers of nodes begin with 1")
    scope.put(block, tags, places, name)


def ngen(scope: Scope, block: Block) -> None:
    """Nodes on a straight line or on an arc between two nodes."""
    line_of = block.options.get("line", "").upper()
    if line_of not in ("", "C"):
        raise block.fail(f"LINE={line_of} of *NGEN is not known here; write the nodes themselves")
    for line, words in block.rows:
        first, last, step = _whole(block, line, words[:3], [None, None, 1])
        a, b = (_node(scope, block, line, tag) for tag in (first, last))
        count = (last - first) // step if step else 0
        if count < 1 or first + count * step != last:
            raise block.fail("the step does not lead from the first to the last node", line)
        t = np.linspace(0.0, 1.0, count + 1)[:, None]
        tags = list(range(first, last + (1 if step > 0 else -1), step))
        places = a + t * (b - a) if not line_of else _arc(scope, block, line, words, (a, b, t))
        places[0], places[-1] = a, b
        _put(scope, block, tags, places, block.options.get("nset", ""))


def _arc(
    scope: Scope,
    block: Block,
    line: int,
    words: list[str],
    ends: tuple[np.ndarray, np.ndarray, np.ndarray],
) -> np.ndarray:
    """Places on the arc around a node or a place; a normal says which way if it is long."""
    a, b, t = ends
    values = [block.real(line, word) for word in (*words[4:], *[""] * 6)[:6]]
    if words[3:4] not in ([], [""]):
        centre = _node(scope, block, line, block.whole(line, words[3]))
    elif any(words[4:7]):
        centre = scope.places(block, [values[:3]])[0]
    else:
        raise block.fail("an arc needs its centre", line)
    normal = np.array(values[3:])
    sizes = np.linalg.norm(a - centre), np.linalg.norm(b - centre)
    across = np.cross(a - centre, b - centre)
    if not any(normal):
        normal = across
    if not min(sizes) or np.linalg.norm(normal) < EQUAL * sizes[0] * sizes[1]:
        raise block.fail("the ends and the centre of the arc lie on one line", line)
    normal = normal / np.linalg.norm(normal)
    angle = np.arctan2(across @ normal, (a - centre) @ (b - centre)) % (2 * np.pi)
    angle = 2 * np.pi if angle < EQUAL else angle
    turned = Rotation.from_rotvec(t * angle * normal).apply(a - centre)
    return np.asarray(centre + turned * (1 + t * (sizes[1] / sizes[0] - 1)))


def nfill(scope: Scope, block: Block) -> None:
    """Nodes on straight lines between the nodes of two sets."""
    for line, words in block.rows:
        if len(words) < 3:
            raise block.fail("*NFILL needs two sets and the number of intervals", line)
        count, step = _whole(block, line, words[2:], [None, 1])
        sides = [_in_order(scope, block, line, word) for word in words[:2]]
        if len(sides[0]) != len(sides[1]) or count < 1:
            raise block.fail("the two sets do not have as many nodes as each other", line)
        ends = [np.array([_node(scope, block, line, tag) for tag in own]) for own in sides]
        name = block.options.get("nset", "")
        for k in range(count + 1):
            tags = [tag + k * step for tag in sides[0]]
            tags = sides[1] if k == count else tags
            _put(scope, block, tags, ends[0] + k / count * (ends[1] - ends[0]), name)


def _in_order(scope: Scope, block: Block, line: int, word: str) -> list[int]:
    found = list(scope.numbers(word, "node_sets", block, line))
    return found if bare(word) in scope.unsorted else sorted(found)


def ncopy(scope: Scope, block: Block) -> None:
    """Copies of nodes, moved or reflected."""
    by = block.whole(block.place, block.need("changenumber"))
    old = list(scope.numbers(block.need("oldset"), "node_sets", block))
    if block.options.get("multiple", "1") != "1":
        raise block.fail("MULTIPLE of *NCOPY is not known here; write the nodes themselves")
    reflect = block.options.get("reflect", "").upper()
    if ("shift" in block.options) == bool(reflect):
        raise block.fail("*NCOPY needs either SHIFT or REFLECT=")
    x = np.array([_node(scope, block, block.place, tag) for tag in old]).reshape(-1, 3)
    if "shift" in block.options:
        places = motion(block, block.rows)(x)
    else:
        places = _reflected(block, reflect, x)
    _put(scope, block, [tag + by for tag in old], places, block.options.get("newset", ""))


def _reflected(block: Block, kind: str, x: np.ndarray) -> np.ndarray:
    """Places (n, 3) reflected at a plane through three points, a line through two, or a point."""
    values = [block.real(line, word) for line, words in block.rows for word in words]
    count = {"MIRROR": 3, "LINE": 2, "POINT": 1}.get(kind, 0)
    if not count or len(values) != 3 * count:
        known = "MIRROR (three points), LINE (two) or POINT (one)"
        raise block.fail(f"REFLECT={kind} must be {known}, with the coordinates of the points")
    a, *others = np.reshape(values, (count, 3))
    if kind == "POINT":
        return np.asarray(2 * a - x)
    along = np.cross(others[0] - a, others[1] - a) if kind == "MIRROR" else others[0] - a
    if not np.any(along):
        raise block.fail("the points of the reflection coincide or lie on one line")
    along = along / np.linalg.norm(along)
    off = np.outer((x - a) @ along, along)
    return np.asarray(x - 2 * off if kind == "MIRROR" else 2 * (a + off) - x)


def elgen(scope: Scope, block: Block) -> None:
    """Rows and layers of elements like one that is there."""
    while block.rows:
        line, words = block.rows[0]
        usual: list[int | None] = [None, 1, 1, 1, 1, 1, 1, 1, 1, 1]
        master, *steps = _whole(block, line, words, usual)
        where = [(b, i) for b, (_, _, ids, _) in enumerate(scope.blocks) for i in _at(ids, master)]
        if not where or any(count < 1 for count in steps[::3]):
            what = f"there is no element {master}" if not where else "a count is below 1"
            raise block.fail(what, line, InputError if where else Later)
        number, row = where[0]
        nodes, ids = scope.blocks[number][1][[row]], np.array([master])
        for count, by_nodes, by_ids in zip(steps[::3], steps[1::3], steps[2::3]):
            k = np.arange(count)
            nodes = (nodes[None] + (k * by_nodes)[:, None, None]).reshape(-1, nodes.shape[1])
            ids = (ids[None] + (k * by_ids)[:, None]).ravel()
        scope.append(scope.types[number], nodes[1:], ids[1:], [(block, line)] * (len(ids) - 1))
        if "elset" in block.options:
            set_of(scope.element_sets, block.need("elset")).update(dict.fromkeys(ids.tolist()))
        block.rows.pop(0)  # what is done is not done again


def _at(ids: np.ndarray, number: int) -> list[int]:
    return list(np.flatnonzero(ids == number))


def elcopy(scope: Scope, block: Block) -> None:
    """Copies of elements on other nodes."""
    by, nodes_by = (block.whole(block.place, block.need(o)) for o in ("elementshift", "shiftnodes"))
    old = np.fromiter(scope.there(block.need("oldset"), block), np.int64)
    for number, (_, nodes, ids, _) in enumerate(list(scope.blocks)):
        own = np.flatnonzero(np.isin(ids, old))
        if len(own):
            where = [(block, block.place)] * len(own)
            scope.append(scope.types[number], nodes[own] + nodes_by, ids[own] + by, where)
    if "newset" in block.options:
        made = set_of(scope.element_sets, block.need("newset"))
        made.update(dict.fromkeys((old + by).tolist()))
