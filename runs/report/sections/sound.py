"""Report section about the sound beside the tire."""

from __future__ import annotations

from base64 import b64encode

import numpy as np
from matplotlib.collections import PolyCollection
from numpy.typing import NDArray

from tireroad.contact.results.spectra import FEW, lines, nominal
from tireroad.runs.report import live
from tireroad.runs.report.figures import (
    CYCLE,
    FEWEST_BANDS,
    WIDE,
    bare_canvas,
    canvas,
    encode,
    level_range,
    line_canvas,
    styled,
    third_octaves,
)
from tireroad.runs.report.read import Results, Section, TextTable, about, digits, quantity
from tireroad.runs.results.wave import LISTEN, joined, wave_file

FILE = "sound.h5"
_CHARTED = 4  # microphones in one chart of bars
_LIMITS = "Sound of the tire's vibrations{air}: no lateral grooves, no car; the contact's own local flexibility is left out."
_WITH_AIR = ", and of the air that tread and road squeeze out of the footprint, over its edge and through its grooves"
_ALONE = " alone, without the air that tread and road squeeze out of the footprint, which is heard from 800 Hz on"


def sound(results: Results) -> Section:
    """Levels at the microphones, sound power, directivity, and which part of the tire is heard."""
    names = [str(name) for name in results.dataset(FILE, "microphones").attrs["names"]]
    frequency = results.array(FILE, "frequency")
    air = results.optional(FILE, "third_octave/air_level")
    heard = air is not None and np.isfinite(air).any()
    section = Section("Sound beside the tire", _LIMITS.format(air=_WITH_AIR if heard else _ALONE))
    band = f"{digits(float(frequency[0]))} to {digits(float(frequency[-1]))} Hz"
    columns = [names]
    for key in ("level", "level_a"):
        columns.append([f"{value:.1f}" for value in results.array(FILE, f"total/{key}")])
        error = results.optional(FILE, f"total/{key}_error")
        columns.append(["unknown"] * len(names) if error is None else [about(e) for e in error])
    head = (f"sound pressure level, {band}", "dB re 20 µPa", "error, dB", "dB(A) re 20 µPa")
    section.table = TextTable((*head, "error, dB"), list(zip(*columns, strict=True)))
    power = results.array(FILE, "total/power")
    section.facts.append(("road, to the sound", _road(results)))
    if unknown := results.attribute(FILE, "unknown_error"):
        section.facts.append(("error of the vibration", str(unknown)))
    section.facts += _probes(results)
    section.facts.append(
        ("sound power", f"{power[0]:.1f} dB, {power[1]:.1f} dB(A) re 1 pW, error unknown")
    )
    centre = results.array(FILE, "third_octave/centre")
    for name, signal in zip(names, results.array(FILE, "signal/pressure"), strict=True):
        rate = float(results.dataset(FILE, "signal/pressure").attrs["rate"])
        data, full = wave_file(joined(signal, max(round(LISTEN * rate), len(signal))), rate)
        uri = f"data:audio/wav;base64,{b64encode(data).decode()}"
        section.sounds.append((f"{name}: full scale is {full:g} Pa", uri))
    if len(centre) < FEWEST_BANDS:
        section.notes.append("Too few third-octave bands for charts: lengthen time.duration.")
        return section
    _bands(results, section, names, centre)
    if heard:
        _sources(results, section, names[0], centre)
    _power(results, section, centre)
    loudest = int(results.array(FILE, "third_octave/level_a")[0].argmax())
    section.show(
        directivity(results, centre),
        "Level over the road's horizon at 7.5 m, by direction (ahead is up, the left side is left): lowest ring of the "
        "hemisphere, three loudest bands.",
    )
    _parts(results, section, names, centre, loudest)
    return section


def _road(results: Results) -> str:
    layer = results.scene.get("sound", {}).get("road")
    if not layer:
        return "rigid"
    return (
        f"porous layer of {quantity(layer['thickness'], 'm')}, {layer['resistivity']:g} N s/m⁴, porosity "
        f"{layer['porosity']:g}, tortuosity {layer['tortuosity']:g}"
    )


