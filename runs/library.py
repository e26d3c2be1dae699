"""The computation as functions of typed inputs, without scenes or files, for scripts and notebooks.

  tire = torus(youngs_modulus=48e6, segments=24, elements_arc=10)
  turning = Turning(speed=50.0, damping=(500.0, 0.0))
  static = press(tire, inflation=2e5, load=500.0, turning=turning)
  standing = modes(tire, static, count=60)
  rolling = roll(standing, turning)
  run = drive(rolling, make_road(kind="sine", amplitude=1e-3), duration=0.1)

SI units, angles in radians. Every function is collective: all processes of the tire's communicator
call it with the same arguments and get the same arrays.
"""

from __future__ import annotations

import inspect
import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, cached_property, wraps
from typing import Any, ParamSpec, TypeVar, get_args, get_type_hints

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from scipy import sparse

from tireroad.contact.choices import LEAST_STEPS, TURN
from tireroad.contact.loop import Block, Steps, check_times, equal_steps
from tireroad.contact.model import ContactSpec, TreadContact
from tireroad.contact.patch import Patch
from tireroad.contact.results.chatter import choose, oscillation
from tireroad.contact.results.spectra import Limit, amplitudes, limits, lowest, pitch, third_octaves
from tireroad.contact.roads.under_tire import RoadUnderTire
from tireroad.contact.rolling import bristles, make_loop, rolling_steadily
from tireroad.contact.setup import ContactSetup, Rolled, contact_setup, freely_rolling
from tireroad.contact.tread.law import TREADS, TreadLaw
from tireroad.contact.tread.laws.elastic import FREQUENCY
from tireroad.fem.errors import ConvergenceError, InputError
from tireroad.fem.matrices import probe
from tireroad.fem.model import SmallMotions, TireModel
from tireroad.fem.parallel import on_root
from tireroad.fem.parameters import plain
from tireroad.fem.sections.mesh2d import crown_layer
from tireroad.fem.sections.torus import Torus
from tireroad.fem.static.footprint import Footprint
from tireroad.fem.static.press import press as press_tire
from tireroad.fem.static.state import StaticState
from tireroad.fem.static.virtual_work import AT_REST
from tireroad.fem.tire.body import Body
from tireroad.fem.tire.material import CONSTANT, REFERENCE, Material, compound, wlf
from tireroad.fem.wheel import StrainEnergy, Turning
from tireroad.greens.coupling import Wheel, wheel_of
from tireroad.greens.outputs import by_momentum
from tireroad.greens.recursion import Recursion
from tireroad.greens.response import Response
from tireroad.greens.responses import make_response
from tireroad.modal.basis import ModalBasis, same_fields
from tireroad.modal.campbell import Campbell, sweep
from tireroad.modal.corner import HUB_MOMENTS, READINGS, widened
from tireroad.modal.damping import ratios
from tireroad.modal.rolling import RollingModes, named_states, rolling_modes
from tireroad.modal.standing import named, standing_modes
from tireroad.modal.states import StateModes
from tireroad.modal.waves import FaceWaves, ModeNames
from tireroad.runs.scene.parts import scaled
from tireroad.runs.scene.physics import make_tire, rolling_shape, run_in_time
from tireroad.runs.scene.rules import barred_from_contact
from tireroad.runs.scene.sections.radial import RadialSection
from tireroad.runs.scene.sections.torus import TorusSection
from tireroad.runs.scene.tables.contact import DRY_ASPHALT, TREAD_RUBBER
from tireroad.runs.scene.tables.tire import NEAR_ROAD, TireTable

# Arguments that are one number.
_NUMBERS = {"inflation", "load", "deflection", "road_height", "count", "up_to", "duration", "step"}

P = ParamSpec("P")
T = TypeVar("T")

# What makes each kind of argument, by the name of its class.
_MADE_BY = {
    "TireModel": "tireroad.torus(…) or tireroad.radial(…)",
    "StaticState": "tireroad.press(…)",
    "Standing": "tireroad.modes(…)",
    "RollingTire": "tireroad.roll(…)",
    "RoadUnderTire": 'tireroad.make_road(kind="sine", …)',
    "Turning": "tireroad.Turning(speed=…, damping=(…, …))",
}


