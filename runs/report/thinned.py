"""Thins long series for drawing without losing peaks."""

import numpy as np
from numpy.typing import NDArray

DRAWN = 600  # bins of a long series; each keeps its minimum and maximum


def envelope(x: NDArray, y: NDArray, bins: int = DRAWN) -> tuple[NDArray, NDArray]:
    """Minimum and maximum of y (n) in each of `bins` blocks of samples, in order, with their x.

    A peak of one sample stays visible, which plain subsampling would not ensure. Short series are
    returned unchanged.
    """
    width = len(y) // bins
    if width <= 2:
        return x, y
    whole = width * bins
    blocks = np.nan_to_num(y[:whole]).reshape(bins, width)
    ends = np.sort(np.stack((blocks.argmin(axis=1), blocks.argmax(axis=1)), -1), axis=1)
    kept = np.append((ends + width * np.arange(bins)[:, None]).ravel(), np.arange(whole, len(y)))
    return x[kept], y[kept]


def peak_hold(frequency: NDArray, level: NDArray, bins: int = DRAWN) -> tuple[NDArray, NDArray]:
    """The highest line in each of `bins` bands equal on a logarithmic axis; frequency (n) > 0."""
    if len(frequency) <= bins:
        return frequency, level
    low, high = np.log(frequency[[0, -1]])
    edges = np.linspace(low, high, bins)
    first = np.unique(np.searchsorted(np.log(frequency), edges[:-1]))
    highest = np.maximum.reduceat(level, first)
    return frequency[first], highest