def _probes(results: Results) -> list[tuple[str, str]]:
    """Levels of the intensity probes, with the largest pressure-intensity index of their bands."""
    level = results.optional(FILE, "total/intensity_level_a")
    if level is None or not len(level):
        return []
    index = results.array(FILE, "intensity_index")
    names = results.dataset(FILE, "intensity").attrs["names"]
    return [
        (
            f"A-weighted sound intensity level at {name}",
            f"{value:.1f} dB(A) re 1 pW/m², error unknown, pressure-intensity index to {most:.1f} dB"
            if np.isfinite(value)
            else "inward",
        )
        for name, value, most in zip(names, level, index.max(axis=1, initial=0.0), strict=True)
    ]


def _bands(results: Results, section: Section, names: list[str], centre: NDArray) -> None:
    level, error = (
        results.array(FILE, f"third_octave/{key}") for key in ("level_a", "level_error")
    )
    elements = results.optional(FILE, "third_octave/element_error")
    caption = "A-weighted sound pressure level in third octaves at the microphones."
    if np.isfinite(error).any():
        caption += (
            " Lines on the bars: estimated error, of the vibration and of the boundary elements."
        )
    else:
        caption += " The error is unknown: that of the vibration was not estimated."
    if elements is not None:
        caption += (
            f" Of the boundary elements alone (by elements of twice the size, and by sources inside whose field is "
            f"known) it is {elements.max():.1g} dB at most."
        )
    frequency = results.array(FILE, "frequency")
    few = lines(centre, frequency[1] - frequency[0]) < FEW
    label = "sound pressure level in dB(A) re 20 µPa"
    for first in range(0, len(names), _CHARTED):
        some = slice(first, first + _CHARTED)
        shown, off = level[some].T, error[some].T
        series = {name: (shown[:, k], off[:, k]) for k, name in enumerate(names[some])}
        drawn = live.bars(
            [f"{c:g}" for c in nominal(centre)],
            series,
            ("third-octave band in Hz", label),
            CYCLE[: len(series)],
            ends=level_range(shown),
            few=few,
        )
        picture = third_octaves(centre, shown, off, label, few, names[some])
        section.show(
            picture,
            caption,
            drawn,
        )


def _sources(results: Results, section: Section, name: str, centre: NDArray) -> None:
    """Levels of the vibrations and of the squeezed air at the first microphone."""
    keys = {"vibrations": "vibration_level", "air of the footprint": "air_level"}
    level = np.stack(
        [results.array(FILE, f"third_octave/{key}")[0] for key in keys.values()], axis=1
    )
    few, unknown = np.zeros(len(centre), bool), np.full(level.shape, np.nan)
    label = "sound pressure level in dB re 20 µPa"
    drawn = live.bars(
        [f"{c:g}" for c in nominal(centre)],
        {key: (level[:, k], unknown[:, k]) for k, key in enumerate(keys)},
        ("third-octave band in Hz", label),
        CYCLE[: len(keys)],
        ends=level_range(level),
        few=few,
    )
    section.show(
        third_octaves(centre, level, None, label, few, list(keys)),
        f"The same at {name} by source, not weighted: the tire's vibrations alone, and the air squeezed out of the footprint alone. Both move "
        "together where the tread's own motion squeezes the air, so that levels of both do not add as powers. Where the air is the louder, "
        "the error of the sum is unknown.",
        drawn,
    )


def _power(results: Results, section: Section, centre: NDArray) -> None:
    power, efficiency = results.array(FILE, "power"), results.array(FILE, "efficiency")
    level = 10 * np.log10(np.maximum(efficiency, 1e-30))
    section.show(
        power_and_efficiency(centre, power, level),
        "Sound power in third octaves, and radiation efficiency: the power over that of a plane wave with the face's "
        "mean square velocity. Waves on a tire are short against those in the air, so most of its motion radiates little.",
    )


@styled
def power_and_efficiency(centre: NDArray, power: NDArray, efficiency: NDArray) -> str:
    """Levels (b,) dB re 1 pW and efficiencies (b,) dB over bands (b,) Hz."""
    figure, axes = line_canvas(WIDE, 4.2, 2, below=0.62, sharex=True)
    place = np.arange(len(centre))
    floor, _ = level_range(power[:, None])
    axes[0, 0].bar(place, np.maximum(power - floor, 0.0), 0.7, bottom=floor, color=CYCLE[0])
    axes[0, 0].set_ylabel("sound power\nin dB re 1 pW")
    axes[1, 0].plot(place, efficiency, "o-", color=CYCLE[2])
    axes[1, 0].set_ylabel("efficiency in dB")
    axes[1, 0].set_xticks(place, [f"{value:g}" for value in nominal(centre)], rotation=45)
    axes[1, 0].set_xlabel("third-octave band in Hz")
    return encode(figure)


