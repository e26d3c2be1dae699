"""Contact models of the literature on one tire and road, against a half-space with fine points."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from scipy.optimize import brentq

from tireroad.contact.results.spectra import distance, third_octaves
from tireroad.contact.tread.law import TREADS
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.footprint import TreadSurface
from tireroad.fem.static.load_steps import LoadStepper
from tireroad.fem.static.state import StaticState, static_state
from tireroad.runs.validation.full_elements import Conditions
from tireroad.runs.validation.tables import Table
from tireroad.tests.bench.accuracy.rough_road import BAND, Mesh, Prepared, modal, prepared
from tireroad.tests.reference.literature import (
    LookUp,
    ShiftedSprings,
    Wedges,
    asperities,
    fitted_stiffness,
    look_up,
)

ABOUT = "the literature's contact models against the half-space with fine points: forces, third octaves, time"
MESH = Mesh(24, 10, 0.3)
SPEED = 60.0  # rad/s
STEP, DURATION = 1e-4, 0.4  # s
FINE, COARSE = 0.005, 0.01  # m between points
RUBBER = {"youngs_modulus": 1e7, "poisson_ratio": 0.49}
STONE, SUNK = (
    0.005,
    5e-4,
)  # m: the sphere to which the Winkler bed is fitted, and its indentation
THICKNESS = 0.01  # m: thickness of the bonded layer
DEPTHS = 8  # road heights in the look-up table
_NEAR = np.radians(60)  # from the lowest point: rings of nodes included
SETTLED = 0.15  # share of the run left out while the road's heights grow from flat


@dataclass(frozen=True)
class Outcome:
    """Result of a contact model.

    Contact force (n,) N every STEP; `seconds`: CPU time of its loop; `follows`: whether it follows
    the road itself rather than only its statistics.
    """

    name: str
    force: np.ndarray
    seconds: float
    follows: bool = True


def run() -> list[Table]:
    """One table: mean, deviation, history, third octaves and cost of each model."""
    with TemporaryDirectory() as folder:
        fine, coarse = (
            prepared(
                Path(folder) / name, MESH, "road.cut_off=0.012", "road.roll_off=0.06", "road.rms=3e-4", 
                pitch=pitch, duration=DURATION, step=STEP, speed=SPEED, modes=80,
            )
            for name, pitch in (("fine", FINE), ("coarse", COARSE))
        )  # fmt: skip
        stiffness = fitted_stiffness(TREADS.make("half-space", **RUBBER), STONE, SUNK)
        models = [
            _law("half-space, points every 5 mm", fine, "half-space", **RUBBER),
            _law("half-space, points every 10 mm", coarse, "half-space", **RUBBER),
            _law("Kropp: Winkler bed, fitted", fine, "winkler", winkler_stiffness=stiffness),
            _law("Larsson and Kropp: bonded layer", fine, "layer", **RUBBER, thickness=THICKNESS),
            _wedges(fine, _pressed(fine)),
            _asperities(fine),
        ]
    return [_table(models, stiffness)]


def _law(name: str, given: Prepared, tread: str, **keys: float) -> Outcome:
    """The time loop with that tread law."""
    run = given.run
    spec = replace(given.run.job.scene.contact, tread=tread, law=TREADS.make(tread, **keys))
    setup, _ = run.setup.equilibrated(run.greens.contact, run.static.normal_force, spec)
    trial = Conditions(spec, setup, DURATION)
    history = modal(Prepared(run, trial), run.greens.contact, STEP)
    return Outcome(name, history.values["contact force"][:, 2], history.seconds)


def _wedges(given: Prepared, states: list[StaticState]) -> Outcome:
    """The wedge model; its look-up table is not timed, like the other models' tire matrices."""
    table, tire = _look_up(given, states), _unloaded(given, states[0])
    setup, load = given.trial.setup, given.run.static.load
    flat = np.zeros(tire.height.shape)
    rise = brentq(lambda z: tire.force(flat + z, table) / load - 1, 0.0, 0.05)
    places = np.broadcast_to(tire.x[:, None], tire.y.shape)
    began, force = time.process_time(), []
    for k in range(1, round(DURATION / STEP) + 1):
        road = setup.road.height(np.asarray(places + setup.rolled.speed * STEP * k), tire.y)
        force.append(tire.force(road + rise, table))
    name = f"Mancosu and Minen: wedges, look-up within {100 * table.scatter:.2g} %"
    return Outcome(name, np.array(force), time.process_time() - began)


def _pressed(given: Prepared) -> list[StaticState]:
    """The inflated tire without a road, then on a plane, up to 1.3 times the deflection."""
    body, static = given.run.job.tire.body, given.run.static
    body.u.x.array[:] = 0.0
    loader = LoadStepper(Equilibrium(body, static.rolling), lambda progress: None)
    loader.inflate(static.inflation)
    states = [static_state(loader.equilibrium, loader.touch)]
    depths = 1.3 * static.deflection * (np.arange(DEPTHS) + 1) / DEPTHS
    for _ in loader.visit(depths.tolist()):
        states.append(static_state(loader.equilibrium, loader.touch))
    body.set_displacement(static.displacement)
    return states


