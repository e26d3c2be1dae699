"""A material of your own: one function of the right Cauchy-Green tensor, entered in the table of laws."""

from __future__ import annotations

import ufl

import tireroad as tr
from tireroad.fem.tire.material import LAWS, Law


def gent(C, shear, bulk):
    """Gent's rubber, which stiffens towards I1 - 3 = 0.1: distortion and dilatation, J/m3."""
    J = ufl.sqrt(ufl.det(C))
    excess = J ** (-2 / 3) * ufl.tr(C) - 3
    limit = 0.1
    return -shear * limit / 2 * ufl.ln(1 - excess / limit), bulk / 2 * (J - 1) ** 2


def main() -> tuple[float, float]:
    """Load in N at 4 mm of deflection: neo-Hookean rubber, and Gent's of the same moduli."""
    LAWS.setdefault("gent", Law(gent, LAWS["neo-hookean"].coefficients))
    loads = []
    for model in ("neo-hookean", "gent"):
        rubber = tr.Material(model, 1200.0, youngs_modulus=48e6, poisson_ratio=0.45)
        tire = tr.torus(segments=16, elements_arc=8, order=2, footprint_size=0.3, material=rubber)
        loads.append(tr.press(tire, inflation=2e5, deflection=0.004).load)
    return loads[0], loads[1]


if __name__ == "__main__":
    print("neo-Hookean {:.1f} N, Gent {:.1f} N".format(*main()))
