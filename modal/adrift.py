"""Unrestrained motions, decoupled from all others: a wheel that drifts together with its car."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy import linalg

from tireroad.modal.rotating import companion_blocks, rotating
from tireroad.modal.states import StateModes


def beside(drag: np.ndarray, stiffness: np.ndarray, adrift: np.ndarray) -> StateModes:
    """`rotating` where the orthonormal motions `adrift` (m, r) meet no stiffness or damping.

    They are split off exactly and drift in a block of their own.
    """
    m, r = adrift.shape
    others = linalg.qr(adrift)[0][:, r:]
    found = rotating(others.T @ drag @ others, others.T @ stiffness @ others)
    block, right, left = companion_blocks(np.arange(r), np.zeros(r), np.zeros(r), r)
    return replace(
        found,
        right=others @ found.right,
        left=found.left @ others.T,
        block=linalg.block_diag(found.block, block),
        block_right=np.hstack([others @ found.block_right, adrift @ right]),
        block_left=np.vstack([found.block_left @ others.T, left @ adrift.T]),
        rigid=2 * r,
    )
