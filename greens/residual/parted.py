"""A real block of states split into those that stay dynamic and those that follow statically."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg


@dataclass(frozen=True)
class Parted:
    """y' = A y + b f as two decoupled blocks: y = right z + lagging r.

    z' = block z + left b f and r' = faster r + lagging_left b f. Shapes: `block` (p, p), `right`
    (n, p), `left` (p, n); `faster` (n - p, n - p), `lagging` (n, n - p), `lagging_left` (n - p, n).
    """

    block: np.ndarray
    right: np.ndarray
    left: np.ndarray
    faster: np.ndarray
    lagging: np.ndarray
    lagging_left: np.ndarray

    def following(self, push: np.ndarray) -> np.ndarray:
        """lagging faster^-1 lagging_left b (n, k) for the inputs b = `push` (n, k).

        Its negative is the static response y, per constant force, of the states that do not stay.
        """
        return self.lagging @ np.linalg.solve(self.faster, self.lagging_left @ push)


def parted(block: np.ndarray, values: np.ndarray, stays: np.ndarray) -> Parted:
    """Split the block (n, n) by its eigenvalues (n,), those that stay first; pairs together.

    Its real Schur form is divided between the two, and the coupling C removed by the solution of
    Sylvester's equation A X - X B = -C. Not collective.
    """

    def first(re: float, im: float) -> bool:
        return bool(stays[np.abs(values - complex(re, im)).argmin()])

    schur, turn, p = linalg.schur(block, output="real", sort=first)
    X = linalg.solve_sylvester(schur[:p, :p], -schur[p:, p:], -schur[:p, p:])
    right, left = turn.copy(), turn.T.copy()
    right[:, p:] += turn[:, :p] @ X
    left[:p] -= X @ turn.T[p:]
    return Parted(schur[:p, :p], right[:, :p], left[:p], schur[p:, p:], right[:, p:], left[p:])
