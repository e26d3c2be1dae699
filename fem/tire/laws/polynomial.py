"""Laws polynomial in the invariants: Mooney-Rivlin and Yeoh."""

from dataclasses import dataclass

from ufl.core.expr import Expr

from tireroad.fem.parameters import number
from tireroad.fem.tire.material import MaterialLaw, material_law


@dataclass(frozen=True, kw_only=True)
class Polynomial(MaterialLaw):
    """Base with the common parameters."""

    c10: float = number(6.6e7, "Pa", "coefficient of the first invariant", least=1e2, most=1e13)
    bulk_modulus: float = number(1.6e9, "Pa", "bulk modulus", least=1e3, most=1e15)

    @property
    def bulk(self) -> float:
        """The bulk modulus, Pa."""
        return self.bulk_modulus


@material_law("mooney-rivlin", "Mooney-Rivlin rubber, linear in both invariants")
class MooneyRivlin(Polynomial):
    """c10 (I1 - 3) + c01 (I2 - 3)."""

    c01: float = number(1.6e7, "Pa", "coefficient of the second invariant", least=0, most=1e13)

    coefficients = ("c10", "c01", "bulk")

    @property
    def shear(self) -> float:
        """2 (c10 + c01), Pa."""
        return 2 * (self.c10 + self.c01)

    @staticmethod
    def energy(C: Expr, c10: Expr, c01: Expr, bulk: Expr) -> tuple[Expr, Expr]:
        """c10 (I1 - 3) + c01 (I2 - 3) of the isochoric part, and K/2 (J - 1)^2."""
        from tireroad.fem.kinematics import dilatation, isochoric

        first, second = isochoric(C)
        return c10 * (first - 3) + c01 * (second - 3), dilatation(C, bulk)


@material_law("yeoh", "Yeoh's rubber, cubic in the first invariant")
class Yeoh(Polynomial):
    """c10 (I1 - 3) + c20 (I1 - 3)^2 + c30 (I1 - 3)^3."""

    c20: float = number(
        0.0, "Pa", "coefficient of the first invariant squared", least=-1e13, most=1e13
    )
    c30: float = number(
        0.0, "Pa", "coefficient of the first invariant cubed", least=-1e13, most=1e13
    )

    coefficients = ("c10", "c20", "c30", "bulk")

    @property
    def shear(self) -> float:
        """2 c10, Pa."""
        return 2 * self.c10

    @staticmethod
    def energy(C: Expr, c10: Expr, c20: Expr, c30: Expr, bulk: Expr) -> tuple[Expr, Expr]:
        """The polynomial of the isochoric part, and K/2 (J - 1)^2."""
        from tireroad.fem.kinematics import dilatation, isochoric

        excess = isochoric(C)[0] - 3
        return c10 * excess + c20 * excess**2 + c30 * excess**3, dilatation(C, bulk)
