"""Contributions of a section to the problem of a wave number: cells, lines of cords, inner face."""

from __future__ import annotations

import numpy as np

from tireroad.fem.sections import mesh2d
from tireroad.fem.sections.construction import CordLine
from tireroad.fem.sections.mesh2d import SectionMesh

_UNIT = np.eye(3)


class Rule:
    """Gauss points of the cells: shapes N (q, a), slopes, radius, volume (c, q) per radian."""

    def __init__(self, section: SectionMesh, points: int):
        edge, (t, w) = mesh2d.equispaced(section.order), _gauss(points)
        at = mesh2d.grid_points(t)
        value, slope = ([shape(edge, x) for x in at] for shape in (mesh2d.line, mesh2d.line_slope))
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


class Line:
    """Cords on a chain of edges: F a at each Gauss point, with the cord's direction a."""

    def __init__(self, section: SectionMesh, edges: np.ndarray, cords: CordLine, points: int):
        order, chain = section.order, section.chain(edges)
        self.nodes = chain[order * np.arange(len(edges))[:, None] + np.arange(order + 1)]
        edge, (t, w) = mesh2d.equispaced(order), _gauss(points)
        self.N, slope = mesh2d.line(edge, t), mesh2d.line_slope(edge, t)
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


class Face:
    """The deformed inner face: x_s, x_theta, and the force of a unit pressure."""

    def __init__(self, section: SectionMesh, displacement: np.ndarray):
        self.nodes = section.side(section.inner)
        edge, (t, self._w) = mesh2d.equispaced(section.order), _gauss(section.order + 2)
        self._N, self._slope = mesh2d.line(edge, t), mesh2d.line_slope(edge, t)
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