# Arguments of the library by the keys of a scene that errors name.
_ARGUMENTS = {
    "contact.points = { dx, dy }": "spacing = (dx, dy)",
    "contact.points": "spacing",
    "contact.tread": "tread",
    "[time] step": "step",
    "time.step": "step",
    "time.duration": "duration",
    "greens.residual": "residual",
    "static.steady_rolling = false": "no turning",
    **{f"static.{name}": name for name in ("inflation", "load", "deflection", "road_height")},
    "rotation.speed": "turning.speed",
    **{f"modal.{name}": name for name in ("count", "up_to")},
    **{
        f"tire.{name}": name
        for name in ("size", "grooves", "rim_width", "scale", "segments", "elements_arc")
    },
    **{f"tire.{name}": name for name in ("footprint_size", "order")},
}
_KEYS = re.compile("|".join(rf"(?<![\w.]){re.escape(key)}(?!\w)" for key in _ARGUMENTS))
Array = NDArray[np.float64]
_OF_ONE_TIRE = 1e-5  # relative difference of a mode's mass and stiffness from 1 kg and omega^2


def in_arguments(text: str) -> str:
    """The text of an error with arguments of the library in place of a scene's keys."""
    return _KEYS.sub(lambda key: _ARGUMENTS[key[0]], text)


def typed(function: Callable[P, T]) -> Callable[P, T]:
    """The function with errors that name its arguments, also those of the wrong class; scalars of numpy are numbers.

    InputError for an argument that is not of the class it is annotated with, if functions of the library
    make that class, and for several numbers where one is meant.
    """
    signature = inspect.signature(function)

    @cache  # when first called: then all classes of the module are defined
    def kinds() -> dict[str, Any]:
        hints = get_type_hints(function)
        return {name: hint for name, hint in hints.items() if name != "return" and _maker(hint)}

    @wraps(function)
    def checked(*args: P.args, **keys: P.kwargs) -> T:
        bound = signature.bind(*args, **keys)
        arguments = bound.arguments
        for name, value in arguments.items():
            arguments[name] = plain(value)
            if isinstance(arguments[name], np.ndarray) and name in _NUMBERS:
                raise InputError(
                    f"{function.__name__}: {name} is an array of shape {value.shape}: it must be one number"
                )
        for name, kind in kinds().items():
            if name in arguments and not isinstance(arguments[name], kind):
                name_of = type(arguments[name]).__name__
                raise InputError(
                    f"{function.__name__}: {name} is of the type {name_of}: take what {_maker(kind)} returns"
                )
        try:
            return function(*bound.args, **bound.kwargs)
        except (InputError, ConvergenceError) as error:
            error.args = (in_arguments(str(error)),)
            raise

    return checked


def _maker(hint: Any) -> str | None:
    """The function that makes the class of an annotation, which may also allow None."""
    names = [getattr(kind, "__name__", "") for kind in (hint, *get_args(hint))]
    return next((_MADE_BY[name] for name in names if name in _MADE_BY), None)


