"""Attachment modes: the static shapes under the probes' loads join the basis, with their inertia.

    R = K_Omega^-1 B,  joined to the modes as in modal.joined

(MacNeal 1971; Rubin, AIAA J. 13 (1975) 995). Exact at 0 Hz: the exact static response lies in the
basis or is added as a residual.

Many neighbouring points yield many shapes, most of which respond only statically. Those whose
static share is negligible at every point (`foremost`) and pseudo-modes far above the highest mode
(`dynamic`) are left out. The residual is then the exact flexibility less that of the states, so
what is left out keeps its static response and loses its inertia.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

from tireroad.modal.basis import Projection

# Of each point's own static flexibility: the most that the shapes left out may add up to. At
# 90 rad/s the receptance up to half the highest mode changes by 1.2e-3, with 1e-3 by 5e-3.
TOLERANCE = 1e-4
# Pseudo-modes this many times faster than the highest mode are static (`dynamic`). At 50 rad/s the
# receptance between 187 points up to half the highest mode changes by 4e-4, at 3 by 1e-3, at 2 by
# 4e-3.
FASTEST = 4.0
FEW = 100  # pseudo-modes that are kept in any case, since they cost next to nothing


def fewest(probes: sparse.csr_matrix) -> tuple[sparse.csr_matrix, sparse.csr_matrix]:
    """(weights (p, t), loads (t, s)) with probes = weights loads and as few loads as possible.

    Unit loads on the unknowns that the probes (p, s) touch if these are fewer, as for points closer
    than nodes; otherwise the probes themselves.
    """
    touched = np.unique(probes.tocoo().col)
    if len(touched) >= probes.shape[0]:
        return sparse.identity(probes.shape[0], format="csr"), probes
    unit = sparse.identity(probes.shape[1], format="csr")[touched]
    return probes[:, touched].tocsr(), unit


def foremost(missing: np.ndarray, flexibility: np.ndarray) -> np.ndarray:
    """Combinations of the loads, columns (p, k), whose static shapes join the basis.

    `missing` (p, p) m/N is what the modes lack of the `flexibility` (p,) m/N of each point. The
    smallest eigenvectors of its symmetric part are left out as long as at no point they add up to
    more than `TOLERANCE` of its own flexibility; by Cauchy-Schwarz the same then holds between any
    two.
    """
    sizes, vectors = np.linalg.eigh((missing + missing.T) / 2)
    order = np.argsort(np.abs(sizes), kind="stable")
    gone = np.cumsum(np.abs(sizes[order]) * vectors[:, order] ** 2, axis=1)
    fits = (gone <= TOLERANCE * flexibility[:, None]).all(axis=0)
    return vectors[:, order[np.argmin(fits) if not fits.all() else len(order) :]]


def dynamic(projection: Projection, speed: float, known: int) -> np.ndarray:
    """Mask (m,) of coordinates that stay: the first `known`, `FEW` pseudo-modes, dynamic ones.

    Relative to its static response, a coordinate's response at w has the dynamic part
    (w^2 + 2 w Omega n) / (omega_k^2 - Omega^2 n^2),  n = |S_kk|^1/2: inertia and convection. It
    counts as static if at half the highest mode this is no more than for a standing wheel at
    `FASTEST` times the highest mode.
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
