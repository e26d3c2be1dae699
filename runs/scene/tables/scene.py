"""The tables of a scene, key by key, with units, ranges and defaults (contract: Scene)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from tireroad.contact.choices import USABLE
from tireroad.contact.roads.road import ROADS, RoadKind
from tireroad.contact.roads.under_tire import Motion, Placement
from tireroad.fem.errors import InputError
from tireroad.fem.parameters import Key, Limits, OnlyFor, described, finite, parameter, text
from tireroad.fem.tire.material import COLDEST, REFERENCE, warmed
from tireroad.fem.wheel import DIRECTIONS, SHAPE_TOLERANCE, Axle
from tireroad.greens.residuals import RESIDUALS, names
from tireroad.greens.schemes import keeps_history
from tireroad.modal.solver.searches import SEARCHES
from tireroad.runs.scene.outputs import OUTPUTS, Output
from tireroad.runs.scene.schema import (
    Collects,
    Variants,
    Where,
    choice,
    collection,
    flag,
    integer,
    number,
    registered,
    table,
    tables,
    variant,
    vector,
)
from tireroad.runs.scene.tables.contact import ContactTable, PatternTable, TimeTable
from tireroad.runs.scene.tables.sound import HEARD, SoundTable
from tireroad.runs.scene.tables.tire import Raw, TireTable

Springs = tuple[float, ...] | tuple[tuple[float, ...], ...]
_SPRINGS = Limits(least=-1e15, most=1e15)  # N/m, N m/rad and per unit of velocity
_HELD = tuple(name for name in DIRECTIONS if name != "z")
_MOVING: OnlyFor = ("kind", ("corner", "free"))
_SPRUNG: OnlyFor = ("kind", ("corner",))
_MOST = 200
_BEYOND = 1.5  # times the scene's own deflection, by default


@dataclass(frozen=True)
class StaticTable:
    inflation: float = number(
        2.0e5, "Pa", "inflation pressure on the inner face", least=0, most=1e8
    )
    load: float | None = number(
        None, "N", "vertical load of the tire on the road", least=1e-3, most=1e8
    )
    deflection: float | None = number(
        None,
        "m",
        "deflection from the first touch of the inflated tire, instead of load",
        least=1e-6,
        most=10,
    )
    road_height: float | None = number(
        None,
        "m",
        "z of the road under the axle, the axle at 0, instead of load",
        least=-10,
        most=-1e-3,
    )
    camber: float = number(
        0.0,
        "deg",
        "inclination of the wheel on its road, load and deflection along the road's normal; > 0: its top leans to the "
        "right (-y)",
        least=-20,
        most=20,
    )
    friction: float | None = number(
        None,
        "-",
        "coefficient of Coulomb friction between tire and road in the static state; absent: none. A standing tire sticks "
        "and slips as it is pressed on the road, a rolling one as its tread passes through the contact, with a wheel "
        "that turns as it would roll freely without contact.slip and rotation.slip_angle",
        least=0,
        most=10,
    )
    friction_steps: int = integer(
        10,
        "steps in which a standing tire with friction is pressed on the road",
        least=1,
        most=1000,
    )
    steady_rolling: bool = flag(
        True,
        "include the inertia and material damping of the rolling shape; false: the state at rest",
    )
    error_estimate: bool = flag(
        True,
        "estimate the discretisation error of the load, by finer elements at the footprint, which also give its extent, "
        "and by elements of another order everywhere",
    )

    @property
    def on_road(self) -> bool:
        """Whether there is a road."""
        return (self.load, self.deflection, self.road_height) != (None, None, None)


@dataclass(frozen=True)
class ModalTable:
    count: int = integer(500, "number of modes, from the lowest", least=1, most=100000)
    up_to: float | None = number(
        None, "Hz", "all modes below this frequency, instead of count", least=1e-3, most=1e6
    )
    rim: str = choice(
        "fixed",
        ("fixed", "free"),
        "bead faces: fixed, or one massless rigid body that is free",
    )
    road: str = choice(
        "forces",
        ("forces", "held"),
        "road in the modes: replaced by its static forces, or the touching nodes held in height",
    )
    solver: str = choice(
        "auto",
        ("auto", *SEARCHES),
        "who finds the modes in slices of equal numbers, of each part that symmetry leaves: block Lanczos, which auto "
        "takes, or SLEPc's Krylov-Schur with one vector, which finds the same in 1.2 to 1.7 times the CPU time",
    )

    @property
    def on_axle_alone(self) -> bool:
        """Whether the axle alone carries what acts on the tire: its rim is fixed, no other node is held."""
        return (self.rim, self.road) == ("fixed", "forces")

    @property
    def asked(self) -> dict[str, Any]:
        """`count` or `up_to` (Hz), whichever decides, the other None; and the `solver`."""
        count = None if self.up_to else self.count
        return {"count": count, "up_to": self.up_to, "solver": self.solver}


@dataclass(frozen=True, kw_only=True)
class RoadTable(Variants, Placement):
    """The road driven over; `surface` is the kind with its parameters."""

    kind: str = registered(ROADS, "flat", "type of road")
    surface: RoadKind = variant("kind", ROADS)
    motion: Motion = table(Motion, "vertical motion of the whole road")

    @property
    def file(self) -> str | None:
        """The file of a measured road, or None."""
        return getattr(self.surface, "file", None)


def _entry(value: Any) -> float:
    number = finite(value)
    _SPRINGS.check(number, "")
    return number


def _springs(default: Springs, doc: str) -> Any:
    """A key of six diagonal entries, or a whole 6 x 6 matrix."""

    def read(value: Any) -> Springs:
        whole = isinstance(value, list | tuple) and len(value) == 6
        if not whole:
            raise ValueError(f"must be 6 numbers, or 6 rows of 6, not {described(value)}")
        if not any(isinstance(part, list | tuple) for part in value):
            return tuple(_entry(part) for part in value)
        rows = [part if isinstance(part, list | tuple) else () for part in value]
        if any(len(row) != 6 for row in rows):
            raise ValueError("must be 6 numbers, or 6 rows of 6")
        return tuple(tuple(_entry(part) for part in row) for row in rows)

    values = "6 numbers ≥ 0, or a symmetric matrix of 6 rows, each ≤ 1e+15"
    key = Key(read=read, unit="N, m, s, rad", doc=doc, values=values, only_for=_SPRUNG)
    return parameter(key, default)


def _directions(default: tuple[str, ...], doc: str) -> Any:
    def read(value: Any) -> tuple[str, ...]:
        if not isinstance(value, list | tuple) or any(part not in DIRECTIONS for part in value):
            raise ValueError(f"must be a list of {', '.join(DIRECTIONS)}, not {described(value)}")
        return tuple(name for name in DIRECTIONS if name in value)

    values = f"of {', '.join(DIRECTIONS)}"
    return parameter(Key(read=read, doc=doc, values=values, only_for=_MOVING), default)


@dataclass(frozen=True)
class AxleTable:
    kind: str = choice(
        "fixed",
        ("fixed", "corner", "free"),
        "support of the wheel: held, on springs and dampers, or free under the constant static load",
    )
    wheel_mass: float = number(
        15.0,
        "kg",
        "mass of rim, brake and all that moves with them, without the tire",
        least=0.01,
        most=1e6,
        only_for=_MOVING,
    )
    wheel_inertia: tuple[float, float, float] = vector(
        (0.4, 0.8, 0.4),
        "kg m²",
        "moments of inertia of the wheel about x, y (the axle) and z",
        least=0,
        most=1e6,
    )
    stiffness: Springs = _springs(
        (0.0, 0.0, 25e3, 0.0, 0.0, 0.0),
        "stiffness of the springs to the body along x, y, z (N/m) and about them (N m/rad)",
    )
    damping: Springs = _springs(
        (0.0, 0.0, 2.4e3, 0.0, 0.0, 0.0),
        "damping of the dampers parallel to the springs, N s/m and N m s/rad",
    )
    body_mass: float | None = number(
        None,
        "kg",
        "mass of the car body on this corner, which moves up and down; absent: springs to the ground",
        least=0.1,
        most=1e8,
        only_for=_SPRUNG,
    )
    locked: tuple[str, ...] = _directions(
        _HELD,
        "directions in which the wheel is held; about y (ry) it is its speed of rotation that is held",
    )


def axle_of(scene: Scene) -> Axle | None:
    """The moving wheel; None if held. Raises InputError if it is no valid mechanical system."""
    axle = scene.axle
    if axle.kind == "fixed" or len(axle.locked) == len(DIRECTIONS):
        return None
    none = (0.0,) * 6
    free = axle.kind == "free"
    return Axle(
        wheel_mass=axle.wheel_mass,
        wheel_inertia=axle.wheel_inertia,
        stiffness=np.array(none if free else axle.stiffness),
        damping=np.array(none if free else axle.damping),
        body_mass=None if free else axle.body_mass,
        locked=axle.locked,
    )


def check_axle(table: AxleTable, scene: Scene, raw: Raw, error: Where) -> None:
    """Raise an error for an unstable corner, and for settings incompatible with a moving wheel."""
    if table.kind == "fixed":
        return
    try:
        axle = axle_of(scene)
    except InputError as problem:
        raise error(("axle",), str(problem).removeprefix("axle: ")) from None
    if axle is None:
        return
    if table.kind == "free" and any(k > 2 for k in axle.moving):
        raise error(
            ("axle", "locked"),
            'must hold rx, ry and rz of kind = "free": nothing else keeps the wheel upright',
        )
    if table.kind == "corner":
        _check_springs(axle, error)
    _check_company(scene, axle, error)


def _check_springs(axle: Axle, error: Where) -> None:
    if axle.body_mass is not None and not axle.has_body:
        raise error(("axle", "body_mass"), "has no part where z is locked: take it or the lock out")
    for k in axle.moving:
        if axle.stiffness[k, k] <= 0:
            what = "carries the static load" if k == 2 else "keeps the wheel in place"
            raise error(
                ("axle", "stiffness"),
                f"has no spring along {DIRECTIONS[k]}, and nothing else {what}: the corner is unstable. "
                f'Give one, or lock {DIRECTIONS[k]}; kind = "free" is a wheel under a constant force',
            )


def _check_company(scene: Scene, axle: Axle, error: Where) -> None:
    """Refuse what is available for a held wheel only."""
    turns = scene.rotation is not None and scene.rotation.speed > 0
    if scene.modes.rim == "free":
        raise error(("modal", "rim"), '= "free" is a wheel without mass: [axle] needs "fixed"')
    if scene.modes.road == "held":
        raise error(
            ("modal", "road"),
            f'= "held" keeps the wheel of axle.kind = "{scene.axle.kind}" where it is: take modal.road = "forces", '
            'or axle.kind = "fixed"',
        )
    if turns and scene.rotation.method == "full":
        raise error(("rotation", "method"), '= "full" knows no [axle] that moves: take "projected"')
    if turns and scene.rotation.inertia == "doppler":
        raise error(
            ("rotation", "inertia"),
            '= "doppler" pulls at a wheel that moves along with its tire: take "full"',
        )
    tilts = any(k > 2 for k in axle.moving)
    if tilts and turns and not scene.static.steady_rolling:
        raise error(
            ("static", "steady_rolling"),
            "= false leaves out the centrifugal tension that keeps a tilting tire upright",
        )


@dataclass(frozen=True)
class AccuracyTable:
    estimate: bool = flag(
        True,
        "error bars of contact and axle force by cheaper companion runs: elements of twice the size, fewer modes, twice "
        "the step, another spacing of points",
    )
    target: float | None = number(
        None,
        "-",
        "largest estimated error of the vertical force named by of: relative L2 norm of the error of its varying part up "
        "to up_to, and relative error of its mean; mesh, modes, residual, points and step are then searched for",
        least=1e-3,
        most=1,
    )
    target_db: float | None = number(
        None,
        "dB",
        "largest estimated error of every third octave below up_to; together with target both must be met",
        least=0.05,
        most=20,
    )
    of: str = choice(
        "axle_force", ("axle_force", "contact_force"), "force to which the target applies"
    )
    chance_db: float | None = number(
        None,
        "dB",
        "by how much third octaves from 63 Hz on may differ from those of an endless rough road by chance, in 95 % of cases: "
        "chooses how many stretches of it are rolled over and pooled; absent: one",
        least=0.1,
        most=20,
    )
    up_to: float = number(
        400.0,
        "Hz",
        'highest frequency of interest: of the error, and of the waves by which contact.points = "auto" is chosen; where '
        "it is given, also of modal.up_to, time.step and the mesh of a radial tire, as far as these are absent",
        least=1,
        most=1e5,
    )
    search: bool = flag(
        True,
        "with a target: search for settings that meet it; false: keep those of the scene, as in the scene that a "
        "search writes",
    )
    trials: int = integer(12, "number of settings that a search tries at most", least=1, most=100)
    budget: float | None = number(
        None,
        "s",
        "duration of the finished trials of a search, also of those before an interruption, after which no further settings "
        "are tried",
        least=1,
        most=1e8,
    )

    def aim(self) -> str:
        """The target in words."""
        asked = [f"{100 * self.target:.3g} %"] if self.target is not None else []
        asked += [f"{self.target_db:.3g} dB"] if self.target_db is not None else []
        return f"settings with {' and '.join(asked)} of the {self.of.replace('_', ' ')} up to {self.up_to:g} Hz"

    @property
    def aimed(self) -> bool:
        """Whether a target error is given."""
        return self.target is not None or self.target_db is not None

    @property
    def searches(self) -> bool:
        """Whether settings are searched for."""
        return self.aimed and self.search


def check_accuracy(accuracy: AccuracyTable, scene: Scene, raw: Raw, error: Where) -> None:
    """Check what a target requires of the other tables."""
    if not accuracy.aimed:
        return
    key = ("accuracy", "target" if accuracy.target is not None else "target_db")
    if not accuracy.estimate:
        raise error(key, "is met by the estimated error: it needs accuracy.estimate = true")
    if not scene.in_contact or scene.road is None or scene.time is None:
        raise error(
            key,
            "is of the forces of a tire on a road: add [contact], [road], [time], and load (N) to [static]",
        )
    if accuracy.of == "axle_force" and not scene.output.axle_force:
        raise error(("accuracy", "of"), '= "axle_force" needs output.axle_force = true')
    if scene.road.kind == "flat" and scene.road.motion.kind == "none" and not scene.force:
        raise error(key, "is of what varies, and nothing drives the tire: take another road")
    if accuracy.up_to * scene.time.duration < 4:
        raise error(
            ("accuracy", "up_to"),
            f"= {accuracy.up_to:g} Hz is not seen in {scene.time.duration:g} s: four periods at least",
        )
    if accuracy.searches:
        _check_points(scene, error)


def _check_points(scene: Scene, error: Where) -> None:
    """Raise an error for contact that does not exist, or is another, on grids of a search."""
    assert scene.contact is not None
    if scene.contact.brush_stiffness is not None:
        raise error(
            ("contact", "brush_stiffness"),
            "is that of a point: a search for accuracy chooses grids of points, and would change the tread with them; take "
            "brush_stiffness_per_area (N/m³), or accuracy.search = false and your own contact.points",
        )
    if not scene.contact.law.compliant:
        raise error(
            ("contact", "tread"),
            f'= "{scene.contact.tread}" has no compliance of its own, so it works on the nodes of the mesh only, and a '
            'search for accuracy chooses grids of points: take another, e.g. "half-space", or accuracy.search = false',
        )


def _ascending(doc: str, unit: str, limits: Limits) -> Any:
    """A key for an ascending list of numbers, empty by default."""

    def read(value: Any) -> tuple[float, ...]:
        if not isinstance(value, list | tuple) or len(value) > _MOST:
            raise ValueError(f"must be a list of at most {_MOST} numbers, not {described(value)}")
        result = tuple(finite(part) for part in value)
        for part in result:
            limits.check(part, unit)
        if any(b <= a for a, b in zip(result, result[1:], strict=False)):
            raise ValueError(f"must ascend, not {described(list(result))}")
        return result

    allowed = f"ascending numbers, {limits}"
    return parameter(Key(read=read, unit=unit, doc=doc, values=allowed, limits=limits), ())


@dataclass(frozen=True)
class StiffnessTable:
    deflections: tuple[float, ...] = _ascending(
        "deflections at which load and footprint are computed; empty: equal steps up to up_to",
        "m",
        Limits(least=1e-6, most=10),
    )
    up_to: float | None = number(
        None, "m", "largest deflection; absent: 1.5 times that of the scene", least=1e-6, most=10
    )
    steps: int = integer(6, "number of equal steps up to up_to", least=1, most=_MOST)
    which: str = choice(
        "all",
        ("all", "vertical"),
        "stiffnesses to compute: vertical, or all (also longitudinal, lateral and torsional)",
    )
    slide_steps: int = integer(
        8,
        "with static.friction and which = all: steps of the curves of force over the displacement of the road along and "
        "across a standing tire, or over the slip of a rolling one, up to sliding; 0: none",
        least=0,
        most=_MOST,
    )
    slide_to: float | None = number(
        None,
        "m",
        "largest displacement of these curves; absent: 2 friction times load over the stiffness of the sticking footprint",
        least=1e-6,
        most=1,
    )
    slip_to: float | None = number(
        None,
        "-",
        "largest slip of these curves for a rolling wheel; absent: 3 friction times load over the initial slope, at most "
        "0.5",
        least=1e-6,
        most=0.5,
    )


def deflections(table: StiffnessTable, own: float | None) -> list[float]:
    """The deflections (m) to compute; `own` is that of the scene's static state."""
    if table.deflections:
        return list(table.deflections)
    last = table.up_to or _BEYOND * own
    return (last * np.arange(1, table.steps + 1) / table.steps).tolist()


