"""Losses of the rubber of a rolling tire by the deformation that stands on the road, and the forces by which it loses.

Material passes the static state with w = -r d/dtheta (per unit Omega, theta as in fem.tire.mesh.position). Its second
Piola-Kirchhoff stress in cylindrical components, a Fourier series around each circle of points of the undeformed ring,

    S(theta) = sum_n S_n e^{i n theta},

changes n Omega / 2 pi times a second. In finite linear viscoelasticity (J. C. Simo, Comput. Methods Appl. Mech. Eng. 60
(1987) 153) each component is multiplied by E*(n Omega) / E, of which the loss modulus adds the stress

    S_v = sum_n -i sign(n) (E''(|n| Omega) / E) S_n e^{i n theta}

in phase with the rate. Its virtual work, a force f on the tire without resultant and without moment about the axle, and the power lost

    f . v = -int F S_v : sym grad v,    P = int S_v : dE/dt = 2 pi Omega sum_n |n| (E'' / E) int S_n : conj(E_n) r dr dy

with the Green-Lagrange strain E. Between the Gauss points of an element around S is a polynomial, whose Fourier integrals
are exact, and S_v is projected on these polynomials, so that waves shorter than elements do not turn into longer ones. The
series ends with waves two nodes long where elements are shortest: what jumps between elements would go on for ever.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import basix
import numpy as np
import ufl

from tireroad.fem import compat, kinematics
from tireroad.fem.collective import summed
from tireroad.fem.static.virtual_work import second_stress
from tireroad.fem.tire.body import Body
from tireroad.fem.tire.material import Kind

Array = np.ndarray

_FULL, _REDUCED = (
    1,
    0,
)  # Gauss points around beyond the elements' order, for distortion and dilatation
_ACROSS = 3  # Gauss points per radian of a wave within an element, for its Fourier integrals, and so many more


@dataclass(frozen=True, kw_only=True)
class RollingLoss:
    """Losses of the deformation that stands on the road.

    `force` (n, 3) N on all nodes of the lattice; `power` (k, n) W by kind of compounds (`kinds`, k) and number of waves, from 1
    on; `speed` rad/s.
    """

    force: Array
    power: Array
    kinds: list[Kind]
    speed: float

    @property
    def whole(self) -> float:
        """Power lost, W."""
        return float(self.power.sum())

    @property
    def frequency(self) -> Array:
        """Frequency (k,) Hz at which each kind is deformed: the mean over what it loses; 0 where it loses nothing."""
        waves, lost = np.arange(1, self.power.shape[1] + 1), self.power.sum(axis=1)
        mean = np.divide(self.power @ waves, lost, out=np.zeros(len(lost)), where=lost > 0)
        return abs(self.speed) / (2 * np.pi) * mean


def rolling_loss(body: Body, speed: float) -> RollingLoss:
    """The losses of a tire that rolls at a `speed` (rad/s) through its present displacement. Collective."""
    waves, kinds = np.arange(1, _highest(body) + 1), [kind for kind, _ in body.wall.kinds()]
    lost = np.array([[kind.modulus(f).imag for f in _passing(waves, speed)] for kind in kinds])
    force, power = _worked(body, waves, -1j * np.sign(speed) * lost.reshape(len(kinds), len(waves)))
    return RollingLoss(
        force=force, power=abs(speed) * waves * np.abs(lost) * power, kinds=kinds, speed=speed
    )


def stiffening_force(body: Body, speed: float, lowest: float) -> Array:
    """Forces (n, 3) N on all nodes by the storage moduli that a rolling tire has beyond those of its static state.

    S + S_v with E'(|n| Omega) / E - 1 in place of the loss modulus, for n from 1 on: the static moduli at the rate of loading are
    those of n = 0. `lowest`: frequency of the lowest mode, Hz (Kind.slow_modulus). Collective.
    """
    waves, kinds = np.arange(1, _highest(body) + 1), [kind for kind, _ in body.wall.kinds()]
    rise = np.array(
        [kind.slow_modulus(_passing(waves, speed), lowest) - kind.static for kind in kinds]
    )
    return _worked(body, waves, rise.reshape(len(kinds), len(waves)).astype(complex))[0]


def _passing(waves: Array, speed: float) -> Array:
    """Frequencies, Hz, at which the rubber meets waves that stand on the road."""
    return waves * abs(speed) / (2 * np.pi)


def _worked(body: Body, waves: Array, moduli: Array) -> tuple[Array, Array]:
    """Forces (n, 3) N on the nodes of the lattice by the stress sum_n c_n S_n e^{i n theta}, real, c_n the `moduli` (k, n) of the
    kinds times their share of the static one; and 4 pi times int share S_n : conj(E_n) r dr dy (k, n), J. Collective."""
    shares = [share.x.array for _, share in body.wall.kinds()]
    held, nodal = np.zeros(moduli.shape), np.zeros((body.lattice.size, 3))
    for part, more in enumerate((_FULL, _REDUCED)):
        ring = _Ring(body, part, body.ring.order + more)
        stress, strain = (ring.series(waves, values) for values in (ring.stress, ring.strain))
        each = np.einsum("nsij,nsij->ns", stress, strain.conj()).real
        held += 4 * np.pi * ring.own_share(shares) @ (each * ring.volume).T
        for own, share in zip(moduli, shares, strict=True):
            changed = ring.projected(waves, own[:, None, None, None] * stress)
            nodal -= ring.assembled(changed, share)
    return summed(body.comm, nodal), held


def _highest(body: Body) -> int:
    """Number of waves around that are two nodes long where elements are shortest."""
    return int(np.pi * body.ring.order / np.diff(body.ring.ring_corners).min())


class _Ring:
    """The Gauss points of all elements, `count` in each direction, as circles (a, s) around the axle.

    `stress` and `strain` (a, s, 3, 3), S in Pa and E in radial, axial and tangential components, on every process; `volume`
    (s,) m3 per radian. `part` of the stress as in `second_stress`. Collective to make.
    """

    def __init__(self, body: Body, part: int, count: int) -> None:
        self._body, self._count = body, count
        line, weights = np.polynomial.legendre.leggauss(count)
        self._line, self._weights = (line + 1) / 2, weights / 2
        corners = body.ring.ring_corners
        self._length = np.diff(corners)
        self._start = corners[:-1]
        mesh, section = body.mesh, body.ring.section
        self._cells = np.arange(mesh.topology.index_map(3).size_local)
        original = np.asarray(mesh.topology.original_cell_index)[self._cells]
        self._segment, self._place = np.divmod(original, len(section.cells))
        self._points = np.array(list(product(self._line, repeat=3)))
        self._evaluate(part, np.prod(list(product(self._weights, repeat=3)), axis=1))

    def _evaluate(self, part: int, weights: Array) -> None:
        body, cells = self._body, self._cells
        F = kinematics.deformation_gradient(body.u)
        C, X = F.T * F, ufl.SpatialCoordinate(body.mesh)
        J = ufl.Jacobian(body.mesh)
        tensors = second_stress(body, part, C), (C - ufl.Identity(3)) / 2, F, ufl.inv(J)
        values = [one[i, j] for one in tensors for i in range(3) for j in range(3)]
        values += [ufl.det(J), X[0], X[2]]
        found = compat.evaluate(ufl.as_vector(values), self._points, body.mesh, cells)
        stress, strain, self._gradient, self._inverse = (
            found[..., 9 * k : 9 * k + 9].reshape(*found.shape[:2], 3, 3) for k in range(4)
        )
        self._volume = np.abs(found[..., 36]) * weights
        angle = np.arctan2(found[..., 37], -found[..., 38])
        sine, cosine, none = np.sin(angle), np.cos(angle), np.zeros_like(angle)
        rows = (sine, none, -cosine), (none, none + 1, none), (cosine, none, sine)
        self._turn = np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
        self.stress, self.strain = (
            self._around(np.einsum("cqij,cqjk,cqlk->cqil", self._turn, one, self._turn))
            for one in (stress, strain)
        )
        self.volume = self._around(self._volume).sum(axis=0) / (2 * np.pi)

    @property
    def _grid(self) -> tuple[Array, Array]:
        """Places (c, n, n^2) in the circles of points, (a, s), of own cells."""
        n = self._count
        around = self._segment[:, None] * n + np.arange(n)
        across = self._place[:, None] * n**2 + np.arange(n**2)
        return around[:, :, None], across[:, None, :]

    def _around(self, values: Array) -> Array:
        """Values (a, s, ...) on every process of those (c, q, ...) of own cells. Collective."""
        n, body = self._count, self._body
        shape = len(self._length) * n, len(body.ring.section.cells) * n**2
        out = np.zeros((*shape, *values.shape[2:]))
        out[self._grid] = values.reshape(len(values), n, n**2, *values.shape[2:])
        return summed(body.comm, out)

    def own_share(self, shares: list[Array]) -> Array:
        """Shares (k, s) by circle of shares by cell, which are alike around. Collective."""
        ones = np.ones((len(self._cells), self._count**3))
        every = [self._around(share[self._cells][:, None] * ones)[0] for share in shares]
        return np.array(every).reshape(len(shares), -1)

    def _fourier(self, waves: Array) -> Iterator[tuple[slice, Array]]:
        """Parts of the points around, and (n, count): int L_a(theta) e^{-i n theta} dtheta of their polynomials L_a."""
        n = self._count
        basis = np.linalg.inv(np.vander(self._line, increasing=True))
        for k, (start, length) in enumerate(zip(self._start, self._length, strict=True)):
            dense = n + int(np.ceil(_ACROSS + length * waves[-1]))
            t, w = np.polynomial.legendre.leggauss(dense)
            t, w = (t + 1) / 2, w / 2 * length
            shapes = np.vander(t, n, increasing=True) @ basis
            wave = np.exp(-1j * np.multiply.outer(waves, start + length * t))
            yield slice(k * n, k * n + n), (wave * w) @ shapes

    def series(self, waves: Array, values: Array) -> Array:
        """Coefficients (n, s, 3, 3) of values (a, s, 3, 3) for the numbers of `waves`."""
        out = np.zeros((len(waves), *values.shape[1:]), complex)
        for some, integral in self._fourier(waves):
            out += np.tensordot(integral, values[some], 1) / (2 * np.pi)
        return out

    def projected(self, waves: Array, series: Array) -> Array:
        """Values (a, s, 3, 3) of a real series, its coefficients (n, s, 3, 3) from n = 1 on, as polynomials of the elements."""
        out = np.empty((len(self._length) * self._count, *series.shape[1:]))
        for k, (some, integral) in enumerate(self._fourier(waves)):
            share = (integral / (self._weights * self._length[k])).conj().T
            out[some] = 2 * np.tensordot(share, series, 1).real
        return out

    def assembled(self, stress: Array, share: Array) -> Array:
        """int share F S : grad v (nodes of the lattice, 3) N of own cells, S (a, s, 3, 3) in components of the circles."""
        body, own = self._body, stress[self._grid].reshape(len(self._cells), -1, 3, 3)
        own = np.einsum("cqji,cqjk,cqkl->cqil", self._turn, own, self._turn)
        family, cell = basix.ElementFamily.P, basix.CellType.hexahedron
        variant = basix.LagrangeVariant.gll_warped
        element = basix.create_element(family, cell, body.ring.order, variant)
        slopes = element.tabulate(1, self._points)[1:].reshape(3, len(self._points), -1)
        weight = self._volume * share[self._cells][:, None]
        work = np.einsum(
            "cq,cqij,cqjk,cqlk,lqa->cai",
            weight, self._gradient, own, self._inverse, slopes, optimize=True,
        )  # fmt: skip
        out = np.zeros((body.lattice.size, 3))
        ids = body.lattice.cells()[self._original]
        np.add.at(out, ids, work)
        return out

    @property
    def _original(self) -> Array:
        """Numbers of own cells in the lattice."""
        return self._segment * len(self._body.ring.section.cells) + self._place
