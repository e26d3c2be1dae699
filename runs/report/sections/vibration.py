"""Report section about the vibration of the tire."""

import numpy as np
from numpy.typing import NDArray

from tireroad.contact.results.spectra import nominal
from tireroad.runs.report import live
from tireroad.runs.report.figures import (
    COLOURS,
    FEWEST_BANDS,
    RANGE_DB,
    WIDE,
    encode,
    line_canvas,
    styled,
    third_octaves,
)
from tireroad.runs.report.read import Results, Section


def vibration(results: Results) -> Section:
    """The section on vibration and equivalent radiated power of the outer face (vibration.h5)."""
    name = "vibration.h5"
    section = Section(
        "Vibration of the outer face",
        "Normal to the surface, by the modes under the forces of the run. The equivalent radiated power is "
        "that of a plate larger than the sound's wave. A tire radiates far less below 1 kHz, 20 to 40 dB: the table "
        "[sound] computes its sound.",
    )
    frequency = results.array(name, "frequency")
    centre = results.array(name, "third_octave/centre")
    if len(frequency) < 2:
        section.notes.append("The run is too short for a line within the band.")
        return section
    level = 10 * np.log10(np.maximum(results.array(name, "mean_square_velocity"), 1e-300) / 1e-18)
    labels = "frequency in Hz", "level in dB re 1 nm/s"
    drawn = live.chart(frequency, {"mean square velocity": level}, labels, COLOURS)
    still = level_lines(frequency, level, "dB re 1 nm/s")
    section.show(still, "Mean square velocity, line by line.", live.charts(drawn))
    if not len(centre):
        section.notes.append("Too few lines for a third-octave band.")
        return section
    plain = results.array(name, "third_octave/radiated_power_level")
    weighted = results.array(name, "third_octave/radiated_power_level_a_weighted")
    if len(centre) < FEWEST_BANDS:
        section.facts += [
            (
                f"radiated power, third octave {name:g} Hz",
                f"{power:.1f} dB, {heard:.1f} dB(A) re 1 pW",
            )
            for name, power, heard in zip(nominal(centre), plain, weighted, strict=True)
        ]
        return section
    both, few = np.stack([plain, weighted], axis=1), np.zeros(len(centre), bool)
    picture = third_octaves(
        centre, both, None, "level in dB re 1 pW", few, ("unweighted", "A-weighted")
    )
    section.show(picture, "Equivalent radiated power in third-octave bands.")
    return section


@styled
def level_lines(frequency: NDArray, level: NDArray, unit: str) -> str:
    """A level (f,) over frequency (f,) Hz."""
    figure, ((axes,),) = line_canvas(WIDE, 2.8)
    axes.plot(frequency, level, color=COLOURS[0], linewidth=1.0)
    top = float(level.max())
    axes.set(xlabel="frequency in Hz", ylabel=f"level in {unit}", ylim=(top - RANGE_DB, top + 5))
    axes.margins(x=0)
    return encode(figure)
