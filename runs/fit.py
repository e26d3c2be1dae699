"""`tireroad fit`: the built-in tire's free parameters from a real tire's figures, by least squares.

The figures are mass, first modes, stiffness and footprint, from a TOML file or a .tir file
(files.tir). Of the latter belong here [UNITS], [DIMENSION], [OPERATING_CONDITIONS], [INERTIA], [VERTICAL], [DEFLECTION_LOAD_CURVE], [STRUCTURAL] and
[CONTACT_PATCH]. The footprint of a load F is there, with the vertical stiffness C and the unloaded
radius R,

    length = 2 R (Q_RA2 x + Q_RA1 sqrt(x)),  width = 2 w (Q_RB2 x + Q_RB1 x^(1/3)),  x = F / (C R)

with the section's width w (Besselink, Schmeitz, Pacejka, Vehicle System Dynamics 48 S1, 2010). [DEFLECTION_LOAD_CURVE] holds rows of
deflection (m) and load (N).

Mass, modes and damping come from Fourier series around the inflated section (fem.sections.inflated,
a second each); load, stiffness and footprint from the stages static and stiffness on a coarse mesh,
by the ratio of the default mesh to it, of the tire as built and then of the fitted one.

The factors f_k are those of the most likely tire: they minimise

    sum_i rho(ln(y_i(f) / target_i) / tolerance_i) + sum_k (ln f_k / ln spread_k)^2,

each drawn to 1 by the spread that its quantity has among tires. rho is Huber's: sharp where figures agree with
one another, linear beyond, so that one that no plausible tire has is left off instead of bending all factors.
What no figure determines stays; the report gives for each factor the standard deviation that is left.
"""

from __future__ import annotations

import math
import re
import tempfile
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.optimize import lsq_linear

from tireroad.contact.roads.text_table import opened
from tireroad.fem.errors import ConvergenceError, InputError
from tireroad.fem.sections.construction import INFLATION
from tireroad.fem.sections.inflated import InflatedRing
from tireroad.fem.sections.radial import radial, size
from tireroad.runs.factors import PARAMETERS, PLAUSIBLE, SCALED, construction
from tireroad.runs.files.names import scene_name
from tireroad.runs.files.tir import UNITS, Tir, finite, hint, parsed
from tireroad.runs.process import console
from tireroad.runs.scene import files

LOADS, PRINTS = 0.03, 0.05  # relative tolerance of the load at a deflection, of a footprint's sizes
ALIKE = 4  # points of a curve from which on their errors are one another's
MODES = "lateral", "yaw", "windup", "vertical"
_FREE = {"mass", *(f"{mode}_{what}" for mode in MODES for what in ("frequency", "damping"))}
_LOAD_RANGES = ((0.0, 0.5), (0.0, 1e6))
_PRINT_RANGES = ((10.0, 1e6), (0.01, 1.0), (0.01, 1.0))
_EXAMPLE = {"size": '"205/55 R16"', "inflation": "2.4e5   # Pa"}
_CURVE = "DEFLECTION_LOAD_CURVE"
_MOST_LOADS = 3  # points of a curve that are fitted
_TRUST, _LEAST = 0.5, 0.03  # largest change of a logarithm in an iteration; one at which they end
# Steps of finite differences, and those of figures on the road, where nodes come into contact one by one.
_STEP, _ROAD_STEP = 0.02, 0.2
_ITERATIONS = 40
# Times that the weights of an iteration are taken at most, and the change of a logarithm at which they stay.
_REWEIGHTED, _SETTLED = 60, 1e-4
_COMPUTED = 6  # deflections of a run on the road
_SAME = 5e-7  # a factor that is 1
# Decrease of the misfit, and share of it, that is none: a tenth of a standard deviation of one factor.
_ENOUGH, _SHARE = 0.01, 0.01
ELEMENTS, ORDER = 26, 2
COARSE = 14, 14  # elements around, and from bead to bead, of the runs on the road
_LOSSES = ("tread", "other")  # factors of the loss factors, fitted to the damping ratios afterwards
_LOSS, _LOSS_SPREAD = (0.1, 3.0), 1.0  # range, and standard deviation of a factor
_SHARP, _KNEE = 4.0, 0.125  # of rho: weight of a residual, and where it turns linear, in tolerances
_LOAD_AT = "load at "
_STAYS = 0.9  # of its spread without figures is left: they do not determine the factor


@dataclass(frozen=True)
class FigureKind:
    """A figure: unit, relative tolerance of a fit, range, key in a .tir file, and what it is."""

    unit: str
    tolerance: float
    least: float
    most: float
    tir: str
    doc: str


