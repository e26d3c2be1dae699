"""Ogden's law, without principal stretches.

With C' = J^(-2/3) C the law is a trace of a function of C', tr f(C'), f(x) = sum over i of
2 mu_i / alpha_i^2 x^(alpha_i / 2). Its derivatives in terms of principal stretches are 0/0 where two of
them are equal, as in the undeformed tire. Here f is a sum of functions whose trace follows from the
invariants (det C' = 1):

    tr C'^n:           p_n = I1 p_(n-1) - I2 p_(n-2) + p_(n-3)   (Cayley-Hamilton)
    tr (C' + t)^-1:    (3 t^2 + 2 I1 t + I2) / (t^3 + I1 t^2 + I2 t + 1)

with weights that give the tangent x d/dx (x f'(x)) by least squares, relative to
sum |mu_i| / 2 x^(alpha_i / 2), at stretches from 1/2.5 to 2.5; its largest error there is `error`.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from ufl.core.expr import Expr

from tireroad.fem.parameters import Limits, ParameterError, number, numbers
from tireroad.fem.tire.material import MaterialLaw, material_law

TERMS = 6
STRETCH = 2.5  # largest, and inverse of the smallest
POWERS = (-4, -3, -2, -1, 1, 2, 3, 4, 5, 6)
POLES = tuple(np.geomspace(1 / (4 * STRETCH**2), 4 * STRETCH**2, 8).tolist())
_LARGEST_ERROR = 1e-3


@lru_cache(maxsize=64)
def weights(mu: tuple[float, ...], alpha: tuple[float, ...]) -> tuple[tuple[float, ...], float]:
    """Weights of the powers and poles, Pa, and the largest relative error of the tangent."""
    x = np.geomspace(STRETCH**-2, STRETCH**2, 400)
    moduli, half = np.array(mu), np.array(alpha) / 2
    terms = moduli / 2 * x[:, None] ** half
    scale = np.abs(terms).sum(axis=1)
    columns = [p**2 * x**p for p in POWERS]
    columns += [x * (x - t) / (x + t) ** 3 for t in POLES]
    table = np.array(columns).T / scale[:, None]
    target = terms.sum(axis=1) / scale
    size = np.linalg.norm(table, axis=0)
    found = np.linalg.lstsq(table / size, target, rcond=1e-13)[0]
    error = float(np.abs(table / size @ found - target).max())
    return tuple((found / size).tolist()), error


@material_law("ogden", "Ogden's rubber, of up to six powers of the principal stretches")
class Ogden(MaterialLaw):
    """sum over i of 2 mu_i / alpha_i^2 (l1^alpha_i + l2^alpha_i + l3^alpha_i - 3), l_k isochoric."""

    moduli: tuple[float, ...] = numbers(
        "mu_1, mu_2, ...: shares of the shear modulus", "Pa", Limits(-1e13, 1e13), (1.6e8,)
    )
    powers: tuple[float, ...] = numbers(
        "alpha_1, alpha_2, ...: powers of the stretches, one for each of moduli",
        "-",
        Limits(-50, 50),
        (2.0,),
    )
    bulk_modulus: float = number(1.6e9, "Pa", "bulk modulus", least=1e3, most=1e15)

    coefficients = (*(f"weight_{k}" for k in range(len(POWERS) + len(POLES))), "bulk")

    def validate(self) -> None:
        """As many powers, none of them 0, as moduli, whose sum is positive; and within what is carried."""
        if len(self.powers) != len(self.moduli) or not 1 <= len(self.moduli) <= TERMS:
            raise ParameterError("powers", f"needs one for each of moduli, 1 to {TERMS}")
        if 0 in self.powers:
            raise ParameterError("powers", "must not be 0")
        if not self.shear > 0:
            raise ParameterError("moduli", "must have a sum above 0, the shear modulus")
        if self.error > _LARGEST_ERROR:
            raise ParameterError(
                "powers",
                f"of {min(self.powers):g} to {max(self.powers):g} are beyond what the elements carry (error of the tangent "
                f"{self.error:.1g}, at most {_LARGEST_ERROR:g} is taken): fit the test data with powers from -9 to 12",
            )

    @property
    def shear(self) -> float:
        """The sum of mu_i, Pa."""
        return sum(self.moduli)

    @property
    def bulk(self) -> float:
        """The bulk modulus, Pa."""
        return self.bulk_modulus

    @property
    def error(self) -> float:
        """Largest error of the tangent at stretches from 1/2.5 to 2.5, relative."""
        return weights(self.moduli, self.powers)[1]

    def __getattr__(self, name: str) -> float:
        if name.startswith("weight_"):
            return weights(self.moduli, self.powers)[0][int(name.removeprefix("weight_"))]
        raise AttributeError(name)

    @staticmethod
    def energy(C: Expr, *coefficients: Expr) -> tuple[Expr, Expr]:
        """The traces of the isochoric part, and K/2 (J - 1)^2."""
        from tireroad.fem.kinematics import dilatation, isochoric

        first, second = isochoric(C)
        *those, bulk = coefficients
        powers = {0: 3.0, 1: first, 2: first**2 - 2 * second, -1: second, -2: second**2 - 2 * first}
        for n in range(3, max(POWERS) + 1):
            powers[n] = first * powers[n - 1] - second * powers[n - 2] + powers[n - 3]
        for n in range(3, -min(POWERS) + 1):
            powers[-n] = second * powers[1 - n] - first * powers[2 - n] + powers[3 - n]
        traces = [powers[n] for n in POWERS]
        traces += [
            (3 * t**2 + 2 * t * first + second) / (t**3 + t**2 * first + t * second + 1)
            for t in POLES
        ]
        return sum(w * trace for w, trace in zip(those, traces, strict=True)), dilatation(C, bulk)
