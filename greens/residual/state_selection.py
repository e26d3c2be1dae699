"""Which states stay dynamic: those that answer the forces within the band, not simply the slowest.

Made static, a state with A = C P leaves  (A e(s) + A* e(s*)) / 2,  e(s) = i w / (s (i w - s)),  behind.
Its participation is the largest size of that over the band; fast modes lose by (w/s)^2, since the
two halves of a pair all but cancel. The axle force, the contact forces less the rate of momentum,
loses the same with s^2 times the state's momentum in place of C: the few modes that carry a net
momentum matter there long after the displacements have stopped to need them.
"""

from __future__ import annotations

import numpy as np

from tireroad.greens.response import Response


def participation(response: Response, band: float) -> np.ndarray:
    """What is lost when a state is made static, (q,), from 0 to `band` Hz: the larger of its shares in
    the static displacements and in the axle force. Frobenius norms over all outputs and forces.
    """
    still = np.linalg.norm(response.static() + response.residual)
    displacement = _lost(response, response.output, band) / still
    # Of every unit force one unit reaches the axle.
    axle = _lost(response, response.momentum * response.eigenvalue**2, band)
    return np.maximum(displacement, axle / np.sqrt(response.input.shape[1]))


def _lost(response: Response, output: np.ndarray, band: float) -> np.ndarray:
    """Largest size (q,) over the band of what each state leaves behind at the outputs (r, q)."""
    s, push = response.eigenvalue, response.input.T
    # Largest at its resonance when that lies within the band, else at the band's end.
    omega = 1j * np.clip(np.abs(s), 0, 2 * np.pi * band)
    half = omega / (s * (omega - s))
    mirror = omega / (s.conj() * (omega - s.conj()))
    square = (np.abs(output) ** 2).sum(axis=0) * (np.abs(push) ** 2).sum(axis=0)
    plain = (output**2).sum(axis=0) * (push**2).sum(axis=0)  # of A with A*
    cross = 2 * (half * mirror.conj() * plain).real
    loss = square * (np.abs(half) ** 2 + np.abs(mirror) ** 2) + cross
    return np.sqrt(np.maximum(loss, 0.0)) / 2


def keep(
    response: Response, count: int, band: float, by: str, counted: slice = slice(None)
) -> Response:
    """Response whose `count` foremost states stay dynamic, the others follow statically.

    `by` "participation" within the band, or "frequency": the slowest. A state is a pair of complex
    eigenvalues or one real eigenvalue; `counted` are the outputs and forces that decide.
    """
    seen = response.between(counted, counted)
    merit = participation(seen, band) if by == "participation" else -np.abs(response.eigenvalue)
    foremost = np.argsort(-merit, kind="stable")[:count]
    return response.keeping(np.isin(np.arange(len(merit)), foremost))
