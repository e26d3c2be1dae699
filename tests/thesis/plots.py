"""Pictures of the reproduced figures, as data URIs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from tireroad.runs.report.figures import CYCLE, canvas, encode, envelope, styled

Array = NDArray[np.floating]


@dataclass(frozen=True)
class Curve:
    """y over x; `dashes` and `marker` as in matplotlib, `colour` an index into the colour cycle."""

    x: Array
    y: Array
    colour: int = 0
    dashes: str = "-"
    marker: str = ""


@dataclass(frozen=True, kw_only=True)
class Panel:
    """Curves by name in the legend, which omits names beginning with "_". `scales` of x and y."""

    title: str = ""
    x: str
    y: str
    curves: Mapping[str, Curve]
    scales: tuple[str, str] = ("linear", "linear")
    limits: dict[str, tuple[float, float]] = field(default_factory=dict)


@styled
def lines(panels: Sequence[Panel], columns: int = 2) -> str:
    """Panels of curves, side by side."""
    columns = min(columns, len(panels))
    rows = -(-len(panels) // columns)
    figure, axes = canvas(4.6 * columns + 0.6, 3.2 * rows, rows, columns)
    for here, panel in zip(axes.flat, panels, strict=False):
        for name, curve in panel.curves.items():
            drawn = (curve.x, curve.y) if curve.marker else envelope(curve.x, curve.y)
            pen = {"ls": curve.dashes, "marker": curve.marker, "ms": 3}
            here.plot(*drawn, label=name, color=CYCLE[curve.colour % len(CYCLE)], **pen)
        here.set(title=panel.title, xlabel=panel.x, ylabel=panel.y, **panel.limits)
        here.set(xscale=panel.scales[0], yscale=panel.scales[1])
        if any(not name.startswith("_") for name in panel.curves):
            here.legend(fontsize=8)
    for here in axes.flat[len(panels) :]:
        here.axis("off")
    return encode(figure)
