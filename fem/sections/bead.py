"""Element sizes near a clamped edge: geometric grading, as far as the other elements allow.

At a clamped edge stresses are singular and a bending boundary layer ends. Sizes that grow in
proportion to the distance (h = h0 + GROWTH d) give each element the same error. The smallest size
depends on the number of elements: if there are few, the middle of the wall needs them more.
"""

from __future__ import annotations

import numpy as np

# Largest error in % of nine frequencies (n = 0, 1, 3; three each) of the clamped torus of order 3,
# exact ring, with 8, 10, 12, 14 and 16 elements along the arc. This grading: 0.82, 0.38, 0.22,
# 0.16, 0.14; cosine down to 0.3 of the uniform size at the bead: 1.0, 0.56, 0.37, 0.28, 0.22; sizes
# from a twelfth of the wall: 12, 5.7, 3.4.
GROWTH = 1.0
SPARE = 1.3  # largest size over the uniform one
LEAST = 1.33  # smallest size: wall thicknesses over the number of elements


def size(distance: np.ndarray, length: float, count: int, floor: float) -> np.ndarray:
    """Sizes at distances from the nearer of two clamped edges, for `count` elements over a length.

    Distances, length, floor (the least size at the edge) and result have the same unit.
    """
    largest = SPARE * length / count

    def elements(logarithm: float) -> float:
        first = largest * np.exp(-logarithm)
        graded = 2 * (largest - first) / GROWTH
        return 2 * logarithm / GROWTH + max(length - graded, 0.0) / largest

    low, deep = 0.0, np.log(largest / floor) if largest > floor else 0.0
    if elements(deep) > count:  # a smaller first element costs more elements: bisect
        for _ in range(60):
            middle = (low + deep) / 2
            low, deep = (middle, deep) if elements(middle) < count else (low, middle)
    return np.minimum(largest * np.exp(-deep) + GROWTH * distance, largest)
