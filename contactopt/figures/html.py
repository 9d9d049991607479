"""Pages that stand alone: one HTML file with its data and its program inside, which opens without
a network.

The data are stored compressed, at about a quarter of their size, and unpacked by the browser. They
are JSON; arrays are base64 of their bytes. Names in the data reach the page as text only, and the
page may load nothing from elsewhere.
"""

from __future__ import annotations

import base64
import gzip
import html
import json
from collections.abc import Iterable, Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import TYPE_CHECKING, Any

import numpy as np

from contactopt.files.writing import whole_file

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:"
)
KINDS = {"f": ("f4", "<f4"), "i": ("i4", "<i4"), "u": ("i4", "<i4"), "b": ("i4", "<i4")}


def packed(array: ArrayLike) -> dict[str, Any]:
    """Numbers or truth values for the data of a page, of four bytes each."""
    array = np.asarray(array)
    name, kind = KINDS[array.dtype.kind]
    return {"type": name, "shape": list(array.shape), "data": _text(array.astype(kind))}


def packed_short(array: np.ndarray) -> dict[str, Any]:
    """Numbers for the data of a page, of two bytes each: their range in 65535 steps."""
    low, high = float(array.min(initial=np.inf)), float(array.max(initial=-np.inf))
    step = (high - low) / 65535 if high > low else 1.0  # the largest number of two bytes
    text = _text(np.rint((array - low) / step).astype("<u2"))
    return {"type": "u2", "shape": list(array.shape), "low": low, "step": step, "data": text}


def _text(array: np.ndarray) -> str:
    return base64.b64encode(np.ascontiguousarray(array).tobytes()).decode()


def write_html(
    file: str | Path, title: str, body: str, data: Mapping[str, Any], programs: Sequence[str]
) -> Path:
    """Write a page that stands alone: title, `body` and programs of pages/ that read `data`."""
    texts = {name: _page_file(name) for name in ("page.css", "start.js", *programs)}
    encoded = _squeezed(json.dumps(data, allow_nan=False))
    parts = [
        '<!doctype html><html lang="en"><head><meta charset="utf-8">',
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>{html.escape(title)}</title><style>{texts['page.css']}</style></head><body>",
        body,
        f'<script type="text/plain" id="data">{encoded}</script>',
        f"<script>{texts['start.js']}\nstart(async () => {{\n"
        + "\n".join(texts[name] for name in programs)
        + "\n});</script>",
        "</body></html>\n",
    ]
    with whole_file(file) as beside:
        beside.write_text("".join(parts), encoding="utf-8")
    return Path(file)


def _squeezed(text: str) -> str:
    """A text, compressed, as text."""
    return base64.b64encode(gzip.compress(text.encode(), 9, mtime=0)).decode()


def filled(name: str, **texts: str) -> str:
    """Fill $NAME in a template of figures/pages with HTML."""
    return Template(_page_file(name)).substitute(texts)


def remark_list(remarks: Iterable[str]) -> str:
    """HTML of remarks, each folded to one line under its number."""
    return "".join(
        '<details class="remark"><summary>'
        f"<em>note {n}</em> {html.escape(text)}</summary></details>"
        for n, text in enumerate(remarks, 1)
    )


def _page_file(name: str) -> str:
    return files("contactopt.figures").joinpath("pages", name).read_text(encoding="utf-8")
