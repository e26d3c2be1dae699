"""What the report says of forces: rolling contact, spectra and point forces."""

from collections.abc import Mapping

import h5py
import numpy as np
from numpy.typing import NDArray

from tireroad.runs.files.read import Absent, Results, Section, attributes
from tireroad.runs.report import figures, surface_figures
from tireroad.runs.report.quantities import quantity
from tireroad.runs.report.sections import corner, pattern, transmissibility
from tireroad.runs.report.sections.tire import pressure

SAMPLED = 400  # instants read of a (time, point) dataset: the file may be larger than memory
AT_ONCE = 2e8  # bytes
PAIRED = 6  # receptances drawn


def contact(results: Results) -> Section:
    """The tire rolling over the road (contact.h5)."""
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
    section.figures.append((picture, "Forces over time; peaks are kept in the drawing."))
    pressure_maps(results, section, time, vertical)
    if len(time) == 1:
        return section
    corner.wheel(results, section, time)
    pattern.tread(results, section)
    points, normal = results.array(name, "points"), results.dataset(name, "normal_force")
    stride = max(1, -(-len(time) // SAMPLED))
    picture = surface_figures.space_time(time[::stride], points, sampled(normal, stride))
    caption = f"Normal force summed across the width, one instant in {stride}."
    section.figures.append((picture, caption))
    return section


def sampled(dataset: h5py.Dataset, stride: int) -> NDArray:
    """Every `stride`-th row (n, c): of a small dataset at once, of a large one row by row.

    One row costs the unpacking of its whole chunk, so that 400 rows cost more than 20 MB at once.
    """
    if dataset.nbytes <= AT_ONCE:
        return dataset[()][::stride]
    return np.stack([dataset[row] for row in range(0, dataset.shape[0], stride)])


def pressure_maps(results: Results, section: Section, time: NDArray, vertical: NDArray) -> None:
    """Adds the contact pressure at the least, mean, greatest and last vertical force."""
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
    picture = surface_figures.footprints(points, maps, titles, shown[0][1], 10.2)
    section.figures.append((picture, "When the vertical force is least, mean, greatest, and last."))


def spectra(results: Results) -> Section:
    """Spectra of the variation of the axle force, or, where that is not kept, of the contact force."""
    name = "spectra.h5"
    frequency, force = results.array(name, "frequency"), results.optional(name, "axle_force")
    of = "contact force" if force is None else "axle force"
    force = results.array(name, "contact_force") if force is None else force
    section = Section(f"Spectra of the {of}", "Of its variation about the mean, by component.")
    if len(frequency) < 2:
        section.notes.append("A run of one step has no spectrum.")
        return section
    spacing = quantity(float(frequency[1] - frequency[0]), "Hz")
    section.facts.append(("spacing of lines", spacing))
    section.facts += attributes(results, name, (("limit", "Hz"), ("limit_cause", "")))
    section.figures.append((figures.spectrum(frequency, force, of), "Amplitude spectrum."))
    centre = results.optional(name, "third_octave/centre")
    level = results.optional(name, "third_octave/level")
    if centre is None or level is None or not len(centre):
        section.notes.append("No third-octave bands in spectra.h5.")
        return section
    error, caption = results.optional(name, "third_octave/level_error"), "Third-octave bands, rms."
    if error is not None and np.isfinite(error).any():
        caption += " Lines on the bars: estimated error by mesh, modes, step and points."
    elif error is not None:
        caption += " The companions of this run were too short to tell the error of a band."
    section.figures.append((figures.third_octaves(centre, level, error), caption))
    return section


def response(results: Results) -> Section:
    """The tire under point forces (response.h5)."""
    name = "response.h5"
    section = Section("Point forces", "Displacement at the driven points.")
    time, moved = results.optional(name, "time"), results.optional(name, "displacement")
    force = results.optional(name, "force")
    if time is not None and moved is not None and len(time):
        names = point_names(results.scene, moved.shape[1])
        for label, path in zip(names, moved.transpose(1, 0, 2), strict=True):
            greatest = float(np.linalg.norm(path, axis=1).max())
            section.facts.append((f"greatest displacement, {label}", quantity(greatest, "m")))
        picture = figures.driven_points(time, force, moved, names)
        section.figures.append((picture, "Displacement over time; dashed: the force."))
    frequency, receptance = (
        results.optional(name, "frequency"),
        results.optional(name, "receptance"),
    )
    if frequency is not None and receptance is not None and len(frequency):
        count = receptance.shape[1]
        both = [(i, j) for i in range(count) for j in range(i + 1)][:PAIRED]
        pairs = [(f"H {i + 1},{j + 1}", receptance[:, i, j]) for i, j in both]
        picture = figures.receptance(frequency, pairs)
        section.figures.append(
            (picture, "Receptance: displacement at i along its force per N at j.")
        )
    driven = len(results.scene.get("force", []))
    transmissibility.add(results, section, point_names(results.scene, driven))
    if not section.figures:
        raise Absent(f"{name} holds neither displacement over time nor receptance")
    return section


def point_names(scene: Mapping, count: int) -> list[str]:
    """A name for every driven point, with its place where the scene tells."""
    forces = scene.get("force", [])
    if len(forces) != count:
        return [f"point {n + 1}" for n in range(count)]
    return [
        f"point {n + 1} ({f.get('angle', 0.0):g}° around, {f.get('arc', 0.0):g}° along the section)"
        for n, f in enumerate(forces)
    ]
