"""Report sections about forces: rolling contact, point forces, axle, road and tread pattern."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import h5py
import numpy as np
from numpy.typing import NDArray

from tireroad.contact.results.spectra import in_band
from tireroad.fem.errors import InputError
from tireroad.runs.report import figures, live, realism, surface_figures
from tireroad.runs.report.figures import COLOURS, COMPONENTS, WIDE, canvas, encode, envelope, styled
from tireroad.runs.report.read import (
    Absent,
    Results,
    Section,
    attributes,
    quantity,
    without_friction,
)
from tireroad.runs.report.sections.tire import pressure

_AXES = "xyz"
_SHOWN = 0.6  # m of tread drawn
_DEEPEST = 60.0  # dB below the highest level: what is drawn
POINTS = 3  # at most, drawn
LEAST = 1e-4  # of the largest; below, rounding at what is zero by symmetry
SAMPLED = 400  # instants read of a (time, point) dataset: it may be larger than memory
AT_ONCE = 2e8  # bytes
PAIRED = 6  # receptances drawn
PLAYED = 240  # instants of the animated footprint


def wheel(results: Results, section: Section, time: NDArray) -> None:
    """Add the hub moments, and the motion of wheel and body if the wheel moves (contact.h5)."""
    moved = results.optional("contact.h5", "wheel/translation")
    moment = results.optional("contact.h5", "hub_moment")
    if moment is not None:
        hub = "the held axle" if moved is None else "the hub"
        for axis, name in enumerate(_AXES):
            section.facts.append(
                (
                    f"greatest moment on {hub}, {name}",
                    f"{_most(moment[:, axis], 'N m')}, error unknown",
                )
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


def tread(results: Results, section: Section) -> None:
    """Add the pattern, and the part of it under the footprint at the beginning (contact.h5)."""
    depth = results.optional("contact.h5", "pattern/depth")
    if depth is None:
        return
    s, y = results.array("contact.h5", "pattern/s"), results.array("contact.h5", "pattern/y")
    points = results.array("contact.h5", "points")
    begun = results.array("contact.h5", "pattern/begun")
    land = float((depth <= 0).mean())
    section.facts += [
        ("deepest groove", quantity(float(depth.max()), "m")),
        ("land of the pattern across the patch", f"{100 * land:.3g} %"),
    ]
    section.show(
        _pattern_drawn(s, y, depth, points, begun),
        f"Tread pattern: depth over the first {1e3 * min(_SHOWN, s[-1]):.0f} mm around the tire, and at the "
        "contact points when the run begins.",
    )  # fmt: skip


@figures.styled
def _pattern_drawn(s: NDArray, y: NDArray, depth: NDArray, points: NDArray, begun: NDArray) -> str:
    figure, axes = figures.canvas(figures.WIDE, 3.0, 1, 2)
    around, patch = axes[0]
    part = s <= _SHOWN
    around.pcolormesh(1e3 * s[part], 1e3 * y, 1e3 * depth[part].T, cmap="Greys", shading="nearest")
    around.set(xlabel="around the tire in mm", ylabel="y in mm")
    shown = patch.scatter(
        *(1e3 * points[:, :2].T), c=1e3 * begun, cmap="Greys", s=6, vmin=0.0, edgecolors="none"
    )
    patch.set(xlabel="x in mm", title="under the footprint", aspect="equal")
    figure.colorbar(shown, ax=patch, label="depth in mm")
    return figures.encode(figure)


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
    section.show(_road_drawn(wavelength, level, labels), caption, live.charts(drawn))


@figures.styled
def _road_drawn(wavelength: NDArray, level: NDArray, labels: tuple[str, str]) -> str:
    figure, axes = figures.canvas(figures.WIDE, 2.6)
    axes[0, 0].step(wavelength, level, where="mid", color=figures.COLOURS[0])
    axes[0, 0].set(xlabel=labels[0], ylabel=labels[1], xscale="log")
    axes[0, 0].set_xlim(wavelength.min(), wavelength.max())
    return figures.encode(figure)


def add(results: Results, section: Section, names: list[str]) -> None:
    """Add the curves of response.h5, by momentum and by the free rim, if it has them."""
    name = "response.h5"
    frequency, values = (
        results.optional(name, f"transmissibility/{part}") for part in ("frequency", "momentum")
    )
    if frequency is None or values is None or not len(frequency):
        return
    other = results.optional(name, "transmissibility/free_rim")
    dashed = "" if other is None else "; dashed: by modes of a tire with a free rim"
    section.show(
        transmissibilities(frequency, values, other, names),
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
    for what, one, by_momentum in (("force", other, values), ("moment", held, turning)):
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


def contact(results: Results) -> Section:
    """The section on rolling contact (contact.h5)."""
    name = "contact.h5"
    section = Section("Rolling contact", "Total forces of the road on the tire.")
    time, total = results.array(name, "time"), results.array(name, "total_force")
    if not len(time):
        raise Absent(f"{name} holds no step yet")
    keys = (("road", ""), ("scheme", ""), ("step", "s"), ("speed", "rad/s"))
    axle, active = results.optional(name, "axle_force"), results.optional(name, "active")
    low = _valid(results, {"contact": total, "axle": axle})
    vertical = low.forces["contact"][:, 2]
    section.facts = [("simulated", quantity(float(time[-1]), "s")), ("steps", quantity(len(time)))]
    section.facts += attributes(results, name, keys)
    section.facts += low.facts
    picture = figures.forces(time, low.forces["contact"], low.forces.get("axle"), active)
    drawn = histories(time, low.forces, active)
    section.show(picture, f"Forces over time{low.words}; peaks are kept in the drawing.", drawn)
    pressure_maps(results, section, time, vertical)
    if len(time) == 1:
        return section
    section.notes += [note] if (note := realism.mean_load(results)) else []
    wheel(results, section, time)
    tread(results, section)
    texture(results, section)
    points, normal = results.array(name, "points"), results.dataset(name, "normal_force")
    stride = max(1, -(-len(time) // SAMPLED))
    picture = surface_figures.space_time(time[::stride], points, sampled(normal, stride))
    caption = f"Normal force summed across the width, one instant in {stride}."
    section.show(picture, caption)
    return section


def run_in(results: Results) -> float:
    """Run-in (s) that the spectra leave out; 0 where it is unknown."""
    try:
        return float(results.attribute("spectra.h5", "left_out") or 0.0)
    except (Absent, InputError):  # a file that is damaged is told of by its own section
        return 0.0


@dataclass(frozen=True)
class _Valid:
    """Forces (nt, 3) N as far as they are valid, the `words` that say so, and figures of them."""

    forces: dict[str, NDArray]
    words: str
    facts: list[tuple[str, str]]


def _valid(results: Results, given: Mapping[str, NDArray | None]) -> _Valid:
    """The forces below the limit of spectra.h5, and their figures after its run-in; all without it.

    Impacts of points make forces beyond the modes, which a single step may have several times as
    large as what the tire feels.
    """
    forces = {name: values for name, values in given.items() if values is not None}
    try:
        limit, step = (
            float(results.attribute(file, name))
            for file, name in (("spectra.h5", "limit"), ("contact.h5", "step"))
        )
        left_out = run_in(results)
    except (Absent, InputError, TypeError):  # a file that is damaged is told of by its own section
        limit, left_out, step = np.inf, 0.0, 1.0
    words = f" below {quantity(limit, 'Hz')}" if np.isfinite(limit) else ""
    if np.isfinite(limit):
        forces = {name: in_band(values, step, limit) for name, values in forces.items()}
    start = min(round(left_out / step), len(forces["contact"]) - 1)
    after = f" from {quantity(start * step, 's')} on" if start else ""
    facts = []
    if words or after:
        facts.append(("forces here", f"those{words}{',' if words and after else ''}{after}"))
    along = "longitudinal (without friction)" if without_friction(results) else "longitudinal"
    for name, values in forces.items():
        for axis, component in ((2, "vertical"), (0, along)):
            some = values[start:, axis]
            for how, value in (
                ("least", some.min()),
                ("mean", some.mean()),
                ("largest", some.max()),
                ("standard deviation of the", some.std()),
            ):
                facts.append((f"{how} {component} {name} force", quantity(float(value), "N")))
    return _Valid(forces, words, facts)


def sampled(dataset: h5py.Dataset, stride: int) -> NDArray:
    """Every `stride`-th row (n, c): of a small dataset at once, of a large one row by row.

    Reading one row decompresses its whole chunk, so 400 rows cost more than 20 MB read at once.
    """
    if dataset.nbytes <= AT_ONCE:
        return dataset[()][::stride]
    return np.stack([dataset[row] for row in range(0, dataset.shape[0], stride)])


def pressure_maps(results: Results, section: Section, time: NDArray, vertical: NDArray) -> None:
    """Add the contact pressure at the minimum, mean, maximum and last vertical force.

    The mean one is of after the run-in, at which the tire rests on a flat road; the film opens there.
    """
    start = min(round(run_in(results) / float(time[0] or 1.0)), len(time) - 1)
    rolls = vertical[start:]
    mean = start + int(np.abs(rolls - rolls.mean()).argmin())
    chosen = {"least": int(vertical.argmin()), "mean": mean, "greatest": int(vertical.argmax())}
    chosen["last"] = len(time) - 1
    normal, area = results.dataset("contact.h5", "normal_force"), None
    for name, path in (("contact.h5", "area"), ("static.h5", "contact/area")):
        area = results.borrowed(name, path) if area is None else area
    shown = [pressure(normal[row], area) for row in chosen.values()]
    titles = [
        f"{key} {quantity(float(vertical[row]), 'N')}, {quantity(float(time[row]), 's')}"
        for key, row in chosen.items()
    ]
    points = results.array("contact.h5", "points")
    maps = [values for values, _ in shown]
    stride = max(1, -(-len(time) // PLAYED))
    played, unit = pressure(np.nan_to_num(sampled(normal, stride)), area)
    top = surface_figures.darkest(played)
    picture = surface_figures.footprints(points, maps, titles, unit, top)
    caption = (
        "The footprint while rolling; in the still picture when the force is least, mean, greatest, last. "
        f"{surface_figures.DARKEST:.0%} of the touching points lie within the scale."
    )
    known = area is not None and area.shape == (len(points),) and len(time) > 1
    film = None
    if known:  # else there are forces, whose points may have any size
        half = np.full(2, np.sqrt(np.median(area)) / 2)
        begin = min(round(mean / stride), len(played) - 1)
        film = live.footprint(points, half, time[::stride], played, unit, top, begin)
    section.show(picture, caption, film)


def histories(
    time: NDArray, forces: Mapping[str, NDArray | None], active: NDArray | None
) -> dict | None:
    """Charts of named forces (nt, 3) N by component, and of the number of touching points (nt,)."""
    if len(time) < 2:
        return None
    there = {name: force for name, force in forces.items() if force is not None}
    made = [
        live.chart(
            time,
            {f"{name} {component}": force[:, axis] for name, force in there.items()},
            ("time in s", "force in N"),
            figures.COLOURS[::2],
            height=170 if axis < 2 else 230,
        )
        for axis, component in reversed(list(enumerate("xyz")))
    ]
    if active is not None:
        curves = {"points in contact": active}
        made.append(
            live.chart(time, curves, ("time in s", "points in contact"), ("#52606d",), height=150)
        )
    return live.charts(*made)


def response(results: Results) -> Section:
    """The section on point forces (response.h5)."""
    name = "response.h5"
    results.file(name)
    section = Section("Point forces", "Displacement at the driven points.")
    time, moved = results.optional(name, "time"), results.optional(name, "displacement")
    force = results.optional(name, "force")
    if time is not None and moved is not None and len(time):
        names = point_names(results.scene, moved.shape[1])
        for label, path in zip(names, moved.transpose(1, 0, 2), strict=True):
            greatest = float(np.linalg.norm(path, axis=1).max())
            section.facts.append((f"greatest displacement, {label}", quantity(greatest, "m")))
        picture = figures.driven_points(time, force, moved, names)
        section.show(picture, "Displacement over time; dashed: the force.")
    frequency, receptance = (
        results.optional(name, "frequency"),
        results.optional(name, "receptance"),
    )
    if frequency is not None and receptance is not None and len(frequency):
        count = receptance.shape[1]
        both = [(i, j) for i in range(count) for j in range(i + 1)][:PAIRED]
        pairs = [(f"H {i + 1},{j + 1}", receptance[:, i, j]) for i, j in both]
        picture = figures.receptance(frequency, pairs)
        levels = {label: figures.decibels(values) for label, values in pairs}
        labels = "frequency in Hz", "receptance in dB re 1 m/N"
        above_zero = frequency > 0
        curves = {label: level[above_zero] for label, level in levels.items()}
        drawn = live.charts(
            live.chart(frequency[above_zero], curves, labels, figures.CYCLE, log=True, height=300)
        )
        section.show(picture, "Receptance: displacement at i along its force per N at j.", drawn)
    driven = len(results.scene.get("force", []))
    add(results, section, point_names(results.scene, driven))
    if not section.figures:
        raise Absent(f"{name} holds neither displacement over time nor receptance")
    return section


def point_names(scene: Mapping, count: int) -> list[str]:
    """A name for every driven point, with its location if the scene has it."""
    forces = scene.get("force", [])
    if len(forces) != count:
        return [f"point {n + 1}" for n in range(count)]
    return [
        f"point {n + 1} ({f.get('angle', 0.0):g}° around, {f.get('arc', 0.0):g}° along the section)"
        for n, f in enumerate(forces)
    ]