@typed
def torus(
    *,
    outer_radius: float = 0.32,
    minor_radius: float = 0.10,
    thickness: float = 0.012,
    half_angle: float = 2 * math.pi / 3,
    segments: int = 30,
    elements_arc: int = 14,
    elements_thickness: int = 1,
    order: int = 3,
    footprint_size: float = 0.2,
    material: Material | None = None,
    youngs_modulus: float = 4.8e8,
    poisson_ratio: float = 0.45,
    density: float = 1200.0,
    comm: MPI.Comm = MPI.COMM_WORLD,
) -> TireModel:
    """A toroidal tire without loads. Lengths in m; `half_angle` in rad from the crown to each bead.

    `material`, or else a neo-Hookean rubber of `youngs_modulus` Pa, `poisson_ratio` and `density`
    kg/m3. Raises InputError for a value of wrong kind, or out of the range that it has in a scene.
    """
    shape = Torus(
        outer_radius=outer_radius,
        minor_radius=minor_radius,
        thickness=thickness,
        half_angle=half_angle,
        segments=segments,
        elements_arc=elements_arc,
        elements_thickness=elements_thickness,
        order=order,
        footprint_size=footprint_size,
    )
    _check_ranges(shape)
    if material is not None and not isinstance(material, Material):
        raise InputError(
            f"torus: material = {material!r} is not a material: take tireroad.compound(…), or "
            "youngs_modulus, poisson_ratio and density"
        )
    section = shape.ring()
    rubber = material or compound(
        "neo-hookean", density, youngs_modulus=youngs_modulus, poisson_ratio=poisson_ratio
    )
    return TireModel(section, lambda: Body(comm, section, {"wall": rubber}))


@typed
def radial(
    size: str = "205/60 R15",
    *,
    grooves: int = 4,
    rim_width: float | None = None,
    scale: dict[str, float] | None = None,
    segments: int = 40,
    elements_arc: int = 26,
    footprint_size: float = NEAR_ROAD,
    temperature: float = REFERENCE,
    comm: MPI.Comm = MPI.COMM_WORLD,
) -> TireModel:
    """The built-in radial passenger tire of a size, without loads (docs/radial-tire.md).

    `segments` elements around and `elements_arc` from bead to bead, quadratic; those near the road
    are `footprint_size` of the others; `grooves` around its tread; `rim_width` m, of the size's measuring rim if
    None; `scale`: factors on its compounds and cords, as [tire.scale] of a scene: {"tread": 1.1, "belt angle": 0.9};
    `temperature` of its rubber in degrees C, which sets its moduli (fem.tire.material).
    Its rubbers have loss factors: with damping = tireroad.StrainEnergy() the rotating tire loses by them. Raises
    InputError for a size that is none, or a value out of the range that it has in a scene.
    """
    shape = RadialSection(
        size=size,
        grooves=grooves,
        rim_width=rim_width,
        scale=scale,
        elements_arc=elements_arc,
    )
    tire = TireTable(
        section="radial", shape=shape, segments=segments, order=2, footprint_size=footprint_size
    )
    try:
        scaled_tire = scaled(tire, shape.scale or {})
    except InputError as problem:
        raise InputError(in_arguments(f"radial: {problem}")) from None
    wlf(temperature)
    return make_tire(comm, scaled_tire, temperature)


def _check_ranges(torus: Torus) -> None:
    """ParameterError for a value out of the range of the scene's key."""
    same = "outer_radius", "minor_radius", "thickness", "elements_arc", "elements_thickness"
    shape = TorusSection(
        half_angle=math.degrees(torus.half_angle), **{name: getattr(torus, name) for name in same}
    )
    TireTable(
        shape=shape,
        segments=torus.segments,
        order=torus.order,
        footprint_size=torus.footprint_size,
    )


@typed
def press(
    tire: TireModel,
    *,
    inflation: float,
    load: float | None = None,
    deflection: float | None = None,
    road_height: float | None = None,
    turning: Turning | None = None,
) -> StaticState:
    """Inflate the tire (Pa) and press it on a flat road; returns the static state.

    Give one of: the load (N), the deflection (m) from first contact, or the road height
    (m, negative); without any of them there is no road. `turning` adds the inertia and damping
    forces of steady rolling. Raises InputError for arguments of the wrong kind, ConvergenceError if
    no equilibrium is found.
    """
    return press_tire(
        tire,
        inflation=inflation,
        load=load,
        deflection=deflection,
        road_height=road_height,
        rolling=AT_REST if turning is None else rolling_shape(turning),
    )


