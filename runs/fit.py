"""`tireroad fit`: the built-in tire's free parameters from a real tire's figures, by least squares.

The figures are mass, first modes, stiffness and footprint, from a TOML file or a .tir file. The
latter is that of MF-Tyre/MF-Swift: sections in brackets, `KEY = value $ comment`, SI units. Of it
belong here [UNITS], [DIMENSION], [OPERATING_CONDITIONS], [INERTIA], [VERTICAL], [DEFLECTION_LOAD_CURVE], [STRUCTURAL] and
[CONTACT_PATCH]. The footprint of a load F is there, with the vertical stiffness C and the unloaded
radius R,

    length = 2 R (Q_RA2 x + Q_RA1 sqrt(x)),  width = 2 w (Q_RB2 x + Q_RB1 x^(1/3)),  x = F / (C R)

with the section's width w (Besselink, Schmeitz, Pacejka, Vehicle System Dynamics 48 S1, 2010).

Mass, modes and damping come from Fourier series around the inflated section (fem.sections.inflated,
a second each); load, stiffness and footprint from the stages static and stiffness on a coarse mesh,
whose ratio to the default mesh is taken from a last run there. Residuals are logarithms of ratios
over each figure's tolerance; each parameter is a factor whose logarithm counts as a residual, too,
over WIDE: what no figure determines stays.
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
from tireroad.fem.sections.construction import INFLATION, Construction
from tireroad.fem.sections.inflated import InflatedRing
from tireroad.fem.sections.radial import radial, size
from tireroad.runs.process import console
from tireroad.runs.scene.resolved import scene_name


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
LOADS = 0.03  # relative tolerance of the load at a deflection
MODES = "lateral", "yaw", "windup", "vertical"


@dataclass(frozen=True, kw_only=True)
class FitFigures:
    """`size`, `inflation` Pa, the `load` N at which stiffness and footprint hold, `values` by KINDS, and
    `loads`: pairs of deflection m and load N.
    """

    size: str
    inflation: float
    load: float
    values: Mapping[str, float] = field(default_factory=dict)
    loads: tuple[tuple[float, float], ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def pressed(self) -> bool:
        """Whether there are figures of the tire on the road."""
        modal = {"mass", *(f"{mode}_{what}" for mode in MODES for what in ("frequency", "damping"))}
        return bool(self.loads or set(self.values) - modal)


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
    known = {"size", "inflation", "load", "loads", *KINDS}
    wrong = sorted(set(table) - known)
    if wrong:
        raise InputError(f"{path}: unknown key {wrong[0]}; valid: {', '.join(sorted(known))}")
    for key in ("size", "inflation"):
        if key not in table:
            raise InputError(f"{path}: {key} is missing, as in {key} = {_EXAMPLE[key]}")
    if not isinstance(table["size"], str):
        raise InputError(f"{path}: size must be a text, as in size = {_EXAMPLE['size']}")
    values = {key: _checked(path, key, table[key]) for key in KINDS if key in table}
    loads = []
    for pair in table.get("loads", []):
        if not (isinstance(pair, list) and len(pair) == 2):
            raise InputError(f"{path}: loads is a list of pairs, [[deflection m, load N], ...]")
        deflection = _number(path, "loads", pair[0], 1e-4, 0.5)
        loads.append((deflection, _number(path, "loads", pair[1], 1, 1e6)))
    try:
        radial(table["size"])
    except InputError as error:
        raise InputError(f"{path}: {str(error).removeprefix('tire.')}") from None
    if not values and not loads:
        raise InputError(f"{path}: no figure to fit to; there are: {', '.join(KINDS)}, loads")
    load = table.get("load")
    if load is None:
        load = loads[-1][1] if loads else 4000.0
        if any(name.endswith("stiffness") for name in values):
            notes.append(f"load = {load:g} N taken for the load at which stiffness holds")
    return FitFigures(
        size=table["size"],
        inflation=_number(path, "inflation", table["inflation"], 1e4, 2e6, "Pa"),
        load=_number(path, "load", load, 10, 1e6, "N"),
        values=values,
        loads=tuple(sorted(loads)),
        notes=tuple(notes),
    )


_EXAMPLE = {"size": '"205/55 R16"', "inflation": "2.4e5   # Pa"}


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


_LINE = re.compile(r"^\s*([A-Za-z_]\w*)\s*=\s*('[^']*'|\"[^\"]*\"|[^$!]*)")
_UNITS: Mapping[str, tuple[str, tuple[str, ...]]] = {
    "LENGTH": ("meter", ("m", "meter", "metre", "meters", "metres")),
    "FORCE": ("newton", ("n", "newton", "newtons")),
    "TIME": ("second", ("s", "sec", "second", "seconds")),
    "MASS": ("kg", ("kg", "kilogram", "kilograms", "kilo")),
    "ANGLE": ("radians", ("rad", "radian", "radians")),
    "PRESSURE": ("pascal", ("pa", "pascal", "pascals")),
}
"""What a .tir file calls the SI units."""
_CURVE = "DEFLECTION_LOAD_CURVE"
_MOST_LOADS = 3  # points of a curve that are fitted


@dataclass(frozen=True)
class Tir:
    """A .tir file: `units` and `values` by key in capitals as written, with their lines, and rows of numbers by section."""

    path: Path
    units: Mapping[str, tuple[str, int]]
    values: Mapping[str, tuple[str, int]]
    tables: Mapping[str, list[tuple[str, int]]]

    def number(self, key: str) -> float | None:
        """The value of a key; None where it is absent. InputError for one that is no finite number."""
        if key not in self.values:
            return None
        text, line = self.values[key]
        try:
            found = float(text.replace("D", "e").replace("d", "e"))
        except ValueError:
            found = math.nan
        if not math.isfinite(found):
            told = f"{key} = {text} is not a number{_hint(text)}" if text else f"{key} has no value"
            raise InputError(f"{self.path}, line {line}: {told}")
        return found

    def unit(self, key: str) -> str | None:
        """The unit as written if it is not that of SI."""
        text = self.units.get(key, ("", 0))[0]
        return text if text and text.lower() not in _UNITS[key][1] else None


def _hint(text: str) -> str:
    return f": write {text.replace(',', '.')}" if re.fullmatch(r"[-+\d,eE]+", text) else ""


def tir_of(text: str, path: Path) -> Tir:
    """The content of a .tir file; comments begin with $ or !. InputError for a key of two values."""
    units: dict[str, tuple[str, int]] = {}
    values: dict[str, tuple[str, int]] = {}
    tables: dict[str, list[tuple[str, int]]] = {}
    section = ""
    for number, line in enumerate(text.replace("\x1a", "").splitlines(), 1):
        plain = line.strip()
        if not plain or plain.startswith(("$", "!", "{")):
            continue
        if plain.startswith("["):
            section = plain[1:].partition("]")[0].strip().upper()
            continue
        if not (match := _LINE.match(line)):
            tables.setdefault(section, []).append((re.split(r"[$!]", plain)[0].strip(), number))
            continue
        key, value = match[1].upper(), match[2].strip().strip("'\"").strip()
        # Without sections MASS is a unit by its text.
        of_units = section == "UNITS" or (not section and key in _UNITS and not value[:1].isdigit())
        into = units if of_units else values
        if key in into and into[key][0] != value and key in _USED:
            raise InputError(
                f"{path}, line {number}: {key} = {value}, and {into[key][0]} in line {into[key][1]}: which is right?"
            )
        into.setdefault(key, (value, number))
    return Tir(path, units, values, tables)


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
    for key, (unit, _) in _UNITS.items():
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
        try:
            pair = [float(field) for field in fields]
        except ValueError:
            pair = []
        if len(pair) != 2 or not all(math.isfinite(one) for one in pair):
            raise InputError(
                f"{tir.path}, line {line}: [{_CURVE}] has lines of a deflection and a load, not {text[:40]!r}{_hint(text)}"
            )
        if points and not (pair[0] > points[-1][0] and pair[1] >= points[-1][1]):
            raise InputError(f"{tir.path}, line {line}: [{_CURVE}] must ascend, not {text[:40]!r}")
        points.append(pair)
    middle = nominal or 4000.0
    near = [one for one in points if one[0] > 0 and 0.3 * middle <= one[1] <= 1.7 * middle]
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


def tir_values(text: str) -> dict[str, str]:
    """Values as written by key in capitals, without units."""
    return {key: value for key, (value, _) in tir_of(text, Path("tir")).values.items()}


def _of_tir(text: str, path: Path, notes: list[str], sized: bool) -> dict[str, Any]:
    """The figures of a .tir file by the keys of a TOML file; `sized`: the size is given otherwise."""
    tir = tir_of(text, path)
    _check_units(tir, notes)
    value = tir.number
    named, off = ("", 0.0) if sized else _size(path, value)
    if abs(off) > 0.02:
        notes.append(
            f"size {named}: its radius is {100 * off:+.1f} % off the file's UNLOADED_RADIUS"
        )
    values: dict[str, float] = {}
    for key, kind in KINDS.items():
        found = value(kind.tir) if kind.tir else None
        if found is None or (found == 0 and key != "mass"):
            continue
        values[key] = _checked(path, key, found)
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
        values |= {key: _checked(path, key, float(one)) for key, one in sizes.items() if one > 0}
    loads = _curve(tir, load, notes)
    table: dict[str, Any] = values | {"size": named} | ({"load": load} if load else {})
    table |= {"loads": loads} if loads else {}
    inflation = value("INFLPRES") or value("IP") or value("NOMPRES")
    if inflation is not None:
        return table | {"inflation": inflation}
    notes.append(
        f"no INFLPRES in the file: inflation = {INFLATION:g} Pa taken (--set inflation=...)"
    )
    return table | {"inflation": INFLATION}


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
        made = size(named)
    except InputError as error:
        raise InputError(f"{path}: {str(error).removeprefix('tire.')}") from None
    return named, (made.rim + made.height) / radius - 1 if radius else 0.0


WIDE = 1.0  # standard deviation of a parameter's logarithm where no figure speaks
_STEP = 0.1  # of the finite differences, and the largest of an iteration is _TRUST
_TRUST = 0.5
_ITERATIONS = 8
_ENOUGH = 0.02  # of a residual: change of the sum's root at which iterations end
ELEMENTS, ORDER = 26, 2
COARSE = 20, 20  # elements around, and from bead to bead, of the runs on the road


@dataclass(frozen=True)
class Parameter:
    """A free factor of the built-in tire: name, range, and what it multiplies."""

    name: str
    least: float
    most: float
    doc: str


PARAMETERS = (
    Parameter("density", 0.6, 1.6, "densities of all compounds"),
    Parameter("tread", 0.4, 3.0, "modulus of the tread"),
    Parameter("skim", 0.4, 3.0, "modulus of the belt skim"),
    Parameter("sidewall", 0.2, 4.0, "moduli of sidewall and ply rubber"),
    Parameter("apex", 0.1, 4.0, "modulus of the apex"),
    Parameter("carcass", 0.2, 5.0, "modulus of the carcass cords"),
    Parameter("dynamic", 0.87, 1.7, "dynamic over static modulus of all compounds"),
)
_LOSSES = ("tread", "other")  # factors of the loss factors, fitted to the damping ratios afterwards
_LOSS = 0.1, 3.0


@dataclass(frozen=True)
class Fitted:
    """`factors` by parameter, and each figure with its target, what is `reached` and what the size alone gives."""

    figures: FitFigures
    factors: Mapping[str, float]
    start: Mapping[str, float]
    reached: Mapping[str, float]

    def row(self, name: str) -> tuple[float, float, float]:
        """Target, of the size alone, reached."""
        return target(self.figures, name), self.start[name], self.reached[name]


def target(figures: FitFigures, name: str) -> float:
    """The value asked for; of loads by "load at ... m"."""
    loads = {_load_name(deflection): load for deflection, load in figures.loads}
    return loads[name] if name in loads else figures.values[name]


def _load_name(deflection: float) -> str:
    return f"load at {1e3 * deflection:.4g} mm"


def construction(size: str, factors: Mapping[str, float]) -> Construction:
    """The built-in construction of a size with factors by parameter."""
    tire = radial(size)
    own = {
        "tread": "tread",
        "skim": "skim",
        "apex": "apex",
        "sidewall": "sidewall",
        "ply": "sidewall",
    }
    compounds = {}
    for name, values in tire.compounds.items():
        loss = factors.get("tread loss" if name == "tread" else "other loss", 1.0)
        compounds[name] = dict(values) | {
            "youngs_modulus": values["youngs_modulus"] * factors.get(own.get(name, ""), 1.0),
            "density": values["density"] * factors.get("density", 1.0),
            "dynamic": values["dynamic"] * (factors.get("dynamic", 1.0) if name != "bead" else 1.0),
            "loss_factor": values["loss_factor"] * loss,
        }
    cords = [
        replace(line, youngs_modulus=line.youngs_modulus * factors.get("carcass", 1.0))
        if line.name == "carcass"
        else line
        for line in tire.cords
    ]
    return replace(tire, compounds=compounds, cords=cords)


class Model:
    """Figures of a construction. `ratios`: of figures on the default mesh over those on the coarse one."""

    def __init__(self, figures: FitFigures) -> None:
        self.figures, self.ratios = figures, dict[str, float]()
        self._known: dict[str, dict[str, float]] = {}  # figures on the road by scene
        self.names = [
            *(name for name in KINDS if name in figures.values and not name.endswith("damping")),
            *(_load_name(deflection) for deflection, _ in figures.loads),
        ]

    def free(self, factors: Mapping[str, float]) -> dict[str, float]:
        """Mass, frequencies and damping ratios of the inflated tire on its rim."""
        ring = InflatedRing(
            construction(self.figures.size, factors), ELEMENTS, ORDER, self.figures.inflation
        )
        found = {"mass": ring.weight}
        for mode in ring.rigid_modes():
            found[f"{mode.name}_frequency"] = mode.frequency
            found[f"{mode.name}_damping"] = mode.damping
        return found

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
        text = tire_table(self.figures, factors)
        if mesh:
            text = text.replace(
                "[tire]\n", f"[tire]\nsegments = {mesh[0]}\nelements_arc = {mesh[1]}\n", 1
            )
        deflections = [deflection for deflection, _ in self.figures.loads]
        rows = f"deflections = {deflections}" if len(deflections) > 2 else "steps = 3"
        return (
            f'name = "fit"\n{text}\n[static]\ninflation = {self.figures.inflation}\nload = {self.figures.load}\n'
            f"error_estimate = false\n[stiffness]\n{rows}\n"
        )

    def _read(self, out: Path) -> dict[str, float]:
        with h5py.File(out / "stiffness.h5") as file:
            curve = {name: file[f"curve/{name}"][:] for name in file["curve"]}
            own = {
                name: float(file[name][()])
                for name in ("vertical", "longitudinal", "lateral", "torsional")
            }
        with h5py.File(out / "static.h5") as file:
            deflection = float(file.attrs["deflection"])
        found = {f"{name}_stiffness": value for name, value in own.items()}
        apart = np.abs(curve["deflection"] - deflection) > 0.02 * deflection
        points = {0.0: 0.0, deflection: self.figures.load}
        points |= dict(zip(curve["deflection"][apart], curve["load"][apart], strict=True))
        moved, load = np.array(sorted(points.items())).T
        at = PchipInterpolator(moved, load, extrapolate=True)
        for there, _ in self.figures.loads:
            found[_load_name(there)] = float(at(there))
        loads = np.sort(curve["load"])
        for name in ("length", "width"):
            values = curve[f"footprint_{name}"][np.argsort(curve["load"])]
            found[f"footprint_{name}"] = float(np.interp(self.figures.load, loads, values))
        return found

    def all(self, factors: Mapping[str, float]) -> dict[str, float]:
        """Every figure; those on the road by the coarse mesh times what is known of its error."""
        found = self.free(factors)
        if self.figures.pressed:
            for name, value in self.pressed(factors, COARSE).items():
                found[name] = value * self.ratios.get(name, 1.0)
        return found

    def residuals(self, found: Mapping[str, float]) -> np.ndarray:
        """Logarithms of ratios to the targets over the tolerances."""
        return np.array(
            [
                np.log(found[name] / target(self.figures, name)) / _tolerance(name)
                for name in self.names
            ]
        )


def _tolerance(name: str) -> float:
    return KINDS[name].tolerance if name in KINDS else LOADS


def _run(folder: Path) -> Path:
    """Run the scene in a folder up to its stiffness; returns the results' folder."""
    from mpi4py import MPI

    from tireroad.runs.files.cache import Cache
    from tireroad.runs.process import mpi
    from tireroad.runs.scene.load import load
    from tireroad.runs.stages.pipeline import run_scene

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
    """The factors of the least sum of squares. Not collective; minutes with figures on the road, else seconds."""
    model = Model(figures)
    low, high = (np.log([getattr(one, end) for one in PARAMETERS]) for end in ("least", "most"))
    place = np.zeros(len(PARAMETERS))
    start = found = model.all({})
    console.say(f"  {figures.size} as built: {_worst(model, found)}")
    jacobian = _jacobian(model, place, found) if model.names else np.zeros((0, len(place)))
    for iteration in range(_ITERATIONS if model.names else 0):
        rest = model.residuals(found)
        wanted = np.concatenate([-rest, -place / WIDE])
        matrix = np.vstack([jacobian, np.eye(len(place)) / WIDE])
        bounds = np.maximum(low - place, -_TRUST), np.minimum(high - place, _TRUST)
        step = lsq_linear(matrix, wanted, bounds=bounds).x
        if np.abs(step).max() < 1e-3:
            break
        new = model.all(_factors(place + step))
        change = model.residuals(new) - rest
        # Broyden: the Jacobian that explains what was seen.
        jacobian += np.outer(change - jacobian @ step, step) / (step @ step)
        before, after = (
            np.hypot(np.linalg.norm(model.residuals(one)), np.linalg.norm(at) / WIDE)
            for one, at in ((found, place), (new, place + step))
        )
        console.say(f"  iteration {iteration + 1}: {_worst(model, new)}")
        if after < before:
            place, found = place + step, new
        if before - after < _ENOUGH * max(before, 1.0):
            if figures.pressed and not model.ratios:
                found = _corrected(model, place, found)
                continue
            break
    factors = _factors(place)
    if figures.pressed:
        found = model.free(factors) | model.pressed(factors, None)
        console.say(f"  on the default mesh: {_worst(model, found)}")
        start = dict(start) | model.pressed({}, None)
    factors |= _losses(figures, factors)
    return Fitted(figures, factors, start, found | model.free(factors))