@styled
def directivity(results: Results, centre: NDArray) -> str:
    """Polar lines of the lowest ring of the hemisphere, for the loudest bands."""
    level = results.array(FILE, "directivity/level")[:, 0]
    azimuth = np.radians(results.array(FILE, "directivity/azimuth"))
    order = np.argsort(-results.array(FILE, "third_octave/level_a")[0])[:3]
    figure, axes = canvas(4.0, 4.0, subplot_kw={"projection": "polar"})
    here = axes[0, 0]
    here.set_theta_zero_location("N")
    closed = np.append(azimuth, azimuth[:1])
    for number, band in enumerate(sorted(order)):
        ring = np.append(level[band], level[band, :1])
        here.plot(closed, ring, color=CYCLE[number], label=f"{nominal(centre)[band]:g} Hz")
    shown = level[order]
    here.set_ylim(shown.min() - 6, shown.max() + 2)
    here.set_xticks(np.radians([0, 90, 180, 270]), ["ahead", "left", "behind", "right"])
    here.legend(loc="upper center", bbox_to_anchor=(0.5, -0.08), ncols=3)
    return encode(figure)


def _parts(
    results: Results, section: Section, names: list[str], centre: NDArray, loudest: int
) -> None:
    held = results.dataset(FILE, "contribution/region")
    regions = [str(name) for name in held.attrs["names"]]
    share = held[()]
    section.show(
        parts(centre, share[0], regions),
        f"Where the sound at {names[0]} comes from: each part's share of the mean square pressure. Shares add up to 1; "
        "below 0 are parts that cancel others.",
    )
    outline = results.array(FILE, "contribution/outline")
    each = results.array(FILE, "contribution/element")[0, loudest]
    section.show(
        unrolled(outline, each),
        f"The same on the unrolled face at {nominal(centre)[loudest]:g} Hz, the loudest band: contribution per area of the "
        "picture, red adds, blue cancels; white in the middle is the contact.",
    )


@styled
def parts(centre: NDArray, share: NDArray, regions: list[str]) -> str:
    """Shares (b, r) of regions over bands (b,) Hz, stacked up- and downwards."""
    figure, axes = line_canvas(WIDE, 3.4, below=0.62)
    here, place = axes[0, 0], np.arange(len(centre))
    for sign in (1, -1):
        base = np.zeros(len(centre))
        for r, name in enumerate(regions):
            part = np.maximum(sign * share[:, r], 0.0) * sign
            label = name if sign > 0 else None
            here.bar(place, part, 0.7, bottom=base, color=CYCLE[r % len(CYCLE)], label=label)
            base += part
    here.axhline(0.0, color="#1f2933", linewidth=0.8)
    here.set_xticks(place, [f"{value:g}" for value in nominal(centre)], rotation=45)
    here.set(xlabel="third-octave band in Hz", ylabel="share of the pressure's square")
    here.grid(axis="x", visible=False)
    here.legend(ncols=3, loc="lower left", bbox_to_anchor=(0.0, 0.98), fontsize=8)
    figure.subplots_adjust(top=1 - 0.5 / 3.4)
    return encode(figure)


@styled
def unrolled(outline: NDArray, share: NDArray) -> str:
    """Shares (e,) per area of elements with corners (e, 4, 2): degrees from the lowest point, place across."""
    known = np.isfinite(outline).all(axis=(1, 2))
    corners = outline[known]
    one, other = corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]
    size = np.abs(one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]) / 2
    density = share[known] / np.maximum(size, 1e-12)
    top = float(np.quantile(np.abs(density), 0.995)) or 1.0
    figure, axes = bare_canvas(WIDE, 2.6)
    here = axes[0, 0]
    colours = PolyCollection(
        corners, array=density / top, cmap="RdBu_r", clim=(-1, 1), edgecolors="face", linewidths=0.2
    )
    here.add_collection(colours)
    here.set(
        xlim=(-180, 180), ylim=(0, 1), xlabel="angle from the lowest point in deg, positive ahead"
    )
    here.set_xticks(range(-180, 181, 45))
    here.set_yticks([0, 0.5, 1], ["right bead", "crown", "left bead"])
    here.grid(visible=False)
    figure.subplots_adjust(left=0.13, right=0.98, bottom=0.2, top=0.96)
    return encode(figure, "png", 140)
