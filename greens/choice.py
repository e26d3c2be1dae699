"""Which states stay dynamic: those that answer the forces within the band, not simply the slowest.

Made static, a state with A = C P leaves  (A e(s) + A* e(s*)) / 2,  e(s) = i w / (s (i w - s)),  behind.
Its participation is the largest size of that over the band; fast modes lose by (w/s)^2, since the
two halves of a pair all but cancel.
"""

from __future__ import annotations

import numpy as np

from greens.response import Response


def participation(response: Response, band: float) -> np.ndarray:
    """What the displacements lose when a state is made static, (q,) m/N, from 0 to `band` Hz.

    The Frobenius norm over all outputs and forces.
    """
    s, output, push = response.eigenvalue, response.output, response.input.T
    # Largest at its resonance when that lies within the band, else at the band's end.
    omega = 1j * np.clip(np.abs(s), 0, 2 * np.pi * band)
    half = omega / (s * (omega - s))
    mirror = omega / (s.conj() * (omega - s.conj()))
    square = (np.abs(output) ** 2).sum(axis=0) * (np.abs(push) ** 2).sum(axis=0)
    plain = (output**2).sum(axis=0) * (push**2).sum(axis=0)  # of A with A*
    cross = 2 * (half * mirror.conj() * plain).real
    loss = square * (np.abs(half) ** 2 + np.abs(mirror) ** 2) + cross
    return np.sqrt(np.maximum(loss, 0.0)) / 2


def keep(response: Response, count: int, band: float, by: str) -> Response:
    """Response whose `count` foremost states stay dynamic, the others follow statically.

    `by` "participation" within the band, or "frequency": the slowest. A state is a pair of complex
    eigenvalues or one real eigenvalue.
    """
    merit = participation(response, band) if by == "participation" else -np.abs(response.eigenvalue)
    foremost = np.argsort(-merit, kind="stable")[:count]
    return response.keeping(np.isin(np.arange(len(merit)), foremost))
