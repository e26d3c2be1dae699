"""Laws polynomial in the invariants: Mooney-Rivlin, Yeoh, their general forms, and Arruda-Boyce."""

from dataclasses import dataclass
from typing import ClassVar

from ufl.core.expr import Expr

from tireroad.fem.parameters import number
from tireroad.fem.tire.material import MaterialLaw, material_law

# Of the inverse Langevin function, to the fifth order in I1 (Arruda and Boyce 1993).
CHAIN = (1 / 2, 1 / 20, 11 / 1050, 19 / 7000, 519 / 673750)


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

    coefficients: ClassVar[tuple[str, ...]] = ("c10", "c20", "c30", "bulk")

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


@material_law("reduced-polynomial", "rubber of the sixth order in the first invariant")
class ReducedPolynomial(Yeoh):
    """sum over i of ci0 (I1 - 3)^i, i = 1 to 6; Yeoh's is its third order."""

    c40: float = number(0.0, "Pa", "coefficient of (I1 - 3)^4", least=-1e13, most=1e13)
    c50: float = number(0.0, "Pa", "coefficient of (I1 - 3)^5", least=-1e13, most=1e13)
    c60: float = number(0.0, "Pa", "coefficient of (I1 - 3)^6", least=-1e13, most=1e13)

    coefficients = ("c10", "c20", "c30", "c40", "c50", "c60", "bulk")

    @staticmethod
    def energy(C: Expr, *coefficients: Expr) -> tuple[Expr, Expr]:
        """The polynomial of the isochoric part, and K/2 (J - 1)^2."""
        from tireroad.fem.kinematics import dilatation, isochoric

        excess = isochoric(C)[0] - 3
        *those, bulk = coefficients
        return sum(c * excess**i for i, c in enumerate(those, 1)), dilatation(C, bulk)


@material_law("polynomial", "rubber of the second order in both invariants")
class SecondOrder(Polynomial):
    """sum over i + j = 1, 2 of cij (I1 - 3)^i (I2 - 3)^j (Rivlin)."""

    c01: float = number(1.6e7, "Pa", "coefficient of I2 - 3", least=-1e13, most=1e13)
    c20: float = number(0.0, "Pa", "coefficient of (I1 - 3)^2", least=-1e13, most=1e13)
    c11: float = number(0.0, "Pa", "coefficient of (I1 - 3) (I2 - 3)", least=-1e13, most=1e13)
    c02: float = number(0.0, "Pa", "coefficient of (I2 - 3)^2", least=-1e13, most=1e13)

    coefficients = ("c10", "c01", "c20", "c11", "c02", "bulk")

    @property
    def shear(self) -> float:
        """2 (c10 + c01), Pa."""
        return 2 * (self.c10 + self.c01)

    @staticmethod
    def energy(
        C: Expr, c10: Expr, c01: Expr, c20: Expr, c11: Expr, c02: Expr, bulk: Expr
    ) -> tuple[Expr, Expr]:
        """The polynomial of the isochoric part, and K/2 (J - 1)^2."""
        from tireroad.fem.kinematics import dilatation, isochoric

        first, second = (invariant - 3 for invariant in isochoric(C))
        linear = c10 * first + c01 * second
        return linear + c20 * first**2 + c11 * first * second + c02 * second**2, dilatation(C, bulk)


@material_law(
    "arruda-boyce", "rubber of eight chains a cell, which stiffen towards their full length"
)
class ArrudaBoyce(MaterialLaw):
    """mu sum over i of C_i / l^(2 i - 2) (I1^i - 3^i), i = 1 to 5 (J. Mech. Phys. Solids 41, 1993)."""

    mu: float = number(
        1.6e8, "Pa", "modulus; of shear at zero strain for long chains", least=1e2, most=1e13
    )
    locking_stretch: float = number(
        3.0, "-", "stretch l at which the chains are straight", least=1.01, most=1e3
    )
    bulk_modulus: float = number(1.6e9, "Pa", "bulk modulus", least=1e3, most=1e15)

    coefficients = ("mu", "locking_stretch", "bulk")

    @property
    def bulk(self) -> float:
        """The bulk modulus, Pa."""
        return self.bulk_modulus

    @property
    def shear(self) -> float:
        """2 mu sum over i of i C_i 3^(i - 1) / l^(2 i - 2), Pa."""
        limit = self.locking_stretch**2
        return 2 * self.mu * sum(i * c * (3 / limit) ** (i - 1) for i, c in enumerate(CHAIN, 1))

    @staticmethod
    def energy(C: Expr, mu: Expr, locking_stretch: Expr, bulk: Expr) -> tuple[Expr, Expr]:
        """The polynomial of the isochoric part, and K/2 (J - 1)^2."""
        from tireroad.fem.kinematics import dilatation, isochoric

        first, limit = isochoric(C)[0], locking_stretch**2
        terms = [c / limit ** (i - 1) * (first**i - 3**i) for i, c in enumerate(CHAIN, 1)]
        return mu * sum(terms), dilatation(C, bulk)
