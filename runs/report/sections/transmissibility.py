"""Report section part about the axle: force on the held axle per force on the tread."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tireroad.runs.files.read import Results, Section
from tireroad.runs.report.figures import COLOURS, COMPONENTS, WIDE, canvas, encode, styled
from tireroad.runs.report.quantities import quantity

POINTS = 3  # at most, drawn
LEAST = 1e-4  # of the largest; below, rounding at what is zero by symmetry


def add(results: Results, section: Section, names: list[str]) -> None:
    """Add the curves of response.h5, by momentum and by the free rim, if it has them."""
    name = "response.h5"
    frequency, found = (
        results.optional(name, f"transmissibility/{part}") for part in ("frequency", "momentum")
    )
    if frequency is None or found is None or not len(frequency):
        return
    other = results.optional(name, "transmissibility/free_rim")
    dashed = "" if other is None else "; dashed: by modes of a tire with a free rim"
    section.show(
        transmissibilities(frequency, found, other, names),
        f"Force on the axle per force at the point, by momentum{dashed}.",
    )
    turning, held = (
        results.optional(name, f"transmissibility/{part}") for part in ("moment", "free_rim_moment")
    )
    if turning is not None:
        section.show(
            transmissibilities(frequency, turning, held, names, "dB re 1 N m/N"),
            "Moment on the axle, about its centre, per force at the point.",
        )
    for what, one, by_momentum in (("force", other, found), ("moment", held, turning)):
        if one is not None and by_momentum is not None:
            apart = np.linalg.norm(one - by_momentum) / np.linalg.norm(by_momentum)
            fact = f"axle {what} by the free rim off that by momentum"
            section.facts.append((fact, quantity(100 * float(apart), "%")))


@styled
def transmissibilities(
    frequency: NDArray,
    found: NDArray,
    other: NDArray | None,
    names: list[str],
    reference: str = "dB re 1 N/N",
) -> str:
    """Magnitudes of (f, 3, k) in dB re `reference`, one row per point."""
    rows = min(found.shape[2], POINTS)
    figure, axes = canvas(WIDE, 2.4 * rows + 0.4, rows, sharex=True)
    floor = LEAST * np.abs(found).max()
    for point in range(rows):
        here = axes[point, 0]
        for column, component in enumerate(COMPONENTS):
            for values, dashes in ((found, "-"), (other, "--")):
                if values is None or np.abs(found[:, column, point]).max() < floor:
                    continue
                level = 20 * np.log10(np.maximum(np.abs(values[:, column, point]), floor))
                label = component if dashes == "-" else None
                here.plot(frequency, level, dashes, color=COLOURS[column], label=label)
        here.set(title=names[point], ylabel=reference)
        if here.lines:
            here.legend(ncols=3, loc="lower right", bbox_to_anchor=(1.0, 1.12), borderaxespad=0.0)
        else:
            here.set_yticks([])
            here.text(0.5, 0.5, "none, by symmetry", ha="center", transform=here.transAxes)
    axes[-1, 0].set_xlabel("frequency in Hz")
    return encode(figure)
