"""An inflated tire and its small motions: Fourier series around, finite elements in the section.

  F = I + grad u,   int P(F) : grad v + cords + p int (x_theta x x_s) . v = 0

(axisymmetric, three components); then for each wave number n the tangent on fields
Re[v(r, y) e^{i n theta}], with stresses, pressure and cords of that state and the rubber's own part
at its dynamic modulus. The integration is selective as in the program (full for the distortion, one
point per direction less for dilatation and cords); everything else is independent: numpy, no
dolfinx.

A wheel that turns at a speed W has the load W^2 rho r on its wall besides. A wave v(r, y) e^{i n theta} that stands on
the road while the tire turns through it at Omega has the accelerations Omega^2 d^2/dtheta^2 of its vectors:

    K_n v = Omega^2 M C_n v,   C_n = [[n^2 + 1, 2 i n, 0], [-2 i n, n^2 + 1, 0], [0, 0, n^2]]  in (r, theta, y).

The lowest Omega over all n is the critical speed, of a tire without losses.  With the moduli that the rubber
has at n Omega, a load that rests on the turning tire makes at every speed

    (K_n*(n Omega) - Omega^2 M C_n) v_n = q_n,

and the losses of those waves are its rolling resistance.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, Protocol

import numpy as np
from scipy import sparse
from scipy.linalg import eigh
from scipy.sparse.linalg import eigsh, splu

from tireroad.fem.errors import ConvergenceError
from tireroad.fem.sections import mesh2d
from tireroad.fem.sections.construction import CordLine
from tireroad.fem.sections.mesh2d import SectionMesh
from tireroad.fem.tire.material import Kind, Spectrum, kinds, own_moduli, power_law

STEPS = (0.02, 0.1, 0.3, 0.6, 1.0)  # shares of the inflation pressure
_SMALL = 1e-10  # m: size of the last Newton step
_UNIT = np.eye(3)


class Rule:
    """Gauss points of the cells: shapes N (q, a), slopes, radius, volume (c, q) per radian."""

    def __init__(self, section: SectionMesh, points: int):
        edge, (t, w) = mesh2d.equispaced(section.order), _gauss(points)
        at = mesh2d.grid_points(t)
        value, slope = (
            [shape(edge, x) for x in at] for shape in (mesh2d.lagrange, mesh2d.lagrange_slope)
        )
        self.N = mesh2d.tensor(*value)
        dN = np.stack([mesh2d.tensor(slope[0], value[1]), mesh2d.tensor(value[0], slope[1])])
        places = section.nodes[section.cells]
        J = np.einsum("dqa,cax->cqxd", dN, places)
        self.radius = np.einsum("qa,ca->cq", self.N, places[..., 0])
        self.volume = np.linalg.det(J) * np.outer(w, w).ravel() * self.radius
        self._slopes = np.einsum("dqa,cqdx->cqax", dN, np.linalg.inv(J))

    def gradient(self, wave: int) -> np.ndarray:
        """(c, q, 9, 3 a): grad u (component, direction) from the nodal values at a wave number."""
        over = self.N[None] / self.radius[..., None]
        out = np.zeros((*self.radius.shape, 3, 3, self.N.shape[1], 3), complex if wave else float)
        for k in range(3):
            out[..., k, 0, :, k], out[..., k, 2, :, k] = self._slopes[..., 0], self._slopes[..., 1]
            if wave:
                out[..., k, 1, :, k] = 1j * wave * over
        out[..., 0, 1, :, 1] -= over
        out[..., 1, 1, :, 0] += over
        return out.reshape(*self.radius.shape, 9, -1)


class CordElements:
    """Cords on a chain of edges: F a at each Gauss point, with the cord's direction a."""

    def __init__(self, section: SectionMesh, edges: np.ndarray, cords: CordLine, points: int):
        order, chain = section.order, section.chain(edges)
        self.nodes = chain[order * np.arange(len(edges))[:, None] + np.arange(order + 1)]
        edge, (t, w) = mesh2d.equispaced(order), _gauss(points)
        self.N, slope = mesh2d.lagrange(edge, t), mesh2d.lagrange_slope(edge, t)
        places = section.nodes[self.nodes]
        tangent = np.einsum("qa,cax->cqx", slope, places)
        length = np.linalg.norm(tangent, axis=2)
        self._radius = np.einsum("qa,ca->cq", self.N, places[..., 0])
        self.area = length * w * self._radius
        self._slope = slope / length[..., None]
        self._cords, angle = cords, cords.angle
        self._cosine, self._sine = np.cos(angle), np.sin(angle)
        t_r, t_y = (tangent[..., k] / length for k in range(2))
        around = np.full(length.shape, self._cosine)
        self._direction = np.stack([self._sine * t_r, around, self._sine * t_y], axis=-1)

    def stretch(self, wave: int) -> np.ndarray:
        """(c, q, 3, 3 a): (grad u) a."""
        over = self._cosine * self.N / self._radius[..., None]
        out = np.zeros((*self._radius.shape, 3, self.N.shape[1], 3), complex if wave else float)
        for k in range(3):
            out[..., k, :, k] = self._sine * self._slope + (1j * wave * over if wave else 0.0)
        out[..., 0, :, 1] -= over
        out[..., 1, :, 0] += over
        return out.reshape(*self._radius.shape, 3, -1)

    def state(self, displacement: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Unit vector of F a, tension (N/m), and the derivative of the cord force by F a."""
        u = displacement.ravel()[dofs(self.nodes)]
        moved = self._direction + np.einsum("cqkd,cd->cqk", self.stretch(0), u)
        stretch = np.linalg.norm(moved, axis=-1)[..., None]
        along, cords = moved / stretch, self._cords
        in_tension = cords.youngs_modulus * cords.area / cords.spacing
        stiffness = in_tension * np.where(stretch < 1, cords.compression, 1.0)
        tension = stiffness * (stretch - 1)
        geometric = (tension / stretch)[..., None]
        outer = along[..., None] * along[..., None, :]
        return along, tension, geometric * (_UNIT - outer) + stiffness[..., None] * outer


class InnerFace:
    """The deformed inner face: x_s, x_theta, and the force of a unit pressure."""

    def __init__(self, section: SectionMesh, displacement: np.ndarray):
        self.nodes = section.side(section.inner)
        edge, (t, self._w) = mesh2d.equispaced(section.order), _gauss(section.order + 2)
        self._N, self._slope = mesh2d.lagrange(edge, t), mesh2d.lagrange_slope(edge, t)
        r, y = section.nodes[self.nodes].transpose(2, 0, 1)
        place = np.stack([r, 0 * r, y], axis=-1) + displacement[self.nodes]
        x = np.einsum("qa,cak->cqk", self._N, place)
        self._x_s = np.einsum("qa,cak->cqk", self._slope, place)
        self._x_t = np.cross([0.0, 0.0, 1.0], x)
        centre = [np.ptp(section.nodes[:, 0]) / 2 + section.nodes[:, 0].min(), 0.0, 0.0]
        out = (np.cross(self._x_t, self._x_s) * (x - centre)).sum(axis=(1, 2))
        self._sign = -np.sign(out)[:, None, None]

    def force(self) -> np.ndarray:
        """(c, 3 a): force of the air on the wall, with the sign it has in the residual."""
        pushed = self._sign * np.cross(self._x_t, self._x_s)
        return np.einsum("qa,cqk,q->cak", self._N, pushed, self._w).reshape(len(self.nodes), -1)

    def tangent(self, wave: int) -> np.ndarray:
        """(c, 3 a, 3 a): derivative of that force at a wave number."""
        q, a = self._N.shape
        W, along, around = (np.zeros((q, a, 3, 3), complex if wave else float) for _ in range(3))
        for k in range(3):
            W[..., k, k], along[..., k, k] = self._N, self._slope
            around[..., k, k] = 1j * wave * self._N if wave else 0.0
        around[:, :, 1, 0] -= self._N
        around[:, :, 0, 1] += self._N
        test, slope, turn = (part.reshape(q, 3 * a, 3) for part in (W, along, around))
        change = np.cross(turn, self._x_s[:, :, None])
        change = (change + np.cross(self._x_t[:, :, None], slope)) * self._sign[..., None]
        return np.einsum("qik,cqjk,q->cij", test, change, self._w)


def _gauss(count: int) -> tuple[np.ndarray, np.ndarray]:
    points, weights = np.polynomial.legendre.leggauss(count)
    return points / 2 + 0.5, weights / 2


def dofs(nodes: np.ndarray) -> np.ndarray:
    """Degrees of freedom (c, 3 a) of nodes (c, a)."""
    return (3 * nodes[:, :, None] + np.arange(3)).reshape(len(nodes), -1)


class LayeredSection(Protocol):
    """The section, compounds and cords of a ring, as a Construction gives them."""

    @property
    def compounds(self) -> Mapping[str, Mapping[str, Any]]:
        """E, nu, density, dynamic over static modulus, loss factor, exponent or spectrum, by region."""

    @property
    def cords(self) -> Sequence[Any]:
        """Cords on the plies of their names."""

    def section(self, elements: int, order: int) -> SectionMesh:
        """The section's mesh."""


@dataclass(frozen=True)
class RigidMode:
    """A mode of the belt: `frequency` Hz, `damping` ratio, and the kg (kg m2 of rotations) that move with it."""

    name: str
    frequency: float
    damping: float
    inertia: float


@dataclass(frozen=True)
class SectionModes:
    """Modes of a wave, of unit mass over one radian, at dynamic moduli.

    `squares` (m,) 1/s2; `push` (m,) N kg^-1/2 of a load; `parts` (m, m) 1/s2 of the stiffness, of each kind of
    compounds (fem.tire.material.kinds); `turned`: M J and M J^2 (m, m), J turning the directions r and theta; `flexibility`
    w . K_n^-1 w, m rad/N, of the load at its own place.
    """

    wave: int
    squares: np.ndarray
    push: np.ndarray
    parts: Sequence[np.ndarray]
    turned: Sequence[np.ndarray]
    flexibility: float

    def first(self, count: int) -> SectionModes:
        """The lowest `count` of them."""
        few = slice(count)
        parts, turned = ([part[few, few] for part in some] for some in (self.parts, self.turned))
        return replace(
            self, squares=self.squares[few], push=self.push[few], parts=parts, turned=turned
        )

    def inertia(self, rate: float, speed: float) -> np.ndarray:
        """-M (i rate + speed (i n + J))^2 (m, m) 1/s2, as of `InflatedRing`."""
        return _inertia(np.eye(len(self.squares)), self.turned, self.wave, rate, speed)


def _inertia(mass: Any, turned: Sequence[Any], wave: int, rate: float, speed: float) -> Any:
    """-M (i rate + speed (i n + J))^2 of a wave of n that oscillates in space at a rate while the tire turns at a speed
    through it, rad/s; J turns the directions r and theta with the tire, `turned` M J and M J^2."""
    met, (once, twice) = rate + speed * wave, turned
    return met**2 * mass - 2j * met * speed * once - speed**2 * twice


def mean_over(
    places: np.ndarray, middle: float, half: float, period: float | None = None
) -> np.ndarray:
    """Weights (n,) of values at `places` (n,), linear between them, in the mean over middle +- half."""
    inside, order = middle + half * np.linspace(-1, 1, 401), np.argsort(places)
    weights = np.empty(len(places))
    weights[order] = [
        np.interp(inside, places[order], unit, period=period).mean() for unit in np.eye(len(places))
    ]
    return weights


def _spectrum(compound: Mapping[str, Any]) -> Spectrum:
    return compound.get("spectrum") or power_law(compound.get("exponent", 0.0))


class InflatedRing:
    """A construction with `elements` from bead to bead, inflated to a pressure (Pa), turning at a speed (rad/s).

    Fields have components (r, theta, y) per node.
    """

    def __init__(
        self, tire: LayeredSection, elements: int, order: int, pressure: float, speed: float = 0.0
    ):
        self.section = mesh = tire.section(elements, order)
        self.pressure, self.speed = pressure, speed
        rubber = [tire.compounds[name] for name in mesh.regions]
        by_cell = {
            key: np.array([c[key] for c in rubber])[mesh.region]
            for key in ("youngs_modulus", "poisson_ratio", "density", "dynamic")
        }
        small = [(_spectrum(c), c["loss_factor"], c["dynamic"]) for c in rubber]
        self._kinds = {k: np.array(share)[mesh.region] for k, share in kinds(small).items()}
        modulus, poisson = by_cell["youngs_modulus"], by_cell["poisson_ratio"]
        self._density, self._dynamic = by_cell["density"], by_cell["dynamic"]
        cellwise = (slice(None), None, None, None)
        self._parts = (
            (
                Rule(mesh, mesh.order + 1),
                partial(_distortion, (modulus / 2 / (1 + poisson))[cellwise]),
            ),
            (
                Rule(mesh, mesh.order),
                partial(_dilatation, (modulus / 3 / (1 - 2 * poisson))[cellwise]),
            ),
        )
        self._cords = [(line, mesh.plies[line.name]) for line in tire.cords]
        self._size = 3 * len(mesh.nodes)
        free = np.setdiff1d(np.arange(len(mesh.nodes)), np.unique(mesh.side(mesh.rim)))
        self._free = dofs(free[None])[0]
        self.displacement = np.zeros((len(mesh.nodes), 3))
        self._inflate()

    def _inflate(self) -> None:
        outwards = sparse.diags(np.tile([self.speed**2, 0.0, 0.0], len(self.section.nodes)))
        turning = self.mass @ outwards
        for share in STEPS:
            for _ in range(30):
                radius = self.displacement.copy()
                radius[:, 0] += self.section.nodes[:, 0]
                rest = self._residual(share * self.pressure) - share * (turning @ radius.ravel())
                tangent = self._tangent(0, share * self.pressure) - share * turning
                step = splu(self._inside(tangent)).solve(-rest[self._free])
                self.displacement.ravel()[self._free] += step
                if np.abs(step).max() < _SMALL:
                    break
            else:
                raise ConvergenceError(f"inflation stops at {share:g} of {self.pressure:g} Pa")

    def frequencies(self, wave: int, count: int) -> np.ndarray:
        """The `count` lowest frequencies (Hz) of a wave, rim held, dynamic moduli; pairs once."""
        squares, _, _ = self._lowest(wave, count, self.mass)
        return np.sqrt(np.sort(squares)) / (2 * np.pi)

    def rigid_modes(self) -> list[RigidMode]:
        """The four modes of the belt as a rigid ring on its sidewalls, rim held, dynamic moduli.

        Of the lowest of wave numbers 0 and 1 those that have most of the ring's mass in its motion. The
        damping ratio is half the loss factors weighted with the strain energy of the compounds; the
        wall's own part alone, without tension and pressure, loses.
        """
        r, y = self.section.nodes.T
        one, none = np.ones_like(r), np.zeros_like(r)
        motions = {
            "lateral": (0, np.stack([none, none, one], axis=-1)),
            "windup": (0, np.stack([none, r, none], axis=-1)),
            "vertical": (1, np.stack([one, 1j * one, none], axis=-1)),
            "yaw": (1, np.stack([-y, -1j * y, r], axis=-1)),
        }
        shapes = []
        for wave in (0, 1):
            squares, loss, fields = self._lowest(wave, 3, self.mass)
            whole = np.zeros((self._size, fields.shape[1]), complex)
            whole[self._free] = fields
            heavy = self.mass @ whole
            sizes = np.einsum("ik,ik->k", whole.conj(), heavy).real
            for name, (own, motion) in motions.items():
                if own != wave:
                    continue
                around = np.pi if wave else 2 * np.pi
                parts = np.abs(motion.ravel().conj() @ heavy) ** 2 / sizes * around
                k = int(parts.argmax())
                frequency = float(np.sqrt(squares[k]) / (2 * np.pi))
                shapes.append(RigidMode(name, frequency, float(loss[k] / 2), float(parts[k])))
        return shapes

    def _of_kind(self, wave: int, share: np.ndarray) -> sparse.csr_matrix:
        """The wall's own stiffness at a wave number, times a `share` of each cell."""
        return self._wall(wave, [share[:, None, None, None] * own for _, own in self._inflated])

    def _dynamic_stiffness(self, wave: int) -> Callable[[float], sparse.csc_matrix]:
        """The complex stiffness of small motions of a wave, free unknowns, by frequency (Hz)."""
        whole = self._inside(self._tangent(wave, self.pressure, dynamic=True))
        parts = [(k, self._inside(self._of_kind(wave, s))) for k, s in self._kinds.items()]

        def at(frequency: float) -> sparse.csc_matrix:
            moduli = [kind.modulus(abs(frequency)) for kind, _ in parts]
            found = moduli if frequency >= 0 else np.conj(moduli)
            return whole + sum((k - 1) * part for k, (_, part) in zip(found, parts, strict=True))

        return at

    def _carried(self, wave: int) -> sparse.csr_matrix:
        """M C_n of a wave that rests in space while the tire turns through it."""
        return _inertia(self.mass, self._turned, wave, 0.0, 1.0)

    @cached_property
    def _turned(self) -> tuple[sparse.csr_matrix, sparse.csr_matrix]:
        """M J and M J^2."""
        turns = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
        everywhere = sparse.kron(sparse.eye(len(self.section.nodes)), turns, format="csr")
        return self.mass @ everywhere, self.mass @ everywhere @ everywhere

    def standing(self, wave: int) -> tuple[float, float]:
        """The lowest speed (rad/s) at which a wave stands on the road, and y (m) where it is largest.

        The rubber feels it at the wave number times the wheel's frequency.
        """
        squares, _, fields = self._lowest(wave, 1, self._carried(wave), per_turn=wave)
        whole = np.zeros(self._size, complex)
        whole[self._free] = fields[:, 0]
        largest = int(np.linalg.norm(whole.reshape(-1, 3), axis=1).argmax())
        return float(np.sqrt(squares[0])), float(self.section.nodes[largest, 1])

    def patch(self, y: float, half_width: float) -> np.ndarray:
        """Weights (n,) of the nodes in the mean over a strip of the outer face about `y`, m."""
        chain = self.section.chain(self.section.outer)
        places = self.section.nodes[chain, 1] + self.displacement[chain, 2]
        weights = np.zeros(len(self.section.nodes))
        weights[chain] = mean_over(places, y, half_width)
        return weights

    def receptance(
        self,
        weights: np.ndarray,
        half_angle: float,
        frequency: np.ndarray,
        angles: np.ndarray,
        waves: int = 80,
        speed: float = 0.0,
    ) -> np.ndarray:
        """Radial motion over a radial force spread on a patch (f, a), m/N, at angles from it; the tire stands, or turns at a
        `speed` W (rad/s) towards larger angles while force and reader rest in space.

        The patch has `weights` (n,) across (`patch`) and a `half_angle` (rad) around. By direct solution for every
        wave number up to `waves`, with complex moduli at every `frequency` (Hz):

            H = sum_n e^(i n angle) sinc(n half_angle)^2 w . (K_n*(omega + n W) + M (i omega + W (i n + J))^2)^-1 w / 2 pi

        over positive and negative n, which are alike standing. Tension is that of the ring's own speed.
        """
        load, out = self._radial(weights), np.zeros((len(frequency), len(angles)), complex)
        for wave in range(-waves if speed else 0, waves + 1):
            stiffness, share = self._dynamic_stiffness(wave), patch_share(abs(wave), half_angle)
            around = np.exp(1j * wave * angles) / 2 if speed and wave else np.cos(wave * angles)
            for row, f in zip(out, frequency, strict=True):
                inertia = self._inside(
                    _inertia(self.mass, self._turned, wave, 2 * np.pi * f, speed)
                )
                dynamic = stiffness(f + wave * speed / (2 * np.pi)) - inertia
                row += share * around * (load @ splu(dynamic).solve(load))
        return out

    def flexibility(self, wave: int, weights: np.ndarray) -> float:
        """w . K_n^-1 w, m rad/N, with static moduli."""
        load = self._radial(weights)
        stiffness = self._inside(self._tangent(wave, self.pressure))
        return float((load @ splu(stiffness.astype(complex)).solve(load)).real)

    def resting(self, wave: int, weights: np.ndarray, speed: float, lowest: float) -> complex:
        """w . (K_n*(n speed) - speed^2 M C_n)^-1 w, m rad/N, of a wave that rests while the tire turns at a `speed` (rad/s).

        Moduli are those that slow motions meet (fem.tire.material.Kind.slow_modulus), `lowest` the frequency (Hz) of
        the lowest mode; tension is that of the ring's own speed.
        """
        load, passing = self._radial(weights), wave * speed / (2 * np.pi)
        stiffness = self._inside(self._tangent(wave, self.pressure, dynamic=True)).astype(complex)
        for kind, share in self._kinds.items():
            stored = float(kind.slow_modulus(np.array([passing]), lowest)[0])
            lost = kind.modulus(passing).imag / kind.modulus(passing).real if wave else 0.0
            part = self._inside(self._of_kind(wave, share))
            stiffness += (stored * (1 + 1j * lost) - 1) * part
        stiffness -= speed**2 * self._inside(self._carried(wave))
        return complex(load @ splu(stiffness.tocsc()).solve(load))

    def modes(self, wave: int, weights: np.ndarray, count: int = 150) -> SectionModes:
        """The `count` lowest modes of a wave, and what of them a load of `weights` (n,) across sees."""
        load, mass = self._radial(weights), self._inside(self.mass).toarray()
        stiffness = self._inside(self._tangent(wave, self.pressure, dynamic=True)).toarray()
        squares, fields = eigh(
            (stiffness + stiffness.T.conj()) / 2, mass, subset_by_index=[0, count - 1]
        )
        wall = [self._of_kind(wave, share) for share in self._kinds.values()]
        among = [fields.T.conj() @ (self._inside(part) @ fields) for part in (*wall, *self._turned)]
        return SectionModes(
            wave=wave,
            squares=squares,
            push=fields.T.conj() @ load,
            parts=among[:-2],
            turned=among[-2:],
            flexibility=float((load @ np.linalg.solve(stiffness, load)).real),
        )

    def rolling(
        self, weights: np.ndarray, half_angle: float, waves: int = 60
    ) -> tuple[float, float]:
        """Deflection over a radial load on a patch, m/N, and braking moment over its square, N m/N2.

        The load, spread as in `receptance`, rests in space while the tire turns through it at its `speed` W:

            a_n = w . (K_n*(n W) - W^2 M C_n)^-1 w,  u / F = sum_n s_n Re a_n,  T / F^2 = -sum_n n s_n Im a_n

        with s_n = (2 or 1) sinc(n half_angle)^2 / 2 pi.  Linear about the inflated tire; friction and the
        shear that it makes in the tread are left out.
        """
        load, deflection, moment = self._radial(weights), 0.0, 0.0
        for wave in range(waves + 1):
            stiffness = self._dynamic_stiffness(wave)(wave * self.speed / (2 * np.pi))
            inertia = self.speed**2 * self._inside(self._carried(wave))
            answer = load @ splu(stiffness - inertia).solve(load)
            deflection += patch_share(wave, half_angle) * answer.real
            moment -= wave * patch_share(wave, half_angle) * answer.imag
        return float(deflection), float(moment)

    def _radial(self, weights: np.ndarray) -> np.ndarray:
        load = np.zeros(self._size, complex)
        load[::3] = weights
        return load[self._free]

    def _lowest(
        self, wave: int, count: int, mass: sparse.spmatrix, per_turn: int = 1
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Eigenvalues nearest to zero of the dynamic stiffness of a wave and a Hermitian `mass`.

        At the moduli of their own frequencies (`own_moduli`), which are `per_turn` times their roots; with
        loss factors and fields.
        """
        stiffness, mass = (
            self._inside(sparse.csr_matrix(matrix))
            for matrix in (self._tangent(wave, self.pressure, dynamic=True), mass)
        )
        both = [(matrix + matrix.getH()) / 2 for matrix in (stiffness, mass)]
        squares, fields = eigsh(both[0], count, M=both[1], sigma=0.0, which="LM")
        sizes = np.einsum("ik,ik->k", fields.conj(), both[1] @ fields).real
        own = [self._inside(self._of_kind(wave, share)) @ fields for share in self._kinds.values()]
        stored = [np.einsum("ik,ik->k", fields.conj(), part).real / sizes for part in own]
        known = np.array(stored).reshape(-1, count)
        rise, loss = own_moduli(per_turn**2 * squares, per_turn**2 * known, list(self._kinds))
        return squares + rise / per_turn**2, loss, fields

    @property
    def kinds(self) -> list[Kind]:
        """The kinds of its compounds."""
        return list(self._kinds)

    @property
    def weight(self) -> float:
        """Mass of wall and cords, kg."""
        along = np.tile([0.0, 0.0, 1.0], len(self.section.nodes))
        return float(2 * np.pi * along @ (self.mass @ along))

    @cached_property
    def mass(self) -> sparse.csr_matrix:
        """Mass matrix over one radian."""
        rule = self._parts[0][0]
        blocks = np.einsum("qa,qb,cq,c->cab", rule.N, rule.N, rule.volume, self._density)
        out = self._assembled(self.section.cells, _each_component(blocks))
        for cords, edges in self._cords:
            line = CordElements(self.section, edges, cords, self.section.order + 1)
            heavy = cords.density * cords.area / cords.spacing * line.area
            blocks = np.einsum("qa,qb,cq->cab", line.N, line.N, heavy)
            out = out + self._assembled(line.nodes, _each_component(blocks))
        return out

    def _residual(self, pressure: float) -> np.ndarray:
        out, u = np.zeros(self._size), self.displacement
        for rule, stress in self._parts:
            G, own = rule.gradient(0), dofs(self.section.cells)
            F = _deformation(G, u.ravel()[own])
            force = np.einsum("cqhd,cqh,cq->cd", G, _flat(stress(F)), rule.volume)
            np.add.at(out, own, force)
        for cords, edges in self._cords:
            line = CordElements(self.section, edges, cords, self.section.order)
            along, tension, _ = line.state(u)
            force = np.einsum("cqkd,cqk,cq->cd", line.stretch(0), tension * along, line.area)
            np.add.at(out, dofs(line.nodes), force)
        face = InnerFace(self.section, u)
        np.add.at(out, dofs(face.nodes), pressure * face.force())
        return out

    def _strained(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Deformation gradient (c, q, 3, 3) and moduli (c, q, 9, 9) Pa of both parts in the present state."""
        u = self.displacement.ravel()[dofs(self.section.cells)]
        every = [(_deformation(rule.gradient(0), u), stress) for rule, stress in self._parts]
        return [(F, _moduli(stress, F)) for F, stress in every]

    @cached_property
    def _inflated(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Moduli of both parts in the inflated state, whole and without those of the tension."""
        every = zip(self._parts, self._strained(), strict=True)
        return [(A, _own(stress, F, A)) for (_, stress), (F, A) in every]

    def _wall(self, wave: int, moduli: Sequence[np.ndarray]) -> sparse.csr_matrix:
        out: sparse.spmatrix = sparse.csr_matrix((self._size, self._size))
        for (rule, _), A in zip(self._parts, moduli, strict=True):
            G = rule.gradient(wave)
            blocks = np.einsum("cqhi,cqhk,cqkj,cq->cij", G.conj(), A, G, rule.volume, optimize=True)
            out = out + self._assembled(self.section.cells, blocks)
        return sparse.csr_matrix(out)

    def _tangent(self, wave: int, pressure: float, dynamic: bool = False) -> sparse.csr_matrix:
        """The tangent of the present state; `dynamic`: of small motions about the inflated one."""
        face, u = InnerFace(self.section, self.displacement), self.displacement
        if dynamic:
            excess = (self._dynamic - 1)[:, None, None, None]
            moduli = [A + excess * own for A, own in self._inflated]
        else:
            moduli = [A for _, A in self._strained()]
        out = self._wall(wave, moduli) + pressure * self._assembled(face.nodes, face.tangent(wave))
        for cords, edges in self._cords:
            line = CordElements(self.section, edges, cords, self.section.order)
            _, _, B = line.state(u)
            Z = line.stretch(wave)
            blocks = np.einsum("cqki,cqkm,cqmj,cq->cij", Z.conj(), B, Z, line.area, optimize=True)
            out = out + self._assembled(line.nodes, blocks)
        return out

    def _assembled(self, nodes: np.ndarray, blocks: np.ndarray) -> sparse.csr_matrix:
        own = dofs(nodes)
        rows = np.repeat(own, own.shape[1], axis=1).ravel()
        columns = np.tile(own, (1, own.shape[1])).ravel()
        return sparse.csr_matrix((blocks.ravel(), (rows, columns)), (self._size, self._size))

    def _inside(self, matrix: sparse.csr_matrix) -> sparse.csc_matrix:
        return matrix[self._free][:, self._free].tocsc()


def patch_share(wave: int, half_angle: float) -> float:
    """Share of a wave in the mean over a patch of a load on it, 1/rad."""
    return float((2 if wave else 1) * np.sinc(wave * half_angle / np.pi) ** 2 / (2 * np.pi))


def _each_component(blocks: np.ndarray) -> np.ndarray:
    size = 3 * blocks.shape[1]
    return np.einsum("cab,xy->caxby", blocks, _UNIT).reshape(-1, size, size)


def _flat(F: np.ndarray) -> np.ndarray:
    return F.reshape(*F.shape[:-2], 9)


def _deformation(G: np.ndarray, u: np.ndarray) -> np.ndarray:
    return np.einsum("cqhd,cd->cqh", G, u).reshape(*G.shape[:2], 3, 3) + _UNIT


def _distortion(shear: np.ndarray, F: np.ndarray) -> np.ndarray:
    """P of mu/2 (J^(-2/3) I1 - 3), Pa."""
    J, I1 = np.linalg.det(F)[..., None, None], (F * F).sum(axis=(-1, -2), keepdims=True)
    return shear * J ** (-2 / 3) * (F - I1 / 3 * np.swapaxes(np.linalg.inv(F), -1, -2))


def _dilatation(bulk: np.ndarray, F: np.ndarray) -> np.ndarray:
    """P of kappa/2 (J - 1)^2, Pa."""
    J = np.linalg.det(F)[..., None, None]
    return bulk * (J - 1) * J * np.swapaxes(np.linalg.inv(F), -1, -2)


def _moduli(stress: Callable[[np.ndarray], np.ndarray], F: np.ndarray) -> np.ndarray:
    """dP/dF (c, q, 9, 9) by complex steps, exact to rounding."""
    out, step = np.empty((*F.shape[:-2], 9, 9)), 1e-30
    for k in range(9):
        moved = F.astype(complex)
        moved[..., k // 3, k % 3] += 1j * step
        out[..., k] = _flat(stress(moved).imag / step)
    return out


def _own(
    stress: Callable[[np.ndarray], np.ndarray], F: np.ndarray, moduli: np.ndarray
) -> np.ndarray:
    """The part of dP/dF (c, q, 9, 9) that the wall's own moduli make, without that of its tension."""
    turning = np.einsum("ij,cqab->cqiajb", _UNIT, np.linalg.solve(F, stress(F)))
    return moduli - turning.reshape(moduli.shape)


def lowest(tire: InflatedRing, waves: Sequence[int] = (0, 1)) -> np.ndarray:
    """The two lowest frequencies (Hz) by wave number: lateral, wind-up; yaw/camber, vertical."""
    return np.concatenate([tire.frequencies(wave, 2) for wave in waves])
