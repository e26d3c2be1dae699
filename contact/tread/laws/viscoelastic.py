"""A viscoelastic tread: a half-space or a bonded layer with up to three relaxation times."""

import numpy as np
from numpy.typing import NDArray

from tireroad.contact.tread.compliance import Influence
from tireroad.contact.tread.law import tread_law
from tireroad.contact.tread.laws.elastic import ElasticLayer, ElasticTread, HalfSpace
from tireroad.fem.errors import InputError
from tireroad.fem.parameters import Limits, ParameterError, number, numbers

Array = NDArray[np.float64]
_TERMS = 3


@tread_law(
    "viscoelastic",
    "viscoelastic rubber, on a grid of points: the history of the pressure travels with the tread",
)
class Viscoelastic(ElasticTread):
    """E(t) = E [1 - sum_k g_k (1 - exp(-t/t_k))] at constant Poisson's ratio.

    E is the instantaneous modulus.
    """

    thickness: float | None = number(
        None, "m", "thickness of a layer on a stiff base; absent: a half-space", least=1e-4, most=1
    )
    relaxation: tuple[float, ...] = numbers(
        "one to three shares of the modulus that relax, with a sum below 1", "-",
        Limits(least=1e-6, most=0.999999), (0.3,),
    )  # fmt: skip
    relaxation_time: tuple[float, ...] = numbers(
        "relaxation time of each share", "s", Limits(least=1e-9, most=1e6), (1e-3,)
    )

    def validate(self) -> None:
        """Require as many times as shares, and a positive relaxed modulus."""
        if not 1 <= len(self.relaxation) <= _TERMS:
            raise ParameterError("relaxation", f"must have one to {_TERMS} numbers")
        try:
            _ = self.creep
        except InputError as problem:
            raise ParameterError("relaxation", str(problem).removeprefix("tread: ")) from None

    @property
    def creeps(self) -> bool:
        """True."""
        return True

    @property
    def creep(self) -> tuple[Array, Array]:
        """Shares and times (k,), - and s, of the creep."""
        from tireroad.contact.tread.memory import creep_of

        return creep_of(np.array(self.relaxation), np.array(self.relaxation_time))

    def influence(self, farthest: float) -> Influence:
        """The influence at the instantaneous modulus, of a half-space or a layer."""
        return self._at_once().influence(farthest)

    def shear(self, farthest: float) -> Influence:
        """The shear at the instantaneous modulus."""
        return self._at_once().shear(farthest)

    def _at_once(self) -> ElasticTread:
        rubber = {"youngs_modulus": self.youngs_modulus, "poisson_ratio": self.poisson_ratio}
        return (
            ElasticLayer(thickness=self.thickness, **rubber)
            if self.thickness
            else HalfSpace(**rubber)
        )
