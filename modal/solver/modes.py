"""The undamped modes of the standing tire, as the eigensolver hands them out."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np


@dataclass(frozen=True, kw_only=True)
class Modes:
    """The lowest m modes. `squares` omega^2 (m,) 1/s2 ascending; `vectors` this process's rows (n, m)
    of the mass-normalised shapes, kg^-1/2, signs and bases of repeated frequencies by rule
    (modal.solver.canonical); `residual` (m,) ||K phi - lambda M phi|| / ||lambda M phi||, twice the relative error
    of the frequency at most; `inertia_count` eigenvalues below `counted_below` (1/s2) by Sylvester's law,
    equal to the number found there; `rigid` modes without stiffness, whose square is 0, among them;
    `sectors` sizes of the independent problems that the `symmetries` (names) or wave numbers split it
    into, `slices` intervals solved; `segments` equal ones around the axle, 1 where none are used.
    """

    squares: np.ndarray
    vectors: np.ndarray
    residual: np.ndarray
    orthonormality: float
    inertia_count: int
    counted_below: float
    rigid: int
    sectors: tuple[int, ...]
    slices: int
    segments: int = 1
    symmetries: tuple[str, ...] = ()

    @property
    def count(self) -> int:
        """How many modes, m: static shapes that joined them (modal.joined) come after."""
        return len(self.residual)

    @property
    def frequency(self) -> np.ndarray:
        """Natural frequencies (m,), Hz; 0 for rigid modes."""
        return np.sqrt(np.maximum(self.squares[: self.count], 0.0)) / (2 * np.pi)

    def first(self, count: int) -> Modes:
        """The `count` lowest of them."""
        return replace(
            self,
            squares=self.squares[:count],
            vectors=self.vectors[:, :count],
            residual=self.residual[:count],
        )

    def among(self, wanted: np.ndarray) -> Modes:
        """With the squares and vectors of those `wanted`, an index or a mask."""
        return replace(self, squares=self.squares[wanted], vectors=self.vectors[:, wanted])
