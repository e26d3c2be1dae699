"""A material of your own: a class with its parameters, its strain energy, and its moduli at zero strain.

Run it with `./tireroad python examples/own_material.py`.
"""

from __future__ import annotations

import ufl

import tireroad as tr
from tireroad.fem.kinematics import dilatation, isochoric
from tireroad.fem.parameters import number
from tireroad.fem.tire.laws.elastic import Elastic
from tireroad.fem.tire.material import MATERIALS, material_law


@material_law("gent", "Gent's rubber, which stiffens towards its limit of stretch")
class Gent(Elastic):
    """Young's modulus and Poisson's ratio as of the other elastic laws, and one parameter more."""

    limit: float = number(0.1, "-", "I1 - 3 that cannot be reached", least=1e-3, most=100)

    coefficients = ("shear", "bulk", "limit")

    @staticmethod
    def energy(C, shear, bulk, limit):
        """-G/2 limit ln(1 - (I1 - 3) / limit) of the isochoric part, and K/2 (J - 1)^2."""
        excess = isochoric(C)[0] - 3
        return -shear * limit / 2 * ufl.ln(1 - excess / limit), dilatation(C, bulk)


def main() -> tuple[float, float]:
    """Load in N at 4 mm of deflection: neo-Hookean rubber, and Gent's of the same moduli."""
    loads = []
    for model in ("neo-hookean", "gent"):
        rubber = tr.compound(model, 1200.0, youngs_modulus=48e6, poisson_ratio=0.45)
        tire = tr.torus(segments=16, elements_arc=8, order=2, footprint_size=0.3, material=rubber)
        loads.append(tr.press(tire, inflation=2e5, deflection=0.004).load)
    return loads[0], loads[1]


if __name__ == "__main__":
    print("neo-Hookean {:.1f} N, Gent {:.1f} N".format(*main()))
    MATERIALS.forget("gent")