def check_stiffness(stiffness: StiffnessTable, scene: Scene, raw: Raw, error: Where) -> None:
    """Raise an error if there is nothing to derive the deflections from."""
    if not (stiffness.deflections or stiffness.up_to or scene.static.on_road):
        raise error(
            ("stiffness", "up_to"),
            "is needed where the scene has no road: give it (m), or load (N) in [static]",
        )


@dataclass(frozen=True)
class DampingTable:
    mass: float = number(
        500.0,
        "1/s",
        "Rayleigh damping γ1, times the mass: a damping ratio of γ1/(2ω). The default is that of the thesis and gives "
        "0.5 to 0.8 in the lowest modes, where a tire has about 0.05 (loss_factor = 0.1)",
        least=0,
        most=1e7,
    )
    stiffness: float = number(
        0.0, "s", "Rayleigh damping γ2, times the stiffness", least=0, most=1.0
    )


@dataclass(frozen=True)
class CampbellTable:
    to: float = number(200.0, "rad/s", "highest speed", least=1e-3, most=2000)
    step: float = number(10.0, "rad/s", "step between two speeds", least=1e-3, most=2000)
    branches: int = integer(20, "number of branches followed, from the lowest", least=1, most=1000)


@dataclass(frozen=True)
class RotationTable:
    speed: float = number(
        100.0, "rad/s", "speed of rotation of the wheel; 0: standing", least=0, most=2000
    )
    travel_speed: float | None = number(
        None,
        "m/s",
        "speed over the road, instead of speed: the wheel turns at the rate of free rolling; 25 m/s are 90 km/h",
        least=1e-6,
        most=500,
    )
    free_rolling: bool | None = flag(
        None,
        "nothing drives the wheel: it turns at the rate at which a smooth road has no moment about the axle, to which "
        "contact.slip adds, and is dragged by its rolling resistance; bristles then feel "
        "the local speeds of the static shape; absent: true with friction",
    )
    wheel: str = choice(
        "held",
        ("held", "free"),
        "rate of rotation in the time loop, with friction: held, or free: the wheel's inertia (axle.wheel_inertia, about y) follows the "
        "moment about the axle beyond that in which the loop begins",
    )
    slip_angle: float = number(
        0.0,
        "deg",
        "angle from the wheel's plane to its direction of travel, > 0 towards +y; its tangent is added to the lateral "
        "contact.slip",
        least=-30,
        most=30,
    )
    inertia: str = choice(
        "full",
        ("full", "doppler"),
        "inertia forces of rotation: all, or without Coriolis and centrifugal forces",
    )
    method: str = choice(
        "projected",
        ("projected", "full"),
        "eigenproblem of the rotating tire: on the modes, or on the finite elements",
    )
    shapes: bool = flag(
        True,
        "rotation shapes: static responses to the Coriolis and convective forces of the modes join these, as many as "
        "matter; for method projected, with a fixed rim",
    )
    shape_tolerance: float = number(
        SHAPE_TOLERANCE,
        "-",
        "relative shift of squared frequencies in the middle of the modes' band, at the speed rounded up to a power of "
        "two, from which on a rotation shape matters",
        least=1e-6,
        most=1,
    )
    count: int = integer(40, "number of pairs of method full", least=1, most=10000)
    window: tuple[float, float] = vector(
        (0.0, 0.0),
        "Hz",
        "from, to: all states of method full in this band, instead of count; 0, 0: count",
        least=0,
        most=1e6,
    )
    rolling_radius: float | None = number(
        None,
        "m",
        "effective rolling radius: road speed over speed of rotation; absent: from the static state",
        least=1e-3,
        most=10,
    )
    campbell: CampbellTable | None = table(
        CampbellTable,
        "eigenvalues over speed, on the modes of this one static state",
        optional=True,
    )