KINDS: Mapping[str, FigureKind] = {
    "mass": FigureKind("kg", 0.01, 1, 200, "MASS", "of the tire"),
    "lateral_frequency": FigureKind("Hz", 0.02, 5, 500, "FREQ_LAT", "sidewise, rim held, no road"),
    "yaw_frequency": FigureKind("Hz", 0.02, 5, 500, "FREQ_YAW", "yaw and tilt of the belt"),
    "windup_frequency": FigureKind(
        "Hz", 0.02, 5, 500, "FREQ_WINDUP", "belt against rim about the axle"
    ),
    "vertical_frequency": FigureKind("Hz", 0.02, 5, 500, "FREQ_LONG", "vertical and fore-aft"),
    "lateral_damping": FigureKind("-", 0.2, 1e-4, 1, "DAMP_LAT", "damping ratio of these modes"),
    "yaw_damping": FigureKind("-", 0.2, 1e-4, 1, "DAMP_YAW", "damping ratio"),
    "windup_damping": FigureKind("-", 0.2, 1e-4, 1, "DAMP_WINDUP", "damping ratio"),
    "vertical_damping": FigureKind("-", 0.2, 1e-4, 1, "DAMP_LONG", "damping ratio"),
    "vertical_stiffness": FigureKind(
        "N/m", 0.04, 1e4, 1e7, "VERTICAL_STIFFNESS", "slope at the load"
    ),
    "longitudinal_stiffness": FigureKind(
        "N/m", 0.05, 1e4, 1e7, "LONGITUDINAL_STIFFNESS", "standing tire, at the load"
    ),
    "lateral_stiffness": FigureKind(
        "N/m", 0.05, 1e4, 1e7, "LATERAL_STIFFNESS", "standing tire, at the load"
    ),
    "torsional_stiffness": FigureKind(
        "N m/rad", 0.15, 100, 1e6, "YAW_STIFFNESS", "about the vertical axis, at the load"
    ),
    "footprint_length": FigureKind("m", 0.05, 0.01, 1, "", "at the load"),
    "footprint_width": FigureKind("m", 0.05, 0.01, 1, "", "at the load"),
}


@dataclass(frozen=True, kw_only=True)
class FitFigures:
    """`size`, `inflation` Pa, the `load` N at which stiffness and footprint hold, `values` by KINDS,
    `loads`: pairs of deflection m and load N, `footprints`: load N, length m and width m, and the `rim_width`
    m; None: that of the size's measuring rim.
    """

    size: str
    inflation: float
    load: float
    values: Mapping[str, float] = field(default_factory=dict)
    loads: tuple[tuple[float, float], ...] = ()
    footprints: tuple[tuple[float, float, float], ...] = ()
    rim_width: float | None = None
    notes: tuple[str, ...] = ()

    @property
    def pressed(self) -> bool:
        """Whether there are figures of the tire on the road."""
        return bool(self.loads or self.footprints or set(self.values) - _FREE)

    @property
    def targets(self) -> dict[str, float]:
        """The value asked for of each figure by name."""
        known = {name: self.values[name] for name in KINDS if name in self.values}
        known |= {_load_name(deflection): load for deflection, load in self.loads}
        for load, length, width in self.footprints:
            known |= {_print_name("length", load): length, _print_name("width", load): width}
        return known

    def tolerance(self, name: str) -> float:
        """Relative tolerance of a figure; many points of one curve count as `ALIKE` do."""
        if name in KINDS:
            return KINDS[name].tolerance
        is_load = name.startswith(_LOAD_AT)
        count = len(self.loads) if is_load else len(self.footprints)
        return (LOADS if is_load else PRINTS) * math.sqrt(max(count / ALIKE, 1.0))


def read(path: Path, changes: Sequence[str] = ()) -> FitFigures:
    """The figures in a file, with `changes` as key=value. Raises InputError with the key for what is no figure."""
    with opened(path, str(path)) as stream:
        try:
            text = stream.read()
        except UnicodeError:
            raise InputError(f"{path}: is not a text file") from None
    notes: list[str] = []
    if path.suffix.lower() == ".tir":
        sized = any(change.partition("=")[0].strip() == "size" for change in changes)
        table = _of_tir(text, path, notes, sized)
    elif path.suffix.lower() == ".toml":
        table = _parsed(text, path)
    else:
        raise InputError(f"{path}: figures are read from .toml or .tir")
    for change in changes:
        key, equals, value = change.partition("=")
        if not equals:
            raise InputError(f"--set {change}: is key=value, as in inflation=2.4e5")
        plain = value.strip() if key.strip() != "size" else f'"{value.strip()}"'
        table |= _parsed(f"{key} = {plain}", Path(f"--set {change}"))
    return _from_table(table, path, notes)


def _parsed(text: str, path: Path) -> dict:
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{path}: {error}") from None