@dataclass(frozen=True, kw_only=True)
class Standing:
    """Modes of the non-rotating tire: `basis`, and the `motions` (matrices) that they solve."""

    motions: SmallMotions
    basis: ModalBasis

    @property
    def frequency(self) -> Array:
        """Natural frequencies (m,), Hz."""
        return self.basis.frequency

    def check(self) -> None:
        """InputError if the modes are not of these motions, in whose mass and stiffness they are normal. Collective."""
        modes, operators = self.basis.modes, self.motions.operators
        if modes is None:
            return
        comm = self.motions.body.comm
        rows = operators.stiffness.getLocalSize()[0]
        same = comm.allreduce(rows == len(modes.vectors), op=MPI.LAND)
        if same and len(modes.squares) > modes.rigid:
            last = modes.vectors[:, -1]
            shape = operators.stiffness.createVecRight()
            shape.setArray(last)
            stiff = shape.dot(operators.stiffness * shape)
            shape.destroy()
            same = abs(comm.allreduce(float(last @ (operators.mass * last))) - 1) < _OF_ONE_TIRE
            if all(kind.spectrum == CONSTANT for kind, _ in self.motions.body.wall.kinds()):
                same = same and abs(stiff / modes.squares[-1] - 1) < _OF_ONE_TIRE
        if not same:
            raise InputError(
                "roll: standing has the modes of another tire or static state: take what tireroad.modes(tire, static) returns"
            )

    @cached_property
    def names(self) -> ModeNames:
        """Names, motions and wave numbers of the modes (modal.waves)."""
        names = named(self.basis, self.motions.lattice).names
        assert names is not None
        return names

    @property
    def name(self) -> NDArray[np.object_]:
        """Names of the modes (m,), texts such as "R2", as testers write them (modal.waves)."""
        return self.names.name

    @property
    def wave_number(self) -> NDArray[np.int64]:
        """Number of waves around the tire (m,) that holds most of each mode."""
        return self.names.wave

    @property
    def damping(self) -> Array:
        """Damping ratios (m,) by the losses of the compounds; NaN where none has any, and of rigid modes."""
        projection = self.basis.projection
        if projection.loss_factor is None:
            return np.full(len(self.frequency), np.nan)
        return ratios(StrainEnergy(), projection)

    @property
    def effective_mass(self) -> Array:
        """Effective mass at the hub (m, 6): x, y, z in kg, then about x, y, z in kg m2."""
        return self.basis.projection.effective_mass.T


@typed
def modes(
    tire: TireModel,
    static: StaticState,
    *,
    count: int | None = None,
    up_to: float | None = None,
    rim: str = "fixed",
    road: str = "forces",
    turning: Turning | None = None,
) -> Standing:
    """The `count` lowest undamped modes about a static state, or all below `up_to` Hz, none missed.

    `rim` "fixed" or "free". `road` "forces": the road is replaced by its contact forces; "held":
    the touching nodes are held in height. `turning`: how the wheel will rotate; the shapes that
    belts couple to then join the modes (modal.rotation_shapes), as in a run. Raises InputError for
    arguments of the wrong kind, a static state of another tire, and unless one of `count` and `up_to` is given, within its range.
    """
    _check_state(tire, static)
    motions = SmallMotions(tire, static, rim=rim, road=road)
    basis = standing_modes(motions, count=count, up_to=up_to, turning=turning)
    return Standing(motions=motions, basis=basis)


def _check_state(tire: TireModel, static: StaticState) -> None:
    """Raise InputError if a static state is not that of the tire. Collective."""
    lattice, nodes = tire.lattice, len(static.displacement)
    why = ""
    if nodes != lattice.size:
        why = f"it has {nodes} nodes, and the tire {lattice.size}"
    elif not np.allclose(static.points, lattice.points(lattice.face), rtol=0, atol=1e-9):
        why = "its nodes lie elsewhere"
    elif static.materials and static.materials != tire.body.materials:
        why = "its tire is of other materials"
    elif static.ring and static.ring != tire.section.fingerprint:
        why = "its mesh is another within, such as a wall of another thickness"
    elif static.ring and static.plies != tuple(tire.body.plies.cords):
        why = "its tire has other cords"
    if why:
        raise InputError(
            f"modes: static is the state of another tire ({why}): call tireroad.press(tire, …) for this one"
        )


