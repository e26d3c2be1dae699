"""The air in the tire: an ideal gas in an annular duct that rotates with the wheel, and its losses.

Air carried along by the wheel flows through the non-rotating duct with A U = const = Omega V / 2
pi. Its displacement xi(s, t) relative to that flow along the ring, s running along the line of
section centroids, obeys

    rho0 A D^2 xi = -A dp/ds,   p = -rho0 c^2 [d(A xi)/ds + a] / A,   D = d/dt + U d/ds,

a(s, t) being the area added by the wall's motion. At rest xi is the time integral of dpsi/ds, psi
being the velocity potential, with  (A/c^2) psi'' - d/ds (A dpsi/ds) = da/dt. The Lagrangian

    1/2 int rho0 A (D xi)^2 ds - 1/2 int rho0 c^2 [d(A xi)/ds + a]^2 / A ds

has the form of the tire's: mass, a skew gyroscopic and a symmetric convective matrix. Wall and air
are coupled in the stiffness only, and only the drive of a rotating wheel can supply energy.
Neglected: changes of density and pressure by the flow (Mach number squared, 0.5 %), the pressure
difference across a section due to the Coriolis force of the moving air, and the flow around the
whole ring, whose circulation is conserved.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI
from petsc4py import PETSc
from scipy import linalg, sparse

from tireroad.fem import compat, kinematics
from tireroad.fem.collective import summed
from tireroad.fem.errors import InputError
from tireroad.fem.matrices.operators import Unknowns
from tireroad.fem.tire.body import Body
from tireroad.fem.tire.material import ATMOSPHERE
from tireroad.fem.tire.mesh import INNER

GAS_CONSTANT = 287.0  # J/(kg K), of dry air
RATIO = 1.4  # of specific heats
_PRANDTL = 0.71
WAVES = 8  # around the ring, kept by default: 1.7 kHz in a passenger tire
_STATIONS = 16  # per wave: integrals of triple products are exact, others to 1e-6
PROFILE_WAVES = 24  # of the profile: a footprint of an eighth of the ring has little content beyond
_LEAST = 1e-12  # of a column's largest entry; smaller ones are rounding


@dataclass(frozen=True)
class Gas:
    """Air at rest: absolute `pressure` Pa and `temperature` K."""

    pressure: float
    temperature: float

    @property
    def density(self) -> float:
        """rho0 = p / (R T), kg/m3."""
        return self.pressure / (GAS_CONSTANT * self.temperature)

    @property
    def sound_speed(self) -> float:
        """c = sqrt(gamma R T), m/s."""
        return float(np.sqrt(RATIO * GAS_CONSTANT * self.temperature))

    @property
    def viscosity(self) -> float:
        """Dynamic viscosity, Pa s, by Sutherland's law for air."""
        return 1.458e-6 * self.temperature**1.5 / (self.temperature + 110.4)

    def wall_loss(self, radius: float, circular: np.ndarray) -> np.ndarray:
        """Damping rate (1/s) of waves at `circular` rad/s in a tube of `radius` m.

        Twice the decay rate of the amplitude, by viscosity and heat conduction in the boundary
        layers (Kirchhoff 1868; Pierce, Acoustics (1981), 10-5):  (2 / a) sqrt(mu w / 2 rho0) (1 +
        (gamma - 1) / sqrt(Pr)).
        """
        layer = np.sqrt(self.viscosity * circular / (2 * self.density))
        return 2 / radius * layer * (1 + (RATIO - 1) / np.sqrt(_PRANDTL))


def inflated(inflation: float, temperature: float) -> Gas:
    """The air of a tire at `inflation` Pa above atmospheric pressure and `temperature` K."""
    return Gas(inflation + ATMOSPHERE, temperature)


