"""The computation as functions of typed inputs, without scenes or files, for scripts and notebooks.

  tire = torus(youngs_modulus=48e6, segments=24, elements_arc=10)
  turning = Turning(speed=50.0, damping=(500.0, 0.0))
  static = press(tire, inflation=2e5, load=500.0, turning=turning)
  standing = modes(tire, static, count=60)
  rolling = roll(standing, turning)
  run = drive(rolling, make_road(kind="sine", amplitude=1e-3), duration=0.1)     # runs.drive

SI units, angles in radians. Every function is collective: all processes of the tire's communicator
call it with the same arguments and get the same arrays.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from scipy import sparse

from tireroad.fem.errors import InputError
from tireroad.fem.matrices import probe
from tireroad.fem.model import SmallMotions, TireModel
from tireroad.fem.sections.torus import Torus
from tireroad.fem.static.press import press as press_tire
from tireroad.fem.static.state import StaticState
from tireroad.fem.static.virtual_work import AT_REST
from tireroad.fem.tire.body import Body
from tireroad.fem.tire.material import Material, compound
from tireroad.fem.turning import Turning
from tireroad.greens.coupling import Wheel, wheel_of
from tireroad.greens.response import Response
from tireroad.greens.responses import make_response
from tireroad.modal.basis import ModalBasis
from tireroad.modal.rolling import RollingModes, rolling_modes
from tireroad.modal.standing import standing_modes
from tireroad.runs.scene.sections.kinds.radial import RadialSection, built
from tireroad.runs.scene.sections.kinds.torus import TorusSection
from tireroad.runs.scene.tables.tire import NEAR_ROAD, Tire
from tireroad.runs.stages.build.tire import make_tire
from tireroad.runs.stages.build.turning import rolling_shape
from tireroad.runs.typed import typed

Array = NDArray[np.float64]


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
            f"torus: material = {material!r} is no material: take tireroad.compound(…), or "
            "youngs_modulus, poisson_ratio and density"
        )
    section = shape.ring()
    rubber = material or compound(
        "neo-hookean", density, youngs_modulus=youngs_modulus, poisson_ratio=poisson_ratio
    )
    return TireModel(section, lambda: Body(comm, section, {"wall": rubber}))


def radial(
    size: str = "205/60 R15",
    *,
    segments: int = 40,
    elements_arc: int = 26,
    footprint_size: float = NEAR_ROAD,
    comm: MPI.Comm = MPI.COMM_WORLD,
) -> TireModel:
    """The built-in radial passenger tire of a size, without loads (docs/radial-tire.md).

    `segments` elements around and `elements_arc` from bead to bead, quadratic; those near the road
    are `footprint_size` of the others. Its rubbers have loss factors: with damping =
    tireroad.StrainEnergy() the rotating tire loses by them. Raises InputError for a size that is
    none, or a value out of the range that it has in a scene.
    """
    shape = RadialSection(size=size, elements_arc=elements_arc)
    tire = Tire(
        section="radial", shape=shape, segments=segments, order=2, footprint_size=footprint_size
    )
    try:
        built(size)
    except InputError as problem:
        raise InputError(f"radial: {str(problem).removeprefix('tire.')}") from None
    return make_tire(comm, tire)


def _check_ranges(torus: Torus) -> None:
    """ParameterError for a value out of the range of the scene's key."""
    same = "outer_radius", "minor_radius", "thickness", "elements_arc", "elements_thickness"
    shape = TorusSection(
        half_angle=math.degrees(torus.half_angle), **{name: getattr(torus, name) for name in same}
    )
    Tire(
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
    lattice, found = tire.lattice, len(static.displacement)
    why = ""
    if found != lattice.size:
        why = f"it has {found} nodes, and the tire {lattice.size}"
    elif not np.allclose(static.points, lattice.points(lattice.face), rtol=0, atol=1e-9):
        why = "its nodes lie elsewhere"
    elif static.materials and static.materials != tire.body.materials:
        why = "its tire is of other materials"
    if why:
        raise InputError(
            f"modes: static is the state of another tire ({why}): press this one, and give the result"
        )


@dataclass(frozen=True, kw_only=True)
class RollingTire:
    """A rotating tire: the modes at rest (`standing`) and the states of the wheel (`states`)."""

    standing: Standing
    states: RollingModes

    @property
    def eigenvalue(self) -> NDArray[np.complex128]:
        """Eigenvalues s (q,) 1/s with Im s >= 0: frequency Im s / 2 pi, decay rate -Re s."""
        return self.states.states.eigenvalue

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
        if not len(spots):
            raise InputError("at: no point given: take (angle around, angle along section) in rad")
        lattice = self.standing.motions.lattice
        rows = [
            probe.directed(probe.spot(lattice, *spot), axis) for spot in spots for axis in np.eye(3)
        ]
        probes = sparse.csr_matrix(np.stack(rows))
        return self.respond(probes, probes, residual)


@typed
def roll(standing: Standing, turning: Turning) -> RollingTire:
    """The states of the rotating tire in the non-rotating frame; at speed 0, those of the modes.

    InputError for arguments of the wrong kind.
    """
    comm = standing.motions.body.comm
    return RollingTire(standing=standing, states=rolling_modes(standing.basis, turning, comm))
