"""Laws with Young's modulus and Poisson's ratio: Hookean and neo-Hookean."""

from dataclasses import dataclass

from ufl.core.expr import Expr

from tireroad.fem.parameters import number
from tireroad.fem.tire.material import MaterialLaw, material_law


@dataclass(frozen=True, kw_only=True)
class Elastic(MaterialLaw):
    """Base of laws with these two parameters."""

    youngs_modulus: float = number(
        4.8e8, "Pa", "Young's modulus at small strain", least=1e3, most=1e13
    )
    poisson_ratio: float = number(
        0.45, "-", "Poisson's ratio at small strain", least=-0.9, most=0.4999
    )

    coefficients = ("shear", "bulk")

    @property
    def shear(self) -> float:
        """E / (2 (1 + nu)), Pa."""
        return self.youngs_modulus / (2 * (1 + self.poisson_ratio))

    @property
    def bulk(self) -> float:
        """E / (3 (1 - 2 nu)), Pa."""
        return self.youngs_modulus / (3 * (1 - 2 * self.poisson_ratio))


@material_law(
    "linear", "Hooke's law between Green-Lagrange strain and second Piola-Kirchhoff stress"
)
class Linear(Elastic):
    """For small strains and large rotations."""

    @staticmethod
    def energy(C: Expr, shear: Expr, bulk: Expr) -> tuple[Expr, Expr]:
        """G E_d : E_d and K/2 (tr E)^2 with E = (C - I) / 2."""
        import ufl  # slow to import, and not needed to read a scene

        E = (C - ufl.Identity(3)) / 2
        return shear * ufl.inner(ufl.dev(E), ufl.dev(E)), bulk / 2 * ufl.tr(E) ** 2


@material_law("neo-hookean", "neo-Hookean rubber")
class NeoHookean(Elastic):
    """The simplest rubber law."""

    @staticmethod
    def energy(C: Expr, shear: Expr, bulk: Expr) -> tuple[Expr, Expr]:
        """G/2 (I1 - 3) of the isochoric part, and K/2 (J - 1)^2."""
        from tireroad.fem.kinematics import dilatation, isochoric

        first, _ = isochoric(C)
        return shear / 2 * (first - 3), dilatation(C, bulk)