@dataclass(frozen=True)
class GreensTable:
    residual: str = choice(
        "static",
        tuple(RESIDUALS),
        "residual flexibility, which represents the truncated modes",
        dropped={
            "second-order": f"take {names(joins=True)}, as accurate standing and more so rolling"
        },
    )
    dynamic: int | None = integer(
        None,
        "number of states that stay dynamic, those that participate most in the band; the others respond statically; "
        "absent: all",
        least=1,
        most=200000,
    )
    band: float | None = number(
        None,
        "Hz",
        "highest frequency of interest; absent: half the highest mode",
        least=1e-3,
        most=1e6,
    )


@dataclass(frozen=True)
class MotionTable:
    kind: str = choice(
        "linear",
        ("linear", "large", "auto"),
        "motion of the tire in the time loop: small about its static state; with the nonlinear force of its elements, reduced "
        "by a training on the road of the run; auto: large where the road makes the forces of a linear tire more than 3 % wrong",
    )


@dataclass(frozen=True)
class PointForceTable:
    angle: float = number(
        0.0,
        "deg",
        "angle around the axle from the lowest point, positive towards +x",
        least=-360,
        most=360,
    )
    arc: float = number(
        0.0,
        "deg",
        "angle along the section from the crown, positive towards +y",
        least=-175,
        most=175,
    )
    spread: tuple[float, float] = vector(
        (0.0, 0.0),
        "deg",
        "half widths (angle, arc) of a uniform traction; 0, 0: one point, whose own receptance holds a dent that depends on the elements",
        least=0,
        most=180,
    )
    direction: tuple[float, float, float] = vector(
        (0.0, 0.0, 1.0), "-", "direction of the force, of any length"
    )
    amplitude: float = number(1.0, "N", "amplitude of the force", least=-1e8, most=1e8)
    frequency: float = number(
        5.0, "Hz", "frequency of the sine; 0: a constant switched on at t = 0", least=0, most=1e6
    )


