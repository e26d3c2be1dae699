"""What the report says of each result file: facts, tables and pictures, from the datasets alone."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

from runs import figures, surface_figures
from runs.quantities import quantity

LISTED = 16  # rows of a table of modes; the files hold them all
PICTURED = 6
SAMPLED = 400  # instants read of a (time, point) dataset: the file may be larger than memory
PAIRED = 6  # receptances drawn


@dataclass
class Table:
    head: tuple[str, ...]
    rows: list[tuple[str, ...]]


@dataclass
class Section:
    title: str
    lead: str = ""
    facts: list[tuple[str, str]] = field(default_factory=list)
    figures: list[tuple[str, str]] = field(default_factory=list)  # data URI, caption
    table: Table | None = None
    notes: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)


class Absent(LookupError):
    """A file or dataset a section needs is not there; the message names it."""


class Results:
    """The result files of one folder, opened when first asked for; a context manager."""

    def __init__(self, directory: Path, scene: Mapping) -> None:
        self.directory, self.scene = directory, scene
        self._open: dict[str, h5py.File] = {}

    def __enter__(self) -> "Results":
        return self

    def __exit__(self, *_: object) -> None:
        for file in self._open.values():
            file.close()

    def file(self, name: str) -> h5py.File:
        """The open HDF5 file; Absent where there is none, OSError where it is damaged."""
        if name not in self._open:
            path = self.directory / name
            if not path.is_file():
                raise Absent(f"there is no {name}")
            self._open[name] = h5py.File(path, "r")
        return self._open[name]

    def dataset(self, name: str, path: str) -> h5py.Dataset:
        found = self.file(name).get(path)
        if not isinstance(found, h5py.Dataset):
            raise Absent(f"{name} holds no dataset {path}")
        return found

    def array(self, name: str, path: str) -> NDArray:
        return self.dataset(name, path)[()]

    def optional(self, name: str, path: str) -> NDArray | None:
        try:
            return self.array(name, path)
        except Absent:
            return None

    def attribute(self, name: str, key: str) -> float | str | None:
        value = self.file(name).attrs.get(key)
        return value.item() if isinstance(value, (np.generic, np.ndarray)) else value


def attributes(results: Results, name: str, wanted: tuple[tuple[str, str], ...]) -> list:
    """Facts from the attributes (key, unit) the file has."""
    found = [(key, unit, results.attribute(name, key)) for key, unit in wanted]
    return [(key.replace("_", " "), quantity(v, unit)) for key, unit, v in found if v is not None]


def static(results: Results) -> Section:
    """The tire at rest on the road (static.h5)."""
    section = Section("Loaded tire and footprint", "The static state everything later starts from.")
    name = "static.h5"
    section.facts = attributes(
        results,
        name,
        (
            ("inflation", "Pa"),
            ("load", "N"),
            ("deflection", "m"),
            ("rolling_radius", "m"),
            ("road_height", "m"),
            ("touch_height", "m"),
            ("footprint_length", "m"),
            ("footprint_width", "m"),
        ),
    )
    speed = results.scene.get("rotation", {}).get("speed")
    radius = results.attribute(name, "rolling_radius")
    if speed and radius:
        pace = quantity(3.6 * speed * radius, "km/h")
        section.facts.append(("travelling speed", pace))
    points, quads = results.array(name, "surface/points"), results.array(name, "surface/quads")
    moved, road = (
        results.array(name, "surface/displacement"),
        results.attribute(name, "road_height"),
    )
    size = 1e3 * np.linalg.norm(moved, axis=1).max()
    section.figures.append(
        (
            surface_figures.deformed(points, moved, quads, road),
            f"Displacement at its true scale, {size:.3g} mm at most. Grey: as made.",
        )
    )
    footprint(results, section)
    return section


def footprint(results: Results, section: Section) -> None:
    """Adds the map of the static contact pressure, where the tire stands on a road."""
    force, points = (results.optional("static.h5", f"contact/{n}") for n in ("force", "points"))
    if force is None or points is None or not (force[:, 2] > 0).any():
        section.notes.append("No road: there is no footprint.")
        return
    area = results.optional("static.h5", "contact/area")
    values, unit = pressure(force[:, 2], area)
    active = force[:, 2] > 0
    section.facts.append(("points in contact", quantity(int(active.sum()))))
    caption = f"Contact force, {quantity(float(force[:, 2].sum()), 'N')} in all"
    if area is not None:
        section.facts.append(("contact area", f"{1e4 * area[active].sum():.4g} cm²"))
        mean = float(force[active, 2].sum() / area[active].sum())
        section.facts.append(("mean contact pressure", quantity(mean, "Pa")))
        caption = f"Contact pressure of {quantity(float(force[:, 2].sum()), 'N')}"
    picture = surface_figures.footprints(points, [values], ["footprint at rest"], unit, 6.2)
    section.figures.append((picture, caption + ". Grey dots: surface points that do not touch."))


def pressure(force: NDArray, area: NDArray | None) -> tuple[NDArray, str]:
    """Pressure (c) kPa where the area of every point is known, else the force (c) N."""
    if area is None or area.shape != force.shape[-1:]:
        return force, "force in N"
    return np.divide(
        1e-3 * force, area, out=np.zeros_like(force), where=area > 0
    ), "pressure in kPa"


def modes(results: Results) -> Section:
    """Modes of the loaded, standing tire (modes.h5)."""
    name = "modes.h5"
    section = Section("Modes of the loaded tire", "Undamped, not rotating, about the static state.")
    frequency, residual = results.array(name, "frequency"), results.optional(name, "residual")
    top = quantity(float(frequency.max()), "Hz")
    section.facts = [("modes", quantity(len(frequency))), ("highest frequency", top)]
    wanted = (("inertia_count", ""), ("rigid_modes", ""))
    section.facts += attributes(results, name, wanted)
    columns = [[quantity(float(value), "Hz") for value in frequency[:LISTED]]]
    if residual is not None:
        columns.append([quantity(float(value)) for value in residual[:LISTED]])
    head = ("mode", "frequency", "residual")[: 1 + len(columns)]
    numbers = [str(n + 1) for n in range(min(LISTED, len(frequency)))]
    section.table = Table(head, list(zip(numbers, *columns, strict=True)))
    points, quads = (
        results.array(name, "surface/points"),
        results.optional("static.h5", "surface/quads"),
    )
    if quads is None or quads.max(initial=-1) >= len(points):
        section.notes.append("No pictures: static.h5 holds no quads for this surface.")
        return section
    shapes = results.dataset(name, "surface/shape")[:PICTURED]
    titles = [f"{n + 1}: {quantity(float(f), 'Hz')}" for n, f in enumerate(frequency[:PICTURED])]
    picture = surface_figures.modes(points, quads, shapes, titles)
    section.figures.append((picture, "The lowest mode shapes, exaggerated."))
    return section


def rotating(results: Results) -> Section:
    """Eigenvalues of the rolling tire (rotating.h5)."""
    name = "rotating.h5"
    section = Section("Modes of the rolling tire", "Eigenvalues s of the rotating, damped tire.")
    value = results.array(name, "eigenvalue")
    growing = int((value.real > 0).sum())
    section.facts = attributes(results, name, (("speed", "rad/s"), ("basis_condition", "")))
    section.facts.append(("growing (Re s > 0)", quantity(growing)))
    if growing:
        worst = value[value.real.argmax()]
        section.warnings.append(
            f"The rolling tire is unstable: {growing} eigenvalues have Re s > 0, the worst "
            f"{quantity(float(worst.real), '1/s')} at "
            f"{quantity(float(abs(worst.imag) / 2 / np.pi), 'Hz')}."
        )
    rising = np.flatnonzero(value.imag > 0)
    rising = rising[np.argsort(value.imag[rising])]
    columns = {"residual": results.optional(name, "residual")}
    columns["left residual"] = results.optional(name, "left_residual")
    present = {key: column for key, column in columns.items() if column is not None}
    rows = [
        (
            quantity(float(value[q].imag / 2 / np.pi), "Hz"),
            quantity(float(value[q].real), "1/s"),
            f"{-100.0 * value[q].real / abs(value[q]):.3g} %".replace("-", "−"),
            *(quantity(float(column[q])) for column in present.values()),
        )
        for q in rising[:LISTED]
    ]
    section.table = Table(("frequency", "Re s", "of critical damping", *present), rows)
    section.figures.append((figures.eigenvalues(value), "Eigenvalues with Im s ≥ 0."))
    return section


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
    points, normal = results.array(name, "points"), results.dataset(name, "normal_force")
    stride = max(1, -(-len(time) // SAMPLED))
    picture = surface_figures.space_time(time[::stride], points, sampled(normal, stride))
    caption = f"Normal force summed across the width, one instant in {stride}."
    section.figures.append((picture, caption))
    return section


def sampled(dataset: h5py.Dataset, stride: int) -> NDArray:
    """Every `stride`-th row."""
    if stride == 1:
        return dataset[()]
    return np.stack([dataset[row] for row in range(0, dataset.shape[0], stride)])


def pressure_maps(results: Results, section: Section, time: NDArray, vertical: NDArray) -> None:
    """Adds the contact pressure at the least, mean, greatest and last vertical force."""
    mean = int(np.abs(vertical - vertical.mean()).argmin())
    chosen = {"least": int(vertical.argmin()), "mean": mean, "greatest": int(vertical.argmax())}
    chosen["last"] = len(time) - 1
    normal, area = results.dataset("contact.h5", "normal_force"), None
    for name, path in (("contact.h5", "area"), ("static.h5", "contact/area")):
        area = results.optional(name, path) if area is None else area
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
    """Spectra of the variation of the axle force (spectra.h5)."""
    name = "spectra.h5"
    section = Section("Spectra of the axle force", "Of its variation about the mean, by component.")
    frequency, force = results.array(name, "frequency"), results.array(name, "axle_force")
    if len(frequency) > 1:
        spacing = quantity(float(frequency[1] - frequency[0]), "Hz")
        section.facts.append(("spacing of lines", spacing))
    section.facts.append(("up to", quantity(float(frequency.max()), "Hz")))
    section.figures.append((figures.spectrum(frequency, force), "Amplitude spectrum."))
    centre = results.optional(name, "third_octave/centre")
    level = results.optional(name, "third_octave/level")
    if centre is None or level is None or not len(centre):
        section.notes.append("No third-octave bands in spectra.h5.")
        return section
    section.figures.append((figures.third_octaves(centre, level), "Third-octave bands, rms."))
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


SECTIONS: Mapping[str, Callable[[Results], Section]] = {
    "static.h5": static,
    "modes.h5": modes,
    "rotating.h5": rotating,
    "response.h5": response,
    "contact.h5": contact,
    "spectra.h5": spectra,
}
