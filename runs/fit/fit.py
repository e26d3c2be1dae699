"""`tireroad fit`: the built-in tire's free parameters from a real tire's figures, by least squares.

Mass, modes and damping come from Fourier series around the inflated section (fem.sections.inflated, a
second each); load, stiffness and footprint from the stages static and stiffness on a coarse mesh, whose ratio to
the default mesh is taken from a last run there. Residuals are logarithms of ratios over each figure's tolerance;
each parameter is a factor whose logarithm counts as a residual, too, over WIDE: what no figure determines stays.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import h5py
import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.optimize import lsq_linear

from tireroad.fem.errors import ConvergenceError, InputError
from tireroad.fem.sections.construction import Construction
from tireroad.fem.sections.inflated import InflatedRing
from tireroad.fem.sections.radial import radial
from tireroad.runs.fit.figures import KINDS, LOADS, MODES, FitFigures, read
from tireroad.runs.process import console

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
    from tireroad.runs.search.search import run

    mpi.start_petsc([])
    scene = load(folder / "scene.toml", [], lambda remark: None, "stiffness")
    with console.quiet():
        run(
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
        f'name = "{path.stem}"',
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
