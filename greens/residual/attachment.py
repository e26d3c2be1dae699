"""Attachment modes: the static shapes under the probes' loads join the basis, with their inertia.

    R = K_Omega^-1 B,  which join the modes as modal.joined says.

(MacNeal 1971; Rubin, AIAA J. 13 (1975) 995.) Exact at 0 Hz: the exact static answer lies in the basis, or joins it as
a residual.

Many points close together ask for many shapes, most of which never answer otherwise than statically. Left
out are those whose static share matters at no point (`foremost`) and pseudo-modes far above the highest
mode (`dynamic`). The exact flexibility minus that of the states is a residual then, so what is left out
keeps its static answer and loses its inertia.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

from tireroad.modal.basis import Projection

# Of each point's own static flexibility: what the shapes left out may add up to. At 90 rad/s the receptance up
# to half the highest mode then changes by 1.2e-3, with 1e-3 by 5e-3.
TOLERANCE = 1e-4
# Pseudo-modes this many times faster than the highest mode are static (`dynamic`). At 50 rad/s the receptance
# between 187 points changes by 4e-4 up to half the highest mode then; at 3 by 1e-3, at 2 by 4e-3.
FASTEST = 4.0
FEW = 100  # pseudo-modes that are kept in any case: they cost less than is worth a thought


def fewest(probes: sparse.csr_matrix) -> tuple[sparse.csr_matrix, sparse.csr_matrix]:
    """(weights (p, t), loads (t, s)) with probes = weights loads: unit loads on what the probes (p, s) touch where
    that is fewer than they are, as for points closer than nodes; else the probes themselves.
    """
    touched = np.unique(probes.tocoo().col)
    if len(touched) >= probes.shape[0]:
        return sparse.identity(probes.shape[0], format="csr"), probes
    unit = sparse.identity(probes.shape[1], format="csr")[touched]
    return probes[:, touched].tocsr(), unit


def foremost(missing: np.ndarray, flexibility: np.ndarray) -> np.ndarray:
    """Combinations of the loads, columns (p, k), whose static shapes join the basis.

    `missing` (p, p) m/N what the modes lack of the `flexibility` (p,) m/N of each point. Of the eigenvectors of
    its symmetric part the least are left out, while at no point they add up to `TOLERANCE` of its own;
    nor do they between any two, then (Cauchy-Schwarz).
    """
    sizes, vectors = np.linalg.eigh((missing + missing.T) / 2)
    order = np.argsort(np.abs(sizes), kind="stable")
    gone = np.cumsum(np.abs(sizes[order]) * vectors[:, order] ** 2, axis=1)
    fits = (gone <= TOLERANCE * flexibility[:, None]).all(axis=0)
    return vectors[:, order[np.argmin(fits) if not fits.all() else len(order) :]]


def dynamic(projection: Projection, speed: float, known: int) -> np.ndarray:
    """Which coordinates (m,) stay: the first `known`, `FEW` pseudo-modes, and all that are more than static.

    Beside its static answer a coordinate's at w has the part  (w^2 + 2 w Omega n) / (omega_k^2 - Omega^2 n^2),
    n = |S_kk|^1/2: inertia, and what the turning carries along. It is static when that is at half the
    highest mode no more than for a standing wheel's at `FASTEST` times the highest mode.
    """
    squares = projection.squares
    highest = np.sqrt(squares[projection.modes - 1])
    turning = np.zeros(len(squares))
    if projection.convective is not None:
        turning = abs(speed) * np.sqrt(np.maximum(-np.diag(projection.convective), 0.0))
    moving = highest**2 + 4 * highest * turning
    stays = squares - turning**2 <= FASTEST**2 * moving
    stays[: known + FEW] = True
    return stays
