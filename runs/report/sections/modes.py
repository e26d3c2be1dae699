"""Report sections about the modes of the rolling tire, in the plane and over speed, and its vibration."""

from __future__ import annotations

from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from tireroad.contact.results.spectra import nominal
from tireroad.fem.errors import InputError
from tireroad.modal.states import growing
from tireroad.runs.report import live
from tireroad.runs.report.figures import (
    COLOURS,
    FEWEST_BANDS,
    MUTED,
    RANGE_DB,
    WIDE,
    canvas,
    encode,
    line_canvas,
    styled,
    third_octaves,
)
from tireroad.runs.report.read import Absent, Results, Section, TextTable, attributes, quantity
from tireroad.runs.report.sections import tire
from tireroad.runs.report.sections.tire import LISTED

_ORDERS = range(1, 9)


@styled
def eigenvalues(eigenvalue: NDArray) -> str:
    """Growth rate Re s over frequency Im s / 2π of eigenvalues (n) 1/s, for Im s >= 0."""
    figure, axes = line_canvas(WIDE, 3.0)
    here = axes[0, 0]
    shown = eigenvalue[eigenvalue.imag >= 0.0]
    unstable = growing(eigenvalue)[eigenvalue.imag >= 0.0]
    for group, colour, label in (
        (shown[~unstable], COLOURS[0], "decaying"),
        (shown[unstable], COLOURS[2], "growing: unstable"),
    ):
        if group.size:
            place = group.imag / (2 * np.pi)
            here.plot(place, group.real, ".", ms=4, color=colour, label=label)
    here.axhline(0.0, color="#7b8794", lw=0.8)
    here.set(xlabel="frequency in Hz", ylabel="Re s in 1/s")
    here.legend(ncols=2, loc="lower left", bbox_to_anchor=(0.0, 1.0))
    return encode(figure)


@styled
def campbell_figure(
    speed: NDArray,
    damped: NDArray,
    undamped: NDArray | None,
    radius: float | None,
    names: list[str],
) -> str:
    """Branches (v, b) Hz over speed (v,) rad/s, in km/h if the rolling `radius` (m) is known.

    With their `names` at the right end, and the lines n Omega / 2 pi, n = 1, 2, ..., at which a stationary road excites.
    """
    figure, ((axes,),) = canvas(WIDE, 4.2)
    x, label, scale = _axis(speed, radius)
    highest = 1.05 * np.nanmax(damped if undamped is None else np.fmax(damped, undamped))
    for n in _ORDERS:
        axes.plot(x, n * speed / (2 * np.pi), color=MUTED, lw=0.6, ls=":")
    if undamped is not None:
        axes.plot(x, undamped, color=COLOURS[2], lw=0.9, ls="--")
        axes.plot([], [], color=COLOURS[2], lw=0.9, ls="--", label="undamped")
    axes.plot(x, damped, color=COLOURS[0])
    axes.plot([], [], color=COLOURS[0], label="damped, Im s / 2π")
    axes.plot([], [], color=MUTED, lw=0.6, ls=":", label="n Ω / 2π")
    axes.set(xlabel=label, ylabel="frequency in Hz", ylim=(0.0, highest))
    axes.margins(x=0)
    for name, place in zip(names, _apart(damped, highest), strict=True):
        if np.isfinite(place):
            axes.annotate(
                name, (x[-1], place), (3, 0), textcoords="offset points", va="center", fontsize=7
            )
    if scale:
        other = axes.secondary_xaxis("top", functions=(lambda v: v / scale, lambda w: w * scale))
        other.set_xlabel("speed of the wheel in rad/s")
    axes.legend(ncols=3, loc="upper center", bbox_to_anchor=(0.5, -0.16))
    return encode(figure)


def _apart(lines: NDArray, highest: float) -> NDArray:
    """Heights (b,) for labels at the ends of lines (v, b), a line of text apart."""
    place = lines[-1].copy()
    order = np.argsort(place)  # NaN last
    least = highest / 34
    for before, after in zip(order[:-1], order[1:], strict=True):
        place[after] = max(place[after], place[before] + least)
    return place


def campbell_live(
    speed: NDArray,
    damped: NDArray,
    undamped: NDArray | None,
    radius: float | None,
    names: list[str],
) -> dict:
    """The same as an interactive chart that names the branch under the pointer."""
    x, label, _ = _axis(speed, radius)
    called = [f"{k + 1}: {name}, damped" for k, name in enumerate(names)]
    curves = dict(zip(called, damped.T, strict=True))
    colours = [COLOURS[0]] * len(curves)
    dashed: list[str] = []
    if undamped is not None:
        dashed = [f"branch {k + 1}, undamped" for k in range(undamped.shape[1])]
        curves |= dict(zip(dashed, undamped.T, strict=True))
        colours += [COLOURS[2]] * len(dashed)
    curves |= {f"{n} Ω / 2π": n * speed / (2 * np.pi) for n in _ORDERS}
    colours += [MUTED] * len(_ORDERS)
    labels = label, "frequency in Hz"
    return live.charts(
        live.chart(x, curves, labels, colours, dashed=dashed, legend=False, height=380)
    )


