"""Report sections about forces: rolling contact and point forces."""

from collections.abc import Mapping

import h5py
import numpy as np
from numpy.typing import NDArray

from tireroad.runs.files.read import Absent, Results, Section, attributes
from tireroad.runs.report import figures, live, realism, surface_figures
from tireroad.runs.report.quantities import quantity
from tireroad.runs.report.sections import corner, pattern, road, transmissibility
from tireroad.runs.report.sections.tire import pressure

SAMPLED = 400  # instants read of a (time, point) dataset: it may be larger than memory
AT_ONCE = 2e8  # bytes
PAIRED = 6  # receptances drawn
PLAYED = 240  # instants of the animated footprint


def contact(results: Results) -> Section:
    """The section on rolling contact (contact.h5)."""
    name = "contact.h5"
    section = Section("Rolling contact", "Total forces of the road on the tire.")
    time, total = results.array(name, "time"), results.array(name, "total_force")
    if not len(time):
        raise Absent(f"{name} holds no step yet")
    wanted = (("road", ""), ("scheme", ""), ("step", "s"), ("speed", "rad/s"))
    vertical = total[:, 2]
    extremes = (("least", vertical.min()), ("mean", vertical.mean()), ("greatest", vertical.max()))
    section.facts = [("simulated", quantity(float(time[-1]), "s")), ("steps", quantity(len(time)))]
    section.facts += attributes(results, name, wanted)
    section.facts += [(f"{key} vertical force", quantity(float(v), "N")) for key, v in extremes]
    section.facts.append(("its standard deviation", quantity(float(vertical.std()), "N")))
    axle, active = results.optional(name, "axle_force"), results.optional(name, "active")
    picture = figures.forces(time, total, axle, active)
    drawn = histories(time, {"contact": total, "axle": axle}, active)
    section.show(picture, "Forces over time; peaks are kept in the drawing.", drawn)
    pressure_maps(results, section, time, vertical)
    if len(time) == 1:
        return section
    section.notes += [note] if (note := realism.mean_load(results)) else []
    corner.wheel(results, section, time)
    pattern.tread(results, section)
    road.texture(results, section)
    points, normal = results.array(name, "points"), results.dataset(name, "normal_force")
    stride = max(1, -(-len(time) // SAMPLED))
    picture = surface_figures.space_time(time[::stride], points, sampled(normal, stride))
    caption = f"Normal force summed across the width, one instant in {stride}."
    section.show(picture, caption)
    return section


def sampled(dataset: h5py.Dataset, stride: int) -> NDArray:
    """Every `stride`-th row (n, c): of a small dataset at once, of a large one row by row.

    Reading one row decompresses its whole chunk, so 400 rows cost more than 20 MB read at once.
    """
    if dataset.nbytes <= AT_ONCE:
        return dataset[()][::stride]
    return np.stack([dataset[row] for row in range(0, dataset.shape[0], stride)])


def pressure_maps(results: Results, section: Section, time: NDArray, vertical: NDArray) -> None:
    """Add the contact pressure at the minimum, mean, maximum and last vertical force."""
    mean = int(np.abs(vertical - vertical.mean()).argmin())
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
    picture = surface_figures.footprints(points, maps, titles, shown[0][1])
    caption = "The footprint while rolling; in the still picture when the force is least, mean, greatest, last."
    section.show(picture, caption, rolling(points, time, normal, area))


def rolling(
    points: NDArray, time: NDArray, normal: h5py.Dataset, area: NDArray | None
) -> dict | None:
    """The animated footprint; None if the area of the points, and so their pressure, is unknown."""
    if area is None or area.shape != (len(points),) or len(time) < 2:
        return None
    stride = max(1, -(-len(time) // PLAYED))
    values, unit = pressure(np.nan_to_num(sampled(normal, stride)), area)
    half = np.full(2, np.sqrt(np.median(area)) / 2)
    return live.footprint(points, half, time[::stride], values, unit)


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
        kept = frequency > 0
        curves = {label: level[kept] for label, level in levels.items()}
        drawn = live.charts(
            live.chart(frequency[kept], curves, labels, figures.CYCLE, log=True, height=300)
        )
        section.show(picture, "Receptance: displacement at i along its force per N at j.", drawn)
    driven = len(results.scene.get("force", []))
    transmissibility.add(results, section, point_names(results.scene, driven))
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
