"""The air in the tire on the basis of undamped modes: what joins the projected problem.

With coordinates eta of the tire and g of the air's own modes (fem.cavity.duct), e (1 + a, m) what each mode
displaces, w the air's circular frequencies and e' the rows of e without the first,

    [K~ + e^T e      -e'^T w ]        [D~        0       ]
    [-w e'       w^2 + Omega^2 S_a + Omega D_a G_a ],  [0   D_a + 2 Omega G_a ],   M~ = 1.

The tire's shapes at the outer face are zero in g. Standing, the pencil is symmetric: g is a displacement.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from tireroad.fem.cavity.duct import Duct


@dataclass(frozen=True)
class Air:
    """`coupling` e (1 + a, m) 1/s of m coordinates; of the air's modes `circular` (a,) rad/s,
    `gyroscopic` (a, a) 1/rad, `convective` (a, a) 1/rad2, `momentum` (3, a) kg^1/2, `loss` (a,) 1/s.
    """

    coupling: np.ndarray
    circular: np.ndarray
    gyroscopic: np.ndarray
    convective: np.ndarray
    momentum: np.ndarray
    loss: np.ndarray

    @property
    def count(self) -> int:
        """Coordinates of the air."""
        return len(self.circular)

    def pencil(self, speed: float) -> tuple[np.ndarray, np.ndarray]:
        """The air's own D~ (1/s) and K~ (1/s2), (a, a), at `speed` rad/s."""
        drag = np.diag(self.loss) + 2 * speed * self.gyroscopic
        turning = speed * self.loss[:, None] * self.gyroscopic
        return drag, np.diag(self.circular**2) + speed**2 * self.convective + turning

    def joined(
        self, drag: np.ndarray, stiffness: np.ndarray, speed: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """D~ and K~ (m + a, m + a) of tire and air from those of the tire (m, m)."""
        own_drag, own_stiffness = self.pencil(speed)
        across = -self.circular[:, None] * self.coupling[1:]
        whole = np.block(
            [[stiffness + self.coupling.T @ self.coupling, across.T], [across, own_stiffness]]
        )
        return linalg.block_diag(drag, own_drag), whole

    def static_stiffness(self, speed: float) -> np.ndarray:
        """W (1 + a, 1 + a): a tire moved for good feels e^T W e more stiffness, 1 for the trapped air alone
        when it stands; of a turning wheel's flow the square of its Mach number remains.
        """
        _, own = self.pencil(speed)
        held = np.diag(self.circular) @ np.linalg.solve(own, np.diag(self.circular))
        return linalg.block_diag(1.0, np.eye(self.count) - held)


def air(duct: Duct, flux: np.ndarray) -> Air:
    """The duct's air driven by what coordinates displace, `flux` (f, m) as in fem.cavity.duct."""
    return Air(
        duct.coupling(flux),
        duct.circular,
        duct.gyroscopic,
        duct.convective,
        duct.momentum,
        duct.loss,
    )