def _from_table(table: dict, path: Path, notes: list[str]) -> FitFigures:
    known = {"size", "inflation", "load", "loads", "footprints", "rim_width", *KINDS}
    wrong = sorted(set(table) - known)
    if wrong:
        raise InputError(f"{path}: unknown key {wrong[0]}; valid: {', '.join(sorted(known))}")
    for key in ("size", "inflation"):
        if key not in table:
            raise InputError(f"{path}: {key} is missing, as in {key} = {_EXAMPLE[key]}")
    if not isinstance(table["size"], str):
        raise InputError(f"{path}: size must be a text, as in size = {_EXAMPLE['size']}")
    values = {key: _checked(path, key, table[key]) for key in KINDS if key in table}
    rows = _rows(path, "loads", table, "pairs, [[deflection m, load N], ...]", _LOAD_RANGES)
    loads = tuple((moved, load) for moved, load in rows if moved and load)  # a curve may begin at 0
    printed = _rows(
        path, "footprints", table, "rows, [[load N, length m, width m], ...]", _PRINT_RANGES
    )
    prints = tuple((load, length, width) for load, length, width in printed)
    rim = table.get("rim_width")
    rim = None if rim is None else _number(path, "rim_width", rim, 0.05, 0.5, "m")
    try:
        radial(table["size"], rim_width=rim)
    except InputError as error:
        raise InputError(f"{path}: {str(error).removeprefix('tire.')}") from None
    if not values and not loads and not prints:
        known_figures = ", ".join(KINDS)
        raise InputError(
            f"{path}: no figure to fit to; there are: {known_figures}, loads, footprints"
        )
    load = table.get("load")
    if load is None:
        heaviest = [*(load for _, load in loads), *(row[0] for row in prints)]
        load = max(heaviest, default=4000.0)
        if any(name.endswith("stiffness") for name in values):
            notes.append(f"load = {load:g} N taken for the load at which stiffness holds")
    return FitFigures(
        size=table["size"],
        inflation=_number(path, "inflation", table["inflation"], 1e4, 2e6, "Pa"),
        load=_number(path, "load", load, 10, 1e6, "N"),
        values=values,
        loads=loads,
        footprints=prints,
        rim_width=rim,
        notes=tuple(notes),
    )


def _rows(
    path: Path, key: str, table: dict, form: str, ranges: Sequence[tuple[float, float]]
) -> tuple[tuple[float, ...], ...]:
    """Rows of numbers, ascending; each in its range."""
    given = table.get(key, [])
    if not isinstance(given, list) or not all(
        isinstance(row, list) and len(row) == len(ranges) for row in given
    ):
        raise InputError(f"{path}: {key} is a list of {form}")
    rows = [
        tuple(
            _number(path, key, number, *limits) for number, limits in zip(row, ranges, strict=True)
        )
        for row in given
    ]
    return tuple(sorted(rows))


def _number(
    path: Path, key: str, value: object, least: float, most: float, unit: str = ""
) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise InputError(f"{path}: {key} must be a number, not {str(value)[:40]!r}")
    if not least <= value <= most:
        raise InputError(f"{path}: {key} = {value:g} {unit} must be from {least:g} to {most:g}")
    return float(value)


def _checked(path: Path, key: str, value: object) -> float:
    kind = KINDS[key]
    return _number(path, key, value, kind.least, kind.most, kind.unit)


_USED = {
    *(kind.tir for kind in KINDS.values()),
    *(
        "FNOMIN",
        "UNLOADED_RADIUS",
        "WIDTH",
        "RIM_RADIUS",
        "ASPECT_RATIO",
        "INFLPRES",
        "IP",
        "NOMPRES",
    ),
    *(f"Q_R{which}" for which in ("A1", "A2", "B1", "B2")),
} - {""}


def _check_units(tir: Tir, notes: list[str]) -> None:
    """InputError for a unit that is not SI and that a figure of the file is in."""
    matters = {"MASS": "MASS" in tir.values, "ANGLE": "YAW_STIFFNESS" in tir.values}
    if not tir.units:
        notes.append("no [UNITS] in the file: SI units assumed")
    for key, (unit, _) in UNITS.items():
        other = tir.unit(key)
        if other is None:
            continue
        if matters.get(key, True):
            raise InputError(
                f"{tir.path}, line {tir.units[key][1]}: {key} = '{other}': files in SI units are read ({key} = '{unit}')"
            )
        notes.append(f"{key} = '{other}' in the file: no figure that is read is in it")


def _curve(tir: Tir, nominal: float | None, notes: list[str]) -> list[list[float]]:
    """Deflections (m) and loads (N) of [DEFLECTION_LOAD_CURVE]: at most three, about the nominal load."""
    points: list[list[float]] = []
    for text, line in tir.tables.get(_CURVE, []):
        fields = re.split(r"[\s;]+", text)
        pair = [number for number in map(finite, fields) if number is not None]
        if len(fields) != 2 or len(pair) != 2:
            raise InputError(
                f"{tir.path}, line {line}: [{_CURVE}] has lines of a deflection and a load, not {text[:40]!r}{hint(text)}"
            )
        if points and not (pair[0] > points[-1][0] and pair[1] >= points[-1][1]):
            raise InputError(f"{tir.path}, line {line}: [{_CURVE}] must ascend, not {text[:40]!r}")
        points.append(pair)
    middle = nominal or 4000.0
    near = [point for point in points if point[0] > 0 and 0.3 * middle <= point[1] <= 1.7 * middle]
    chosen = (
        [near[k] for k in sorted({round(k) for k in np.linspace(0, len(near) - 1, _MOST_LOADS)})]
        if near
        else []
    )
    if points:
        loads = ", ".join(f"{load:g} N at {1e3 * deflection:g} mm" for deflection, load in chosen)
        notes.append(
            f"[{_CURVE}]: {len(points)} points; "
            + (f"fitted: {loads}" if chosen else "none near the load: not used")
        )
    return chosen


