"""Symmetries of the static state: one section if inflated, half a ring if pressed on the road at rest."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy import sparse
from scipy.sparse.linalg import SuperLU, splu
from scipy.spatial import cKDTree

from tireroad.fem.sections.mesh2d import Ring
from tireroad.fem.static.equilibrium import Equilibrium, SolveOutcome
from tireroad.fem.static.tangent import ConstrainedSystem, PrescribedMotion
from tireroad.fem.static.virtual_work import Rolling
from tireroad.fem.timing import Timing
from tireroad.fem.tire.body import Body
from tireroad.fem.tire.mesh import NodeGrid

TURN = np.array([-1.0, -1.0, 1.0])  # of x, y, z under a half turn about the vertical
_SAME = 1e-9  # of the section's size: distance of a cell's centre from another's image


class AxisymmetricEquilibrium(Equilibrium):
    """Equilibrium of a ring's axisymmetric shape, on the shortest of its elements around.

    On the calling process only. The state is `body.u` of its own `body`, a sector.

    With P from the motion of the section's nodes, in circumferential, axial and radial directions,
    to all nodes of a sector of one element around,

        P^T (F_int(P v) + p F_pressure(P v) + Omega^2 S (X + P v)) = 0.

    The boundary terms of the two cut faces cancel in an axisymmetric motion. Angled belts may
    rotate the crown relative to the beads; that is axisymmetric too. Damping by mass or stiffness
    has no effect in an axisymmetric shape.
    """

    def __init__(self, whole: Body, rolling: Rolling) -> None:
        ring = whole.ring
        angle = float(np.diff(ring.ring_corners).min())
        sector = replace(ring, ring_corners=np.array([0.0, angle]), coarser=lambda: None)
        body = Body(MPI.COMM_SELF, sector, whole.materials, cords=whole.plies.cords)
        self._turned = _turned(body)
        super().__init__(body, replace(rolling, damping=0.0, stiffness_damping=0.0))

    def _make_system(self, kind: str) -> AxisymmetricSystem:
        return AxisymmetricSystem(self._turned, self.cost)

    def _assemble_residual(self) -> np.ndarray:
        """The axisymmetric part of the residual forces, N."""
        copies = self.body.lattice.shape[0]
        return self._turned @ (self._turned.T @ super()._assemble_residual()) / copies

    def on(self, lattice: NodeGrid) -> np.ndarray:
        """The displacement (n, 3) m at the nodes of the whole ring's lattice."""
        local = np.empty((self.body.lattice.shape[1], 3))
        first = self.body.ids < len(local)
        local[self.body.ids[first]] = self.body.owned(self.body.u.x.array)[first]
        along, across, down = local.T  # at the angle 0, the lowest point
        sine, cosine = np.sin(lattice.ring)[:, None], np.cos(lattice.ring)[:, None]
        parts = cosine * along - sine * down, np.tile(across, (len(sine), 1))
        return np.stack([*parts, sine * along + cosine * down], axis=-1).reshape(-1, 3)