@dataclass(frozen=True)
class DuctProfile:
    """The cavity around the ring, by Fourier moments over the angle.

    `volume` (f,) m3: int chi_f dV; `area` (f,) m2: int chi_f dA dtheta, A being the section in the
    plane through the axle at theta, measured from the lowest point towards +x. chi_f as in
    `waves`.
    """

    volume: np.ndarray
    area: np.ndarray

    @property
    def count(self) -> int:
        """Highest wave number."""
        return (len(self.volume) - 1) // 2

    def at(self, angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """dV/dtheta (m3/rad) and A (m2) at the angles (t,), from their Fourier series."""
        chi = waves(self.count, angle)
        weight = np.full(chi.shape[1], 1 / np.pi)
        weight[0] /= 2
        return chi @ (weight * self.volume), chi @ (weight * self.area)

    @property
    def total(self) -> float:
        """Volume, m3."""
        return float(self.volume[0])

    @property
    def tube_radius(self) -> float:
        """Radius (m) of the circle with the area of the mean section."""
        return float(np.sqrt(self.area[0] / (2 * np.pi) / np.pi))


def waves(count: int, angle: np.ndarray, order: int = 0) -> np.ndarray:
    """1, cos n theta, sin n theta for n = 1 to `count`, by columns (t, 2 count + 1), or their
    derivatives of the given order.
    """
    n = np.arange(1, count + 1)
    phase = np.multiply.outer(angle, n) + order * np.pi / 2
    out = np.empty((len(angle), 2 * count + 1))
    out[:, 0] = order == 0
    out[:, 1::2] = n**order * np.cos(phase)
    out[:, 2::2] = n**order * np.sin(phase)
    return out


@dataclass(frozen=True)
class Duct:
    """The a modes of the air between rigid walls, at unit modal mass, and their pressure shapes.

    `circular` (a,) rad/s at rest; `pressure` (1 + a, f): coefficients over `waves` of P_j, int rho0
    / c^2 A P_i P_j ds = delta_ij, the first being uniform, without motion along the ring;
    `gyroscopic` (a, a) 1/rad skew and `convective` (a, a) 1/rad2, Omega factored out; `momentum`
    (3, a) kg^1/2 per unit rate; `loss` (a,) 1/s; `density` kg/m3 of the air, `volume` m3.
    """

    circular: np.ndarray
    pressure: np.ndarray
    gyroscopic: np.ndarray
    convective: np.ndarray
    momentum: np.ndarray
    loss: np.ndarray
    density: float
    volume: float

    @property
    def frequency(self) -> np.ndarray:
        """Frequencies (a,) Hz at rest between rigid walls."""
        return self.circular / (2 * np.pi)

    def coupling(self, flux: np.ndarray) -> np.ndarray:
        """e (1 + a, m) 1/s from `flux` (f, m), int chi_f u . n dS, m3 per unit of each motion.

        With the air's coordinates g the energy of compression is 1/2 |e eta - (0, w g)|^2. The
        first row alone gives the adiabatic stiffness of the trapped air, rho0 c^2 / V (dV)^2.
        """
        return self.density * self.pressure @ flux

    def pencil(self, speed: float) -> tuple[np.ndarray, np.ndarray]:
        """The air's damping (1/s) and stiffness (1/s2) (a, a) at `speed` rad/s, for unit mass."""
        drag = np.diag(self.loss) + 2 * speed * self.gyroscopic
        turning = speed * self.loss[:, None] * self.gyroscopic
        return drag, np.diag(self.circular**2) + speed**2 * self.convective + turning

    def with_tire(
        self, drag: np.ndarray, stiffness: np.ndarray, speed: float, coupling: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Damping and stiffness (m + a, m + a) of a tire of unit mass with its air.

        From those of the tire (m, m) and e = `coupling` (1 + a, m); e' is e without its first row:

            [K + e^T e   -e'^T w ]      [D          0        ]
            [ -w e'         K_a  ],     [0   D_a + 2 Omega G_a].
        """
        own_drag, own_stiffness = self.pencil(speed)
        across = -self.circular[:, None] * coupling[1:]
        whole = np.block([[stiffness + coupling.T @ coupling, across.T], [across, own_stiffness]])
        return linalg.block_diag(drag, own_drag), whole

    def dynamic_stiffness(self, s: complex, speed: float) -> np.ndarray:
        """W(s) (1 + a, 1 + a): the air adds e^T W e to the tire's dynamic stiffness at e^(st).

        At s = 0 and standing only the trapped air remains, 1 in the first place; if the wheel
        rotates, terms of the flow's Mach number squared are added.
        """
        drag, stiffness = self.pencil(speed)
        own = s**2 * np.eye(len(stiffness)) + s * drag + stiffness
        held = self.circular[:, None] * np.linalg.solve(own, np.diag(self.circular))
        return linalg.block_diag(1.0, np.eye(len(held)) - held)


def modes(
    profile: DuctProfile, gas: Gas, up_to: float | None, loss_factor: float | None = None
) -> Duct:
    """The duct's modes below `up_to` Hz, at least the lowest pair; None: up to `WAVES` waves.

    Far below its resonance a mode of the air adds mass to motions of the wall with as many waves: it
    counts in bands that it lies far above. Without the waves n = 2 (435 Hz) and 3 the second ring
    mode of a passenger tire at 79 Hz is 0.9 % too high; those beyond `WAVES` change less than 1e-4.

    `loss_factor`: damping rate over circular frequency; None: boundary-layer losses
    (Gas.wall_loss).
    """
    n = profile.count
    angle, width = _stations(_STATIONS * n)
    volume, _ = profile.at(angle)
    stretch = _stretch(profile, angle)
    chi, slope = waves(n, angle), waves(n, angle, 1)
    density, c = gas.density, gas.sound_speed
    mass = density / c**2 * width * (chi.T * volume) @ chi
    stiffness = density * width * (slope.T * (volume / stretch**2)) @ slope
    squares, shape = linalg.eigh(stiffness, mass)
    circular = np.sqrt(np.maximum(squares[1:], 0.0))
    below = 2 * WAVES if up_to is None else int((circular <= 2 * np.pi * up_to).sum())
    count = min(max(below, 2), len(circular))
    circular, shape = circular[:count], _signed(shape[:, : count + 1])
    # Displacement shapes xi_j = P_j' / (w_j ds/dtheta), of unit mass because the potentials are.
    along = slope @ shape[:, 1:] / stretch[:, None] / circular
    rate = _derivative(along)
    flow = -profile.total / (2 * np.pi)  # A U at 1 rad/s: the wheel turns from +x downwards
    turning = density * flow * width * along.T @ rate
    convective = -density * flow**2 * width * (rate.T / volume) @ rate
    if loss_factor is None:
        loss = gas.wall_loss(profile.tube_radius, circular)
    else:
        loss = loss_factor * circular
    return Duct(
        circular,
        shape.T,
        (turning - turning.T) / 2,
        (convective + convective.T) / 2,
        density * momentum_of_waves(profile) @ shape[:, 1:] / circular,
        loss,
        density,
        profile.total,
    )


def momentum_of_waves(profile: DuctProfile) -> np.ndarray:
    """int (dchi_f/dtheta) e_theta A dtheta = closed int chi_f n dS, (3, f) m2.

    The first, times density, is the momentum of a potential chi_f, the second the force of a
    pressure chi_f on wall and rim; by Gauss's theorem they are equal.
    """
    angle, width = _stations(_STATIONS * profile.count)
    _, area = profile.at(angle)
    direction = np.stack([np.cos(angle), 0 * angle, np.sin(angle)])
    return width * (direction * area) @ waves(profile.count, angle, 1)


def _stations(count: int) -> tuple[np.ndarray, float]:
    width = 2 * np.pi / count
    return width * np.arange(count), width


def _stretch(profile: DuctProfile, angle: np.ndarray) -> np.ndarray:
    """ds/dtheta (t,) m of the line of centroids."""
    volume, area = profile.at(angle)
    radius = volume / area
    return np.hypot(radius, _derivative(radius[:, None])[:, 0])


def _derivative(values: np.ndarray) -> np.ndarray:
    """d/dtheta of periodic columns (t, k) at equidistant angles."""
    t = len(values)
    wave = 1j * np.fft.rfftfreq(t, 1 / t)[:, None]
    wave[-1] = 0.0 if t % 2 == 0 else wave[-1]
    return np.fft.irfft(wave * np.fft.rfft(values, axis=0), t, axis=0)


def _signed(shape: np.ndarray) -> np.ndarray:
    """Columns with their largest entry made positive."""
    largest = np.take_along_axis(shape, np.abs(shape).argmax(axis=0)[None], axis=0)
    return shape * np.sign(largest)


class CavityTrace:
    """The inner face of a body at its present displacement, with `count` waves, by default as many
    as its mesh resolves. Collective.

    The geometry of the cavity, and the volume displaced by motions of the tire's wall:

        int chi dV = closed int chi rho/2 e_rho . n dS,
        int chi dA dtheta = closed int chi e_rho . n dS,
        flux_f(u) = closed int chi_f u . n dS = d/de int chi_f dV of the shape x + e u,

    over the deformed inner face and the cone between its two bead ends, which belongs to the rim; n
    points out of the air, rho is the distance from the axle, chi_f = 1, cos n theta, sin n theta
    with theta of the deformed position.
    """

    def __init__(self, body: Body, count: int | None = None) -> None:
        # Wave numbers above a quarter of the nodes around show only ripples of the mesh.
        self.count = count or max(min(PROFILE_WAVES, len(body.lattice.ring) // 4), 2)
        self._body = body
        self._ends = _bead_ends(body)
        u, v = body.u, body.test
        # The waves are not polynomials: a few more points than for a uniform pressure.
        finer = {"quadrature_degree": 3 * (len(body.lattice.edge) - 1) + 5}
        inner = ufl.Measure("ds", body.mesh, subdomain_data=body.tire.facets, metadata=finer)(INNER)
        x = ufl.SpatialCoordinate(body.mesh) + u
        reach = ufl.sqrt(x[0] ** 2 + x[2] ** 2)
        # cos(n theta - phase) with the half-angle formula: a single form for all waves, in any UFL.
        self._wave = fem.Constant(body.mesh, 0.0)
        self._phase = fem.Constant(body.mesh, 0.0)
        chi = ufl.cos(2 * self._wave * ufl.atan(x[0] / (reach - x[2])) - self._phase)
        outward = ufl.as_vector((x[0], 0.0, x[2]))
        swept = kinematics.pressure_virtual_work(u, outward, ufl.FacetNormal(body.mesh))
        self._volume = compat.form(-chi * swept / 2 * inner)
        self._area = compat.form(-chi * swept / reach * inner)
        pushed = kinematics.pressure_virtual_work(u, v, ufl.FacetNormal(body.mesh))
        self._flux = compat.form(-chi * pushed * inner)

    def profile(self) -> DuctProfile:
        """The cavity's section around the ring. InputError if it is no closed tube. Collective."""
        moments = np.array([self._scalars() for _ in self._each_wave()])
        moments = self._body.comm.allreduce(moments)
        around = 2 * np.pi  # the rim is axisymmetric: it contributes to the mean only
        (r1, y1), (r2, y2) = self._ends
        moments[0] -= around * (y2 - y1) * np.array([(r1**2 + r1 * r2 + r2**2) / 6, (r1 + r2) / 2])
        duct = DuctProfile(*moments.T)
        volume, area = duct.at(np.linspace(0, 2 * np.pi, 8 * self.count))
        if min(volume.min(), area.min()) <= 0:
            raise InputError(
                f"tire.cavity: the section of the air is {1e4 * area.min():.3g} cm2 at its narrowest: the "
                "inner face and the rim enclose no ring of air. Check tire.inner, or leave "
                "[tire.cavity] out."
            )
        return duct

    def _scalars(self) -> tuple[float, float]:
        return fem.assemble_scalar(self._volume), fem.assemble_scalar(self._area)

    def _each_wave(self) -> Iterator[int]:
        """Set the form's wave to 1, cos theta, sin theta, cos 2 theta, ... in turn."""
        for index in range(2 * self.count + 1):
            self._wave.value = (index + 1) // 2
            self._phase.value = np.pi / 2 if index and index % 2 == 0 else 0.0
            yield index

    def columns(self, unknowns: Unknowns) -> sparse.csr_matrix:
        """flux_f of own unknowns, (n, f) m2; its transpose maps motions to volume. Collective.

        A free rim carries the cone between the beads.
        """
        nodal = sparse.hstack([self._column() for _ in self._each_wave()], format="csr")
        on_rim = None if unknowns.rim is None else rim_cone(*self._ends, self.count)
        return unknowns.loads(nodal, on_rim)

    def _column(self) -> sparse.csc_matrix:
        vector = fem.petsc.assemble_vector(self._flux)
        vector.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
        values = vector.array_r.copy()
        vector.destroy()
        values[np.abs(values) < _LEAST * np.abs(values).max(initial=0.0)] = 0.0
        return sparse.csc_matrix(values[:, None])


def rim_cone(end: tuple[float, float], other: tuple[float, float], count: int) -> np.ndarray:
    """Force (m2) and moment about the origin (m3), (6, f), of unit pressures chi_f on a cone.

    The cone joins two circles (radius, y) about the axle; the air lies outside it.
    """
    (r1, y1), (r2, y2) = end, other
    slope = (r2 - r1) / (y2 - y1)
    t, weight = np.polynomial.legendre.leggauss(4)
    r, y = (r1 + r2) / 2 + t * (r2 - r1) / 2, (y1 + y2) / 2 + t * (y2 - y1) / 2
    weight = weight * (y2 - y1) / 2
    inward, aside = weight @ r, weight @ (r * slope)
    turning = weight @ (r * (r * slope + y))
    angle = 2 * np.pi * np.arange(4 * count + 4) / (4 * count + 4)
    chi = waves(count, angle) * (angle[1] - angle[0])
    zero, unit = 0 * angle, 0 * angle + 1
    radial = np.stack([np.sin(angle), zero, -np.cos(angle)])
    around = np.stack([np.cos(angle), zero, np.sin(angle)])
    force = -inward * radial + aside * np.stack([zero, unit, zero])
    return np.vstack([force, turning * around]) @ chi


def _bead_ends(body: Body) -> tuple[tuple[float, float], tuple[float, float]]:
    """(radius, y) m of the inner face's two ends on the rim, ordered by y."""
    lattice = body.lattice
    section = lattice.tire.section
    # The edges may come in any order: an end of the face is a node of one edge only.
    nodes, edges = np.unique(section.side(section.inner)[:, [0, -1]], return_counts=True)
    low, high = sorted(lattice.section[nodes[edges == 1]], key=lambda end: end[1])
    return (float(low[0]), float(low[1])), (float(high[0]), float(high[1]))


@dataclass(frozen=True, kw_only=True)
class Column:
    """`duct` on every process; `pushed`: own rows (n, 1 + a) of e^T; `speed` in rad/s.

    The air is coupled to the full matrices of one body as a low-rank term: a motion u of the tire
    drives the air by e u, e (1 + a, n) being rows over the unknowns; the air adds e^T W(s) e to the
    full matrices (fem.cavity.Duct.dynamic_stiffness). Responses of the tire without air are
    corrected for it (Woodbury):

        X <- X - V W (1 + e V W)^-1 e X,   X = A^-1 B,  V = A^-1 e^T.
    """

    comm: MPI.Comm
    duct: Duct
    pushed: sparse.csr_matrix
    speed: float

    def coupling(self, vectors: np.ndarray) -> np.ndarray:
        """e (1 + a, m) of motions given by own rows (n, m). Collective."""
        return summed(self.comm, self.pushed.T @ vectors)

    def mended(self, answers: np.ndarray, s: complex = 0.0) -> np.ndarray:
        """Responses (r, k) with air, from those without (r + 1 + a, k + 1 + a), those of e last."""
        q = self.pushed.shape[1]
        weight = self.duct.dynamic_stiffness(s, self.speed)
        core = np.eye(q) + answers[-q:, -q:] @ weight
        pull = weight @ np.linalg.solve(core, answers[-q:, :-q])
        return answers[:-q, :-q] - answers[:-q, -q:] @ pull

    def with_air(self, solution: np.ndarray) -> np.ndarray:
        """Own rows (n, p) of static shapes with air, from A^-1 [B, e^T] (n, p + 1 + a). Collective."""
        q = self.pushed.shape[1]
        x, v = solution[:, :-q], solution[:, -q:]
        weight = self.duct.dynamic_stiffness(0.0, self.speed)
        core = np.eye(q) + self.coupling(v) @ weight
        return x - v @ (weight @ np.linalg.solve(core, self.coupling(x)))


def make_column(
    body: Body,
    unknowns: Unknowns,
    inflation: float,
    temperature: float,
    speed: float,
    up_to: float | None,
    loss_factor: float | None = None,
) -> Column:
    """The air of a body at its static state, with modes up to `up_to` Hz or, None, `WAVES`. Collective.

    `inflation` Pa above atmospheric pressure, `temperature` K; `loss_factor` as in
    fem.cavity.modes.
    """
    trace = CavityTrace(body)
    gas = inflated(inflation, temperature)
    # One process solves: LAPACK on another might rotate a pair of equal frequencies.
    profile = trace.profile()
    duct = modes(profile, gas, up_to, loss_factor) if body.comm.rank == 0 else None
    duct = body.comm.bcast(duct)
    pushed = trace.columns(unknowns) @ (duct.density * duct.pressure.T)
    return Column(comm=body.comm, duct=duct, pushed=sparse.csr_matrix(pushed), speed=speed)