def _of_tir(text: str, path: Path, notes: list[str], sized: bool) -> dict[str, Any]:
    """The figures of a .tir file by the keys of a TOML file; `sized`: the size is given otherwise."""
    tir = parsed(text, path, _USED)
    _check_units(tir, notes)
    value = tir.number
    named, off = ("", 0.0) if sized else _size(path, value)
    if abs(off) > 0.02:
        notes.append(
            f"size {named}: its radius is {100 * off:+.1f} % off the file's UNLOADED_RADIUS"
        )
    values: dict[str, float] = {}
    for key, kind in KINDS.items():
        stated = value(kind.tir) if kind.tir else None
        if stated is None or (stated == 0 and key != "mass"):
            continue
        values[key] = _checked(path, key, stated)
    load, radius, stiffness = (
        value("FNOMIN"),
        value("UNLOADED_RADIUS"),
        values.get("vertical_stiffness"),
    )
    if load and radius and stiffness:
        x = load / (stiffness * radius)
        q = [value(f"Q_R{which}") or 0.0 for which in ("A1", "A2", "B1", "B2")]
        sizes = {
            "footprint_length": 2 * radius * (q[1] * x + q[0] * math.sqrt(x)),
            "footprint_width": 2 * (value("WIDTH") or 0.0) * (q[3] * x + q[2] * np.cbrt(x)),
        }
        values |= {key: _checked(path, key, float(size)) for key, size in sizes.items() if size > 0}
    loads = _curve(tir, load, notes)
    table: dict[str, Any] = values | {"size": named} | ({"load": load} if load else {})
    table |= {"loads": loads} if loads else {}
    if (rim := value("RIM_WIDTH")) and not sized:
        table |= _fitting_rim(named, rim, notes)
    inflation = value("INFLPRES") or value("IP") or value("NOMPRES")
    if inflation is not None:
        return table | {"inflation": inflation}
    notes.append(
        f"no INFLPRES in the file: inflation = {INFLATION:g} Pa taken (--set inflation=...)"
    )
    return table | {"inflation": INFLATION}


def _fitting_rim(named: str, width: float, notes: list[str]) -> dict[str, float]:
    """The file's rim, where the size can stand on it."""
    try:
        radial(named, rim_width=width)
    except InputError as error:
        notes.append(f"RIM_WIDTH not used: {error}")
        return {}
    return {"rim_width": width}


def _size(path: Path, value: Callable[[str], float | None]) -> tuple[str, float]:
    """The nearest size of passenger tires, and how far its radius is off, relative."""
    width, rim = value("WIDTH"), value("RIM_RADIUS")
    radius, ratio = value("UNLOADED_RADIUS"), value("ASPECT_RATIO")
    if not width or not rim:
        raise InputError(
            f'{path}: no size: WIDTH and RIM_RADIUS of [DIMENSION] are needed, or --set size="205/60 R15"'
        )
    ratio = ratio / 100 if ratio and ratio > 2 else ratio  # some write per cent
    if not ratio:
        if not radius:
            raise InputError(
                f"{path}: no size: UNLOADED_RADIUS or ASPECT_RATIO of [DIMENSION] is needed"
            )
        ratio = (radius - rim) / width
    across = 10 * round((1e3 * width - 5) / 10) + 5
    named = f"{across}/{5 * round(20 * ratio)} R{round(2 * rim / 0.0254)}"
    try:
        size_found = size(named)
    except InputError as error:
        raise InputError(f"{path}: {str(error).removeprefix('tire.')}") from None
    return named, (size_found.rim + size_found.height) / radius - 1 if radius else 0.0


@dataclass(frozen=True)
class Fitted:
    """`factors` by parameter, each figure as `reached` and as the size alone gives it at the `start`, and the
    `left` standard deviation of each parameter's logarithm over the one that it has without figures."""

    figures: FitFigures
    factors: Mapping[str, float]
    start: Mapping[str, float]
    reached: Mapping[str, float]
    left: Mapping[str, float] = field(default_factory=dict)

    def row(self, name: str) -> tuple[float, float, float]:
        """Target, of the size alone, reached."""
        return self.figures.targets[name], self.start[name], self.reached[name]


def _load_name(deflection: float) -> str:
    return f"{_LOAD_AT}{1e3 * deflection:.4g} mm"


def _print_name(what: str, load: float) -> str:
    return f"footprint {what} at {load:.5g} N"


