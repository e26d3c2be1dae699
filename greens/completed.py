"""The states of a basis with the static answers of all that they lack."""

from __future__ import annotations

from dataclasses import replace

from tireroad.fem.turning import Turning
from tireroad.greens.basis import Array, Basis, Probes
from tireroad.greens.residual.second_order import modal_moments
from tireroad.greens.response import Response
from tireroad.modal.rotating import held_matrices


def completed(
    basis: Basis,
    turning: Turning,
    outputs: Probes,
    loads: Probes,
    flexibility: Array,
    beside: Array,
) -> Response:
    """The response (r, k) that answers a slow force as the full matrices do, its rim held: `flexibility` (r, k) m/N, and
    what that carries `beside` (Basis.beside), the momentum (3, k) or that with the moments on the hub (12, k).

    A wheel that moves has the states' answers to that, and of what they lack those of the held rim.
    """
    hub = basis.of_hub(outputs)
    if hub.nnz:
        flexibility = flexibility - hub @ beside[3:6]
    if not basis.projection.moves:
        if hub.nnz:
            flexibility = flexibility + hub @ basis.loaded(loads)
        response = basis.couple(outputs, loads, flexibility)
        return replace(response, left_out=beside[:3] - response.static_moment())
    held = basis.held
    pencil = held_matrices(basis.projection, turning.speed, turning.damping, turning.inertia)
    known = modal_moments(*pencil, held.seen(outputs), held.seen(loads), held.beside(hub))
    missing = flexibility - known.compliance
    if hub.nnz:
        missing += hub @ known.momentum[3:6]
    response = basis.couple(outputs, loads)
    return replace(
        response,
        residual=response.residual + missing,
        left_out=beside[:3] - known.momentum[:3],
    )
