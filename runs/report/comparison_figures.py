"""Figures of several runs side by side, as data URIs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from numpy.typing import NDArray

from tireroad.runs.report.differences import Row
from tireroad.runs.report.figures import CYCLE, WIDE, canvas, encode, styled
from tireroad.runs.report.surface_figures import PRESSURE, frame
from tireroad.runs.report.thinned import envelope

Array = NDArray[np.float64]
DASHES = ("-", "--")


def pen(number: int) -> dict[str, str]:
    """Colour and dashes for the curve of run `number`."""
    return {"color": CYCLE[number % len(CYCLE)], "ls": DASHES[number // len(CYCLE) % 2]}


@styled
def levels(rows: Sequence[Row], names: Sequence[str]) -> str:
    """Third octaves of every run, and below them the difference from the first, dB."""
    values = np.array([[np.nan if v is None else v for v in row.values] for row in rows])
    figure, axes = canvas(WIDE, 5.0, 2, sharex=True, gridspec_kw={"height_ratios": (2, 1)})
    place = np.arange(len(rows))
    for number, name in enumerate(names):
        axes[0, 0].plot(place, values[:, number], marker="o", ms=3, label=name, **pen(number))
        if number:
            change = values[:, number] - values[:, 0]
            axes[1, 0].plot(place, change, marker="o", ms=3, **pen(number))
    axes[0, 0].set_ylabel(rows[0].unit)
    axes[0, 0].legend(ncols=2, loc="lower left", bbox_to_anchor=(0.0, 1.0), fontsize=8)
    axes[1, 0].axhline(0.0, color="#7b8794", lw=0.8)
    axes[1, 0].set(ylabel=f"less {names[0]}, dB", xlabel="third-octave band")
    axes[1, 0].set_xticks(place, [row.name for row in rows], rotation=45)
    return encode(figure)


@styled
def histories(runs: Mapping[str, tuple[Array, Array]]) -> str:
    """Forces (nt,) N over time (nt,) s."""
    figure, axes = canvas(WIDE, 3.0)
    for number, (name, (time, force)) in enumerate(runs.items()):
        axes[0, 0].plot(*envelope(time, force), lw=0.9, label=name, **pen(number))
    axes[0, 0].set(xlabel="time in s", ylabel="vertical contact force in N")
    axes[0, 0].legend(ncols=2, loc="lower left", bbox_to_anchor=(0.0, 1.0), fontsize=8)
    return encode(figure)


@styled
def footprints(runs: Mapping[str, tuple[Array, Array]]) -> str:
    """Pressure (c,) Pa at contact points (c, 3) m, on one colour scale."""
    columns = min(len(runs), 3)
    rows = -(-len(runs) // columns)
    figure, axes = canvas(WIDE, 2.6 * rows, rows, columns, sharex=True, sharey=True)
    top = 1e-3 * max(pressure.max() for _, pressure in runs.values())
    scale = Normalize(0.0, top)
    every = np.concatenate([points[pressure > 0, :2] for points, pressure in runs.values()])
    low, high = frame(1e3 * every)
    for here, (name, (points, pressure)) in zip(axes.flat, runs.items(), strict=False):
        touching = pressure > 0
        place = 1e3 * points[touching]
        here.scatter(
            place[:, 0], place[:, 1], s=14, c=1e-3 * pressure[touching], cmap=PRESSURE, norm=scale
        )
        here.set(aspect="equal", xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        here.set_title(name, fontsize=8)
        here.set_xlabel("x in mm")
    for here in axes.flat[len(runs) :]:
        here.axis("off")
    axes[0, 0].set_ylabel("y in mm")
    figure.colorbar(ScalarMappable(scale, PRESSURE), ax=axes, label="pressure in kPa", pad=0.01)
    return encode(figure, "png")