def _corrected(model: Model, place: np.ndarray, found: Mapping[str, float]) -> dict[str, float]:
    """Take the ratio of the default to the coarse mesh from here on; the figures by it."""
    fine = model.pressed(_factors(place), None)
    model.ratios = {name: value / found[name] for name, value in fine.items()}
    console.say("  ratios of the default mesh to the coarse one are known from here on")
    return dict(found) | fine


def _factors(place: np.ndarray) -> dict[str, float]:
    return {one.name: float(np.exp(p)) for one, p in zip(PARAMETERS, place, strict=True)}


def _jacobian(model: Model, place: np.ndarray, found: Mapping[str, float]) -> np.ndarray:
    columns = []
    for k, one in enumerate(PARAMETERS):
        moved = place.copy()
        moved[k] += _STEP
        columns.append(
            (model.residuals(model.all(_factors(moved))) - model.residuals(found)) / _STEP
        )
        console.say(f"  sensitivity to {one.name}: {one.doc}")
    return np.array(columns).T


def _worst(model: Model, found: Mapping[str, float]) -> str:
    """The figure that is farthest off."""
    if not model.names:
        return "only damping ratios are asked for"
    off = {name: found[name] / target(model.figures, name) - 1 for name in model.names}
    name = max(off, key=lambda one: abs(off[one]) / _tolerance(one))
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
        found = model.free(dict(factors) | alone)
        columns.append(
            [found[name] / figures.values[name] / KINDS[name].tolerance for name in names]
        )
    matrix = np.vstack([np.array(columns).T, np.eye(2) / WIDE])
    wanted = np.concatenate([[1 / KINDS[name].tolerance for name in names], np.ones(2) / WIDE])
    best = lsq_linear(matrix, wanted, bounds=_LOSS).x
    return {f"{which} loss": float(value) for which, value in zip(_LOSSES, best, strict=True)}


