"""A ring of equal segments: found from its nodes, verified on its matrix, split by wave number.

With components along and across the ring at each node, the matrix of an axisymmetric state repeats from
segment to segment: blocks A_j between a segment and the j-th after it. The fields

    u_s = Re[e^{i n s alpha} v],  alpha = 2 pi / N,   H_n v = lambda v,   H_n = sum_j e^{i n j alpha} A_j

are left to themselves for each n = 0 ... N / 2, all but the first and an even N's last of them in
pairs. (Thomas, Int. J. Numer. Meth. Eng. 14 (1979) 81.) A ring that is its own mirror image has
H_n real once each node's phase e^{i n delta} and i for motion along the ring are taken out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg, sparse
from scipy.spatial import cKDTree

from tireroad.modal.symmetry import TOLERANCE, Sites

_NEAR = 1e-6  # of the body's size: nodes are each other's images
_LARGEST = 2000  # unknowns a segment: dense problems of this size cost as much as slices
_LONGEST = 4  # nodes a segment along the ring, at most


@dataclass(frozen=True)
class Ring:
    """`turn` (n, n) from the components of all segments, one after the other, to the unknowns; `blocks`
    j -> A_j (d, d); `angle` (d,) within the segment, rad, and `along` (d,) motion along the ring.
    """

    segments: int
    turn: sparse.csr_matrix
    blocks: dict[int, np.ndarray]
    angle: np.ndarray
    along: np.ndarray

    @property
    def waves(self) -> range:
        """Wave numbers n."""
        return range(self.segments // 2 + 1)

    def single(self, n: int) -> bool:
        """Whether the modes of a wave number do not come in pairs."""
        return n == 0 or 2 * n == self.segments

    def matrix(self, n: int) -> tuple[np.ndarray, np.ndarray]:
        """H_n, real where the ring is its own mirror image, and the phases (d,) taken out of its vectors."""
        alpha = 2 * np.pi / self.segments
        H = sum(np.exp(1j * n * alpha * j) * block for j, block in self.blocks.items())
        if self.single(n):
            return np.ascontiguousarray(H.real), np.ones(len(H))
        phase = np.exp(1j * n * self.angle) * np.where(self.along, 1j, 1.0)
        mirrored = phase.conj()[:, None] * H * phase
        largest = np.abs(H).max()
        if np.abs(mirrored.imag).max() <= TOLERANCE * largest:
            return np.ascontiguousarray(mirrored.real), phase
        return H, np.ones(len(phase))

    def values(self, n: int) -> np.ndarray:
        """All eigenvalues of H_n, ascending, once each."""
        return linalg.eigvalsh(self.matrix(n)[0])

    def vectors(self, n: int, count: int) -> np.ndarray:
        """The lowest `count` eigenvectors of H_n, complex (d, count), and the partner after each of a pair."""
        H, phase = self.matrix(n)
        _, found = linalg.eigh(H, subset_by_index=[0, count - 1])
        found = phase[:, None] * found
        if self.single(n):
            return found
        return np.stack([found, -1j * found], axis=-1).reshape(len(found), -1)


@dataclass(frozen=True)
class Wave:
    """The fields of one wave number as an isometry: `wave @ v` is (n, k) from complex v (d, k)."""

    ring: Ring
    number: int

    @property
    def shape(self) -> tuple[int, int]:
        """Unknowns of the ring and dimension of the fields."""
        size = len(self.ring.angle)
        return self.ring.turn.shape[0], size * (1 if self.ring.single(self.number) else 2)

    def __matmul__(self, v: np.ndarray) -> np.ndarray:
        N, n = self.ring.segments, self.number
        phase = np.exp(2j * np.pi * n / N * np.arange(N))
        fields = (phase[:, None, None] * v).real.reshape(-1, v.shape[1])
        scale = np.sqrt((1 if self.ring.single(n) else 2) / N)
        return self.ring.turn @ (scale * fields)


def repeated(matrix: sparse.csr_matrix, sites: Sites) -> Ring | None:
    """The matrix (n, n) as that of equal segments, as many as there are; None where it is none. Not collective."""
    if len(sites.component) % 3 or (sites.component.reshape(-1, 3) != np.arange(3)).any():
        return None
    points = sites.place[::3]
    angle = np.arctan2(points[:, 0], -points[:, 2]) % (2 * np.pi)
    near = _NEAR * np.abs(points).max(initial=0.0)
    circles = np.hypot(points[:, 0], points[:, 2])
    if not len(points) or circles.min() < near:
        return None
    places = len(np.unique(np.rint(angle / _NEAR).astype(int) % round(2 * np.pi / _NEAR)))
    for nodes in range(1, _LONGEST + 1):
        if places % nodes or places // nodes < 3:
            continue
        found = _segments(points, angle, places // nodes, near)
        if found is None or 3 * found.shape[1] > _LARGEST:
            continue
        ring = _verified(matrix, angle, found)
        if ring is not None:
            return ring
    return None


def _segments(points: np.ndarray, angle: np.ndarray, count: int, near: float) -> np.ndarray | None:
    """Nodes (segments, nodes of each) in one order, or None where a segment is not the first one turned."""
    alpha = 2 * np.pi / count
    segment = np.floor((angle + _NEAR) / alpha).astype(int) % count
    reach, rest = np.hypot(points[:, 0], points[:, 2]), angle - segment * alpha
    back = np.stack([reach * np.sin(rest), points[:, 1], reach * np.cos(rest)], axis=1)
    first = np.flatnonzero(segment == 0)
    if len(first) * count != len(points):
        return None
    distance, image = cKDTree(back[first]).query(back)
    order = segment * len(first) + image
    if distance.max() > near or len(np.unique(order)) != len(order):
        return None
    return np.argsort(order).reshape(count, -1)


def _verified(matrix: sparse.csr_matrix, angle: np.ndarray, nodes: np.ndarray) -> Ring | None:
    """The ring, if turning by one segment leaves the matrix as it is."""
    count, each = nodes.shape[0], 3 * nodes.shape[1]
    order = nodes.ravel()
    size = 3 * len(order)
    sine, cosine = np.sin(angle[order]), np.cos(angle[order])
    one, none = np.ones(len(order)), np.zeros(len(order))
    # Columns: along the ring, along the axle, outwards, in x, y, z.
    axes = np.array([[cosine, none, sine], [none, one, none], [sine, none, -cosine]])
    rows = np.broadcast_to((3 * order + np.arange(3)[:, None])[:, None], axes.shape)
    columns = np.broadcast_to((3 * np.arange(len(order)) + np.arange(3)[:, None])[None], axes.shape)
    places = rows.ravel(), columns.ravel()
    turn = sparse.csr_matrix((axes.ravel(), places), (size, size))
    turn.eliminate_zeros()
    local = (turn.T @ matrix @ turn).tocsr()
    shift = np.roll(np.arange(size), each)
    if abs(local[shift][:, shift] - local).max() > TOLERANCE * abs(matrix).max():
        return None
    top = local[:each].tocoo()
    blocks = {}
    for j in np.unique(top.col // each):
        inside = top.col // each == j
        entries = top.data[inside], (top.row[inside], top.col[inside] - j * each)
        blocks[int(j)] = sparse.csr_matrix(entries, (each, each)).toarray()
    first = nodes[0]
    within = np.where(angle[first] > np.pi, angle[first] - 2 * np.pi, angle[first])
    return Ring(
        count, turn, blocks, np.repeat(within, 3), np.tile([True, False, False], len(first))
    )
