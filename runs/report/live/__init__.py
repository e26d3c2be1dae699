"""Interactive charts and shapes in place of still figures, if scripts are enabled.

The scripts are charts.js and shapes.js beside this file, and uPlot 1.6.32 (uplot/, MIT), all
embedded in the page, which loads nothing from outside. Without scripts, and in print, the still
figure is shown.
"""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

_HERE = Path(__file__).parent
MOST = 10_000  # values of a curve; longer ones keep minimum and maximum of each block of values
_STEPS = 127  # full scale of a coordinate as a signed byte


def script() -> str:
    """All scripts as text."""
    names = "uplot/uPlot.iife.min.js", "charts.js", "shapes.js"
    return "\n".join((_HERE / name).read_text(encoding="utf-8") for name in names)


def style() -> str:
    """uPlot's style sheet as text."""
    return (_HERE / "uplot/uPlot.min.css").read_text(encoding="utf-8")


def packed(values: Any, kind: str) -> dict[str, str]:
    """An array for the scripts: little-endian numbers of numpy type `kind`, in base 64."""
    flat = np.ascontiguousarray(values, dtype=np.dtype(kind).newbyteorder("<"))
    return {"kind": kind, "data": b64encode(flat.tobytes()).decode()}


def thinned(x: NDArray, columns: NDArray) -> tuple[NDArray, NDArray]:
    """x (n,) and columns (n, k) in at most MOST rows: minimum, then maximum, of each block."""
    width = -(-len(x) // (MOST // 2))
    if len(x) <= MOST:
        return x, columns
    count = len(x) // width
    blocks = np.nan_to_num(columns[: count * width]).reshape(count, width, -1)
    ends = np.stack((blocks.min(axis=1), blocks.max(axis=1)), axis=1)
    starts = x[: count * width : width]
    middles = x[width // 2 : count * width : width]
    return np.column_stack((starts, middles)).ravel(), ends.reshape(2 * count, -1)


def chart(
    x: NDArray,
    curves: Mapping[str, NDArray],
    labels: tuple[str, str],
    colours: Sequence[str],
    *,
    log: bool = False,
    dashed: Sequence[str] = (),
    legend: bool = True,
    height: int = 240,
) -> dict[str, Any]:
    """Curves (n,) by name over x (n,), for charts.js; `labels` of both axes with units.

    Without `legend`, for many curves, the one under the pointer is named. Non-finite values are
    gaps.
    """
    place, values = thinned(np.asarray(x, float), np.column_stack(list(curves.values())))
    series = [
        {
            "name": name,
            "colour": colours[number % len(colours)],
            "dashed": name in dashed,
            "y": packed(values[:, number], "f4"),
        }
        for number, name in enumerate(curves)
    ]
    return {
        "x": packed(place, "f4"),
        "series": series,
        "labels": labels,
        "log": log,
        "legend": legend,
        "height": height,
    }


def charts(*one: dict[str, Any]) -> dict[str, Any]:
    """Charts one below the other, with a common pointer."""
    return {"kind": "charts", "charts": list(one)}


def bars(
    names: Sequence[str],
    series: Mapping[str, tuple[NDArray, NDArray | None]],
    labels: tuple[str, str],
    colours: Sequence[str],
    *,
    ends: tuple[float, float],
    few: NDArray,
    chance: NDArray | None = None,
    height: int = 300,
) -> dict[str, Any]:
    """Bars by name, each (values (n,), errors (n,) or None), side by side over named places (n,).

    From ends[0] to at least ends[1]; pale where `few` (n,); boxes for bounds (n, 2) of all by `chance`.
    Non-finite values have no bar.
    """
    drawn = [
        {
            "name": name,
            "colour": colour,
            "y": packed(values, "f4"),
            "error": None if errors is None else packed(errors, "f4"),
        }
        for (name, (values, errors)), colour in zip(series.items(), colours, strict=True)
    ]
    return {
        "kind": "bars",
        "names": list(names),
        "series": drawn,
        "labels": labels,
        "floor": float(ends[0]),
        "top": float(ends[1]),
        "few": [bool(one) for one in few],
        "chance": None if chance is None else [packed(bound, "f4") for bound in chance.T],
        "height": height,
    }


def shapes(
    points: NDArray, quads: NDArray, normal: NDArray, moved: NDArray, titles: Sequence[str]
) -> dict[str, Any]:
    """Shapes (m, s, 3) on points (s, 3) with quads (q, 4) and unit normals (s, 3), for 3D view.

    Coordinates as 16-bit shares of the largest one; displacements as signed bytes, each shape's
    largest being full scale.
    """
    reach = np.abs(points).max()
    greatest = np.maximum(np.linalg.norm(moved, axis=2).max(axis=1), 1e-300)
    return {
        "kind": "shapes",
        "points": packed(np.rint(32767 * points / reach), "i2"),
        "quads": packed(quads, "u4"),
        "shapes": packed(np.rint(_STEPS * moved / greatest[:, None, None]), "i1"),
        "across": packed(
            np.rint(_STEPS * np.einsum("msi,si->ms", moved, normal) / greatest[:, None]), "i1"
        ),
        "titles": list(titles),
    }


def footprint(
    points: NDArray,
    half: NDArray,
    time: NDArray,
    values: NDArray,
    label: str,
    top: float,
    begin: int,
) -> dict[str, Any]:
    """Animation of values (n, c) at points (c, 3) m, squares of half sizes (2,) m, over time, s.

    The colours end at `top`; it opens at the instant `begin`.
    """
    touched = (values > 0).any(axis=0)
    near = touched if touched.any() else np.ones(len(points), bool)
    return {
        "kind": "footprint",
        "points": packed(1e3 * points[near, :2], "f4"),
        "half": [1e3 * float(size) for size in half],
        "time": packed(time, "f4"),
        "values": packed(np.rint(255 * np.clip(np.nan_to_num(values[:, near]) / top, 0, 1)), "u1"),
        "top": top,
        "begin": begin,
        "label": label,
    }