class Model:
    """Figures of a construction. `ratios`: of figures on the default mesh over those on the coarse one."""

    def __init__(self, figures: FitFigures) -> None:
        self.figures, self.ratios = figures, dict[str, float]()
        self._known: dict[str, dict[str, float]] = {}  # figures on the road by scene
        self.names = [name for name in figures.targets if not name.endswith("damping")]
        self.on_road = np.array([name not in _FREE for name in self.names], dtype=bool)

    def free(self, factors: Mapping[str, float]) -> dict[str, float]:
        """Mass, frequencies and damping ratios of the inflated tire on its rim."""
        tire = construction(self.figures.size, factors, self.figures.rim_width)
        ring = InflatedRing(tire, ELEMENTS, ORDER, self.figures.inflation)
        values = {"mass": ring.weight}
        for mode in ring.rigid_modes():
            values[f"{mode.name}_frequency"] = mode.frequency
            values[f"{mode.name}_damping"] = mode.damping
        return values

    def pressed(
        self, factors: Mapping[str, float], mesh: tuple[int, int] | None
    ) -> dict[str, float]:
        """Loads, stiffness and footprint on a mesh (None: the default one)."""
        scene = self._scene(factors, mesh)
        if scene not in self._known:  # minutes each
            with tempfile.TemporaryDirectory() as folder:
                path = Path(folder)
                (path / "scene.toml").write_text(scene)
                self._known[scene] = self._read(_run(path))
        return self._known[scene]

    def _scene(self, factors: Mapping[str, float], mesh: tuple[int, int] | None) -> str:
        of_static_state = {
            parameter.name: factors.get(parameter.name, 1.0)
            for parameter in PARAMETERS
            if parameter.on_road
        }
        text = tire_table(self.figures, of_static_state)
        if mesh:
            text = text.replace(
                "[tire]\n", f"[tire]\nsegments = {mesh[0]}\nelements_arc = {mesh[1]}\n", 1
            )
        return (
            f'name = "fit"\n{text}\n[static]\ninflation = {self.figures.inflation}\nload = {self.figures.load}\n'
            f"error_estimate = false\n[stiffness]\n{self._computed()}\n"
        )

    def _computed(self) -> str:
        """The deflections that are computed, as keys of [stiffness]: a few, between which the curve is smooth."""
        moved = [deflection for deflection, _ in self.figures.loads]
        if len(moved) > 2:
            least, most = moved[0], moved[-1]
            few = np.unique(np.round(np.linspace(least, most, min(len(moved), _COMPUTED)), 5))
            return f"deflections = {few.tolist()}"
        return f"steps = {_COMPUTED if len(self.figures.footprints) > 1 else 3}"

    def _read(self, out: Path) -> dict[str, float]:
        with h5py.File(out / "stiffness.h5") as file:
            curve = {name: file[f"curve/{name}"][:] for name in file["curve"]}
            own = {
                name: float(file[name][()])
                for name in ("vertical", "longitudinal", "lateral", "torsional")
            }
        with h5py.File(out / "static.h5") as file:
            deflection = float(file.attrs["deflection"])
        values = {f"{name}_stiffness": value for name, value in own.items()}
        apart = np.abs(curve["deflection"] - deflection) > 0.02 * deflection
        points = {0.0: 0.0, deflection: self.figures.load}
        points |= dict(zip(curve["deflection"][apart], curve["load"][apart], strict=True))
        moved, load = np.array(sorted(points.items())).T
        at = PchipInterpolator(moved, load, extrapolate=True)
        for there, _ in self.figures.loads:
            values[_load_name(there)] = float(at(there))
        loads = np.sort(curve["load"])
        for name in ("length", "width"):
            sizes = curve[f"footprint_{name}"][np.argsort(curve["load"])]
            over = PchipInterpolator(np.append(0.0, loads), np.append(0.0, sizes), extrapolate=True)
            values[f"footprint_{name}"] = float(over(self.figures.load))
            for there, *_ in self.figures.footprints:
                values[_print_name(name, there)] = float(over(there))
        return values

    def all(self, factors: Mapping[str, float]) -> dict[str, float]:
        """Every figure; those on the road by the coarse mesh times what is known of its error."""
        values = self.free(factors)
        if self.figures.pressed:
            for name, value in self.pressed(factors, COARSE).items():
                values[name] = value * self.ratios.get(name, 1.0)
        return values

    def correct(self, factors: Mapping[str, float]) -> None:
        """Take the ratios of the default to the coarse mesh from the tire with these factors."""
        coarse, fine = (self.pressed(factors, mesh) for mesh in (COARSE, None))
        self.ratios = {name: value / coarse[name] for name, value in fine.items()}

    def residuals(self, reached: Mapping[str, float]) -> np.ndarray:
        """Logarithms of ratios to the targets over the tolerances."""
        targets = self.figures.targets
        return np.array(
            [
                np.log(reached[name] / targets[name]) / self.figures.tolerance(name)
                for name in self.names
            ]
        )


def _run(folder: Path) -> Path:
    """Run the scene in a folder up to its stiffness; returns the results' folder."""
    from mpi4py import MPI

    from tireroad.runs.files.cache import Cache
    from tireroad.runs.pipeline import run_scene
    from tireroad.runs.process import mpi
    from tireroad.runs.scene.load import load

    mpi.start_petsc([])
    scene = load(folder / "scene.toml", [], lambda remark: None, "stiffness")
    with console.quiet():
        run_scene(
            scene,
            folder / "out",
            MPI.COMM_SELF,
            until="stiffness",
            fresh=True,
            petsc_options=[],
            cache=Cache(),
        )
    return folder / "out"