def _axis(speed: NDArray, radius: float | None) -> tuple[NDArray, str, float]:
    """Speeds in km/h, axis label and km/h per rad/s; without a radius rad/s, and 0."""
    if not radius:
        return speed, "speed of the wheel in rad/s", 0.0
    return 3.6 * radius * speed, "travelling speed in km/h", 3.6 * radius


def rotating(results: Results) -> Section:
    """The section on eigenvalues of the rolling tire (rotating.h5)."""
    name = "rotating.h5"
    section = Section("Modes of the rolling tire", "Eigenvalues s of the rotating, damped tire.")
    value = results.array(name, "eigenvalue")
    # Including those of the near-defective block.
    block = results.optional(name, "block")
    every = value if block is None else np.concatenate([value, np.linalg.eigvals(block)])
    beyond = every[growing(every)]
    section.facts = attributes(results, name, (("speed", "rad/s"), ("basis_condition", "")))
    section.facts.append(("growing", quantity(len(beyond))))
    if len(beyond):
        worst = beyond[beyond.real.argmax()]
        section.warnings.append(
            f"The rolling tire is unstable: {len(beyond)} eigenvalues have Re s > 0, the worst "
            f"{quantity(float(worst.real), '1/s')} at "
            f"{quantity(float(abs(worst.imag) / 2 / np.pi), 'Hz')}."
        )
    rising = np.flatnonzero(value.imag > 0)
    rising = rising[np.argsort(value.imag[rising])]
    section.table, listed = _table(results, name, value, rising)
    tire.resonances(results, section, name, "air_share", value)
    if section.table.head[0] == "name":
        section.notes.append(
            "Names as in the table of modes. In the frame that does not turn a mode has two branches: - travels around "
            "against the rotation, + with it; what does neither by two thirds stands. Damping in percent of critical."
        )
    if len(rising) > listed:
        section.notes.append(f"The table lists {listed} of {len(rising)} pairs, by frequency.")
    campbell(results, section)
    section.show(eigenvalues(value), "Eigenvalues with Im s ≥ 0.")
    return section


def _table(results: Results, file: str, value: NDArray, rising: NDArray) -> tuple[TextTable, int]:
    """The lowest states, the branches of one mode in one row, and how many states that are.

    `rising` (q,): indices of the oscillating ones of the eigenvalues `value` 1/s, ascending.
    """

    def told(q: int) -> tuple[str, str]:
        s = complex(value[q])
        return quantity(s.imag / 2 / np.pi, "Hz"), tire.ratio(-s.real / abs(s))

    name = results.optional(file, "name")
    if name is None:  # of an earlier version
        shown = rising[:LISTED]
        return TextTable(("frequency", "damping"), [told(q) for q in shown]), len(shown)
    motion, wave = results.array(file, "motion"), results.array(file, "wave_number")
    rows: list[tuple[str, dict[str, int]]] = []
    for q in rising:
        mode, branch = (name[q][:-1], name[q][-1]) if name[q][-1] in "+-" else (name[q], "")
        row = next((held for other, held in rows if other == mode and branch not in held), None)
        if row is None:
            row = {}
            rows.append((mode, row))
        row[branch] = int(q)
    head = ("name", "standing", "- branch", "+ branch", "apart", "waves around", "motion")
    listed, count = [], 0
    for mode, row in rows[:LISTED]:
        first = next(iter(row.values()))
        each = [", ".join(told(row[branch])) if branch in row else "–" for branch in ("", "-", "+")]
        apart = "–"
        if {"-", "+"} <= row.keys():
            split = (value[row["+"]].imag - value[row["-"]].imag) / 2 / np.pi
            apart = quantity(float(split), "Hz")
        listed.append((mode, *each, apart, str(wave[first]), motion[first]))
        count += len(row)
    return TextTable(head, listed), count


def campbell(results: Results, section: Section) -> None:
    """Add the branches over speed, damped and undamped, if the run has computed them."""
    speed = results.optional("rotating.h5", "campbell/speed")
    if speed is None:
        return
    radius: float | None = None
    with suppress(Absent, InputError):  # that file's own section reports the problem
        radius = float(results.attribute("static.h5", "rolling_radius") or 0.0)
    damped = results.array("rotating.h5", "campbell/frequency")
    undamped = results.optional("rotating.h5", "campbell/undamped")
    name = results.optional("rotating.h5", "campbell/name")
    names = [f"branch {k + 1}" for k in range(damped.shape[1])] if name is None else list(name)
    arguments = speed, damped, undamped, radius, names
    text = "Branches followed over speed, on one static state. Solid: damped, as the tire rings"
    if undamped is not None:
        text += (
            "; dashed: the same tire without damping (what is damped beyond critical has only this)"
        )
    text += "; dotted: n Ω/2π, n = 1 to 8, at which a standing road excites."
    section.show(campbell_figure(*arguments), text, campbell_live(*arguments))


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
