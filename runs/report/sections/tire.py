"""Report sections about the loaded tire, its stiffness, its modes and its air."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from tireroad.runs.report import live, surface_figures
from tireroad.runs.report.element_surface import ElementSurface
from tireroad.runs.report.figures import COLOURS, MUTED, canvas, encode, styled
from tireroad.runs.report.read import Results, Section, TextTable, attributes, quantity
from tireroad.runs.report.realism import mean_pressure

_MOSTLY = 0.3  # of a state's kinetic energy
_LISTED = 6
LISTED = 16  # rows of a table of modes; the files hold all modes
PICTURED = 6
_LABELS = {"footprint shoulder": "pressure of shoulders over middle"}
NAMES = (
    "R: in the plane of the wheel, symmetric in y; L: out of it, antisymmetric; T: torsional, about the axle; C: air "
    "in the cavity; then the number of waves around the tire. R0 breathes, R1 moves the belt up or forward, L0 moves "
    "it sideways, L1 tilts it (yaw, camber). [n,a] is not the lowest of its kind: n waves around, a nodal lines along "
    "the tread. R7/6: no number of waves holds half of it, 7 and 6 the most."
)
_ALONG = (
    *(("kg in ", axis) for axis in "xyz"),
    *(("kg m² about ", axis) for axis in "xyz"),
)
_WORTH = 0.01  # of the largest effective mass
_FILE = "stiffness.h5"
_FACTS = (
    ("vertical", "vertical stiffness, slope of the curve", "N/m"),
    ("longitudinal", "longitudinal stiffness", "N/m"),
    ("lateral", "lateral stiffness", "N/m"),
    ("torsional", "torsional stiffness about the vertical", "N m/rad"),
)
_COLUMNS = (
    ("deflection", 1e3, "deflection, mm"),
    ("load", 1.0, "load, N"),
    ("stiffness", 1e-3, "slope, N/mm"),
    ("footprint_length", 1e3, "length, mm"),
    ("footprint_width", 1e3, "width, mm"),
    ("footprint_area", 1e4, "area, cm²"),
    ("pressure", 1e-3, "mean pressure, kPa"),
    ("rolling_radius", 1e3, "rolling radius, mm"),
)


def duct(results: Results, section: Section) -> None:
    """Add the modes of the air between rigid walls, if the tire has air (modes.h5)."""
    frequency = results.optional("modes.h5", "cavity/frequency")
    if frequency is None:
        return
    volume = results.dataset("modes.h5", "cavity/pressure").parent.attrs["volume"]
    section.facts.append(("air inside", f"{1e3 * volume:.4g} l"))
    section.facts.append(("modes of the air between rigid walls", _listed(frequency)))
    section.notes.append("The modes listed are the tire's, without the air that couples them.")


def resonances(
    results: Results, section: Section, file: str, name: str, eigenvalue: NDArray
) -> None:
    """Add the states dominated by the air, if the tire has air."""
    share = results.optional(file, name)
    if share is None:
        return
    mostly = np.flatnonzero((share >= _MOSTLY) & (eigenvalue.imag > 0))
    mostly = mostly[np.argsort(eigenvalue.imag[mostly])]
    text = _listed(eigenvalue.imag[mostly] / (2 * np.pi)) if len(mostly) else "none"
    section.facts.append((f"states with {_MOSTLY:.0%} and more of their energy in the air", text))


def _listed(frequency: NDArray) -> str:
    more = ", …" if len(frequency) > _LISTED else ""
    return ", ".join(quantity(float(f), "Hz") for f in frequency[:_LISTED]) + more


def static(results: Results) -> Section:
    """The section on the static state (static.h5)."""
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
            ("footprint_shape_factor", "-"),
            ("footprint_shoulder", "-"),
            ("camber", "deg"),
            ("drum_radius", "m"),
        ),
    )
    section.facts = [(_LABELS.get(label, label), value) for label, value in section.facts]
    speed = results.scene.get("rotation", {}).get("speed")
    radius = results.attribute(name, "rolling_radius")
    if speed and radius:
        pace = quantity(3.6 * speed * radius, "km/h")
        section.facts.append(("travelling speed", pace))
    section.facts += friction(results)
    text = results.attribute(name, "from_file")
    if text:
        section.listing = "What the run takes from the tire's file, and what not", str(text)
    points, quads = results.array(name, "surface/points"), results.array(name, "surface/quads")
    moved, road = (
        results.array(name, "surface/displacement"),
        results.attribute(name, "road_height"),
    )
    size = 1e3 * np.linalg.norm(moved, axis=1).max()
    face = ElementSurface.of(points, quads, results.scene)
    section.show(
        surface_figures.deformed(face.points, face.field(moved), face.quads, road),
        f"Displacement at its true scale, {size:.3g} mm at most. Grey: as made.",
    )
    footprint(results, section)
    cords(results, section)
    return section


def friction(results: Results) -> list[tuple[str, str]]:
    """Resultants of a static state with friction; empty without friction."""
    force, moment = (
        results.attribute("static.h5", name) for name in ("horizontal_force", "moment")
    )
    if not (isinstance(force, list) and isinstance(moment, list)):
        return []
    named = zip(
        ("horizontal force of the road, forward", "to the left"),
        force,
        strict=True,
    )
    turning = zip(("torque on the axle", "moment about the vertical"), moment[1:], strict=True)
    return [(name, quantity(round(value, 6), "N")) for name, value in named] + [
        (name, quantity(round(value, 6), "N m")) for name, value in turning
    ]


def cords(results: Results, section: Section) -> None:
    """Add a table of the cord forces, if the tire has cords."""
    rows = []
    for ply in results.scene.get("tire", {}).get("cords", ()):
        force, area = (
            results.optional("static.h5", f"cords/{ply['name']}/{part}")
            for part in ("force", "area")
        )
        if force is None or area is None:
            continue
        mean, slack = (force * area).sum() / area.sum(), area[force < 0].sum() / area.sum()
        forces = (quantity(float(value), "N") for value in (force.max(), mean, force.min()))
        rows.append((ply["name"], *forces, f"{100 * slack:.3g} %"))
    if rows:
        section.notes.append(
            "Force of one cord, tension positive; compressed: share of the ply's area whose cords are."
        )
        section.table = TextTable(("cords", "largest", "mean", "least", "compressed"), rows)


def footprint(results: Results, section: Section) -> None:
    """Add the map of the static contact pressure, if there is a road."""
    force, points = (results.optional("static.h5", f"contact/{n}") for n in ("force", "points"))
    if force is None or points is None or not (force[:, 2] > 0).any():
        section.notes.append("No road: there is no footprint.")
        return
    area = results.optional("static.h5", "contact/area")
    values, unit = pressure(force[:, 2], area)
    active = force[:, 2] > 0
    section.facts.append(("points in contact", quantity(int(active.sum()))))
    caption = f"Contact force, {quantity(float(force[:, 2].sum()), 'N')} in all"
    whole = results.attribute("static.h5", "footprint_area")
    if isinstance(whole, float) and whole > 0:
        section.facts.append(("contact area", f"{1e4 * whole:.4g} cm²"))
        section.facts.append(("mean contact pressure", quantity(mean_pressure(results), "Pa")))
        if (largest := results.optional("static.h5", "contact/pressure")) is not None:
            found = quantity(float(largest.max(initial=0.0)), "Pa")
            section.facts.append(("largest contact pressure", found))
    if area is not None:
        caption = f"Contact pressure of {quantity(float(force[:, 2].sum()), 'N')}"
    picture = surface_figures.footprints(points, [values], ["footprint at rest"], unit)
    section.show(picture, caption + ". Grey dots: surface points that do not touch.")


def pressure(force: NDArray, area: NDArray | None) -> tuple[NDArray, str]:
    """Pressure (c) kPa if the area of every point is known, else the force (c) N."""
    if area is None or area.shape != force.shape[-1:]:
        return force, "force in N"
    return np.divide(
        1e-3 * force, area, out=np.zeros_like(force), where=area > 0
    ), "pressure in kPa"


def modes(results: Results) -> Section:
    """The section on the modes of the loaded, non-rotating tire (modes.h5)."""
    name = "modes.h5"
    section = Section("Modes of the loaded tire", "Undamped, not rotating, about the static state.")
    frequency = results.array(name, "frequency")
    top = quantity(float(frequency.max()), "Hz")
    section.facts = [("modes", quantity(len(frequency))), ("highest frequency", top)]
    keys = (("inertia_count", ""), ("rigid_modes", ""))
    section.facts += attributes(results, name, keys)
    duct(results, section)
    called = _named(results, name)
    columns = {
        "mode": [str(n + 1) for n in range(min(LISTED, len(frequency)))],
        **{key: called.pop(key) for key in ("name",) if key in called},
        "frequency": [quantity(float(value), "Hz") for value in frequency[:LISTED]],
        **called,
    }
    rows = list(zip(*columns.values(), strict=True))
    section.table = TextTable(tuple(columns), rows)
    if "name" in columns:
        section.notes.append(NAMES)
    if len(frequency) > LISTED:
        section.notes.append(f"The table lists {LISTED} of {len(frequency)} modes.")
    points, quads = (
        results.array(name, "surface/points"),
        results.borrowed("static.h5", "surface/quads"),
    )
    if quads is None or quads.max(initial=-1) >= len(points):
        section.notes.append("No pictures: static.h5 holds no quads for this surface.")
        return section
    shapes = results.dataset(name, "surface/shape")[:PICTURED]
    names = columns.get("name", columns["mode"])
    titles = [f"{n}: {f}" for n, f in zip(names, columns["frequency"], strict=True)][:PICTURED]
    face = ElementSurface.of(points, quads, results.scene)
    drawn = face.points, face.quads
    picture = surface_figures.modes(*drawn, face.field(shapes), titles)
    normal = surface_figures.outward(*drawn)
    turned = live.shapes(*drawn, normal, face.field(shapes), titles)
    section.show(picture, "The lowest mode shapes, exaggerated.", turned)
    return section


def _named(results: Results, file: str) -> dict[str, list[str]]:
    """Columns that say what each mode is: name, motion, wave number, damping, effective mass."""
    name = results.optional(file, "name")
    if name is None:  # of an earlier version
        return {}
    carried = results.array(file, "effective_mass")[:LISTED]
    return {
        "name": list(name[:LISTED]),
        "damping": [ratio(value) for value in results.array(file, "damping")[:LISTED]],
        "waves around": [str(n) for n in results.array(file, "wave_number")[:LISTED]],
        "effective mass at the hub": [_carried(row, carried) for row in carried],
        "motion": list(results.array(file, "motion")[:LISTED]),
    }


def ratio(value: float) -> str:
    """A damping ratio in percent of critical damping."""
    return f"{100.0 * value:.3g} %".replace("-", "−") if np.isfinite(value) else "unknown"


def _carried(row: NDArray, every: NDArray) -> str:
    """The larger ones of the effective masses (6,), beside the largest of all modes (m, 6)."""
    largest = [np.nanmax(every[:, part], initial=0.0) for part in (slice(0, 3), slice(3, 6))]
    forces = [
        f"{row[k]:.3g} {unit}{axis}"
        for k, (unit, axis) in enumerate(_ALONG)
        if row[k] >= _WORTH * largest[k // 3] > 0
    ]
    return ", ".join(forces) or "–"


def stiffness(results: Results) -> Section:
    """The section: curve, table and stiffnesses."""
    section = Section(
        "Load, deflection and stiffness",
        "The standing tire pressed on a flat road, its rim held. Horizontally and about the vertical: "
        "the footprint sticks to a road that moves a little, at constant load.",
    )
    load = float(results.array(_FILE, "load"))
    section.facts.append(("at a load of", quantity(load, "N")))
    for name, title, unit in _FACTS:
        value = results.optional(_FILE, name)
        if value is not None:
            section.facts.append((title, quantity(float(value), unit)))
    columns = [scale * results.array(_FILE, f"curve/{name}") for name, scale, _ in _COLUMNS]
    head = tuple(title for *_, title in _COLUMNS)
    section.table = TextTable(
        head, [tuple(f"{v:.4g}" for v in row) for row in np.transpose(columns)]
    )
    picture = curve(columns[0], columns[1], columns[5], load)
    section.show(picture, "Load and contact area over deflection; dashed: the scene's load.")
    _slides(results, section)
    return section


def _slides(results: Results, section: Section) -> None:
    """Add force over road displacement or slip, for a tire with friction."""
    rolls = results.attribute("static.h5", "travel") is not None
    curves = {}
    for name in ("longitudinal", "lateral"):
        moved = results.optional(_FILE, f"slide/{name}/moved")
        if moved is not None:
            curves[name] = (
                (1.0 if rolls else 1e3) * moved,
                results.array(_FILE, f"slide/{name}/force"),
            )
    if not curves:
        return
    for name, (_, force) in curves.items():
        section.facts.append((f"largest {name} force", quantity(float(force.max()), "N")))
    section.show(
        slid(curves, "slip of the wheel" if rolls else "way of the road, mm"),
        "Force along and across the road with friction, "
        + (
            "of the rolling wheel over its slip."
            if rolls
            else "over the way that the road is moved under the standing tire."
        ),
    )


@styled
def slid(curves: Mapping[str, tuple[NDArray, NDArray]], label: str) -> str:
    """Figure of force (n) N over displacement or slip (n), by name."""
    figure, axes = canvas(6.2, 3.0)
    here, start = axes[0, 0], np.zeros(1)
    for colour, (name, (moved, force)) in zip(COLOURS, curves.items(), strict=False):
        x, y = (np.concatenate([start, part]) for part in (moved, force))
        here.plot(x, y, "o-", ms=3, color=colour, label=name)
    here.set_xlabel(label)
    here.set_ylabel("force, N")
    here.legend(loc="lower right")
    return encode(figure)


@styled
def curve(deflection: NDArray, load: NDArray, area: NDArray, own: float) -> str:
    """Figure of load (n) N and contact area (n) cm2 over deflection (n) mm."""
    figure, axes = canvas(6.2, 3.0)
    here, other = axes[0, 0], axes[0, 0].twinx()
    start = np.zeros(1)
    x = np.concatenate([start, deflection])
    here.plot(x, np.concatenate([start, load]), "o-", ms=3, color=COLOURS[0], label="load")
    here.axhline(own, color=MUTED, lw=0.8, ls="--")
    other.plot(x, np.concatenate([start, area]), "s-", ms=3, color=COLOURS[2], label="area")
    here.set_xlabel("deflection, mm")
    here.set_ylabel("load, N")
    other.set_ylabel("contact area, cm²")
    lines = here.get_lines()[:1] + other.get_lines()
    here.legend(lines, [line.get_label() for line in lines], loc="upper left")
    return encode(figure)
