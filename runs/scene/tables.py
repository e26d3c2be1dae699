"""The tables of a scene, key by key, with units, ranges and defaults (contract: Scene)."""

from dataclasses import dataclass

from tireroad.runs.scene.road_tables import Road
from tireroad.runs.scene.schema import (
    Pitch,
    choice,
    flag,
    integer,
    number,
    points,
    table,
    tables,
    text,
    vector,
)
from tireroad.runs.scene.tire_tables import Tire


@dataclass(frozen=True)
class Static:
    inflation: float = number(2.0e5, "Pa", "pressure on the inner face", least=0, most=1e8)
    load: float | None = number(None, "N", "vertical load on the road", above=0, most=1e8)
    deflection: float | None = number(
        None, "m", "road raised from first touch of the inflated tire", above=0, most=10
    )
    road_height: float | None = number(None, "m", "z of the road plane", least=-10, below=0)
    steady_rolling: bool = flag(
        True, "inertia and damping of the rolling shape; false: the state at rest"
    )
    error_estimate: bool = flag(
        True, "how far the load is from that of finer elements, by a run on coarser ones"
    )


@dataclass(frozen=True)
class Modal:
    count: int = integer(500, "lowest modes wanted", least=1, most=100000)
    up_to: float | None = number(
        None, "Hz", "all modes below it are wanted, instead of count", above=0, most=1e6
    )
    rim: str = choice(
        "fixed", ("fixed", "free"), "the bead faces: clamped, or one rigid body that nothing holds"
    )
    road: str = choice(
        "forces",
        ("forces", "held"),
        "after the static state: its forces, or its nodes' height held",
    )


@dataclass(frozen=True)
class Damping:
    mass: float = number(500.0, "1/s", "γ1, times the mass", least=0, most=1e7)
    stiffness: float = number(0.0, "s", "γ2, times the stiffness", least=0, most=1.0)


@dataclass(frozen=True)
class Campbell:
    to: float = number(200.0, "rad/s", "highest speed", above=0, most=2000)
    step: float = number(10.0, "rad/s", "between two speeds", above=0, most=2000)
    branches: int = integer(20, "followed, from the lowest", least=1, most=1000)


@dataclass(frozen=True)
class Rotation:
    speed: float = number(100.0, "rad/s", "of the wheel; 0: standing", least=0, most=2000)
    inertia: str = choice("full", ("full", "doppler"), "doppler: without Coriolis, centrifugal")
    method: str = choice("projected", ("projected", "full"), "second eigenproblem")
    count: int = integer(40, "pairs wanted of method full", least=1, most=10000)
    window: tuple[float, float] = vector(
        (0.0, 0.0),
        "Hz",
        "from, to: all states of method full in it; 0, 0: count",
        least=0,
        most=1e6,
    )
    rolling_radius: float | None = number(
        None, "m", "effective; absent: from the static state", above=0, most=10
    )
    campbell: Campbell | None = table(
        Campbell, "eigenvalues over speed, on the modes of this one static state", optional=True
    )


@dataclass(frozen=True)
class Greens:
    residual: str = choice(
        "static",
        ("none", "dirac", "static", "second-order", "attachment"),
        "flexibility of the modes left out",
    )
    dynamic: int | None = integer(
        None, "states kept dynamic, the others follow statically; absent: all", least=1, most=200000
    )
    choice: str = choice(
        "participation",
        ("participation", "frequency"),
        "of the dynamic states: in the band, or the slowest",
    )
    band: float | None = number(
        None, "Hz", "that matters; absent: up to half the highest mode", above=0, most=1e6
    )


@dataclass(frozen=True)
class PointForce:
    angle: float = number(
        0.0, "deg", "around the axle from the lowest point, towards +x", least=-360, most=360
    )
    arc: float = number(
        0.0, "deg", "along the section from the crown, towards +y", least=-175, most=175
    )
    spread: tuple[float, float] = vector(
        (0.0, 0.0), "deg", "half widths (angle, arc); 0: one point", least=0, most=180
    )
    direction: tuple[float, float, float] = vector((0.0, 0.0, 1.0), "-", "of the force")
    amplitude: float = number(1.0, "N", "of the force", least=-1e8, most=1e8)
    frequency: float = number(5.0, "Hz", "0: a constant switched on at t = 0", least=0, most=1e6)