def tire_table(figures: FitFigures, factors: Mapping[str, float]) -> str:
    """The [tire] of a scene with these factors: size, compounds, carcass cords."""
    tire = construction(figures.size, factors)
    lines = ["[tire]", 'section = "radial"', f'size = "{figures.size}"']
    for name, values in tire.compounds.items():
        lines += [
            "",
            "[[tire.region]]",
            f'name = "{name}"',
            f"dynamic = {values['dynamic']:.5g}",
            f"loss_factor = {values['loss_factor']:.4g}",
            "[tire.region.material]",
            *(
                f"{key} = {values[key]:.6g}"
                for key in ("youngs_modulus", "poisson_ratio", "density")
            ),
        ]
    line = next(one for one in tire.cords if one.name == "carcass")
    lines += ["", "[[tire.cords]]", 'name = "carcass"', f"angle = {np.degrees(line.angle):g}"]
    keys = "youngs_modulus", "area", "spacing", "density", "compression"
    lines += [f"{key} = {getattr(line, key):.6g}" for key in keys]
    return "\n".join(lines) + "\n"


def report(found: Fitted) -> str:
    """The figures beside those reached, the factors, and what cannot be reached."""
    figures = found.figures
    names = [
        *(name for name in KINDS if name in figures.values),
        *(_load_name(d) for d, _ in figures.loads),
    ]
    rows = [("figure", "asked", "as built", "fitted", "off")]
    missed = []
    for name in names:
        wanted, before, reached = found.row(name)
        off = reached / wanted - 1
        unit = KINDS[name].unit if name in KINDS else "N"
        rows.append(
            (
                f"{name}, {unit}",
                f"{wanted:.5g}",
                f"{before:.5g}",
                f"{reached:.5g}",
                f"{100 * off:+.1f} %",
            )
        )
        if abs(off) > 2 * _tolerance(name):
            missed.append(f"{name} ({100 * off:+.1f} %)")
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    lines = [
        "  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)).rstrip()
        for row in rows
    ]
    lines += ["", "factors of the built-in tire's values:"]
    documents = {one.name: one for one in PARAMETERS}
    for name, value in found.factors.items():
        one = documents.get(name)
        at_end = one and min(value / one.least, one.most / value) < 1.001
        ending = (
            f" (at the end of its range, {one.least:g} to {one.most:g})" if one and at_end else ""
        )
        lines.append(f"  {name:12s} {value:.3f}  {one.doc if one else 'of loss factors'}{ending}")
    lines += [f"  note: {note}" for note in figures.notes]
    lines.append(
        f"not reached within twice the tolerance: {', '.join(missed)}"
        if missed
        else "all figures are reached within twice their tolerances"
    )
    return "\n".join(lines)


def command(path: Path, out: Path, changes: Sequence[str] = ()) -> str:
    """Fit the figures in a file; writes out/scene.toml. Returns what to print."""
    figures = read(path, changes)
    try:
        found = fit(figures)
    except ConvergenceError as error:
        raise ConvergenceError(f"{path}: {error}") from None
    out.mkdir(parents=True, exist_ok=True)
    text = report(found)
    scene = [
        f"# {figures.size} fitted to {path.name}:",
        *(f"#   {line}".rstrip() for line in text.splitlines()),
        f'name = "{scene_name(out.name)}"',
        "",
        tire_table(figures, found.factors),
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
