"""Small motions of an unloaded ring: Fourier series around, finite elements in the section.

  u(r, y, theta) = Re[v(r, y) e^{i n theta}],   K_n v = omega^2 M v   for each wave number n,

linear elasticity in cylindrical coordinates, exact around the axle, with lines of cords as
membranes: a reference for the program's three-dimensional meshes. Uses no dolfinx and shares no
code with the program's forms.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import eigsh

from tireroad.fem.sections import mesh2d
from tireroad.fem.sections.mesh2d import SectionMesh


@dataclass(frozen=True)
class Rubber:
    """Linear elasticity: E in Pa, Poisson's ratio, density in kg/m3."""

    youngs_modulus: float
    poisson_ratio: float
    density: float


@dataclass(frozen=True)
class Membrane:
    """Cords on a ply: E A / s in N/m, rho A / s in kg/m2, angle in rad to the circumference."""

    stiffness: float
    angle: float
    mass: float = 0.0


def frequencies(
    section: SectionMesh,
    rubbers: Mapping[str, Rubber],
    wave: int,
    count: int,
    cords: Mapping[str, Membrane] | None = None,
) -> np.ndarray:
    """The `count` lowest frequencies (Hz) of a wave number, rim held; one per pair if n > 0."""
    stiffness, mass = _solid(section, rubbers, wave)
    for name, membrane in (cords or {}).items():
        more, heavier = _cords(section, section.plies[name], membrane, wave)
        stiffness, mass = stiffness + more, mass + heavier
    held = np.unique(section.side(section.rim))
    free = np.setdiff1d(np.arange(len(section.nodes)), held)
    dofs = (3 * free[:, None] + np.arange(3)).ravel()
    K, M = stiffness[dofs][:, dofs].tocsc(), mass[dofs][:, dofs].tocsc()
    squares = eigsh(K, count, M, sigma=0.0, which="LM", return_eigenvectors=False)
    return np.sqrt(np.sort(squares)) / (2 * np.pi)


def lowest(section, rubbers, count: int, waves: int = 16, cords=None) -> np.ndarray:
    """The lowest `count` frequencies (Hz) of the whole ring, with pairs counted twice."""
    found = [
        np.repeat(frequencies(section, rubbers, n, 8, cords), 1 if n == 0 else 2)
        for n in range(waves)
    ]
    return np.sort(np.concatenate(found))[:count]


def _rule(order: int) -> tuple[np.ndarray, np.ndarray]:
    points, weights = np.polynomial.legendre.leggauss(order + 2)
    return points / 2 + 0.5, weights / 2


def _solid(section: SectionMesh, rubbers: Mapping[str, Rubber], n: int):
    """K_n and M of the rubber, over one radian."""
    edge, (t, w) = mesh2d.equispaced(section.order), _rule(section.order)
    xi, eta = mesh2d.grid_points(t)
    weight = np.outer(w, w).ravel()
    value = [mesh2d.lagrange(edge, x) for x in (xi, eta)]
    slope = [mesh2d.lagrange_slope(edge, x) for x in (xi, eta)]
    N = mesh2d.tensor(*value)
    dN = np.stack([mesh2d.tensor(slope[0], value[1]), mesh2d.tensor(value[0], slope[1])])
    points = section.nodes[section.cells]
    J = np.einsum("dqa,cax->cqxd", dN, points)
    r = np.einsum("qa,ca->cq", N, points[..., 0])
    volume = np.linalg.det(J) * weight * r
    gradient = np.einsum("dqa,cqdx->cqax", dN, np.linalg.inv(J))
    B = _strains(N, gradient, r, n)
    materials = [rubbers[name] for name in section.regions]
    D = np.array([_hooke(m) for m in materials])[section.region]
    rho = np.array([m.density for m in materials])[section.region]
    K = np.einsum("cqsi,cst,cqtj,cq->cij", B.conj(), D, B, volume, optimize=True)
    m = np.einsum("qa,qb,cq,c->cab", N, N, volume, rho, optimize=True)
    M = np.einsum("cab,xy->caxby", m, np.eye(3)).reshape(K.shape)
    return _assembled(section, section.cells, K), _assembled(section, section.cells, M)