def fit(figures: FitFigures) -> Fitted:
    """The most likely factors. Not collective; half an hour with figures on the road, else seconds."""
    model = Model(figures)
    if figures.pressed:
        model.correct({})
    start = model.all({})
    console.say(f"  {figures.size} as built: {_worst(model, start)}")
    best = _least(model, np.zeros(len(PARAMETERS)))
    if figures.pressed:
        model.correct(_factors(best.place))  # the coarse mesh errs as for this tire from here on
        ends = [best, _least(model, best.place)]
        best = min((end.on_default_mesh(model) for end in ends), key=lambda end: end.misfit)
        console.say(f"  on the default mesh: {_worst(model, best.found)}")
    factors = _factors(best.place)
    factors |= _losses(figures, factors)
    left = _left(_weights(best.rest)[:, None] * best.jacobian)
    return Fitted(figures, factors, start, dict(best.found) | model.free(factors), left)


@dataclass(frozen=True)
class _Place:
    """Logarithms of the factors, the figures `found` there, their residuals `rest` (n,) and the `jacobian`
    (n, factors) of these."""

    place: np.ndarray
    found: Mapping[str, float]
    rest: np.ndarray
    jacobian: np.ndarray

    @property
    def misfit(self) -> float:
        """Misfit of the figures and factors, which is minimised."""
        return _misfit(self.rest, self.place)

    def expected(self, step: np.ndarray) -> float:
        """Decrease of the misfit by a step if residuals were linear."""
        return self.misfit - _misfit(self.rest + self.jacobian @ step, self.place + step)

    def on_default_mesh(self, model: Model) -> _Place:
        """The same factors with the figures of the default mesh."""
        factors = _factors(self.place)
        values = model.free(factors) | model.pressed(factors, None)
        return replace(self, found=values, rest=model.residuals(values))


def _least(model: Model, start: np.ndarray) -> _Place:
    """The place of least misfit, from `start` on by the least misfit of linearised residuals within a radius.

    It ends where a Jacobian that was taken at that very place, and what was seen since, expect no decrease,
    and none of the neighbouring sets of factors by which it was taken has a smaller misfit.
    """
    if not model.names:
        return _Place(start, model.all(_factors(start)), np.zeros(0), np.zeros((0, len(start))))
    here, radius = _differentiated(model, start), _TRUST
    tested = start
    for iteration in range(_ITERATIONS):
        step = _step(here, radius)
        expected = here.expected(step)
        if expected < _ENOUGH + _SHARE * here.misfit or radius < _LEAST:
            if np.array_equal(tested, here.place):
                break
            tested = here.place
            here, radius = _differentiated(model, here.place), _ROAD_STEP
            continue
        there = _moved(model, here, step)
        gained = here.misfit - there.misfit
        if gained < 0.25 * expected:
            radius = 0.5 * float(np.abs(step).max())
        elif gained > 0.75 * expected:
            radius = min(2 * radius, _TRUST)
        told = "" if gained > 0 else ", not taken"
        console.say(f"  iteration {iteration + 1}: misfit {there.misfit:.4g}{told}")
        here = there if gained > 0 else replace(here, jacobian=there.jacobian)
    console.say(f"  misfit {here.misfit:.4g}: {_worst(model, here.found)}")
    return here


def _step(here: _Place, radius: float) -> np.ndarray:
    """The step (factors,) to the least misfit of linearised residuals, no logarithm by more than the radius.

    Squares with weights that have the slope of rho, taken anew until they stay.
    """
    low, high = _ranges()
    bounds = np.maximum(low - here.place, -radius), np.minimum(high - here.place, radius)
    drawn = np.diag(1 / _deviations())
    step = np.zeros(len(here.place))
    for _ in range(_REWEIGHTED):
        weight = _weights(here.rest + here.jacobian @ step)
        matrix = np.vstack([weight[:, None] * here.jacobian, drawn])
        target = np.concatenate([-weight * here.rest, -drawn @ here.place])
        last, step = step, lsq_linear(matrix, target, bounds=bounds).x
        if np.abs(step - last).max() < _SETTLED:
            break
    return step


def _moved(model: Model, here: _Place, step: np.ndarray) -> _Place:
    """The place a step further; of figures on the road with the Jacobian that explains what was seen (Broyden)."""
    place = np.clip(here.place + step, *_ranges())
    values = model.all(_factors(place))
    rest = model.residuals(values)
    jacobian = here.jacobian + np.outer(rest - here.rest - here.jacobian @ step, step) / (
        step @ step
    )
    jacobian[~model.on_road] = _free_rows(model, place, values, rest)
    return _Place(place, values, rest, jacobian)


def _differentiated(model: Model, place: np.ndarray) -> _Place:
    """The place with a new Jacobian; in its stead the best of the places by which it is taken if that is better.

    These are nearer to the tire as built in one factor each.
    """
    values = model.all(_factors(place))
    rest = model.residuals(values)
    jacobian = np.zeros((len(rest), len(place)))
    beside = []
    for k, parameter in enumerate(PARAMETERS):
        by = -_ROAD_STEP if place[k] > 0 else _ROAD_STEP
        moved = place + by * (np.arange(len(place)) == k)
        there = model.all(_factors(moved))
        jacobian[:, k] = (model.residuals(there) - rest) / by
        beside.append(_Place(moved, there, model.residuals(there), jacobian))
        console.say(f"  sensitivity to {parameter.name}: {parameter.doc}")
    least = _ENOUGH + _SHARE * _misfit(rest, place)
    best = min(beside, key=lambda trial: trial.misfit)
    if best.misfit > _misfit(rest, place) - least:
        best = _Place(place, values, rest, jacobian)
    jacobian[~model.on_road] = _free_rows(model, best.place, best.found, best.rest)
    return best


