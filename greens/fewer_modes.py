"""The response that a run would have had with fewer modes, by a Galerkin projection of its own small matrices.

The first modes stay as they are. What joins modes, rotation shapes (modal.rotation_shapes) and attachment modes
(greens.coupling), joins *them* anew, sought among the other coordinates of the run instead of on its finite elements:

    T = [1 0; 0 W],   X~ = T^T X T  for every projected matrix X,   W^T Lambda_r W diagonal,  W^T W = 1.

What relaxes (greens.slow), what always acts and the losses stay as they are. The new states differ from those of as few modes on the finite
elements by what static shapes lack outside the run's coordinates.

The static response is that of the run but for the stiffness beyond the modes, g_c K of the finite elements with moduli in the middle
of the modes' band (modal.damping): of rubber with g ~ f^0.1 a band of 0.7 makes what is beyond softer by up to 3.5 %, in a footprint
most of all. With S the static response of the modes that stay, by themselves,

    A' = S + (A - S) g_c / g'_c.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from mpi4py import MPI
from scipy import linalg, sparse

from tireroad.fem.errors import InputError
from tireroad.fem.tire.material import Spectrum
from tireroad.greens.basis import Array, Basis, modal_statics
from tireroad.greens.coupling import FASTEST, dynamic, foremost, with_left_out
from tireroad.greens.residuals import residual_of
from tireroad.greens.response import Response, couple
from tireroad.greens.responses import cutoff
from tireroad.modal.basis import ModalBasis, Projection
from tireroad.modal.corner import HUB_MOMENTS
from tireroad.modal.damping import tail_growth
from tireroad.modal.rolling import RollingModes, decouple, pencil
from tireroad.modal.rotating import held_matrices
from tireroad.modal.rotation_shapes import among_others

_ROUNDING = 1e-6  # of a unit column: shorter directions are rounding


def of_fewer_modes(
    response: Response,
    rolling: RollingModes,
    readings: Array,
    probes: sparse.csr_matrix,
    share: float,
    residual: str,
    spectra: Sequence[Spectrum],
    comm: MPI.Comm,
) -> tuple[Response, RollingModes, Array]:
    """The response of the modes up to a `share` of the highest, with a residual of the same kind, its states, and the combinations
    T (m, m') of the tire's coordinates that are theirs.

    `response` (r, k) of the states of `rolling`, whose first outputs are its inputs; `readings` (p, m) of the `probes` (p, 3 s)
    or wider per coordinate of the tire, k <= p <= r. `spectra` of the compounds' moduli, as many as the projection has
    `parts`. Outputs beyond the probes, but for moments on the hub, are zero. InputError
    where no mode or all modes are below the limit. Collective.
    """
    kind, turning = residual_of(residual), rolling.turning
    old = rolling.basis.projection
    count = int(np.count_nonzero(2 * np.pi * old.frequency <= share * rolling.highest))
    if not 0 < count < old.modes:
        raise InputError("all modes lie far below the highest, or none: none can be left out")
    turn = _joined(old, count, among_others(old, count, turning))
    if kind.joins:
        attached = _attached(rolling, count, turn, readings, probes)
        wide = _joined(old, count, np.hstack([turn[count:, count:], attached]))
        stays = dynamic(old.on(wide, count), turning.speed, turn.shape[1])
        turn = wide[:, stays]
    small = old.on(turn, count)
    basis = ModalBasis(frequency=small.frequency, shape=readings @ turn, projection=small)
    rolls = RollingModes(basis=basis, states=decouple(small, turning, comm), turning=turning)
    own, slow = response.without_slow(), slice(response.of_modes.stop, None)
    made = _coupled(own, rolls, probes)
    if kind.joins:
        highest = cutoff(rolls)
        limit = FASTEST * max(highest.circular, highest.rate)
        made = made.keeping_where(lambda s: np.abs(s) <= limit)
    if kind.solves:
        few = _alone(old, count, spectra)
        made = _completed(made, own, _softening(own, rolling, few, readings, probes))
    relaxing = response.eigenvalue[slow], response.output[:, slow], response.input[slow]
    return made.with_slow(*relaxing), rolls, turn


def _joined(projection: Projection, count: int, columns: Array) -> Array:
    """T (m, count + k): the first modes, and the span of `columns` (m - count, p) of the other coordinates."""
    lengths = np.linalg.norm(columns, axis=0)
    basis, sizes, _ = np.linalg.svd(columns[:, lengths > 0] / lengths[lengths > 0], False)
    basis = basis[:, sizes > _ROUNDING]
    _, turn = np.linalg.eigh(basis.T @ (projection.squares[count:, None] * basis))
    return linalg.block_diag(np.eye(count), basis @ turn)


def _alone(projection: Projection, count: int, spectra: Sequence[Spectrum]) -> Projection:
    """The projection on the first `count` modes, with what moduli in the middle of *their* band add to each."""
    few = projection.first(count)
    if few.parts is None:
        return few
    middle = np.array([few.frequency.max() / 2])
    growth = np.array([float(one.modulus(middle)[0]) - 1 for one in spectra])
    return replace(few, band_rise=growth @ np.diagonal(few.parts, axis1=1, axis2=2))


def _softening(
    response: Response,
    rolling: RollingModes,
    few: Projection,
    readings: Array,
    probes: sparse.csr_matrix,
) -> Array:
    """Flexibility (r, k) m/N that the static `response` gains beside a `few` of the modes instead of all of them.

    Nothing of a wheel that nothing holds: it has no static response.
    """
    softer = np.zeros_like(response.residual)
    if few.parts is None or few.free_motions.shape[1] or not (few.squares > 0).all():
        return softer
    _, stiffness = pencil(few, rolling.turning)
    seen = few.seen(readings[:, : few.own], probes)
    p, k = len(seen), softer.shape[1]
    kept = modal_statics(stiffness, seen, seen[:k], np.zeros((0, len(stiffness)))).compliance
    whole = (response.residual + response.static())[:p]
    growth = tail_growth(rolling.basis.projection) / tail_growth(few)
    softer[:p] = (growth - 1) * (whole - kept)
    return softer


def _attached(
    rolling: RollingModes, count: int, turn: Array, readings: Array, probes: sparse.csr_matrix
) -> Array:
    """Attachment modes (m - count, k) of the probes in the other coordinates, beyond those of `turn`."""
    old, turning = rolling.basis.projection, rolling.turning
    loads = np.pad(readings, ((0, 0), (0, old.inside.shape[1] - old.own)))  # the air is not loaded
    arguments = turning.speed, turning.damping, turning.inertia
    stiffness = held_matrices(old, *arguments)[1]
    flexible = np.pad(old.squares > 0, (0, len(stiffness) - old.own), constant_values=True)
    answers = np.zeros((len(stiffness), len(loads)))
    within = np.ix_(flexible, flexible)
    answers[flexible] = np.linalg.solve(stiffness[within], loads[:, flexible].T)
    flexibility = loads @ answers
    few = old.on(turn, count)
    own = np.pad(readings @ turn, ((0, 0), (0, loads.shape[1] - old.own)))
    some = np.pad(few.squares > 0, (0, own.shape[1] - few.own), constant_values=True)
    known = held_matrices(few, *arguments)[1][np.ix_(some, some)]
    static = modal_statics(known, own[:, some], own[:, some], np.zeros((0, int(some.sum()))))
    moving = np.flatnonzero(np.diag(flexibility) > 0)
    missing = (flexibility - static.compliance)[np.ix_(moving, moving)]
    chosen = foremost(missing, np.diag(flexibility)[moving])
    most = old.shapes - few.shapes  # as many as the run has: more would span all of its coordinates
    return answers[count : old.own, moving] @ chosen[:, max(chosen.shape[1] - most, 0) :]


def _coupled(response: Response, rolling: RollingModes, probes: sparse.csr_matrix) -> Response:
    """The response of the states alone, with as many outputs and inputs as a given one."""
    basis = rolling.basis
    seen = basis.projection.seen(basis.shape, probes)
    outputs = np.zeros((len(response.residual), seen.shape[1]))
    outputs[: len(seen)] = seen
    whole, count = Basis.of(rolling), response.residual.shape[1]
    made = couple(rolling.states, outputs, seen[:count], whole.carried)
    if response.moments is not None:
        rows = np.flatnonzero(response.moments)
        hub = sparse.csr_matrix(
            (np.ones(len(rows)), (rows, np.arange(len(rows)))), (len(outputs), HUB_MOMENTS)
        )
        made = whole.reading_hub(made, hub, probes[:count])
    return replace(made, pulse=response.pulse, offset=response.offset)


def _completed(made: Response, response: Response, softer: Array) -> Response:
    """The response with what its states lack of the static answer of the run's own and what is `softer` (r, k) m/N."""
    whole = response.residual + response.static() + softer
    made = replace(made, residual=whole - made.static())
    if response.left_out is None:
        return made
    return with_left_out(made, response.left_out + response.static_moment())
