"""Long series thinned for drawing, so that no peak is lost."""

import numpy as np
from numpy.typing import NDArray

DRAWN = 600  # bins of a long series: each keeps its least and its greatest value


def envelope(x: NDArray, y: NDArray, bins: int = DRAWN) -> tuple[NDArray, NDArray]:
    """Least and greatest y (n) of each of `bins` runs of samples, in the order they come; x alike.

    A peak of one sample stays visible, which skipping samples would not grant. Short series are
    returned as they are.
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
    """The highest line of each of `bins` bands equal on a logarithmic axis; frequency (n) > 0."""
    if len(frequency) <= bins:
        return frequency, level
    low, high = np.log(frequency[[0, -1]])
    edges = np.linspace(low, high, bins)
    first = np.unique(np.searchsorted(np.log(frequency), edges[:-1]))
    highest = np.maximum.reduceat(level, first)
    return frequency[first], highest
