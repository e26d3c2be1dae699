"""Cords of a steel belt."""

import numpy as np

from tireroad.fem.tire.cords import Cords

STEEL = {"youngs_modulus": 172.2e9, "area": 2.118e-7, "spacing": 1.16e-3}


def cords(angle, name="belt", **more):
    return Cords(angle=np.radians(angle), **(STEEL | {"name": name} | more))
