"""The tables of a scene, key by key, with units, ranges and defaults (contract: Scene)."""

from dataclasses import dataclass

from tireroad.fem.parameters import choice, flag, integer, number, text, vector
from tireroad.runs.scene.outputs import OUTPUTS
from tireroad.runs.scene.outputs import Output as PointOutput
from tireroad.runs.scene.schema import Collects, collection, table, tables
from tireroad.runs.scene.tables.accuracy import Accuracy
from tireroad.runs.scene.tables.axle import AxleTable
from tireroad.runs.scene.tables.contact import Contact, Time
from tireroad.runs.scene.tables.modal import Modal
from tireroad.runs.scene.tables.pattern import PatternTable
from tireroad.runs.scene.tables.road import Road
from tireroad.runs.scene.tables.static import Static
from tireroad.runs.scene.tables.stiffness import Stiffness
from tireroad.runs.scene.tables.tire import Tire


@dataclass(frozen=True)
class Damping:
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
class Campbell:
    to: float = number(200.0, "rad/s", "highest speed", least=1e-3, most=2000)
    step: float = number(10.0, "rad/s", "step between two speeds", least=1e-3, most=2000)
    branches: int = integer(20, "number of branches followed, from the lowest", least=1, most=1000)


@dataclass(frozen=True)
class Rotation:
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
    free_rolling: bool = flag(
        False,
        "find the slip of the wheel at which a smooth road exerts no drag, with the time loop and its brush, which then "
        "feels the local speeds of the static shape; added to contact.slip",
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
    campbell: Campbell | None = table(
        Campbell, "eigenvalues over speed, on the modes of this one static state", optional=True
    )


@dataclass(frozen=True)
class Greens:
    residual: str = choice(
        "static",
        ("none", "dirac", "static", "second-order", "attachment"),
        "residual flexibility, which represents the truncated modes",
    )
    dynamic: int | None = integer(
        None,
        "number of states kept dynamic; the others respond statically; absent: all",
        least=1,
        most=200000,
    )
    choice: str = choice(
        "participation",
        ("participation", "frequency"),
        "selection of the dynamic states: by participation in the band, or lowest first",
    )
    band: float | None = number(
        None,
        "Hz",
        "highest frequency of interest; absent: half the highest mode",
        least=1e-3,
        most=1e6,
    )


@dataclass(frozen=True)
class PointForce:
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
        "half widths (angle, arc) of a uniform traction; 0, 0: one point",
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
class Output(Collects):
    spectra: bool = flag(True, "spectra of the contact force and the axle force")
    axle_force: bool = flag(True, "axle force, from the momentum of the tire")
    vibration: bool = flag(
        False, "vibration of the outer face in frequency, and its equivalent radiated power"
    )
    fields: bool = flag(
        False, "motion of the outer face at the end of the run, also as XDMF for ParaView"
    )
    kinds: tuple[tuple[str, PointOutput], ...] = collection(OUTPUTS)


@dataclass(frozen=True)
class Scene:
    name: str = text("scene", "name of the scene and its result folder")
    tire: Tire = table(Tire, "geometry, mesh and materials of the tire")
    static: Static = table(Static, "inflation and load of the static state")
    stiffness: Stiffness | None = table(
        Stiffness, "load over deflection, and the stiffness of the standing tire", optional=True
    )
    modal: Modal | None = table(
        Modal,
        "modes at the static state; absent: with its defaults where anything needs modes",
        optional=True,
    )
    damping: Damping | None = table(
        Damping,
        "Rayleigh damping of the material; absent: by the loss factors of the compounds, where "
        "there are any, else with its defaults",
        optional=True,
    )
    rotation: Rotation | None = table(Rotation, "rotation of the wheel", optional=True)
    axle: AxleTable = table(AxleTable, "support of the wheel")
    greens: Greens = table(Greens, "Green's functions")
    force: tuple[PointForce, ...] = tables(PointForce, "a prescribed force on the outer face")
    contact: Contact | None = table(Contact, "contact with the road in time", optional=True)
    pattern: PatternTable | None = table(
        PatternTable,
        "grooves of the tread, which rotate with the tire; absent: a slick",
        optional=True,
    )
    road: Road | None = table(Road, "the road driven over", optional=True)
    time: Time | None = table(Time, "the run in time", optional=True)
    accuracy: Accuracy = table(Accuracy, "error bars, and the search for settings")
    output: Output = table(Output, "what is computed and kept")

    @property
    def modes(self) -> Modal:
        """The table [modal], or its defaults."""
        return self.modal or Modal()

    @property
    def in_contact(self) -> bool:
        """Whether the contact with the road is followed in time."""
        return self.contact is not None and self.time is not None and self.static.on_road

    @property
    def joins_shapes(self) -> bool:
        """Whether rotation shapes join the modes of a rotating wheel (modal.rotation_shapes)."""
        rotation = self.rotation
        if rotation is None or self.modes.rim == "free":
            return False
        return rotation.shapes and rotation.method == "projected"
