"""The contact problem relative to a set of points that usually touch: a principal pivot transform.

Of the points considered, B usually touch and N do not. With forces in metres, a = diag(A) f, the
unknowns z = (g_B, a_N) and their partners w = (a_B, g_N) solve a problem of the same kind,

    w = M z + h >= 0, z >= 0, w . z = 0,
    M = [ P, -P A_BN; A_NB P, A_NN - A_NB P A_BN ],  P = A_BB^-1,

in which few z are nonzero if the contact is near B. M is a P-matrix if A is one. Source: Cottle,
Pang and Stone, The Linear Complementarity Problem, 2.3 and 4.1.
"""

import numpy as np
from scipy.linalg import inv

from tireroad.contact.solver.conditions import Array, Mask, checked_compliance
from tireroad.contact.solver.grid_compliance import Compliance


class Pivot:
    """M (c, c) of the `taken` points (n,) bool, of which `base` (n,) are B; 20 c^3 bytes of work.

    `places` (c,): the points in the order of M, B first. InputError if A is not positive definite.
    """

    def __init__(self, compliance: Compliance, taken: Mask, base: Mask) -> None:
        self.taken, self.base = taken, base
        self.places = np.concatenate([np.flatnonzero(base), np.flatnonzero(taken & ~base)])
        self._size = int(np.count_nonzero(base))
        whole = checked_compliance(compliance.block(self.places, self.places))
        # A power of two, so that forces return from metres to the last bit.
        self._unit = 2.0 ** np.round(np.log2(whole.diagonal()))
        self.matrix = self._pivoted(whole / self._unit)
        self._turned = np.ascontiguousarray(self.matrix[:, : self._size].T)
        self._reference: Array | None = None

    def _pivoted(self, whole: Array) -> Array:
        b = self._size
        inverse = inv(whole[:b, :b]) if b else whole[:b, :b]
        out = np.empty_like(whole)
        out[:b, :b] = inverse
        out[:b, b:] = -inverse @ whole[:b, b:]
        out[b:, :b] = whole[b:, :b] @ inverse
        out[b:, b:] = whole[b:, b:] + whole[b:, :b] @ out[:b, b:]
        return out

    def offset(self, q: Array, reference: Array) -> Array:
        """h (c,) m for gaps q (n,) m at forces `reference` (n,) N, which are 0 at points not taken.

        With q = 0 on B and a reference that is 0 elsewhere, h is that reference to the last bit.
        """
        if reference is not self._reference:
            self._reference, self._begun = reference, self._at(reference)
        own = q[self.places]
        own[: self._size], pushed = 0.0, own[: self._size] @ self._turned
        return self._begun + (own - pushed)

    def _at(self, reference: Array) -> Array:
        """The part of h due to the reference, (c,) m."""
        force = reference[self.places] * self._unit
        out = -(self.matrix[:, self._size :] @ force[self._size :])
        out[: self._size] += force[: self._size]
        return out

    def exchanged(self, active: Mask) -> Mask:
        """Nonzero z (c,) if `active` (n,) touch: of B those that do not, of N those that do."""
        out = active[self.places]
        out[: self._size] ^= True
        return out

    def forces(self, z: Array, w: Array) -> Array:
        """Contact forces (n,) N of the z and w (c,) m."""
        out = np.zeros(len(self.taken))
        b = self._size
        own = np.concatenate([w[:b], z[b:]])
        out[self.places] = np.maximum(own, 0.0) / self._unit
        return out
