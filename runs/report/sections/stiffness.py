"""Report section about load, deflection and stiffness of the non-rolling tire (stiffness.h5)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from tireroad.runs.report.figures import COLOURS, MUTED, canvas, encode, styled
from tireroad.runs.report.read import Results, Section, TextTable, quantity

_FILE = "stiffness.h5"
_FACTS = (
    ("vertical", "vertical stiffness, slope of the curve", "N/m"),
    ("longitudinal", "longitudinal stiffness", "N/m"),
    ("lateral", "lateral stiffness", "N/m"),
    ("torsional", "torsional stiffness about the vertical", "N m/rad"),
)
_COLUMNS = (
    ("deflection", 1e3, "deflection, mm"),
    ("load", 1.0, "load, N"),
    ("stiffness", 1e-3, "slope, N/mm"),
    ("footprint_length", 1e3, "length, mm"),
    ("footprint_width", 1e3, "width, mm"),
    ("footprint_area", 1e4, "area, cm²"),
    ("pressure", 1e-3, "mean pressure, kPa"),
    ("rolling_radius", 1e3, "rolling radius, mm"),
)


def section(results: Results) -> Section:
    """The section: curve, table and stiffnesses."""
    made = Section(
        "Load, deflection and stiffness",
        "The standing tire pressed on a flat road, its rim held. Horizontally and about the vertical: "
        "the footprint sticks to a road that moves a little, at constant load.",
    )
    load = float(results.array(_FILE, "load"))
    made.facts.append(("at a load of", quantity(load, "N")))
    for name, title, unit in _FACTS:
        value = results.optional(_FILE, name)
        if value is not None:
            made.facts.append((title, quantity(float(value), unit)))
    columns = [scale * results.array(_FILE, f"curve/{name}") for name, scale, _ in _COLUMNS]
    head = tuple(title for *_, title in _COLUMNS)
    made.table = TextTable(head, [tuple(f"{v:.4g}" for v in row) for row in np.transpose(columns)])
    picture = curve(columns[0], columns[1], columns[5], load)
    made.show(picture, "Load and contact area over deflection; dashed: the scene's load.")
    _slides(results, made)
    return made


def _slides(results: Results, made: Section) -> None:
    """Add force over road displacement or slip, for a tire with friction."""
    rolls = results.attribute("static.h5", "travel") is not None
    curves = {}
    for name in ("longitudinal", "lateral"):
        moved = results.optional(_FILE, f"slide/{name}/moved")
        if moved is not None:
            curves[name] = (
                (1.0 if rolls else 1e3) * moved,
                results.array(_FILE, f"slide/{name}/force"),
            )
    if not curves:
        return
    for name, (_, force) in curves.items():
        made.facts.append((f"largest {name} force", quantity(float(force.max()), "N")))
    made.show(
        slid(curves, "slip of the wheel" if rolls else "way of the road, mm"),
        "Force along and across the road with friction, "
        + (
            "of the rolling wheel over its slip."
            if rolls
            else "over the way that the road is moved under the standing tire."
        ),
    )


@styled
def slid(curves: Mapping[str, tuple[NDArray, NDArray]], label: str) -> str:
    """Figure of force (n) N over displacement or slip (n), by name."""
    figure, axes = canvas(6.2, 3.0)
    here, start = axes[0, 0], np.zeros(1)
    for colour, (name, (moved, force)) in zip(COLOURS, curves.items(), strict=False):
        x, y = (np.concatenate([start, part]) for part in (moved, force))
        here.plot(x, y, "o-", ms=3, color=colour, label=name)
    here.set_xlabel(label)
    here.set_ylabel("force, N")
    here.legend(loc="lower right")
    return encode(figure)


@styled
def curve(deflection: NDArray, load: NDArray, area: NDArray, own: float) -> str:
    """Figure of load (n) N and contact area (n) cm2 over deflection (n) mm."""
    figure, axes = canvas(6.2, 3.0)
    here, other = axes[0, 0], axes[0, 0].twinx()
    start = np.zeros(1)
    x = np.concatenate([start, deflection])
    here.plot(x, np.concatenate([start, load]), "o-", ms=3, color=COLOURS[0], label="load")
    here.axhline(own, color=MUTED, lw=0.8, ls="--")
    other.plot(x, np.concatenate([start, area]), "s-", ms=3, color=COLOURS[2], label="area")
    here.set_xlabel("deflection, mm")
    here.set_ylabel("load, N")
    other.set_ylabel("contact area, cm²")
    lines = here.get_lines()[:1] + other.get_lines()
    here.legend(lines, [line.get_label() for line in lines], loc="upper left")
    return encode(figure)