def _free_rows(
    model: Model, place: np.ndarray, reached: Mapping[str, float], rest: np.ndarray
) -> np.ndarray:
    """Rows of the Jacobian that are those of the free tire; a second each."""
    columns = []
    for k in range(len(place)):
        factors = _factors(place + _STEP * (np.arange(len(place)) == k))
        there = model.residuals(dict(reached) | model.free(factors))
        columns.append((there - rest)[~model.on_road] / _STEP)
    return np.array(columns).T


def _weights(rest: np.ndarray) -> np.ndarray:
    """Weights (n,) of the rows whose squares have the slope of rho at the residuals `rest` (n,)."""
    return _SHARP * np.sqrt(np.minimum(1.0, _KNEE / np.maximum(np.abs(rest), 1e-12)))


def _misfit(rest: np.ndarray, place: np.ndarray) -> float:
    """Misfit at residuals and logarithms of factors: the sum that is minimised."""
    size = np.abs(rest)
    rho = _SHARP**2 * np.where(size < _KNEE, size**2, _KNEE * (2 * size - _KNEE))
    return float(rho.sum() + np.sum((place / _deviations()) ** 2))


def _left(jacobian: np.ndarray) -> dict[str, float]:
    """Standard deviation of each parameter's logarithm with the figures, over that without them."""
    spread = np.linalg.inv(jacobian.T @ jacobian + np.diag(_deviations() ** -2.0))
    shares = np.sqrt(np.diag(spread)) / _deviations()
    return {
        parameter.name: float(share) for parameter, share in zip(PARAMETERS, shares, strict=True)
    }


def _deviations() -> np.ndarray:
    return np.array([parameter.deviation for parameter in PARAMETERS])


def _ranges() -> tuple[np.ndarray, np.ndarray]:
    """Least and largest logarithm of each factor."""
    low, high = (
        np.log([getattr(parameter, end) for parameter in PARAMETERS]) for end in ("least", "most")
    )
    return low, high


def _factors(place: np.ndarray) -> dict[str, float]:
    return {
        parameter.name: float(np.exp(p)) for parameter, p in zip(PARAMETERS, place, strict=True)
    }


def _worst(model: Model, reached: Mapping[str, float]) -> str:
    """The figure that is farthest off."""
    if not model.names:
        return "only damping ratios are asked for"
    targets = model.figures.targets
    off = {name: reached[name] / targets[name] - 1 for name in model.names}
    name = max(off, key=lambda one: abs(off[one]) / model.figures.tolerance(one))
    return f"{name} {100 * off[name]:+.1f} %, farthest off of {len(off)} figures"


def _losses(figures: FitFigures, factors: Mapping[str, float]) -> dict[str, float]:
    """Factors of the loss factors by the damping ratios, which are linear in them."""
    names = [f"{mode}_damping" for mode in MODES if f"{mode}_damping" in figures.values]
    if not names:
        return {}
    model = Model(figures)
    columns = []
    for which in _LOSSES:
        alone = {f"{other} loss": 1.0 if other == which else 0.0 for other in _LOSSES}
        values = model.free(dict(factors) | alone)
        columns.append(
            [values[name] / figures.values[name] / KINDS[name].tolerance for name in names]
        )
    matrix = np.vstack([np.array(columns).T, np.eye(2) / _LOSS_SPREAD])
    asked = [1 / KINDS[name].tolerance for name in names]
    target = np.concatenate([asked, np.ones(2) / _LOSS_SPREAD])
    best = lsq_linear(matrix, target, bounds=_LOSS).x
    return {f"{which} loss": float(value) for which, value in zip(_LOSSES, best, strict=True)}


def tire_table(figures: FitFigures, factors: Mapping[str, float]) -> str:
    """The [tire] of a scene with these factors: size, rim, and factors that are not 1."""
    lines = ["[tire]", 'section = "radial"', f'size = "{figures.size}"']
    if figures.rim_width is not None:
        lines.append(f"rim_width = {figures.rim_width:.6g}")
    scale = [
        f'"{key}" = {factors[name]:.6g}'
        for name, keys in SCALED.items()
        if name in factors and abs(factors[name] - 1) > _SAME
        for key in keys
    ]
    return "\n".join([*lines, *(["", "[tire.scale]", *scale] if scale else [])]) + "\n"