@dataclass(frozen=True)
class OutputTable(Collects):
    spectra: bool = flag(True, "spectra of the contact force and the axle force")
    axle_force: bool = flag(True, "axle force, from the momentum of the tire")
    vibration: bool = flag(
        False, "vibration of the outer face in frequency, and its equivalent radiated power"
    )
    fields: bool = flag(
        False, "motion of the outer face at the end of the run, also as XDMF for ParaView"
    )
    kinds: tuple[tuple[str, Output], ...] = collection(OUTPUTS)


@dataclass(frozen=True)
class Scene:
    name: str = text("scene", "name of the scene and its result folder")
    temperature: float = number(
        REFERENCE,
        "°C",
        f"temperature of the tire: compounds are given at {REFERENCE:g} °C, and so is static.inflation",
        least=COLDEST,
        most=150,
    )
    tire: TireTable = table(TireTable, "geometry, mesh and materials of the tire")
    static: StaticTable = table(StaticTable, "inflation and load of the static state")
    stiffness: StiffnessTable | None = table(
        StiffnessTable,
        "load over deflection, and the stiffness of the standing tire",
        optional=True,
    )
    modal: ModalTable | None = table(
        ModalTable,
        "modes at the static state; absent: with its defaults where anything needs modes",
        optional=True,
    )
    damping: DampingTable | None = table(
        DampingTable,
        "Rayleigh damping of the material; absent: by the loss factors of the compounds, where "
        "there are any, else with its defaults",
        optional=True,
    )
    rotation: RotationTable | None = table(RotationTable, "rotation of the wheel", optional=True)
    axle: AxleTable = table(AxleTable, "support of the wheel")
    greens: GreensTable = table(GreensTable, "Green's functions")
    motion: MotionTable = table(MotionTable, "small or large motions of the tire in the time loop")
    force: tuple[PointForceTable, ...] = tables(
        PointForceTable, "a prescribed force on the outer face"
    )
    contact: ContactTable | None = table(
        ContactTable, "contact with the road in time", optional=True
    )
    pattern: PatternTable | None = table(
        PatternTable,
        "grooves of the tread, which rotate with the tire; absent: a slick",
        optional=True,
    )
    road: RoadTable | None = table(RoadTable, "the road driven over", optional=True)
    time: TimeTable | None = table(TimeTable, "the run in time", optional=True)
    accuracy: AccuracyTable = table(AccuracyTable, "error bars, and the search for settings")
    sound: SoundTable | None = table(
        SoundTable,
        "sound pressure at microphones, of the tire's vibrations and of the air squeezed out of its footprint",
        optional=True,
    )
    output: OutputTable = table(OutputTable, "what is computed and kept")

    @property
    def inflation(self) -> float:
        """Pressure (Pa above the atmosphere) of the tire at its temperature: static.inflation by the gas law."""
        return warmed(self.static.inflation, REFERENCE, self.temperature)

    @property
    def modes(self) -> ModalTable:
        """The table [modal], or its defaults."""
        return self.modal or ModalTable()

    @property
    def in_contact(self) -> bool:
        """Whether the contact with the road is followed in time."""
        return self.contact is not None and self.time is not None and self.static.on_road

    @property
    def horizontal_forces(self) -> bool:
        """Whether the contact has horizontal forces: of bristles, or of a road that leans."""
        if self.contact is None or self.contact.has_friction:
            return self.contact is not None
        rotation, road = self.rotation, self.road
        rolls = rotation is not None and (rotation.travel_speed or rotation.speed) > 0
        return rolls and road is not None and road.kind != "flat"

    @property
    def heard_up_to(self) -> float:
        """Highest frequency (Hz) of the sound: sound.up_to, or where the modes end, at most `HEARD`."""
        assert self.sound is not None, "of scenes with [sound] only"
        if self.sound.up_to is not None:
            return self.sound.up_to
        highest = self.modal.up_to if self.modal else None
        return min(HEARD, USABLE * highest) if highest else HEARD

    @property
    def joins_shapes(self) -> bool:
        """Whether rotation shapes join the modes of a rotating wheel (modal.rotation_shapes)."""
        rotation = self.rotation
        if rotation is None or self.modes.rim == "free":
            return False
        return rotation.shapes and rotation.method == "projected"


