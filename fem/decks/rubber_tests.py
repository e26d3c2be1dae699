"""Rubber laws fitted to test data: uniaxial, equibiaxial and planar tension or compression.

For an incompressible rubber with the stretches l_1, l_2 and l_3 = 1 / (l_1 l_2), free along 3, the nominal
stress along 1 is dW/dl_1 - l_3 / l_1 dW/dl_3. With W(I1, I2), dW/dl_i = 2 l_i (W_1 + (I1 - l_i^2) W_2).
The sum of squares of the stress's error over all data is least, as written in the deck: large stresses count
most. Coefficients that enter linearly are those of a linear least-squares problem at any value of the others.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from tireroad.fem.errors import InputError
from tireroad.fem.tire.laws.polynomial import CHAIN

# Stretches along 2 and 3 as powers of that along 1.
TESTS = {
    "UNIAXIAL TEST DATA": (-0.5, -0.5),
    "BIAXIAL TEST DATA": (1.0, -2.0),
    "PLANAR TEST DATA": (0.0, -1.0),
}
_ENOUGH = 0.01  # of the stress's norm: Marlow's function is not followed closer


@dataclass(frozen=True)
class Curve:
    """A test: `stretch` (n,) and nominal `stress` (n,) in the deck's unit, and the law's from rest on.

    The law is `fitted` (k,) at the stretches `along` (k,).
    """

    test: str
    stretch: np.ndarray
    stress: np.ndarray
    along: np.ndarray
    fitted: np.ndarray


@dataclass(frozen=True)
class Fit:
    """A fitted law, its coefficients by the scene's keys, and the error's norm over the stress's."""

    model: str
    coefficients: Mapping[str, float | tuple[float, ...]]
    error: float
    curves: tuple[Curve, ...] = field(repr=False)


@dataclass(frozen=True)
class _Points:
    """All data: stretches (n, 3) and nominal stress (n,)."""

    stretches: np.ndarray
    stress: np.ndarray

    def of(self, first: np.ndarray, second: np.ndarray | float = 0.0) -> np.ndarray:
        """Nominal stress (n,) for W_1 and W_2 at the points."""
        one, _, three = self.stretches.T
        total = self.invariants[0]
        return 2 * (
            (one - three**2 / one) * first
            + (one * (total - one**2) - three**2 / one * (total - three**2)) * second
        )

    @property
    def invariants(self) -> tuple[np.ndarray, np.ndarray]:
        """I1 and I2 (n,)."""
        squares = self.stretches**2
        return squares.sum(axis=1), (1 / squares).sum(axis=1)

    def power(self, alpha: float) -> np.ndarray:
        """Nominal stress (n,) of a term of Ogden's law with mu = 1."""
        first, _, three = self.stretches.T
        return 2 / alpha * (first ** (alpha - 1) - three**alpha / first)


def fitted(
    model: str, order: int, tests: Mapping[str, np.ndarray], refuse: Callable[[str], InputError]
) -> Fit:
    """The law `model` of an order (terms of "ogden", powers of "reduced-polynomial") for some tests.

    `tests`: keyword -> (n, 2) of nominal stress and strain. `model`: mooney-rivlin, polynomial,
    reduced-polynomial, arruda-boyce, ogden or marlow. Raises what `refuse` makes of a reason.
    """
    curves = {name: _curve(name, table, refuse) for name, table in tests.items() if len(table)}
    if not curves:
        raise refuse("its test data are missing: *UNIAXIAL, *BIAXIAL or *PLANAR TEST DATA")
    points = _Points(
        np.concatenate([stretches for stretches, _ in curves.values()]),
        np.concatenate([stress for _, stress in curves.values()]),
    )
    name, values, stress = _LAWS[model](points, order)
    size = np.linalg.norm(points.stress)
    error = float(np.linalg.norm(stress(points) - points.stress) / size) if size else np.inf
    if not (np.isfinite(error) and error < 1):
        raise refuse("no coefficients follow its test data: are stress and strain in this order?")
    fits = []
    for test, (stretches, given) in curves.items():
        ends = min(stretches[:, 0].min(), 1.0), max(stretches[:, 0].max(), 1.0)
        along = np.linspace(*ends, 60)
        line = _Points(_stretches(test, along), np.zeros(60))
        fits.append(Curve(test, stretches[:, 0], given, along, stress(line)))
    return Fit(name, values, error, tuple(fits))


def _stretches(test: str, first: np.ndarray) -> np.ndarray:
    """All three (n, 3) of a test."""
    return np.column_stack([first, *(first**p for p in TESTS[test])])


def _curve(
    name: str, table: np.ndarray, refuse: Callable[[str], InputError]
) -> tuple[np.ndarray, np.ndarray]:
    """Stretches (n, 3) and stress (n,) of a test, without its point at rest."""
    stress, strain = table[:, 0], table[:, 1]
    if (strain <= -1).any():
        raise refuse(f"a strain of {strain.min():g} in its *{name}: nominal strains are above -1")
    if (stress * strain < 0).any():
        raise refuse(
            f"stress and strain of different sign in its *{name}: a line is stress, strain"
        )
    moved = strain != 0
    return _stretches(name, 1 + strain[moved]), stress[moved]