def _unloaded(given: Prepared, state: StaticState) -> Wedges:
    """The inflated tire's face above its lowest point, on the grid of the fine points."""
    x0, x1, y0, y1 = given.trial.setup.patch.extent
    x, y = (
        np.arange(np.ceil(a / FINE), np.floor(b / FINE) + 1) * FINE for a, b in ((x0, x1), (y0, y1))
    )
    return _face(given, state, x, np.full(len(x), FINE), y)


def _face(
    given: Prepared, state: StaticState, x: np.ndarray, length: np.ndarray, y: np.ndarray
) -> Wedges:
    """Wedges at x (a,) m, `length` (a,) m long, evaluated at evenly spaced y (b,) m."""
    surface = TreadSurface(given.run.job.tire.lattice, state.positions)
    places = [part.ravel() for part in np.meshgrid(x, y, indexing="ij")]
    ring, arc, found = surface.locate(*places)
    height = np.where(found, surface.at(ring, arc)[:, 2] - state.touch_height, np.inf)
    shape = len(x), len(y)
    across, width = np.broadcast_to(y, shape), np.full(shape, y[1] - y[0])
    return Wedges(x=x, length=length, y=across, height=height.reshape(shape), width=width)


def _look_up(given: Prepared, states: list[StaticState]) -> LookUp:
    """Area within the plane and force per metre, of rings of nodes near the road, at each depth."""
    inflated, lattice = states[0], given.run.job.tire.lattice
    near = np.abs((lattice.ring + np.pi) % (2 * np.pi) - np.pi) < _NEAR
    x0, x1, y0, y1 = given.trial.setup.patch.extent
    y = np.linspace(y0, y1, 41)
    middle = inflated.shape[1] // 2
    x = inflated.positions.reshape(*inflated.shape, 3)[near, middle, 0]
    order = np.argsort(x)
    # Nodal areas within a ring follow from the elements' quadrature: so does the length each ring
    # represents.
    areas = inflated.area.reshape(inflated.shape)[near][order]
    length = np.gradient(x[order]).sum() * areas[:, middle] / areas[:, middle].sum()
    wedges = _face(given, inflated, x[order], length, y)
    inside, carried = [], []
    for state in states[1:]:
        depth = np.full(wedges.height.shape, state.road_height - state.touch_height)
        inside.append(wedges.area(depth))
        carried.append(state.force.reshape(state.shape)[near][order].sum(axis=1) / length)
    return look_up(np.concatenate(inside), np.concatenate(carried))


def _asperities(given: Prepared) -> Outcome:
    """From the statistics of the road's middle line."""
    setup, static = given.trial.setup, given.run.static
    pitch = 0.25 * setup.road.spacing
    line: np.ndarray = setup.patch.extent[1] + np.arange(
        0.0, setup.rolled.travel - setup.patch.extent[1], pitch
    )
    road = asperities(setup.road.height(line, 0 * line), pitch)
    crown = static.positions.reshape(*static.shape, 3)[:, static.shape[1] // 2, 0]
    gap = static.gap.reshape(static.shape)[:, static.shape[1] // 2]
    low = np.flatnonzero(gap < setup.reach)
    order = low[np.argsort(crown[low])]
    springs = ShiftedSprings(
        road=road,
        modulus=RUBBER["youngs_modulus"] / (1 - RUBBER["poisson_ratio"] ** 2),
        width=static.footprint().width,
        gap=lambda x: np.interp(x, crown[order], gap[order]),
        length=float(np.abs(crown[order]).max()),
        load=static.load,
    )
    began = time.process_time()
    way = setup.rolled.speed * STEP * (np.arange(round(DURATION / STEP)) + 1)
    force = springs.forces(np.asarray(way))
    name = (
        f"Fujikawa: asperities {1e3 * road.spacing:.2g} mm apart, of {1e3 * road.radius:.2g} mm radius, "
        f"{1e3 * road.unevenness:.2g} mm uneven"
    )
    return Outcome(name, force, time.process_time() - began, follows=False)


def _table(models: list[Outcome], stiffness: float) -> Table:
    first = round(SETTLED * DURATION / STEP)
    reference = models[0].force[first:]
    centre, level = third_octaves(reference[:, None], STEP, BAND)
    rows = []
    for model in models:
        force = model.force[first:]
        off = distance(reference[:, None], force[:, None], len(force) * STEP, BAND).mean
        difference = third_octaves(force[:, None], STEP, BAND)[1] - level
        rows.append(
            [model.name, float(force.mean()), float(force.std()), 100 * off if model.follows else "",
             float(difference.mean()), float(np.abs(difference).max()), model.seconds]
        )  # fmt: skip
    columns = [("model", ""), ("mean", "N"), ("deviation", "N"), ("history off", "%"),
               ("third octaves off, mean", "dB"), ("at worst", "dB"), ("time loop", "s")]  # fmt: skip
    notes = [
        f"Contact force after the first {100 * SETTLED:.0f} % of {DURATION:g} s; history and third octaves "
        f"({centre[0]:.0f} to {centre[-1]:.0f} Hz) against the first row, up to {BAND:.0f} Hz. The wedges do not "
        "answer in time, the asperities have mean spacings alone.",
        f"Winkler bed of {stiffness:.3g} N/m^3: as much force as the half-space on a sphere of {1e3 * STONE:g} mm "
        f"pressed in by {1e3 * SUNK:g} mm.",
    ]
    return Table("Contact models of the literature", columns, rows, notes)