@dataclass(frozen=True, kw_only=True)
class RollingTire:
    """A rotating tire: the modes at rest (`standing`) and the states of the wheel (`states`)."""

    standing: Standing
    states: RollingModes

    def __post_init__(self) -> None:
        """InputError if the states are not of these modes."""
        if not self.states.full and not same_fields(
            self.states.basis.shape, self.standing.basis.shape
        ):
            raise InputError(
                "RollingTire: states and standing are of two tires, or of two solutions: take what tireroad.roll(standing, "
                "turning) returns"
            )

    @property
    def eigenvalue(self) -> NDArray[np.complex128]:
        """Eigenvalues s (q,) 1/s with Im s >= 0: frequency Im s / 2 pi, decay rate -Re s."""
        return self.states.states.eigenvalue

    @property
    def frequency(self) -> Array:
        """Frequencies Im s / 2 pi (q,), Hz, in the frame that does not turn."""
        return self.eigenvalue.imag / (2 * np.pi)

    @property
    def damping(self) -> Array:
        """Damping ratios -Re s / |s| (q,)."""
        return self.states.states.damping

    @cached_property
    def names(self) -> ModeNames:
        """Names, motions, wave numbers and directions of travel of the states (modal.waves)."""
        basis, waves = self.states.basis, FaceWaves(self.standing.motions.lattice)
        return named_states(self.states.states, basis.shape, basis.projection, waves)

    @property
    def name(self) -> NDArray[np.object_]:
        """Names of the states (q,): "R2+" travels with the rotation, "R2-" against it (modal.waves)."""
        return self.names.name

    @property
    def wave_number(self) -> NDArray[np.int64]:
        """Number of waves around the tire (q,) that holds most of each state."""
        return self.names.wave

    @cached_property
    def wheel(self) -> Wheel:
        """The full matrices of the rotating wheel."""
        projection = self.standing.basis.projection
        return wheel_of(self.standing.motions, self.states.turning, projection=projection)

    def respond(self, outputs, loads, residual: str = "static") -> Response:
        """Green's functions between probes (r, 3 s) and loads (k, 3 s) on the outer face.

        `residual`: kind of residual flexibility that replaces the truncated modes
        (greens.responses); InputError for an unknown one.
        """
        basis = self.standing.basis
        return make_response(
            lambda: self.wheel, self.states, outputs, loads, residual, lambda: basis
        ).response

    def at(self, spots: list[tuple[float, float]], residual: str = "static") -> Response:
        """The response between points of the outer face (angle around, angle along section; rad).

        In all three directions: probes x, y, z of the first point, then of the second, and so on.
        InputError for a point beyond a bead, and without any point.
        """
        probes = self._probes("at", spots)
        return self.respond(probes, probes, residual)

    def hub(
        self, spots: list[tuple[float, float]], frequency: Array, residual: str = "static"
    ) -> NDArray[np.complex128]:
        """Force, N/N, and moment about the axle's centre, N m/N, on the held hub per force at the spots.

        (f, 6, 3 k) complex at `frequency` (f,) Hz above 0: Fx, Fy, Fz, Mx, My, Mz for the forces x, y, z at each
        of the k spots, which are those of `at`. The force is the load less the rate of the tire's momentum
        (greens.outputs.by_momentum); the moment as in modal.corner.Corner.moments. InputError for frequencies that
        are not above 0, and for modes with a free rim or a held road.
        """
        probes, projection = self._probes("hub", spots), self.standing.basis.projection
        at = np.atleast_1d(np.asarray(frequency, float))
        if at.ndim != 1 or not (np.isfinite(at) & (at > 0)).all():
            raise InputError("hub: frequency must be frequencies in Hz above 0")
        if projection.corner is None:
            raise InputError(
                'hub: these modes have a free rim or a held road, and no force on a held hub: take rim = "fixed", '
                'road = "forces"'
            )
        count = probes.shape[0]
        loads = sparse.hstack([probes, sparse.csr_matrix((count, READINGS))], format="csr")
        response = self.respond(widened(probes, HUB_MOMENTS), loads, residual)
        force = by_momentum(response, np.tile(np.eye(3), len(spots)), at)
        moment = response.between(slice(count, None), slice(None)).receptance(at)
        return np.concatenate([force, moment], axis=1)

    def _probes(self, what: str, spots: list[tuple[float, float]]) -> sparse.csr_matrix:
        """Probes x, y, z (3 k, 3 s) of k points of the outer face. InputError without any point."""
        if not len(spots):
            raise InputError(
                f"{what}: no point given: take (angle around, angle along section) in rad"
            )
        lattice = self.standing.motions.lattice
        rows = [
            probe.directed(probe.spot(lattice, *spot), axis) for spot in spots for axis in np.eye(3)
        ]
        return sparse.csr_matrix(np.stack(rows))


