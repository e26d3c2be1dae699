"""The road under contact points, smoothed over their rectangles: contact/roads/cell_mean.py position by position."""

import numpy as np


def smoothed(road, y, half, x, most=32):
    """Heights (n, c) m and slopes (n, c, 2) of a road at x (n, c) m under points with y (c,) and half sizes (c, 2)."""
    widest, broadest = half.max(axis=0)
    step = min(max(road.spacing, 2 * widest / most), widest / 4)
    reach = int(np.ceil(2 * widest / step + 0.5))
    strips = 4 * int(np.clip(np.ceil(broadest / road.spacing), 2, most // 2))
    first = np.floor(x / step).astype(int)
    t = x / step - first
    height, slope = np.zeros(x.shape), np.zeros((*x.shape, 2))
    for p, (own, (a, b)) in enumerate(zip(y, half, strict=True)):
        places = np.arange(first[:, p].min() - 1, first[:, p].max() + 3)
        z = np.array(
            [_mean(road, k, step, reach, own, a, b, strips) for k in places]
        )  # (positions, 2)
        here = first[:, p] - places[0]
        before, at, after, beyond = (z[here + k, 0] for k in (-1, 0, 1, 2))
        s = t[:, p]
        # The cubic through `at` and `after` with the slopes (after - before) / 2 and (beyond - at) / 2.
        into, out = (after - before) / 2, (beyond - at) / 2
        bend = [at, into, 3 * (after - at) - 2 * into - out, 2 * (at - after) + into + out]
        height[:, p] = sum(c * s**k for k, c in enumerate(bend))
        slope[:, p, 0] = sum(k * c * s ** (k - 1) for k, c in enumerate(bend) if k) / step
        slope[:, p, 1] = z[here, 1] + s * (z[here + 1, 1] - z[here, 1])
    return height, slope


def _mean(road, k, step, reach, y, a, b, strips):
    """4/3 of the mean height, and of the least-squares slope across, over a rectangle at k * step, less 1/3 of those
    over one of twice the size."""
    x = np.minimum(step * np.arange(k - reach, k + reach + 1), road.end)
    offset = step * np.arange(-reach, reach + 1)
    middle = b * ((np.arange(strips) + 0.5) / strips * 4 - 2)
    found = np.zeros(2)
    for share, times in ((1, 4 / 3), (2, -1 / 3)):
        low, high = (
            np.maximum(offset - step / 2, -share * a),
            np.minimum(offset + step / 2, share * a),
        )
        along = np.maximum(high - low, 0.0) / (2 * share * a)
        inside = middle[np.abs(middle) < share * b]
        z = road.height(*np.broadcast_arrays(x[:, None], y + inside))
        found += times * (along @ np.column_stack([z.mean(axis=1), z @ inside / (inside @ inside)]))
    return found
