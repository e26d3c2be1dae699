"""Selection of dynamic states: those that respond within the band, not just the slowest.

A state A = C P that is made static loses  (A e(s) + A* e(s*)) / 2,  e(s) = i w / (s (i w - s)). Its
participation is the largest magnitude of that over the band. Fast modes lose (w/s)^2, since the two
halves of a pair almost cancel. For the axle force, the contact forces less the rate of momentum, C
is replaced by s^2 times the state's momentum: the few modes with a net momentum matter there long
after the displacements no longer need them.
"""

from __future__ import annotations

import numpy as np

from tireroad.greens.response import Response


def participation(response: Response, band: float) -> np.ndarray:
    """Loss (q,) if a state is made static, from 0 to `band` Hz.

    The larger of its shares in the static displacements and in the axle force, in Frobenius norms
    over all outputs and forces.
    """
    still = np.linalg.norm(response.static() + response.residual)
    displacement = _lost(response, response.output, band) / still
    # Of each unit force one unit reaches the axle.
    axle = _lost(response, response.inertia[0], band)
    return np.maximum(displacement, axle / np.sqrt(response.input.shape[1]))


def _lost(response: Response, output: np.ndarray, band: float) -> np.ndarray:
    """Largest magnitude (q,) over the band of what each state loses at the outputs (r, q)."""
    s, push = response.eigenvalue, response.input.T
    # The maximum is at the state's resonance if that is within the band, else at the end of the
    # band.
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
    """The response with its `count` foremost states dynamic; the others follow statically.

    `by` "participation" within the band, or "frequency": the slowest. A state is a pair of complex
    eigenvalues or one real eigenvalue; `counted` are the outputs and forces that decide.
    """
    seen = response.between(counted, counted)
    merit = participation(seen, band) if by == "participation" else -np.abs(response.eigenvalue)
    foremost = np.argsort(-merit, kind="stable")[:count]
    return response.keeping(np.isin(np.arange(len(merit)), foremost))