def _strains(N: np.ndarray, gradient: np.ndarray, r: np.ndarray, n: int) -> np.ndarray:
    """B (cells, points, 6, dofs) of (e_rr, e_tt, e_yy, g_rt, g_ty, g_ry), nodal dofs (r, t, y)."""
    dr, dy = gradient[..., 0], gradient[..., 1]
    over = N / r[..., None]
    B = np.zeros((*r.shape, 6, N.shape[1], 3), complex)
    B[..., 0, :, 0], B[..., 2, :, 2] = dr, dy
    B[..., 1, :, 0], B[..., 1, :, 1] = over, 1j * n * over
    B[..., 3, :, 0], B[..., 3, :, 1] = 1j * n * over, dr - over
    B[..., 4, :, 1], B[..., 4, :, 2] = dy, 1j * n * over
    B[..., 5, :, 0], B[..., 5, :, 2] = dy, dr
    return B.reshape(*r.shape, 6, -1)


def _hooke(rubber: Rubber) -> np.ndarray:
    E, nu = rubber.youngs_modulus, rubber.poisson_ratio
    shear, lame = E / (2 * (1 + nu)), E * nu / ((1 + nu) * (1 - 2 * nu))
    D = np.diag([2 * shear] * 3 + [shear] * 3)
    D[:3, :3] += lame
    return D


def _cords(section: SectionMesh, edges: np.ndarray, cords: Membrane, n: int):
    """K_n and M of cords on a ply, over one radian; strain along the cord from the ply's own."""
    chain = section.chain(edges)
    order = section.order
    line = chain[order * np.arange(len(edges))[:, None] + np.arange(order + 1)]
    edge, (t, w) = mesh2d.equispaced(order), _rule(order)
    N, slope = mesh2d.lagrange(edge, t), mesh2d.lagrange_slope(edge, t)
    points = section.nodes[line]
    r = np.einsum("qa,ca->cq", N, points[..., 0])
    tangent = np.einsum("qa,cax->cqx", slope, points)
    length = np.linalg.norm(tangent, axis=2)
    tangent = tangent / length[..., None]
    along = slope / length[..., None]
    cosine, sine = np.cos(cords.angle), np.sin(cords.angle)
    over = N / r[..., None]
    tr, ty = tangent[..., 0, None], tangent[..., 1, None]
    B = np.zeros((*r.shape, order + 1, 3), complex)
    # e_tt = (i n v_t + v_r)/r,  e_ss = t . dv/ds,  g_ts = dv_t/ds - t_r v_t/r + i n t . v/r
    B[..., 0] = cosine**2 * over + sine**2 * tr * along + sine * cosine * 1j * n * tr * over
    B[..., 1] = cosine**2 * 1j * n * over + sine * cosine * (along - tr * over)
    B[..., 2] = sine**2 * ty * along + sine * cosine * 1j * n * ty * over
    B = B.reshape(*r.shape, -1)
    area = length * w * r
    K = cords.stiffness * np.einsum("cqi,cqj,cq->cij", B.conj(), B, area)
    m = cords.mass * np.einsum("qa,qb,cq->cab", N, N, area)
    M = np.einsum("cab,xy->caxby", m, np.eye(3)).reshape(K.shape)
    return _assembled(section, line, K), _assembled(section, line, M)


def _assembled(section: SectionMesh, nodes: np.ndarray, blocks: np.ndarray) -> sparse.csr_matrix:
    dofs = (3 * nodes[:, :, None] + np.arange(3)).reshape(len(nodes), -1)
    rows = np.repeat(dofs, dofs.shape[1], axis=1).ravel()
    columns = np.tile(dofs, (1, dofs.shape[1])).ravel()
    size = 3 * len(section.nodes)
    return sparse.csr_matrix((blocks.ravel(), (rows, columns)), (size, size))