def _linear(columns: list[np.ndarray], stress: np.ndarray) -> np.ndarray:
    """Least squares with columns of any size."""
    table = np.array(columns).T
    size = np.linalg.norm(table, axis=0)
    size[size == 0] = 1.0
    return np.linalg.lstsq(table / size, stress, rcond=1e-12)[0] / size


_Found = tuple[str, dict, Callable[[_Points], np.ndarray]]


def _terms(points: _Points, names: tuple[str, ...]) -> list[np.ndarray]:
    """Stress of cij = 1 for each of the names: cij (I1 - 3)^i (I2 - 3)^j."""
    first, second = (invariant - 3 for invariant in points.invariants)
    columns = []
    for i, j in ((int(name[1]), int(name[2])) for name in names):
        by_first = i * first ** (i - 1) * second**j if i else 0 * first
        by_second = j * first**i * second ** (j - 1) if j else 0 * first
        columns.append(points.of(by_first, by_second))
    return columns


def _polynomial(points: _Points, model: str, names: tuple[str, ...]) -> _Found:
    coefficients = _linear(_terms(points, names), points.stress)
    values = dict(zip(names, coefficients.tolist(), strict=True))
    return model, values, lambda at: np.array(_terms(at, names)).T @ coefficients


def _reduced(points: _Points, order: int) -> _Found:
    return _polynomial(points, "reduced-polynomial", tuple(f"c{i}0" for i in range(1, order + 1)))


def _marlow(points: _Points, _: int) -> _Found:
    """A function of I1 alone, by the lowest order of (I1 - 3) that follows the test."""
    for order in range(1, min(6, len(points.stress)) + 1):
        table = _reduced(points, order)
        off = np.linalg.norm(table[2](points) - points.stress)
        if off <= _ENOUGH * np.linalg.norm(points.stress):
            break
    return table


def _chains(points: _Points, _: int) -> _Found:
    from scipy.optimize import minimize_scalar

    def column(at: _Points, limit: float) -> np.ndarray:
        first = at.invariants[0]
        terms = [i * c / limit ** (2 * i - 2) * first ** (i - 1) for i, c in enumerate(CHAIN, 1)]
        return at.of(np.sum(terms, axis=0))

    def off(logarithm: float) -> float:
        residual = column(points, np.exp(logarithm))
        return float(np.linalg.norm(points.stress - residual * _linear([residual], points.stress)))

    starts = np.log(np.geomspace(1.02, 50, 30))
    best = int(np.argmin([off(s) for s in starts]))
    bounds = starts[max(best - 1, 0)], starts[min(best + 1, len(starts) - 1)]
    limit = float(np.exp(minimize_scalar(off, bounds=bounds, method="bounded").x))
    mu = float(_linear([column(points, limit)], points.stress)[0])
    return (
        "arruda-boyce",
        {"mu": mu, "locking_stretch": limit},
        lambda at: mu * column(at, limit),
    )


def _ogden(points: _Points, order: int) -> _Found:
    """Powers by least squares from several starts; at each the moduli are linear."""
    from scipy.optimize import least_squares

    def columns(at: _Points, powers: np.ndarray) -> list[np.ndarray]:
        return [at.power(a if abs(a) > 1e-3 else 1e-3) for a in powers]

    def off(powers: np.ndarray) -> np.ndarray:
        table = columns(points, powers)
        return (np.array(table).T @ _linear(table, points.stress) - points.stress) / scale

    scale = np.linalg.norm(points.stress) or 1.0
    exponents = np.array([2.0, -2.0, 5.0, -4.0, 8.0, -6.0])
    starts = [
        exponents[:order],
        0.5 * exponents[:order],
        -exponents[:order],
        1.0 + np.arange(order),
    ]
    results = [least_squares(off, start, bounds=(-9, 12)) for start in starts]
    powers = min(results, key=lambda result: result.cost).x
    powers[np.abs(powers) <= 1e-3] = 1e-3
    moduli = _linear(columns(points, powers), points.stress)
    values = {"moduli": tuple(moduli.tolist()), "powers": tuple(powers.tolist())}
    return "ogden", values, lambda at: np.array(columns(at, powers)).T @ moduli


_LAWS: dict[str, Callable[[_Points, int], _Found]] = {
    "mooney-rivlin": lambda points, _: _polynomial(points, "mooney-rivlin", ("c10", "c01")),
    "polynomial": lambda points, _: _polynomial(
        points, "polynomial", ("c10", "c01", "c20", "c11", "c02")
    ),
    "reduced-polynomial": _reduced,
    "marlow": _marlow,
    "arruda-boyce": _chains,
    "ogden": _ogden,
}
