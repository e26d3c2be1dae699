"""The undamped modes of the standing tire, as the eigensolver returns them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np


@dataclass(frozen=True, kw_only=True)
class Modes:
    """The lowest m modes.

    `squares` omega^2 (m,) 1/s2, ascending; `vectors`: this process's rows (n, m) of the
    mass-normalised shapes, kg^-1/2, with signs and bases of repeated frequencies by rule
    (modal.solver.canonical); `residual` (m,) ||K phi - lambda M phi|| / ||lambda M phi||, a bound
    on twice the relative error of the frequency; `inertia_count` eigenvalues below `counted_below`
    (1/s2) by Sylvester's law, equal to the number found there; `rigid`: the number of modes without
    stiffness among them, whose square is 0; `sectors`: sizes of the independent problems that the
    `symmetries` (names) or wave numbers split it into; `slices`: intervals solved; `segments`:
    equal ones around the axle, 1 where none are used.
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
        """Number of modes, m; static shapes that joined them (modal.joined) come after."""
        return len(self.residual)

    @property
    def frequency(self) -> np.ndarray:
        """Natural frequencies (m,), Hz; 0 for rigid modes."""
        return np.sqrt(np.maximum(self.squares[: self.count], 0.0)) / (2 * np.pi)

    def first(self, count: int) -> Modes:
        """The `count` lowest modes."""
        return replace(
            self,
            squares=self.squares[:count],
            vectors=self.vectors[:, :count],
            residual=self.residual[:count],
        )

    def among(self, wanted: np.ndarray) -> Modes:
        """The same with the squares and vectors at `wanted`, indices or a mask."""
        return replace(self, squares=self.squares[wanted], vectors=self.vectors[:, wanted])