def report(fitted: Fitted) -> str:
    """The figures beside those reached, the factors, and what cannot be reached."""
    figures = fitted.figures
    rows = [("figure", "asked", "as built", "fitted", "off")]
    missed = []
    for name in figures.targets:
        asked, before, reached = fitted.row(name)
        off = reached / asked - 1
        values = (f"{asked:.5g}", f"{before:.5g}", f"{reached:.5g}", f"{100 * off:+.1f} %")
        rows.append((f"{name}, {_unit(name)}", *values))
        if abs(off) > 2 * figures.tolerance(name):
            missed.append(f"{name} ({100 * off:+.1f} %)")
    lines = _aligned(rows)
    lines += ["", "factors of the built-in tire's values:"]
    lines += _aligned([_factor_row(fitted, name) for name in fitted.factors])
    strange = [name for name, value in fitted.factors.items() if _implausible(value)]
    if strange:
        named = ", ".join(f"{name} x {fitted.factors[name]:.2f}" for name in strange)
        lines.append(
            f"outside the plausible range, {1 / PLAUSIBLE:.2f} to {PLAUSIBLE:g}: {named}: look whether such a tire is "
            "built, and whether the figures are all of one tire and of the same conditions"
        )
    lines += [f"  note: {note}" for note in figures.notes]
    lines.append(
        f"not reached within twice the tolerance: {', '.join(missed)}"
        if missed
        else "all figures are reached within twice their tolerances"
    )
    return "\n".join(lines)


def _unit(name: str) -> str:
    if name in KINDS:
        return KINDS[name].unit
    return "N" if name.startswith(_LOAD_AT) else "m"


def _aligned(rows: Sequence[tuple[str, ...]]) -> list[str]:
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    cells = ([cell.ljust(w) for cell, w in zip(row, widths, strict=True)] for row in rows)
    return ["  ".join(row).rstrip() for row in cells]


def _implausible(factor: float) -> bool:
    return max(factor, 1 / factor) > PLAUSIBLE


def _factor_row(fitted: Fitted, name: str) -> tuple[str, ...]:
    """Name, value, what is known of it, and what it multiplies."""
    parameter = next((one for one in PARAMETERS if one.name == name), None)
    value = fitted.factors[name]
    if parameter is None:
        return f"  {name}", f"{value:.3f}", "", "of loss factors"
    left = fitted.left.get(name, 1.0)
    stays = left > _STAYS and abs(math.log(value)) < (1 - _STAYS) * parameter.deviation
    known = "no figure determines it" if stays else f"± {100 * left * parameter.deviation:.0f} %"
    at_end = min(value / parameter.least, parameter.most / value) < 1.001
    ending = (
        f" (at the end of its range, {parameter.least:g} to {parameter.most:g})" if at_end else ""
    )
    return f"  {name}", f"{value:.3f}", known, f"{parameter.doc}{ending}"


def read_of(figures: FitFigures, path: Path, changes: Sequence[str] = ()) -> list[files.Row]:
    """Rows of the table of a run's files: what was read of a file of figures as what."""
    tir = path.suffix.lower() == ".tir"
    listed: list[tuple[str, str, str, str]] = [
        ("size", "[DIMENSION]" if tir else "size", "", figures.size),
        (
            "inflation",
            "INFLPRES, IP or NOMPRES" if tir else "inflation",
            "Pa",
            f"{figures.inflation:g}",
        ),
        ("load", "FNOMIN" if tir else "load", "N", f"{figures.load:g}"),
    ]
    for name, value in figures.values.items():
        key = (KINDS[name].tir or "Q_RA1 to Q_RB2, FNOMIN, VERTICAL_STIFFNESS") if tir else name
        listed.append((name, key, KINDS[name].unit, f"{value:g}"))
    for name, rows, unit in (
        ("loads", figures.loads, "m, N"),
        ("footprints", figures.footprints, "N, m, m"),
    ):
        if rows:
            listed.append((name, f"[{_CURVE}]" if tir else name, unit, f"{len(rows)} rows"))
    changed = {change.partition("=")[0].strip() for change in changes}
    rows_of = [
        (path.name, name, "--set" if name in changed else key, unit, text)
        for name, key, unit, text in listed
    ]
    return [*rows_of, *((path.name, "remark", "", "", note) for note in figures.notes)]


def command(path: Path, out: Path, changes: Sequence[str] = ()) -> str:
    """Fit the figures in a file; writes out/scene.toml. Returns what to print."""
    figures = read(path, changes)
    for line in files.table(read_of(figures, path, changes)):
        console.say(line)
    try:
        fitted = fit(figures)
    except ConvergenceError as error:
        raise ConvergenceError(f"{path}: {error}") from None
    out.mkdir(parents=True, exist_ok=True)
    text = report(fitted)
    scene = [
        f"# {figures.size} fitted to {path.name}:",
        *(f"#   {line}".rstrip() for line in text.splitlines()),
        f'name = "{scene_name(out.name)}"',
        "",
        tire_table(figures, fitted.factors),
        "[static]",
        f"inflation = {figures.inflation:.6g}",
        f"load = {figures.load:.6g}",
        "",
        "[modal]",
        "count = 20",
    ]
    try:
        (out / "scene.toml").write_text("\n".join(scene) + "\n", encoding="utf-8")
    except OSError as error:
        raise InputError(f"{out / 'scene.toml'}: {error.strerror}") from None
    return f"{text}\n\na scene with this tire: {out / 'scene.toml'}"
