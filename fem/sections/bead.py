"""Sizes of elements towards an edge that is held: geometric, as far as the rest can spare them.

At a clamped edge stresses are singular and a boundary layer of bending ends. Sizes that grow in
proportion to the distance spend the same error on each (h = h0 + GROWTH d). How small they start
depends on how many there are: with few, the middle of the wall needs them more.
"""

from __future__ import annotations

import numpy as np

# Largest error of nine frequencies (n = 0, 1, 3; three each) of the clamped torus of order 3, ring exact, in %,
# 8, 10, 12, 14 and 16 elements along the arc: 0.82, 0.38, 0.22, 0.16, 0.14 so; 1.0, 0.56, 0.37, 0.28, 0.22
# with a cosine to 0.3 of the uniform size at the bead; 12, 5.7, 3.4 with sizes from a twelfth of the wall on.
GROWTH = 1.0
SPARE = 1.3  # the largest size over the uniform one
LEAST = 1.33  # the smallest size, in walls over the number of elements


def size(distance: np.ndarray, length: float, count: int, floor: float) -> np.ndarray:
    """Sizes at a distance from the nearer of two held edges, of `count` elements over a length.

    Distances, length, floor (the least size at the edge) and result in one unit.
    """
    largest = SPARE * length / count

    def elements(logarithm: float) -> float:
        first = largest * np.exp(-logarithm)
        graded = 2 * (largest - first) / GROWTH
        return 2 * logarithm / GROWTH + max(length - graded, 0.0) / largest

    low, deep = 0.0, np.log(largest / floor) if largest > floor else 0.0
    if elements(deep) > count:  # what a smaller first element costs grows with its depth: bisect
        for _ in range(60):
            middle = (low + deep) / 2
            low, deep = (middle, deep) if elements(middle) < count else (low, middle)
    return np.minimum(largest * np.exp(-deep) + GROWTH * distance, largest)