class AxisymmetricSystem:
    """P^T K P of the sector, the counterpart of `ConstrainedSystem`; no dof is held."""

    def __init__(self, turned: sparse.csr_matrix, timing: Timing) -> None:
        self._turned, self._timing = turned, timing
        self.gap_closure = self.road_rise = PrescribedMotion(
            np.zeros(turned.shape[0]), np.zeros(turned.shape[0])
        )
        self._factor: SuperLU | None = None

    def take(
        self, matrix: PETSc.Mat, held: np.ndarray, gap_closure: np.ndarray, road_rise: np.ndarray
    ) -> bool:
        """Factorise; False if the matrix is singular."""
        rows, columns, values = matrix.getValuesCSR()
        whole = sparse.csr_matrix((values, columns, rows), matrix.getSize())
        with self._timing("factorisation"):
            try:
                self._factor = splu((self._turned.T @ whole @ self._turned).tocsc())
            except RuntimeError:  # SuperLU: "Factor is exactly singular"
                return False
        return True

    def solve(
        self, right: np.ndarray, moved: PrescribedMotion | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Motion (m) of all dofs of the sector under forces (N), and no reactions."""
        assert self._factor is not None, "take() comes before"
        with self._timing("solve"):
            change = self._turned @ self._factor.solve(self._turned.T @ right)
        return change, np.zeros(0)


def _turned(body: Body) -> sparse.csr_matrix:
    """P (3 nodes, 3 free nodes of the section)."""
    angle, node = np.divmod(body.ids, body.lattice.shape[1])
    held = np.zeros(body.lattice.shape[1], bool)
    held[node[body.rim]] = True
    number = np.cumsum(~held) - 1
    own = np.flatnonzero(~held[node])
    sine, cosine = (f(body.lattice.ring[angle[own]]) for f in (np.sin, np.cos))
    unit, none = np.ones(len(own)), np.zeros(len(own))
    axes = np.array([[cosine, none, sine], [none, unit, none], [sine, none, -cosine]])
    rows = np.broadcast_to((3 * own + np.arange(3)[:, None])[:, None], axes.shape)
    columns = np.broadcast_to((3 * number[node[own]] + np.arange(3)[:, None])[None], axes.shape)
    size = 3 * body.nodes, 3 * int((~held).sum())
    return sparse.csr_matrix((axes.ravel(), (rows.ravel(), columns.ravel())), size)


@dataclass(frozen=True)
class Cut:
    """The cut faces of a half ring. In each pair of their nodes the one at lower y follows the
    other.

    `follower`, `leader`: own nodes of pairs, whose pair numbers (k,) are `followed` and `led`;
    `axis`: own nodes on the vertical through the centre. Over all processes, in global numbering:
    `lead` and `sign`, the unknown with which each one moves and its sign, -1 for a fixed one. Of
    the section: `image`, `low` and `middle` nodes; `ends`: the angles of the cuts.
    """

    comm: MPI.Comm
    pairs: int
    follower: np.ndarray
    followed: np.ndarray
    leader: np.ndarray
    led: np.ndarray
    axis: np.ndarray
    lead: np.ndarray
    sign: np.ndarray
    image: np.ndarray
    low: np.ndarray
    middle: np.ndarray
    ends: np.ndarray

    @staticmethod
    def of(body: Body) -> Cut:
        """Cut faces of a body that is half a ring. Collective."""
        lattice = body.lattice
        places, (around, count) = lattice.section, lattice.shape
        image = cKDTree(places).query(places * [1, -1])[1]
        middle = np.flatnonzero(image == np.arange(count))
        low = np.flatnonzero((places[:, 1] < 0) & (image != np.arange(count)))
        ends = np.array([0, around - 1])
        follows, leads, still = (
            (ends[:, None] * count + nodes).ravel() for nodes in (low, image[low], middle)
        )
        number = _global_numbers(body)
        lead = 3 * np.arange(lattice.size)[:, None] + np.arange(3)
        sign = np.ones((lattice.size, 3))
        lead[number[follows]] = 3 * number[leads][:, None] + np.arange(3)
        sign[number[follows]] = TURN
        lead[number[still], :2] = -1
        follower, followed = _found(body.ids, follows)
        leader, led = _found(body.ids, leads)
        return Cut(
            comm=body.comm,
            pairs=len(follows),
            follower=follower,
            followed=followed,
            leader=leader,
            led=led,
            axis=_found(body.ids, still)[0],
            lead=lead.ravel(),
            sign=sign.ravel(),
            image=image,
            low=low,
            middle=middle,
            ends=ends,
        )

    def fold(self, forces: np.ndarray) -> None:
        """P^T: move forces (3 own nodes,) from followers to their leaders. Collective."""
        forces = forces.reshape(-1, 3)
        forces[self.leader] += self._exchanged(TURN * forces[self.follower], self.followed)[
            self.led
        ]
        forces[self.follower] = 0.0
        forces[self.axis, :2] = 0.0

    def unfold(self, motion: np.ndarray) -> None:
        """P: set the motion (3 own nodes,) of followers from their leaders. Collective."""
        motion = motion.reshape(-1, 3)
        motion[self.follower] = TURN * self._exchanged(motion[self.leader], self.led)[self.followed]

    def _exchanged(self, values: np.ndarray, pairs: np.ndarray) -> np.ndarray:
        out = np.zeros((self.pairs, 3))
        out[pairs] = values
        self.comm.Allreduce(MPI.IN_PLACE, out)
        return out


def _global_numbers(body: Body) -> np.ndarray:
    """Global number of each lattice node. Collective."""
    number = np.zeros(body.lattice.size, dtype=np.int64)
    number[body.ids] = body.space.dofmap.index_map.local_range[0] + np.arange(body.nodes)
    body.comm.Allreduce(MPI.IN_PLACE, number)
    return number


def _found(ids: np.ndarray, selection: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions in `ids` of entries of `selection`, and their indices in `selection`."""
    order = np.argsort(selection)
    own = np.flatnonzero(np.isin(ids, selection))
    return own, order[np.searchsorted(selection, ids[own], sorter=order)]


class FoldedSystem:
    """P^T K P: a `ConstrainedSystem` of half a ring. Followers keep a unit diagonal row."""

    def __init__(
        self, comm: MPI.Comm, matrix: PETSc.Mat, kind: str, timing: Timing, cut: Cut
    ) -> None:
        self._cut, self._timing = cut, timing
        self._folding = _Folding(matrix, cut)
        self._inner = ConstrainedSystem(comm, self._folding.matrix, kind, timing)

    @property
    def gap_closure(self) -> PrescribedMotion:
        return self._inner.gap_closure

    @property
    def road_rise(self) -> PrescribedMotion:
        return self._inner.road_rise

    def take(
        self, matrix: PETSc.Mat, held: np.ndarray, gap_closure: np.ndarray, road_rise: np.ndarray
    ) -> bool:
        """Fold and factorise; `matrix` stays unchanged. Collective."""
        with self._timing("assembly"):
            self._folding.fill(matrix)
        return self._inner.take(self._folding.matrix, held, gap_closure, road_rise)

    def solve(
        self, right: np.ndarray, moved: PrescribedMotion | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Motion (m) of owned dofs under folded forces (N), force (N) at held ones. Collective."""
        change, force = self._inner.solve(right, moved)
        self._cut.unfold(change)
        return change, force

    def columns(
        self, numbers: np.ndarray, dofs: np.ndarray, count: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """As in ConstrainedSystem, without the motion of followers. Collective."""
        return self._inner.columns(numbers, dofs, count)

    def spread(self, motion: np.ndarray) -> np.ndarray:
        """Add the motion of the followers, in place. Collective."""
        self._cut.unfold(motion)
        return motion


class _Folding:
    """`matrix` P^T K P, its pattern made once and its values summed from K in `fill`."""

    def __init__(self, matrix: PETSc.Mat, cut: Cut) -> None:
        comm, size = matrix.comm.tompi4py(), matrix.getSize()[0]
        first, last = matrix.getOwnershipRange()
        begin, column, _ = matrix.getValuesCSR()
        row = np.repeat(np.arange(first, last), np.diff(begin))
        sign, to = cut.sign[row] * cut.sign[column], cut.lead[column]
        self._comm = comm
        self._stays = np.flatnonzero((cut.lead[row] == row) & (to >= 0))
        self._goes = np.flatnonzero((cut.lead[row] != row) & (cut.lead[row] >= 0) & (to >= 0))
        self._sign, self._sent_sign = sign[self._stays], sign[self._goes]
        sent = np.stack([cut.lead[row[self._goes]], to[self._goes]])
        come = np.concatenate(comm.allgather(sent), axis=1)
        self._comes = np.flatnonzero((come[0] >= first) & (come[0] < last))
        own = np.arange(first, last)
        alone = own[cut.lead[first:last] != own]
        rows = np.concatenate([row[self._stays], come[0, self._comes], alone])
        columns = np.concatenate([to[self._stays], come[1, self._comes], alone])
        key = (rows - first) * size + columns
        order = np.argsort(key, kind="stable")
        new = np.append(True, np.diff(key[order]) > 0)
        self._place = np.empty(len(key), np.intp)
        self._place[order] = np.cumsum(new) - 1
        keys = key[order][new]
        self._columns = (keys % size).astype(PETSc.IntType)
        counts = np.bincount(keys // size, minlength=last - first)
        self._begin = np.append(0, np.cumsum(counts)).astype(PETSc.IntType)
        self._ones = np.ones(len(alone))
        csr = self._begin, self._columns, np.zeros(len(keys))
        self.matrix = PETSc.Mat().createAIJ(matrix.getSizes(), csr=csr, comm=comm)

    def fill(self, matrix: PETSc.Mat) -> None:
        """Set the values from K. Collective."""
        values = matrix.getValuesCSR()[2]
        come = np.concatenate(self._comm.allgather(self._sent_sign * values[self._goes]))
        given = np.concatenate([self._sign * values[self._stays], come[self._comes], self._ones])
        summed = np.bincount(self._place, weights=given, minlength=len(self._columns))
        self.matrix.setValuesCSR(self._begin, self._columns, summed)
        self.matrix.assemble()


def looks_the_same(ring: Ring, rolling: Rolling) -> bool:
    """Whether a half turn maps the ring of elements and its loads to themselves.

    Corners around and the section's cells are compared, but not cords, so the state found must be
    checked on the whole ring.
    """
    corners, section = ring.ring_corners, ring.section
    if not ring.closed or ring.segments % 2 or rolling.damping or rolling.stiffness_damping:
        return False
    if not np.allclose(corners + corners[::-1], 2 * np.pi, rtol=0, atol=1e-9):
        return False
    middle = section.nodes[section.cells].mean(axis=1)
    small = _SAME * np.ptp(section.nodes)
    distance, image = cKDTree(middle).query(middle * [1, -1])
    return bool(distance.max() < small and (section.region[image] == section.region).all())


class HalfModelEquilibrium(Equilibrium):
    """Equilibrium of half a ring, from the lowest point over x > 0 to the highest. Collective.

    The state is `body.u` of its own `body`; loads passed and returned are those of the whole
    tire.

    With P from the motion of the half ring's free nodes to all its nodes,

        P^T (F_int(P v) + p F_pressure(P v) + Omega^2 S (X + P v)) = P^T f.

    On the two cut faces, at the lowest and the highest point, the node at (r, -y) moves as that at
    (r, y), rotated: (-u_x, -u_y, u_z). The boundary terms of the cut faces cancel between the
    halves. Angled belts keep this symmetry, although they break both mirror symmetries. Damping
    breaks it.
    """

    def __init__(self, whole: Body, rolling: Rolling, ring: Ring | None = None) -> None:
        """From the elements of the `whole` body, or from another `ring` of elements of its tire."""
        ring = ring or whole.ring
        corners = ring.ring_corners[: ring.segments // 2 + 1]
        half = replace(ring, ring_corners=corners, coarser=lambda: None)
        body = Body(whole.comm, half, whole.materials, cords=whole.plies.cords)
        self._cut = Cut.of(body)
        body.tread = np.setdiff1d(body.tread, self._cut.follower)
        self._paired = ~np.isin(body.tread, self._cut.axis)
        super().__init__(body, rolling)

    def _make_system(self, kind: str) -> FoldedSystem:
        return FoldedSystem(self.body.comm, self.matrix, kind, self.cost, self._cut)

    def solve(
        self, road_height: float | None = None, load: float | None = None, allowed: float = 0.0
    ) -> SolveOutcome:
        """As for the whole tire; the half carries half of its load."""
        return super().solve(road_height, None if load is None else load / 2, allowed / 2)

    def load(self) -> float:
        """Load of the whole tire, N. Collective."""
        return 2 * super().load()

    def points(self) -> int:
        """Number of nodes of the whole tire in contact. Collective."""
        paired = self.body.comm.allreduce(int((self.road.force[self._paired] > 0).sum()))
        return super().points() + paired

    def _error(self, load: float | None) -> float:
        """Upper bound for the whole tire's error, from two halves with the same forces."""
        return 2 * super()._error(load)

    def _assemble_residual(self) -> np.ndarray:
        """Residual forces at the leading nodes, N."""
        super()._assemble_residual()
        self._cut.fold(self._work.array)
        return self._work.array_r

    def start(self, whole: Equilibrium) -> None:
        """Start from the whole body's present state, inflated and without a road. Collective."""
        self.body.set_displacement(whole.body.displacement())  # the half's nodes come first
        self.road.active[:], self.road.force[:] = False, 0.0
        self.pressure.value = float(whole.pressure.value)

    def uniform_traction_step(self, weights: np.ndarray, load: float) -> tuple[float, float]:
        """As for the whole tire, for a traction that the half turn preserves. Leaders take the
        weights of their followers, and each half takes half of those on the axis."""
        face, own = self.body.surface, weights.copy()
        own[face.place[np.isin(face.local, self._cut.follower)]] = 0.0
        own[face.place[np.isin(face.local, self._cut.axis)]] /= 2
        further, compliance = super().uniform_traction_step(own, load)
        return 2 * further, 2 * compliance

    def on(self, lattice: NodeGrid) -> tuple[np.ndarray, np.ndarray]:
        """Displacement (n, 3) m and road force (n,) N on the whole ring's lattice. Collective."""
        count, around = lattice.shape[1], lattice.shape[0]
        moved = self.body.displacement().reshape(-1, count, 3)
        force = self.body.everywhere(self.contact_force()).reshape(-1, count)
        image = self._cut.image
        for end in self._cut.ends:  # a node on the axis has half of its force in each half
            moved[end, self._cut.low] = TURN * moved[end, image[self._cut.low]]
            force[end, self._cut.low] = force[end, image[self._cut.low]]
            force[end, self._cut.middle] *= 2
        first = np.arange(len(moved))
        other = np.arange(len(moved), around)
        displacement, road = np.empty((around, count, 3)), np.empty((around, count))
        displacement[first], road[first] = moved, force
        displacement[other] = TURN * moved[around - other][:, image]
        road[other] = force[around - other][:, image]
        return displacement.reshape(-1, 3), road.ravel()
