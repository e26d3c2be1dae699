"""Geometry of the cavity, and the volume displaced by motions of the tire's wall.

    int chi dV = closed int chi rho/2 e_rho . n dS,
    int chi dA dtheta = closed int chi e_rho . n dS,
    flux_f(u) = closed int chi_f u . n dS = d/de int chi_f dV of the shape x + e u,

over the deformed inner face and the cone between its two bead ends, which belongs to the rim; n
points out of the air, rho is the distance from the axle, chi_f = 1, cos n theta, sin n theta with
theta of the deformed position.

Coupling of the duct's air to the full matrices of one body, as a low-rank term.

A motion u of the tire drives the air by e u, e (1 + a, n) being rows over the unknowns; the air
adds e^T W(s) e to the full matrices (fem.cavity.duct.Duct.dynamic_stiffness). Responses of the tire
without air are corrected for it (Woodbury):

    X <- X - V W (1 + e V W)^-1 e X,   X = A^-1 B,  V = A^-1 e^T.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI
from petsc4py import PETSc
from scipy import sparse

from tireroad.fem import compat, kinematics
from tireroad.fem.cavity.duct import Duct, DuctProfile, inflated, modes, waves
from tireroad.fem.collective import summed
from tireroad.fem.errors import InputError
from tireroad.fem.matrices.operators import Unknowns
from tireroad.fem.tire.body import Body
from tireroad.fem.tire.mesh import INNER

WAVES = 24  # of the profile: a footprint of an eighth of the ring has little content beyond
_LEAST = 1e-12  # of a column's largest entry; smaller ones are rounding


class CavityTrace:
    """The inner face of a body at its present displacement, with `count` waves, by default as many
    as its mesh resolves. Collective."""

    def __init__(self, body: Body, count: int | None = None) -> None:
        # Wave numbers above a quarter of the nodes around show only ripples of the mesh.
        self.count = count or max(min(WAVES, len(body.lattice.ring) // 4), 2)
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
        found = DuctProfile(*moments.T)
        volume, area = found.at(np.linspace(0, 2 * np.pi, 8 * self.count))
        if min(volume.min(), area.min()) <= 0:
            raise InputError(
                f"tire.cavity: the section of the air is {1e4 * area.min():.3g} cm2 at its narrowest: the "
                "inner face and the rim enclose no ring of air. Check tire.inner, or leave "
                "[tire.cavity] out."
            )
        return found

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
    zero, one = 0 * angle, 0 * angle + 1
    radial = np.stack([np.sin(angle), zero, -np.cos(angle)])
    around = np.stack([np.cos(angle), zero, np.sin(angle)])
    force = -inward * radial + aside * np.stack([zero, one, zero])
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
    """`duct` on every process; `pushed`: own rows (n, 1 + a) of e^T; `speed` in rad/s."""

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

    def with_air(self, solution: np.ndarray, transposed: bool = False) -> np.ndarray:
        """Own rows (n, p) of static shapes with air, from A^-1 [B, e^T] (n, p + 1 + a). Collective.

        `transposed`: for A^T.
        """
        q = self.pushed.shape[1]
        x, v = solution[:, :-q], solution[:, -q:]
        weight = self.duct.dynamic_stiffness(0.0, self.speed)
        weight = weight.T if transposed else weight
        core = np.eye(q) + self.coupling(v) @ weight
        return x - v @ (weight @ np.linalg.solve(core, self.coupling(x)))

    def following(self, shapes: np.ndarray, transposed: bool = False) -> np.ndarray:
        """The air's coordinates g (a, p) under constant shapes, own rows (n, p). Collective."""
        _, stiffness = self.duct.pencil(self.speed)
        stiffness = stiffness.T if transposed else stiffness
        driven = self.duct.circular[:, None] * self.coupling(shapes)[1:]
        return np.linalg.solve(stiffness, driven)


def make_column(
    body: Body,
    unknowns: Unknowns,
    inflation: float,
    temperature: float,
    speed: float,
    up_to: float | None,
    loss_factor: float | None = None,
) -> Column:
    """The air of a body at its static state, with modes up to `up_to` Hz or, None, `duct.WAVES`. Collective.

    `inflation` Pa above atmospheric pressure, `temperature` K; `loss_factor` as in
    fem.cavity.duct.modes.
    """
    trace = CavityTrace(body)
    gas = inflated(inflation, temperature)
    # One process solves: LAPACK on another might rotate a pair of equal frequencies.
    profile = trace.profile()
    duct = modes(profile, gas, up_to, loss_factor) if body.comm.rank == 0 else None
    duct = body.comm.bcast(duct)
    pushed = trace.columns(unknowns) @ (duct.density * duct.pressure.T)
    return Column(comm=body.comm, duct=duct, pushed=sparse.csr_matrix(pushed), speed=speed)