@typed
def roll(standing: Standing, turning: Turning) -> RollingTire:
    """The states of the rotating tire in the non-rotating frame; at speed 0, those of the modes.

    InputError for arguments of the wrong kind.
    """
    standing.check()
    comm = standing.motions.body.comm
    return RollingTire(standing=standing, states=rolling_modes(standing.basis, turning, comm))


@typed
def campbell(
    standing: Standing,
    turning: Turning,
    *,
    speeds: Sequence[float] | None = None,
    branches: int = 12,
) -> Campbell:
    """The Campbell diagram: the `branches` lowest states followed from standstill to higher speeds.

    At `speeds` (v,) rad/s, ascending from 0 or more; by default 21 from 0 to the speed of `turning`, whose
    damping and inertia hold at each. One static state and one set of modes serve all speeds. The branches of
    the result have names, frequencies and damping ratios (modal.campbell). InputError for arguments of the
    wrong kind or out of range. Collective.
    """
    if speeds is None:
        given = np.linspace(0.0, turning.speed, 21 if turning.speed else 1)
    else:
        given = np.asarray(speeds, float)
    steps = np.diff(given) > 0 if given.ndim == 1 and len(given) else np.zeros(1, bool)
    if not (np.isfinite(given).all() and steps.all() and given[0] >= 0):
        raise InputError("campbell: speeds must ascend from 0 rad/s or more, each given once")
    if isinstance(branches, bool) or branches != int(branches) or branches < 1:
        raise InputError(f"campbell: branches = {branches!r} must be a whole number, 1 or more")
    basis, comm = standing.basis, standing.motions.body.comm
    waves = FaceWaves(standing.motions.lattice)

    def names(states: StateModes) -> ModeNames:
        return named_states(states, basis.shape, basis.projection, waves)

    asked = basis.projection, turning.damping, turning.inertia, given, int(branches), names
    return on_root(comm, lambda: sweep(*asked))


@dataclass(frozen=True, kw_only=True)
class History:
    """Histories of a run over n instants and c contact points.

    `time` (n,) s; `force` (n, c) N of each contact point and `horizontal` (n, c, 2) N, which the
    road's slope pushes forward and to the left; `axle_force` (n, 3) N; `displacement`
    (n, c) m of the tire at the points; `gap` (n, c) m; `patch`: the contact points; `limit`: the
    highest frequency up to which the results are valid; `run_in` s: until then the road grows from
    flat under a part of the patch.

    Figures of the road alone begin with a `start` (s) of `run_in`; by default they are of the whole
    record, with what the run-in excites.
    """

    time: Array
    force: Array
    horizontal: Array
    axle_force: Array
    displacement: Array
    gap: Array
    patch: Patch
    limit: Limit
    run_in: float

    @property
    def total_force(self) -> Array:
        """Vertical force of the road (n,), N."""
        return self.force.sum(axis=1)

    @property
    def step(self) -> float:
        """Time step, s: the first instant is one step after the state at rest."""
        return float(self.time[0])

    def spectrum(self, start: float = 0.0) -> tuple[Array, NDArray[np.complex128]]:
        """Frequencies (f,) Hz up to the limit, axle-force amplitudes (f, 3) N (contact.results).

        From `start` s on.
        """
        frequency, amplitude = amplitudes(self._from(start), self.step)
        below = frequency <= self.limit.frequency
        return frequency[below], amplitude[below]

    def third_octaves(self, start: float = 0.0) -> tuple[Array, Array]:
        """Axle force: third-octave centres (b,) Hz to the limit, levels (b, 3) dB re 1 N rms.

        From `start` s on. A run of one step has no band.
        """
        return third_octaves(self._from(start), self.step, self.limit.frequency)

    def _from(self, start: float) -> Array:
        """Axle force (k, 3) N of the instants from `start` s on. InputError if there are none."""
        if not 0.0 <= start <= self.time[-1]:
            raise InputError(f"start = {start:g} s must be from 0 to the end, {self.time[-1]:g} s")
        return self.axle_force[np.searchsorted(self.time, start) :]