def confined(scene: Scene) -> Iterator[tuple[tuple[str, ...], str]]:
    """Why a scene has no large motions: (path of the key, reason with advice)."""
    rotation, time, road = scene.rotation, scene.time, scene.road
    if not scene.in_contact:
        yield (
            ("motion", "kind"),
            "is of the time loop: add [contact], [time], and load (N) to [static]",
        )
        return
    if scene.greens.residual != "static":
        yield (
            ("greens", "residual"),
            f'= "{scene.greens.residual}" leaves out how the tire gives way at once: large motions need "static"',
        )
    if scene.greens.dynamic is not None:
        yield (
            ("greens", "dynamic"),
            "chooses states by what forces of the road move: large motions need all; leave it out",
        )
    if rotation is not None and rotation.speed and rotation.method == "full":
        yield ("rotation", "method"), '= "full" has no large motions: take "projected"'
    if time is not None and keeps_history(time.scheme):
        yield ("time", "scheme"), f'= "{time.scheme}" has no large motions: take "auto"'
    if (road is not None and road.drum_radius is not None) or scene.static.camber:
        key = ("static", "camber") if scene.static.camber else ("road", "drum_radius")
        yield (
            key,
            "is not available with large motions, which are trained on a level road: leave it out",
        )
    if scene.accuracy.chance_db is not None:
        yield (
            ("accuracy", "chance_db"),
            "asks for further stretches, on which large motions are not trained: leave it out",
        )
    if scene.accuracy.searches:
        yield (
            ("accuracy", "target"),
            'and target_db search on linear tires: take accuracy.search = false, or motion.kind = "linear"',
        )
    output = scene.output
    for path, asked in (
        (("sound",), scene.sound is not None),
        (("output", "vibration"), output.vibration),
        (("output", "fields"), output.fields),
    ):
        if asked:
            yield (
                path,
                'is seen through the linear tire\'s modes alone: leave it out, or take motion.kind = "linear"',
            )


def check_motion(motion: MotionTable, scene: Scene, raw: Raw, error: Where) -> Iterator[InputError]:
    """Refuse what large motions do not have, where the scene asks for them."""
    if motion.kind != "large":
        return
    for path, reason in confined(scene):
        yield error(path, reason)


def rolls_freely(scene: Scene) -> bool:
    """Whether the rate of free rolling is sought: by default wherever bristles roll over the road."""
    rotation, contact = scene.rotation, scene.contact
    if rotation is None or contact is None or not contact.has_friction or rotation.speed == 0:
        return False
    return contact.brush == "rolling" if rotation.free_rolling is None else rotation.free_rolling


def has_air(scene: Scene) -> bool:
    """Whether the air in the tire is modelled."""
    return scene.tire.cavity is not None and scene.tire.cavity.gas != "none"
