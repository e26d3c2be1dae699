"""Schemes of the time loop: the force within a step, from the forces f_n at its end, f_{n-1} and f_{n-2}.

A scheme is declared here with all that others ask of it; `greens.recursion` steps by it.

    linear       from f_{n-1} to f_n: second order; a contact that the step does not resolve chatters
    damped       (9 f_n + 6 f_{n-1} + f_{n-2}) / 16 throughout: second order; damps such a contact
    constant     f_n throughout: first order, as forces half a step early; never gains energy from
                 contact
    convolution  as linear, by sampled Green's functions and all forces of the past: the reference

Of the means a f_n + b f_{n-1} + c f_{n-2} that are of second order, a = 1/2 + c, b = 1/2 - 2 c, the
error is (1/8 + c) h^2 f'' and the work that springs lose on an oscillation of angle t a step is as
2 c (1 - cos t)^2 >= 0, whatever the tire. With c = 1/16 a mass bouncing on a spring of stiffness k
loses at least 2.5 % of its amplitude a step from k h^2 / m = 2 to 10^3.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

DAMPED = 1 / 16


@dataclass(frozen=True)
class Scheme:
    """One scheme. A state advances by z_n = e^{sh} z_{n-1} + b0 P l + b1 P f_n.

    `earlier`: parts of f_{n-1} and f_{n-2} in the earlier force l; `held`: whether the force is constant
    over the step, b0 and b1 then being multiples of h phi1; `curvature`: c of the mean above; `late`:
    whether the mean force of a step is f_n itself, half a step early; `history`: whether all forces of
    the past are kept; `chatters`: whether points that open and close from step to step may come from
    the scheme.
    """

    earlier: tuple[float, float] = (1.0, 0.0)
    held: bool = False
    curvature: float = 0.0
    late: bool = False
    history: bool = False
    chatters: bool = True

    @property
    def order(self) -> float:
        """Order of the error in the step."""
        return 1.0 if self.late else 2.0

    def shares(self, first: np.ndarray, second: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """b0 and b1 from h phi1 and h phi2."""
        if not self.held:
            return first - second, second
        return (0 * first, first) if self.late else (first, (0.5 + self.curvature) * first)

    def ahead_of_mean(self, forces: np.ndarray) -> np.ndarray:
        """The mean force that acts during each step, less (f_n + f_{n-1}) / 2: (n, k) N.

        `forces` (n + 2, k) N: at the ends of n steps, with the two before them.
        """
        if self.late:
            return 0.5 * np.diff(forces[1:], axis=0)
        return self.curvature * np.diff(forces, 2, axis=0)


SCHEMES: Mapping[str, Scheme] = {
    "linear": Scheme(),
    "damped": Scheme((0.5 - 2 * DAMPED, DAMPED), held=True, curvature=DAMPED, chatters=False),
    "constant": Scheme(held=True, late=True),
    "convolution": Scheme(history=True),
}


def keeps_history(name: str) -> bool:
    """Whether the scheme of this name, which may be "auto", keeps all forces of the past."""
    return name in SCHEMES and SCHEMES[name].history
