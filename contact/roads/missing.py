"""Values that stand for a missing height, found by how they lie among the others.

A code is one or two values far from all others, or a value in irregular runs with jumps on both
sides. It is not a ladder of rounded heights, whose values are evenly spaced; not a cleat, whose runs
are of one length; and not a clipped plateau, which the heights beside it lead up to.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tireroad.fem.errors import InputError

Array = NDArray[np.float64]

_FEWEST = 20  # known heights
_SHARE = 0.3  # of the heights: a value more frequent than that is the ground
_FAR = 0.3  # m from all other heights: no cleat, whatever the number
_DEEPEST = 2.0  # m: no kerb, whatever part of the road lies there
_GAP = 5.0  # largest spacings between the other heights
_JUMP = 20.0  # usual differences of neighbours
_RUNS = 3
_MOST = 3  # codes in runs; more are a road that has heights again and again
_TAPER, _FADING = 2.0, 0.2  # last digits, usual differences of neighbours
_CHANCE = 8.0  # as many equal neighbours as expected
_NEAR = 10  # values below and above, by which the usual count of a height is known
_SHORT = 12  # heights in a row: more are a plate
_STANDS_OUT, _IN_RUNS = 3.0, 0.5  # usual differences of neighbours, for heights alone and in runs
_OFTEN = 5  # as many as of any height near it
_IMPROBABLE = math.log(1e-5)
_PIECE = 500_000  # heights that are compared at a time
_LARGE = 1e6  # and more: 1e10, 1.70141e38, 9.96921e36


def _usual_codes() -> Array:
    """0, -1, nines and other repeated digits as in -9999, 99.99 or 888.8, powers of ten, and limits of integers."""
    scaled = {"9" * count for count in range(2, 8)} | {"32767", "32768", "65535", "65536"}
    whole = {digit * count for digit in "12345678" for count in range(3, 7)}
    whole |= {"127", "128", "255", "256", "1000", "10000", "100000"}
    numbers = [float(number) for number in whole]
    numbers += [float(number) / 10 for number in whole if len(set(number)) == 1]
    numbers += [999.25, 9999.25]  # of well logs
    numbers += [float(f"{number}e-{k}") for number in scaled for k in range(5) if k < len(number)]
    return np.unique([0.0, -1.0, *numbers, *(-number for number in numbers)])


_CODES = _usual_codes()


def special(values: Array | np.float64) -> NDArray[np.bool_]:
    """Mask of the numbers (any shape) that programs write for "no value"."""
    return np.isin(values, _CODES) | (np.abs(values) >= _LARGE)


def codes(z: Array, metre: float, *, single: bool = False) -> list[float]:
    """Values among heights z (rows, n) in units of `metre` m, nan where missing, that mean there is none.

    Neighbours are those along the second axis. `single`: whether one height alone, farther than any kerb, is one, too; in
    a profile it is an outlier, which is bridged.
    """
    known = np.isfinite(z)
    values, counts = np.unique(z[known], return_counts=True)
    found_codes: list[float] = []
    while counts.sum() >= _FEWEST and len(values) > 1:
        more = _far(values, counts, metre, 0 if single else 1)
        if not more:
            break
        found_codes += more
        rest = ~np.isin(values, more)
        values, counts = values[rest], counts[rest]
    if counts.sum() >= _FEWEST and len(values) > 2:
        others = np.where(known & ~np.isin(z, found_codes), z, np.nan)
        more = _in_runs(others, values, counts)
        found_codes += (
            more or _repeated(others, values, counts) or _repeated(others.T, values, counts)
        )
    return sorted(code + 0.0 for code in found_codes)  # no -0


def _far(values: Array, counts: NDArray[np.intp], metre: float, spike: int) -> list[float]:
    """One or two of the lowest and of the highest values that lie apart from all others."""
    most = _SHARE * counts.sum()
    for low, high in ((1, 0), (0, 1), (1, 1), (2, 0), (0, 2), (2, 1), (1, 2), (2, 2)):
        rest = values[low : len(values) - high]
        if len(rest) < 1:
            continue
        outer = [*range(low), *range(len(values) - high, len(values))]
        gaps = [rest[0] - values[k] if k < low else values[k] - rest[-1] for k in outer]
        if counts[outer].sum() > most and not _no_ground(values[outer], gaps, rest, metre):
            continue
        if all(
            _apart(values[k], int(counts[k]), gap, rest, metre, spike)
            for k, gap in zip(outer, gaps, strict=True)
        ):
            return [float(values[k]) for k in outer]
    return []


def _no_ground(values: Array, gaps: list[float], rest: Array, metre: float) -> bool:
    """Whether values that many heights have are no road beside `rest`: numbers that programs use, and far away."""
    spread = float(rest[-1] - rest[0])
    if len(rest) < 3 or any(gap <= 3 * spread for gap in gaps):
        return False
    if all(gap * metre > _DEEPEST for gap in gaps):
        return True
    nines = len(rest) >= _FEWEST and bool((np.abs(values) >= 9).all())
    return bool(special(values).all()) and (nines or all(gap * metre > _FAR for gap in gaps))


def _apart(value: float, count: int, gap: float, rest: Array, metre: float, spike: int) -> bool:
    """Whether a value `gap` below or above the others (ascending) is none of them; `spike` heights far away are outliers."""
    spread = float(rest[-1] - rest[0])
    if spread == 0:  # on an even plate
        return (
            bool(special(np.float64(value)))
            and (
                gap * metre > _FAR
                or (gap > 100 * abs(rest[0]) and np.log10(abs(value) or 1.0) % 1.0)
            )  # a cleat of 10 mm
            and abs(value) >= 99
        )
    if not special(np.float64(value)):
        return gap * metre > _FAR and gap > 3 * spread and count > spike
    if count == 1 and abs(value) < 99:
        return count > spike and gap * metre > _FAR and gap > 3 * spread
    spacing = float(np.diff(rest).max())
    smallest = float(np.diff(rest).min())
    return gap > spread or (count > 2 and gap > _GAP * spacing and gap > 4 * _GAP * smallest)


def _in_runs(z: Array, values: Array, counts: NDArray[np.intp]) -> list[float]:
    """Values that repeat in irregular runs, between jumps, where the other heights do not."""
    some = (counts >= 4) & (counts <= _SHARE * counts.sum())
    if not some.any():
        return []
    same = z[:, 1:] == z[:, :-1]
    if not same.any():
        return []
    differ = np.abs(np.diff(z, axis=1))
    moves = differ[np.isfinite(differ) & (differ > 0)]
    if not moves.size:
        return []
    usual, quantum = float(np.median(moves)), _quantum(values)
    pairs = np.zeros(len(values))
    which, often = np.unique(z[:, 1:][same], return_counts=True)
    pairs[np.searchsorted(values, which)] = often
    starts = []
    for k in np.flatnonzero(some & (pairs >= 3)):
        value, marked = float(values[k]), bool(special(values[k]))
        runs, beside, inside = _runs(z, value)
        long = runs > 1
        if not len(beside):
            continue
        apart = float(np.median(np.abs(beside - value)))
        irregular = len(inside) and np.ptp(inside) > max(1, 0.1 * inside.max())
        total = counts.sum()
        others = (pairs.sum() - pairs[k] + 1) / max(total - counts[k], 1)
        expected = counts[k] * max(others, counts[k] / total)  # neighbours that are equal by chance
        end = k in (0, len(values) - 1)
        if end and _leads_up(values, k):
            continue  # clipped, or a plate
        between_jumps = apart > _JUMP * usual and long.sum() >= _RUNS and (irregular or marked)
        by_no_chance = pairs[k] > max(_CHANCE * (expected + 0.1), 0.3 * counts[k])
        tapered = apart <= max(_TAPER * quantum, _FADING * usual)  # heights that fade out to it
        if between_jumps or (marked and by_no_chance and not tapered):
            starts.append(value)
    return starts if len(starts) <= _MOST else []


def _repeated(z: Array, values: Array, counts: NDArray[np.intp]) -> list[float]:
    """Special numbers within the range of heights that repeat in several places, as no other height near them does."""
    differ = np.abs(np.diff(z, axis=1))
    moves = differ[np.isfinite(differ) & (differ > 0)]
    inner = special(values) & (counts > 1) & (counts <= _SHARE * counts.sum())
    inner[[0, -1]] = False
    if not moves.size or not inner.any():
        return []
    usual, quantum = float(np.median(moves)), _quantum(values)
    repeated = []
    for k in np.flatnonzero(inner):
        near = np.r_[max(0, k - _NEAR) : k, k + 1 : min(k + 1 + _NEAR, len(values))]
        expected = counts[near].sum() * quantum / (values[near[-1]] - values[near[0]])
        if not _unlikely(int(counts[k]), expected, int(counts[near].max())):
            continue
        _, beside, inside = _runs(z, float(values[k]))
        count = int(inside.sum())
        if len(inside) < 2 or inside.max() > _SHORT:
            continue
        improbable = _unlikely(count, expected, int(counts[near].max()))
        # Rough heights have jumps of their own, but no runs.
        runs = (inside > 1).sum() > 1 and count > _OFTEN * counts[near].max()
        least = _IN_RUNS if runs else _STANDS_OUT
        if improbable and np.median(np.abs(beside - values[k])) > least * usual:
            repeated.append(float(values[k]))
    return repeated


def _unlikely(count: int, expected: float, usual: int) -> bool:
    """Whether a height is there more often than those near it, and than chance makes (Poisson) where `expected` are."""
    return count > usual and count * math.log(expected) - math.lgamma(count + 1) < _IMPROBABLE


def _quantum(values: Array) -> float:
    """The power of ten of which all values are multiples, 1e-9 at least."""
    places = range(10)
    whole = (
        k
        for k in places
        if np.allclose(values * 10.0**k, np.round(values * 10.0**k), rtol=0, atol=1e-4)
    )
    return float(10.0 ** -next(whole, 9))


def _leads_up(values: Array, k: int) -> bool:
    """Whether the values beside the lowest or highest one are as close to it as they are to each other."""
    steps = np.diff(values)
    if k:
        steps = steps[::-1]
    return bool(steps[0] <= _GAP * np.median(steps[1:20]))


def _runs(z: Array, value: float) -> tuple[NDArray[np.intp], Array, NDArray[np.intp]]:
    """Lengths of the runs of a value along the rows of z, the heights beside them, and lengths of those inside."""
    rows = np.flatnonzero((z == value).any(axis=1))
    lengths, beside, inside = [], [], []
    for row in z[rows]:
        at = np.concatenate([[False], row == value, [False]])
        change = np.diff(at.astype(np.int8))
        begin, end = np.flatnonzero(change == 1), np.flatnonzero(change == -1)
        lengths.append(end - begin)
        within = (begin > 0) & (end < len(row))
        inside.append((end - begin)[within])
        beside += [row[begin[begin > 0] - 1], row[end[end < len(row)]]]
    near = np.concatenate(beside)
    return np.concatenate(lengths), near[np.isfinite(near)], np.concatenate(inside)


def refused(codes: list[float], count: int, where: str, source: str) -> InputError:
    """The error for values that look like codes; `count` heights have them (0: not counted), the first is at `where`."""
    shown = ", ".join(f"{code:.10g}" for code in codes)
    many = f"{count}, the first {where}" if count else where
    return InputError(
        f"{source}: heights of exactly {shown} ({many}) stand apart from the others: if they mean that there is none, say "
        f"road.missing = [{shown}]; if they are heights, say road.missing = []"
    )


@dataclass(frozen=True)
class CodeSearch:
    """Searches rows of heights for codes among the numbers of the file; picklable.

    A height is (number * `scale` + `offset`) * `metre` m.
    """

    source: str
    metre: float
    scale: float = 1.0
    offset: float = 0.0

    def __call__(self, z: Array, x: Array, y: Array) -> None:
        """InputError for a code among z (nx, ny) m at x (nx,), y (ny,) m."""
        most = max(_PIECE // max(len(y), 1), 2)
        for first in range(0, len(x), most):
            heights = z[first : first + most] / self.metre
            part = np.round(
                (heights - self.offset) / self.scale, 9 if self.scale == 1.0 else 5
            )  # as written
            if repeated := codes(part, self.metre * abs(self.scale), single=True):
                at = np.isin(part, repeated)
                i, j = np.argwhere(at)[0]
                where = f"at x = {x[first + i]:.6g} m, y = {y[j]:.4g} m"
                raise refused(repeated, int(at.sum()), where, self.source)