@dataclass(frozen=True)
class Contact:
    tread: str = choice(
        "half-space", ("half-space", "layer", "winkler", "none"), "local compliance"
    )
    youngs_modulus: float = number(3.4e8, "Pa", "of the half-space or layer", above=0, most=1e13)
    poisson_ratio: float = number(0.49, "-", "of the half-space or layer", above=-1, most=0.5)
    thickness: float = number(
        0.010,
        "m",
        "of the layer on its stiff base",
        above=0,
        most=1,
        only_for=("tread", ("layer",)),
    )
    winkler_stiffness: float = number(2.0e8, "N/m³", "of the winkler tread", above=0, most=1e15)
    points: str | Pitch = points("contact points: the nodes, or a grid of pitch", above=0, most=1)
    brush_stiffness: float | None = number(
        None, "N/m", "per point; absent: no horizontal forces", above=0, most=1e12
    )
    brush: str = choice(
        "rolling", ("rolling", "spring"), "transported through the patch, or the thesis's spring"
    )
    friction: float | None = number(None, "-", "absent: never slips", least=0, most=10)
    slip: tuple[float, float] = vector(
        (0.0, 0.0), "-", "of the rolling tire: longitudinal (> 0 drives), lateral", least=-1, most=1
    )
    solver: str = choice(
        "auto",
        ("auto", "active-set", "projected-cg", "snes-vi"),
        "of the complementarity problem",
    )
    reach: float | None = number(
        None, "m", "gap up to which points take part; absent: from the road", above=0, most=1
    )


@dataclass(frozen=True)
class Time:
    duration: float = number(0.1, "s", "of the run", above=0, most=1e5)
    step: float | str = number(
        "auto", "s", "of the time integration", above=0, most=1e3, word="auto"
    )
    scheme: str = choice("auto", ("auto", "linear", "constant", "convolution"), "force over a step")
    checkpoint: float = number(60.0, "s", "wall-clock time between checkpoints", above=0, most=1e6)


@dataclass(frozen=True)
class Receptance:
    to: float = number(500.0, "Hz", "highest frequency", above=0, most=1e6)
    step: float = number(2.0, "Hz", "between two frequencies", above=0, most=1e6)
    direct: int = integer(
        0, "frequencies also solved on the full matrices, as a check", least=0, most=1000
    )


@dataclass(frozen=True)
class Output:
    spectra: bool = flag(True, "of contact and axle force")
    axle_force: bool = flag(True, "from momentum")
    impulse: bool = flag(False, "Green's functions between the driven points, over [time]")
    velocity: bool = flag(False, "of the driven points")
    acceleration: bool = flag(False, "of the driven points")
    vibration: bool = flag(False, "u(ω) on the whole tire")
    fields: bool = flag(False, "XDMF of every kept step")
    receptance: Receptance | None = table(Receptance, "of the driven points", optional=True)


@dataclass(frozen=True)
class Scene:
    name: str = text("scene", "of the result folder")
    tire: Tire = table(Tire, "geometry and mesh")
    static: Static = table(Static, "inflation and road of the static state")
    modal: Modal = table(Modal, "modes at the static state")
    damping: Damping | None = table(
        Damping,
        "in proportion to mass and stiffness; absent: by the loss factors of the compounds, where "
        "there are any, else with its defaults",
        optional=True,
    )
    rotation: Rotation | None = table(Rotation, "of the wheel", optional=True)
    greens: Greens = table(Greens, "Green's functions")
    force: tuple[PointForce, ...] = tables(PointForce, "prescribed point forces")
    contact: Contact | None = table(Contact, "with the road, in time", optional=True)
    road: Road | None = table(Road, "the road driven over", optional=True)
    time: Time | None = table(Time, "of the run", optional=True)
    output: Output = table(Output, "what is kept")
