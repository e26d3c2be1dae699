"""The air in the tire as a ring duct that turns with the wheel: its own modes, without the wall.

Air that the wheel carries along flows through the standing duct with A U = const = Omega V / 2 pi. Its
displacement xi(s, t) along the ring about that flow, s on the line of the section's centroids, obeys

    rho0 A D^2 xi = -A dp/ds,   p = -rho0 c^2 [d(A xi)/ds + a] / A,   D = d/dt + U d/ds,

a(s, t) the area that the wall's motion adds; standing, xi is the time integral of dpsi/ds of the velocity
potential psi with  (A/c^2) psi'' - d/ds (A dpsi/ds) = da/dt. The Lagrangian of it,

    1/2 int rho0 A (D xi)^2 ds - 1/2 int rho0 c^2 [d(A xi)/ds + a]^2 / A ds,

has the tire's own form: mass, a skew gyroscopic matrix, a symmetric convective one; the wall meets the
air in the stiffness alone, and nothing but the drive of a turning wheel can put energy in. Left out:
what the flow changes in density and pressure (Mach number squared, 0.5 %), the pressure across a section that the
Coriolis force of the moving air makes, and the flow all around the ring, whose circulation is kept.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from tireroad.fem.cavity.gas import Gas

_STATIONS = 16  # a wave of the basis: integrals of products of three are exact, of others to 1e-6


@dataclass(frozen=True)
class Profile:
    """The cavity around the ring, from moments over cos and sin of whole multiples of the angle.

    `volume` (f,) m3: int chi_f dV; `area` (f,) m2: int chi_f dA dtheta, A the section in the plane
    through the axle at theta, an angle from the lowest point towards +x. chi_f as in `waves`.
    """

    volume: np.ndarray
    area: np.ndarray

    @property
    def count(self) -> int:
        """Highest wave number."""
        return (len(self.volume) - 1) // 2

    def at(self, angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """dV/dtheta (m3/rad) and A (m2) at the angles (t,), by their Fourier series."""
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
        """Radius (m) of the circle of the mean section."""
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
    """Modes of the air between rigid walls, at unit modal mass: a of them, and their pressure shapes.

    `circular` (a,) rad/s standing; `pressure` (1 + a, f) the coefficients over `waves` of
    P_j, int rho0 / c^2 A P_i P_j ds = delta_ij, the first the uniform one, which has no motion along the
    ring; `gyroscopic` (a, a) 1/rad skew and `convective` (a, a) 1/rad2, Omega taken out; `momentum`
    (3, a) kg^1/2 per rate; `loss` (a,) 1/s. `density` kg/m3 of the air, `volume` m3.
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
        """(a,) Hz, standing, between rigid walls."""
        return self.circular / (2 * np.pi)

    def coupling(self, flux: np.ndarray) -> np.ndarray:
        """e (1 + a, m) 1/s from what motions displace: `flux` (f, m) int chi_f u . n dS, m3 a unit.

        With it and coordinates g of the air, the energy of compression is 1/2 |e eta - (0, w g)|^2, and
        the first row alone is the adiabatic stiffness of the trapped air, rho0 c^2 / V (dV)^2.
        """
        return self.density * self.pressure @ flux

    def pencil(self, speed: float) -> tuple[np.ndarray, np.ndarray]:
        """The air's own damping (1/s) and stiffness (1/s2) matrices (a, a), mass 1, at `speed` rad/s."""
        drag = np.diag(self.loss) + 2 * speed * self.gyroscopic
        turning = speed * self.loss[:, None] * self.gyroscopic
        return drag, np.diag(self.circular**2) + speed**2 * self.convective + turning

    def joined(
        self, drag: np.ndarray, stiffness: np.ndarray, speed: float, coupling: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Damping and stiffness (m + a, m + a) of a tire with unit mass and its air, from those of the
        tire (m, m) and e = `coupling` (1 + a, m):

            [K + e^T e   -e'^T w ]      [D          0        ]
            [ -w e'         K_a  ],     [0   D_a + 2 Omega G_a],    e' the rows of e without the first.
        """
        own_drag, own_stiffness = self.pencil(speed)
        across = -self.circular[:, None] * coupling[1:]
        whole = np.block([[stiffness + coupling.T @ coupling, across.T], [across, own_stiffness]])
        return linalg.block_diag(drag, own_drag), whole

    def dynamic_stiffness(self, s: complex, speed: float) -> np.ndarray:
        """W(s) (1 + a, 1 + a): the air adds e^T W e to what resists a motion of the tire with e^(st).

        At rest and s = 0 the trapped air alone is left, 1 in the first place; when the wheel turns the
        square of the flow's Mach number besides.
        """
        drag, stiffness = self.pencil(speed)
        own = s**2 * np.eye(len(stiffness)) + s * drag + stiffness
        held = self.circular[:, None] * np.linalg.solve(own, np.diag(self.circular))
        return linalg.block_diag(1.0, np.eye(len(held)) - held)


def modes(profile: Profile, gas: Gas, up_to: float, loss_factor: float | None = None) -> Duct:
    """The duct's modes below `up_to` Hz, the lowest pair at least.

    `loss_factor`: damping rate over circular frequency; None: friction at the walls (Gas.wall_loss).
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
    kept = max(int((circular <= 2 * np.pi * up_to).sum()), 2)
    circular, shape = circular[:kept], _signed(shape[:, : kept + 1])
    # Displacement shapes xi_j = P_j' / (w_j ds/dtheta), at unit mass because the potentials are.
    along = slope @ shape[:, 1:] / stretch[:, None] / circular
    rate = _derivative(along)
    flow = -profile.total / (2 * np.pi)  # A U at 1 rad/s: the wheel turns from +x to below
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


def momentum_of_waves(profile: Profile) -> np.ndarray:
    """int (dchi_f/dtheta) e_theta A dtheta = closed int chi_f n dS, (3, f) m2.

    The first per density is the momentum of a potential chi_f, the second the force of a pressure
    chi_f on wall and rim together: Gauss's theorem makes them one.
    """
    angle, width = _stations(_STATIONS * profile.count)
    _, area = profile.at(angle)
    direction = np.stack([np.cos(angle), 0 * angle, np.sin(angle)])
    return width * (direction * area) @ waves(profile.count, angle, 1)


def _stations(count: int) -> tuple[np.ndarray, float]:
    width = 2 * np.pi / count
    return width * np.arange(count), width


def _stretch(profile: Profile, angle: np.ndarray) -> np.ndarray:
    """ds/dtheta (t,) m of the line of centroids."""
    volume, area = profile.at(angle)
    radius = volume / area
    return np.hypot(radius, _derivative(radius[:, None])[:, 0])


def _derivative(values: np.ndarray) -> np.ndarray:
    """d/dtheta of periodic columns (t, k) at equal distances."""
    t = len(values)
    wave = 1j * np.fft.rfftfreq(t, 1 / t)[:, None]
    wave[-1] = 0.0 if t % 2 == 0 else wave[-1]
    return np.fft.irfft(wave * np.fft.rfft(values, axis=0), t, axis=0)


def _signed(shape: np.ndarray) -> np.ndarray:
    """Columns with their largest entry positive."""
    largest = np.take_along_axis(shape, np.abs(shape).argmax(axis=0)[None], axis=0)
    return shape * np.sign(largest)
