"""Elastic treads: a half-space, or a layer bonded to a rigid base (the belt)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tireroad.contact.tread.compliance import Influence, half_space_influence
from tireroad.contact.tread.law import TreadLaw, tread_law
from tireroad.fem.parameters import number

Array = NDArray[np.float64]

FREQUENCY = 1000.0  # Hz: at which a tread with losses has its modulus


@dataclass(frozen=True, kw_only=True)
class ElasticTread(TreadLaw):
    """An isotropic rubber."""

    youngs_modulus: float = number(
        3.4e8,
        "Pa",
        "Young's modulus of the tread; rubber has about 1e7, and so has a radial tire where this is absent, times what its "
        "tread is stiffer than built in",
        least=1e3,
        most=1e13,
    )
    shears = True
    poisson_ratio: float = number(0.49, "-", "Poisson's ratio of the tread", least=-0.99, most=0.5)


@tread_law("half-space", "elastic half-space (Love's formula)")
class HalfSpace(ElasticTread):
    """Uniform pressure on the rectangle of each point."""

    def influence(self, farthest: float) -> Influence:
        """Love's formula; see contact.tread.compliance."""

        def of(x: Array, y: Array, a: Array, b: Array) -> Array:
            return half_space_influence(x, y, a, b, self.youngs_modulus, self.poisson_ratio)

        return of

    def shear(self, farthest: float) -> Influence:
        """Cerruti's formulas; see contact.tread.shear."""
        # scipy, not needed to read a scene
        from tireroad.contact.tread.shear import half_space_shear

        def of(x: Array, y: Array, a: Array, b: Array) -> Array:
            return half_space_shear(x, y, a, b, self.youngs_modulus, self.poisson_ratio)

        return of


@tread_law("layer", "elastic layer bonded to a stiff base")
class ElasticLayer(ElasticTread):
    """A tread of finite thickness on the belt."""

    thickness: float = number(0.010, "m", "thickness of the layer", least=1e-4, most=1)
    loss_factor: float = number(
        0.0,
        "-",
        "loss factor tan δ of the layer's rubber from 40 to 2500 Hz, on a grid of points, whose history travels with the tread; "
        "youngs_modulus is then that at 1 kHz, and rises with frequency as it does with such losses; absent: none, of the tire's "
        "own tread that of its compound",
        least=0,
        most=1,
    )

    @property
    def creeps(self) -> bool:
        """Whether it has losses."""
        return self.loss_factor > 0.0

    @property
    def creep(self) -> tuple[Array, Array] | None:
        """Shares and times (k,), - and s, of its creep, if it has losses."""
        if not self.loss_factor:
            return None
        from tireroad.contact.tread.memory import creep_of, relaxation_of

        return creep_of(*relaxation_of(self.loss_factor, FREQUENCY)[1:])

    def influence(self, farthest: float) -> Influence:
        """The half-space's influence with a correction; see contact.tread.layer."""
        from tireroad.contact.tread.layer import LayerInfluence  # scipy, not needed to read a scene

        return LayerInfluence(self._at_once, self.poisson_ratio, self.thickness)

    def shear(self, farthest: float) -> Influence:
        """The half-space's shear with a correction; see contact.tread.layer."""
        from tireroad.contact.tread.layer import LayerShear

        return LayerShear(self._at_once, self.poisson_ratio, self.thickness)

    @property
    def _at_once(self) -> float:
        """Young's modulus of what is pressed at once, Pa."""
        if not self.loss_factor:
            return self.youngs_modulus
        from tireroad.contact.tread.memory import relaxation_of

        return self.youngs_modulus * relaxation_of(self.loss_factor, FREQUENCY)[0]