@typed
def drive(
    tire: RollingTire,
    road: RoadUnderTire,
    *,
    duration: float,
    step: float | None = None,
    tread: TreadLaw | None = None,
    spacing: float | tuple[float, float] | None = None,
    residual: str = "static",
    friction: float = DRY_ASPHALT,
) -> History:
    """Roll the tire over the road for `duration` s.

    `step` s: time step, by default small enough for the fastest mode. `tread`: a law of
    contact.tread.laws, which lies on the tire's own tread; by default a half-space of 10 MPa, and with a `spacing` on a tire with
    cords what its elements do not resolve of its tread, a layer of 10 MPa at 1 kHz with the losses of its compound (contact.tread.between_nodes). `spacing` (m, or m, m along and across) of
    a grid of contact points, by default the nodes of the mesh. `friction`: coefficient between tread and road,
    where the tread shears (half-space, layer, viscoelastic); 0: none, and horizontal forces come from the road's
    slope alone.

    Raises InputError for arguments of the wrong kind, times that are not positive and finite, a tire
    that is off the road, modes with a free rim or a held road, and a `spacing` with less than two
    points along or across the footprint; ConvergenceError if the road touches the tire outside the patch of contact points.
    Collective.
    """
    check_times(duration, duration if step is None else step)
    pitches = _pitches(spacing)
    motions, turning = tire.standing.motions, tire.states.turning
    static = motions.static
    _check_motions(motions)
    if pitches is not None:
        _check_pitches(pitches, static.footprint())
    rolled = Rolled(speed=turning.speed * static.rolling_radius(), duration=duration)
    setup = contact_setup(static, motions.lattice, road, rolled, spacing=pitches)
    if not (math.isfinite(friction) and friction >= 0.0):
        raise InputError(f"drive: friction = {friction!r} must be a number of 0 or more")
    own = tread is None and pitches is not None and bool(motions.tire.section.section.plies)
    law = _own_tread(motions.tire, turning.speed) if own else _law(tread)
    spec = TreadContact(law=law, friction=friction, in_series=not own)
    if spec.has_friction and rolled.speed > 0:
        setup = freely_rolling(setup, static, motions.lattice.ring, static.rolling_radius())
    followed = (2, 0, 1) if spec.has_friction or setup.leans else (2,)
    points = [probe.nodes(setup.patch.index, len(static.points), part) for part in followed]
    every = sparse.vstack(points, "csr")
    response = tire.respond(every, every, residual)
    setup, _ = setup.equilibrated(response, static.force, spec)
    fastest = np.abs(response.eigenvalue).max(initial=1.0 / duration)
    largest = min(duration / LEAST_STEPS, TURN / fastest) if step is None else step
    chosen = equal_steps(duration, largest)
    setup = rolling_steadily(spec, setup, response, chosen.size)
    blocks = _blocks(spec, setup, response, chosen, motions.body.comm)
    highest = tire.states.highest / (2 * np.pi)
    bounds = limits(step=chosen.size, highest=highest, pitch=pitch(setup.patch), speed=rolled.speed)
    return _history(setup.patch, blocks, lowest(bounds), run_in_time(setup, road.run_in))


