"""Report section part about the road."""

import numpy as np
from numpy.typing import NDArray

from tireroad.runs.files.read import Results, Section
from tireroad.runs.report import figures, live
from tireroad.runs.report.quantities import quantity

_DEEPEST = 60.0  # dB below the highest level: what is drawn


def texture(results: Results, section: Section) -> None:
    """Add mean profile depth and texture third octaves of the road (contact.h5)."""
    depth = results.attribute("contact.h5", "mean_profile_depth")
    if depth is not None:
        section.facts.append(("mean profile depth of the road", quantity(depth, "m")))
    notes = results.attribute("contact.h5", "road_notes")
    if notes is not None:
        section.notes.append(f"Road: {notes}.")
    level = results.optional("contact.h5", "road/texture_level")
    if level is None:
        return
    wavelength = 1e3 * results.array("contact.h5", "road/wavelength")
    labels = "wavelength in mm", "level in dB re 1 µm"
    level = np.maximum(level, level.max() - _DEEPEST)
    curves, colours = {"level": level}, figures.COLOURS
    drawn = live.chart(wavelength, curves, labels, colours, log=True, legend=False)
    caption = "Texture of the road along its middle: level of each third octave (ISO 13473-4)."
    section.show(_drawn(wavelength, level, labels), caption, live.charts(drawn))


@figures.styled
def _drawn(wavelength: NDArray, level: NDArray, labels: tuple[str, str]) -> str:
    figure, axes = figures.canvas(figures.WIDE, 2.6)
    axes[0, 0].step(wavelength, level, where="mid", color=figures.COLOURS[0])
    axes[0, 0].set(xlabel=labels[0], ylabel=labels[1], xscale="log")
    axes[0, 0].set_xlim(wavelength.min(), wavelength.max())
    return figures.encode(figure)
