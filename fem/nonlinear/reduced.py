"""The reduced nonlinear force: some vectors, some weighted cells.

    s = V^T r(q) = sum_e w_e V_e^T [F_e(u_0 + q) - F_e(u_0) - K_e q_e],   w_e >= 0,

over a few cells e, whose weights make it right for the states of a training (energy-conserving sampling and
weighting: Farhat, Avery, Chapman, Cortial 2014, doi 10.1002/nme.4668). The tire is then the linear one with the k
further loads -K V s.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tireroad.fem.collective import summed
from tireroad.fem.matrices.compliance import multiply
from tireroad.fem.nonlinear.cells import CellForms, cell_forms
from tireroad.fem.nonlinear.force import RestoringForce
from tireroad.fem.static.virtual_work import tangent

Array = np.ndarray


@dataclass(frozen=True)
class ReducedForce:
    """V^T r from the motion of the nodes of a few cells, the same on every process.

    `nodes` (d / 3,): of the kept cells, by their lattice ids; `vectors` (d, k) J^(-1/2) m: V there, a motion being
    all x, y, z of the first node, then the next; `cells` (c,): their numbers in the whole mesh, ascending, and their
    `weights` (c,). Every process evaluates all kept cells: that takes less than a message, and all have the same
    bits. Not collective.
    """

    nodes: Array
    vectors: Array
    cells: Array
    weights: Array
    _forces: CellForms
    _rest: Array
    _linear: Array
    _at_rest: Array

    def evaluate(self, motion: Array) -> Array:
        """s (k,) J^(1/2) at a motion (d,) m of `nodes` from the static state."""
        forces = self._forces.summed(self._rest + motion, self.weights) - self._at_rest
        return forces @ self.vectors - self._linear @ motion

    def jacobian(self, motion: Array, along: Array, size: float = 1e-7) -> Array:
        """Derivative (k, m) of s along motions (d, m), by differences of `size` m."""
        steps = size / np.maximum(np.abs(along).max(axis=0), np.finfo(float).tiny)
        base = self.evaluate(motion)
        found = [
            (self.evaluate(motion + step * one) - base) / step
            for step, one in zip(steps, along.T, strict=True)
        ]
        return np.stack(found, axis=1)


def at_nodes(force: RestoringForce, fields: Array, nodes: Array) -> Array:
    """Values (3 nodes, k) at lattice nodes of fields (n, k) on own unknowns, on every process. Collective."""
    body, operators = force.body, force.operators
    out = np.empty((3 * len(nodes), fields.shape[1]))
    for k, one in enumerate(fields.T):
        out[:, k] = body.everywhere(operators.spread(one))[nodes].ravel()
    return out


def reduced_force(
    force: RestoringForce, vectors: Array, cells: Array, weights: Array
) -> ReducedForce:
    """The reduced force of `vectors` V (n, k) on own unknowns, V^T K V = 1, and weighted cells, by their numbers. Collective."""
    body, comm = force.body, force.body.comm
    forces = cell_forms(body, force.work, 1)
    own = np.flatnonzero(np.isin(forces.number, cells))
    parts = []
    for form in (forces, cell_forms(body, tangent(body, force.work), 2)):
        kept = form.only(own)
        parts.append(kept.moved_to(_in_lattice(force, kept.place)).everywhere(comm))
    forces, stiffness = parts
    if not np.array_equal(forces.number, cells):
        raise ValueError("cells of the reduced force that the mesh does not have, or unsorted ones")
    known = np.unique(forces.place[forces.place >= 0] // 3)
    index = np.full(3 * body.lattice.size, -1)
    index[(3 * known[:, None] + np.arange(3)).ravel()] = np.arange(3 * len(known))
    place = np.where(forces.place < 0, -1, index[forces.place])
    at_kept = at_nodes(force, vectors, known)
    rest = body.displacement()[known].ravel()
    local = np.vstack([at_kept, np.zeros((1, vectors.shape[1]))])[place]  # -1: the last, 0
    weighted = weights[:, None, None] * local
    forces, stiffness = forces.moved_to(place), stiffness.moved_to(place)
    size = place.shape[1]
    columns = np.einsum("cik,cij->ckj", weighted, stiffness(rest).reshape(-1, size, size))
    linear = np.zeros((vectors.shape[1], len(rest) + 1))
    for part, where in zip(columns, place, strict=True):
        linear[:, where] += part  # a cell has each value once, or held ones, which are dropped
    return ReducedForce(
        nodes=known,
        vectors=at_kept,
        cells=cells,
        weights=weights,
        _forces=forces,
        _rest=rest,
        _linear=np.ascontiguousarray(linear[:, :-1]),
        _at_rest=forces.summed(rest, weights),
    )


def _in_lattice(force: RestoringForce, place: Array) -> Array:
    """Places among all components of the lattice's nodes, -1 on the rim, of local ones."""
    body = force.body
    points = body.space.tabulate_dof_coordinates()
    ids = body.lattice.ids(points)  # of ghosts too
    held = np.zeros(len(points), bool)
    held[body.rim] = True
    node, part = np.divmod(place, 3)
    return np.where(held[node], -1, 3 * ids[node] + part)


def sizes(force: RestoringForce, motions: Array, answers: Array) -> Array:
    """|q + K^-1 r|_K (s,) J^(1/2) of motions q and their `answers` K^-1 r (n, s): the motion that their loads
    would cause in the linear tire. Collective."""
    straight = motions + answers
    pushed = multiply(force.operators.stiffness, straight)
    return np.sqrt(summed(force.body.comm, np.einsum("ns,ns->s", straight, pushed)))


def outside(force: RestoringForce, vectors: Array, answers: Array, forces: Array) -> Array:
    """|(1 - V V^T K) K^-1 r|_K (s,) J^(1/2) of `answers` K^-1 r and forces r (n, s): the motion that the reduced
    force leaves out, over `sizes` the measure of how far a state is outside the training. Collective.

    Its share of K^-1 r itself says less: a belted tire that rises by 25 mm has four times the energy in K^-1 r
    that its loads would give the linear tire, and 3 % of it outside are 5 % of the load.
    """
    comm = force.body.comm
    inside = summed(comm, vectors.T @ forces)
    whole = summed(comm, np.einsum("ns,ns->s", answers, forces))
    return np.sqrt(np.maximum(whole - (inside**2).sum(axis=0), 0.0))


def extra_loads(force: RestoringForce, vectors: Array) -> Array:
    """K V (n, k) on own unknowns, N J^(-1/2): the loads of the reduced force. Collective."""
    return multiply(force.operators.stiffness, vectors)
