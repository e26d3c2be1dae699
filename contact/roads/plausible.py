"""Whether the sizes of a measured road can be metres; a file in millimetres looks the same."""

import numpy as np
from numpy.typing import NDArray

from tireroad.contact.roads.rows import Rows
from tireroad.fem.errors import InputError

Array = NDArray[np.float64]

WIDEST = 50.0  # m: a measured road across; a texture of 300 mm is 300 m wide when read as metres
# Median of |dz|/dx or |dz|/dy between neighbours, the larger: ruts and steps have but one of them.
# Measured: 0.03 on Belgian block every 10 mm, about 0.2 on a texture of 0.5 mm rms every 0.5 mm.
# Millimetres read as metres give a thousand times that.
STEEPEST = 5.0
# Median over the rows of their relief over the width: a kerb of 0.15 m on 0.3 m has 0.5.
ROUGHEST = 2.0
HIGHEST = 1e4  # m above sea level; larger values are damage
SAMPLES = 64  # rows inspected


def check_plausible(
    extent: tuple[float, float],
    steps: tuple[float, float],
    rows: Rows,
    source: str,
    *,
    lengths: bool = True,
    heights: str | None = "m",
) -> None:
    """InputError if a road cannot be in the unit in which it was read.

    `extent` (m) along and across, `steps` (m) between points, `rows` of heights (m), of which 64
    are read. `lengths`: whether their unit was assumed rather than given; `heights`: the unit that
    was assumed for them, None: it was given. The message then names the keys that give it. Heights
    beyond 10 km are refused in any case.
    """
    if lengths and extent[1] > WIDEST:
        raise InputError(
            f"{source}: x and y were read as metres, and the road is {extent[1]:.4g} m wide, which is "
            f'more than {WIDEST:g} m: if the file is in millimetres say length_unit = "mm" in [road]; '
            'if it really is in metres say length_unit = "m"'
        )
    count = rows.shape[0]
    picked = np.unique(np.linspace(0, count - 1, min(SAMPLES, count)).astype(int))
    pairs = [rows.read(i, min(i + 2, count)) for i in picked]
    z = np.concatenate([pair[:1] for pair in pairs])
    with np.errstate(invalid="ignore", over="ignore"):
        largest = np.nanmax(np.abs(z), initial=0.0)
        differ = (
            _median(np.concatenate([np.diff(pair, axis=0) for pair in pairs])),
            _median(np.diff(z)),
        )
    slope, apart, height = max(
        (dz / step, step, dz) for dz, step in zip(differ, steps, strict=True)
    )
    if largest > HIGHEST:
        raise InputError(f"{source}: heights of {largest:.3g} m are no road")
    relief = np.ptp(z[~np.isnan(z).any(axis=1)], axis=1)
    if heights and (slope > STEEPEST or _median(relief) > ROUGHEST * extent[1]):
        raise InputError(
            f"{source}: heights were read as {heights}, and in the median they differ by "
            f"{height:.3g} m between neighbours {apart:.3g} m apart, by "
            f"{_median(relief):.3g} m across the road's {extent[1]:.3g} m: say in [road] what they "
            f'are in, height_unit = "mm" or "um"; if they really are in {heights} say height_unit = "{heights}"'
        )


def _median(values: Array) -> float:
    """The median magnitude of the finite values; 0 if there are none."""
    known = np.abs(values[np.isfinite(values)])
    return float(np.median(known)) if known.size else 0.0
