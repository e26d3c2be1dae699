"""The states of a basis, completed by the static response of all that they lack."""

from __future__ import annotations

from dataclasses import replace

from tireroad.fem.turning import Turning
from tireroad.greens.basis import Array, Basis, Probes
from tireroad.greens.residual.second_order import modal_moments
from tireroad.greens.response import Response
from tireroad.modal.rotating import held_matrices


def with_left_out(response: Response, whole: Array) -> Response:
    """The response with what its states lack of the `whole` static rows (Basis.felt)."""
    return replace(response, left_out=whole - response.static_moment())


def completed(
    basis: Basis,
    turning: Turning,
    outputs: Probes,
    loads: Probes,
    flexibility: Array,
    beside: Array,
) -> Response:
    """The response (r, k) whose static limit is that of the full matrices with the rim held.

    `flexibility` (r, k) m/N is their static response and `beside` what it carries (Basis.beside):
    the momentum (3, k), or with hub moments (12, k). For a wheel that moves, the states respond as
    they are, and are completed by what the states of the held rim lack.
    """
    hub = basis.of_hub(outputs)
    if hub.nnz:
        flexibility = flexibility - hub @ beside[3:6]
    if not basis.projection.moves:
        if hub.nnz:
            flexibility = flexibility + hub @ basis.loaded(loads)
        response = basis.couple(outputs, loads, flexibility)
        return with_left_out(response, basis.felt(beside[:3]))
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
