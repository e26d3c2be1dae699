"""Report section part about the wheel: hub moments, and its motion if it moves."""

import numpy as np
from numpy.typing import NDArray

from tireroad.runs.files.read import Results, Section
from tireroad.runs.report import figures, live
from tireroad.runs.report.quantities import quantity
from tireroad.runs.report.thinned import envelope

_AXES = "xyz"


def wheel(results: Results, section: Section, time: NDArray) -> None:
    """Add the hub moments, and the motion of wheel and body if the wheel moves (contact.h5)."""
    moved = results.optional("contact.h5", "wheel/translation")
    moment = results.optional("contact.h5", "hub_moment")
    if moment is not None:
        hub = "the held axle" if moved is None else "the hub"
        for axis, name in enumerate(_AXES):
            section.facts.append(
                (f"greatest moment on {hub}, {name}", _most(moment[:, axis], "N m"))
            )
    if moved is None:
        return
    turned = results.array("contact.h5", "wheel/rotation")
    body = results.array("contact.h5", "body/height")
    for axis, name in enumerate(_AXES):
        if np.abs(moved[:, axis]).max() > 0:
            section.facts.append(
                (f"greatest motion of the wheel, {name}", _most(moved[:, axis], "m"))
            )
        if np.abs(turned[:, axis]).max() > 0:
            turn = _most(turned[:, axis], "rad")
            section.facts.append((f"greatest rotation of the wheel, {name}", turn))
    lines = {"wheel, z": moved[:, 2], "body, z": body}
    shown = {name: 1e3 * line for name, line in lines.items() if np.abs(line).max() > 0}
    if shown:
        drawn = live.chart(time, shown, ("time in s", "height in mm"), figures.COLOURS)
        caption = "Wheel and body over the static state."
        section.show(_drawn(time, shown), caption, live.charts(drawn))


@figures.styled
def _drawn(time: NDArray, lines: dict[str, NDArray]) -> str:
    figure, axes = figures.canvas(figures.WIDE, 2.6)
    for colour, (name, line) in zip(figures.COLOURS, lines.items(), strict=False):
        axes[0, 0].plot(*envelope(time, line), color=colour, label=name)
    axes[0, 0].set(xlabel="time in s", ylabel="height in mm", xlim=(time[0], time[-1]))
    axes[0, 0].legend(ncols=2, loc="lower left", bbox_to_anchor=(0.0, 1.0))
    return figures.encode(figure)


def _most(values: NDArray, unit: str) -> str:
    return quantity(float(np.abs(values).max()), unit)
