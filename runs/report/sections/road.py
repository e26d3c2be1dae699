"""What the report says of the road."""

from numpy.typing import NDArray

from tireroad.runs.files.read import Results, Section
from tireroad.runs.report import figures
from tireroad.runs.report.quantities import quantity


def texture(results: Results, section: Section) -> None:
    """Adds mean profile depth and third octaves of the road that was driven over (contact.h5)."""
    depth = results.attribute("contact.h5", "mean_profile_depth")
    if depth is not None:
        section.facts.append(("mean profile depth of the road", quantity(depth, "m")))
    notes = results.attribute("contact.h5", "road_notes")
    if notes is not None:
        section.notes.append(f"Road: {notes}.")
    level = results.optional("contact.h5", "road/texture_level")
    if level is None:
        return
    section.show(
        _drawn(results.array("contact.h5", "road/wavelength"), level),
        "Texture of the road along its middle: level of each third octave, re 1 um (ISO 13473-4).",
    )


@figures.styled
def _drawn(wavelength: NDArray, level: NDArray) -> str:
    figure, axes = figures.canvas(9.5, 2.6)
    axes[0, 0].step(1e3 * wavelength, level, where="mid", color=figures.COLOURS[0])
    axes[0, 0].set(xlabel="wavelength in mm", ylabel="level in dB", xscale="log")
    axes[0, 0].set_xlim(1e3 * wavelength[0], 1e3 * wavelength[-1])
    axes[0, 0].set_ylim(bottom=max(level.min(), level.max() - 60.0))
    return figures.encode(figure)