def _check_motions(motions: SmallMotions) -> None:
    """InputError for a tire off the road, and for modes that cannot carry the contact."""
    if motions.static.road_height is None:
        raise InputError("drive: the tire is not on a road: press it on one first")
    for key, why in barred_from_contact(motions.rim, motions.road):
        raise InputError(f"drive: modes with {key} {why}")


def _own_tread(tire: TireModel, speed: float) -> TreadLaw:
    """A layer of 10 MPa at 1 kHz, as thick as the tire's own tread at the crown, if it turns with the losses of its compound."""
    region, thickness = crown_layer(tire.section.section)
    loss = tire.body.wall.materials[region].loss(FREQUENCY) if speed else 0.0
    return TREADS.make("layer", youngs_modulus=TREAD_RUBBER, thickness=thickness, loss_factor=loss)


def _law(tread: TreadLaw | None) -> TreadLaw:
    """The tread law, by default a half-space of 10 MPa."""
    if tread is None:
        return TREADS.make("half-space", youngs_modulus=TREAD_RUBBER)
    if isinstance(tread, TreadLaw):
        return tread
    raise InputError(
        f"drive: tread = {tread!r} is not a tread law: take an object of contact.tread.laws, such as "
        "HalfSpace(youngs_modulus=1e7)"
    )


def _pitches(spacing: float | tuple[float, float] | None) -> tuple[float, float] | None:
    """Distances (m) of the contact points along and across; one number is both."""
    if spacing is None:
        return None
    try:
        along, across = np.broadcast_to(np.asarray(spacing, dtype=float), 2)
    except (TypeError, ValueError):
        along = across = np.nan
    if not (0 < along < np.inf and 0 < across < np.inf):
        raise InputError(
            f"drive: spacing = {spacing!r} must be one length or two (along, across) above 0 m, such as 0.005"
        )
    return float(along), float(across)


def _check_pitches(pitches: tuple[float, float], footprint: Footprint) -> None:
    """InputError if fewer than two points fit along or across the footprint at rest."""
    extents = footprint.length, footprint.width
    if any(0 < extent < pitch for extent, pitch in zip(extents, pitches, strict=True)):
        raise InputError(
            f"drive: spacing = {pitches[0]:g} m along, {pitches[1]:g} m across leaves less than two points in a "
            f"footprint of {footprint.length:.3g} m x {footprint.width:.3g} m: take {min(extents) / 8:.1g} m, for example"
        )


def _blocks(
    spec: ContactSpec, setup: ContactSetup, response: Response, chosen: Steps, comm: MPI.Comm
) -> list[Block]:
    """Run the time loop with the integration scheme that suits the contact. Collective."""
    resolved = response.resolved(chosen.size)
    patch, rubbed = setup.patch, bristles(spec, setup.patch)
    steps = oscillation(spec, patch, resolved, chosen.size, rubbed, setup.resolved)
    scheme = choose(steps).scheme
    recursion = Recursion(response=resolved, step=chosen.size, scheme=scheme, comm=comm)
    loop = make_loop(spec, setup, recursion, chosen.size)
    return list(loop.roll(setup.drive, chosen.size, chosen.count))


def _history(patch: Patch, blocks: list[Block], limit: Limit, run_in: float) -> History:
    """Join the blocks. Raises ConvergenceError if the road touches the edge of the patch."""
    kept = {
        name: np.concatenate([getattr(block, name) for block in blocks])
        for name in ("time", "force", "horizontal", "axle_force", "displacement", "gap")
    }
    if (kept["force"][:, patch.edge] > 0).any():
        raise ConvergenceError(
            "drive: contact at the edge of the patch of contact points: the road is higher than its declared "
            "maximum; take a smoother road or smaller steps"
        )
    return History(**kept, patch=patch, limit=limit, run_in=run_in)
