"""The two cut faces of a half ring, and the coupling of their nodes by the half turn."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from scipy.spatial import cKDTree

from tireroad.fem.tire.body import Body

TURN = np.array([-1.0, -1.0, 1.0])  # of x, y, z under a half turn about the vertical


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


def _found(ids: np.ndarray, wanted: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions of `wanted` entries in `ids`, and their indices in `wanted`."""
    order = np.argsort(wanted)
    own = np.flatnonzero(np.isin(ids, wanted))
    return own, order[np.searchsorted(wanted, ids[own], sorter=order)]
