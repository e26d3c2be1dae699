"""A road of two slopes: ISO 8608 for long waves, a third-octave texture for short ones."""

import numpy as np

from tireroad.contact.roads.kinds.iso8608 import CLASSES, Iso8608
from tireroad.contact.roads.random_texture import (
    MOST_PLACES,
    MOST_SKEW,
    Layered,
    band_power,
    bands,
    textured,
    tile_places,
)
from tireroad.contact.roads.road import Levelled, road_kind
from tireroad.fem.parameters import Limits, ParameterError, choice, integer, number, numbers

# A typical stone mastic asphalt of 11 mm (chosen within the 38 to 48 dB at 5 mm of asphalts; at
# 0.5 m the level of ISO 8608 class A, so that the two meet).
WAVELENGTHS = (0.5, 0.2, 0.1, 0.05, 0.02, 0.01, 0.005, 0.002)
LEVELS = (42.0, 42.0, 43.0, 44.0, 45.5, 45.0, 42.0, 36.0)


@road_kind(
    "two-slope",
    "ISO 8608 for long waves, below them a texture given by third octaves (ISO 13473-4)",
)
class TwoSlope(Levelled):
    """Class of the long waves, levels of the texture, and the wavelength that separates them."""

    drawn = True

    road_class: str = choice("A", tuple(CLASSES), "road class of ISO 8608 of the long waves")
    crossover: float = number(
        0.5, "m", "wavelength where the texture begins: longer waves are of the class, the same over "
        "the width; shorter ones of the texture, isotropic", least=0.02, most=10,
    )  # fmt: skip
    stone_size: float = number(
        0.004, "m", "shortest wavelength: the spectrum is cut there", least=1e-3, most=1
    )
    wavelengths: tuple[float, ...] = numbers(
        "wavelengths of the levels; interpolated linearly over the logarithm of the wavelength, constant beyond",
        "m", Limits(least=1e-5, most=100), WAVELENGTHS,
    )  # fmt: skip
    levels: tuple[float, ...] = numbers(
        "texture level of the third octave at each wavelength, re 1 um", "dB",
        Limits(least=-60, most=90), LEVELS,
    )  # fmt: skip
    skewness: float = number(
        0.0, "-", "skewness of the texture's heights; negative: plateaus with pits. At -1 levels move by "
        "up to 0.5 dB", least=-MOST_SKEW, most=MOST_SKEW,
    )  # fmt: skip
    seed: int = integer(0, "seed of the random generator", least=0, most=2**31 - 1)

    def validate(self) -> None:
        """Require one level per wavelength, a band of waves, tiles that fit into memory."""
        if len(self.levels) != len(self.wavelengths) or not self.levels:
            raise ParameterError(
                "levels", f"has {len(self.levels)} numbers, wavelengths {len(self.wavelengths)}: give one "
                "level for each wavelength",
            )  # fmt: skip
        if len(set(self.wavelengths)) < len(self.wavelengths):
            raise ParameterError("wavelengths", "must differ from each other")
        if self.stone_size > self.crossover / 2:
            raise ParameterError(
                "stone_size", f"= {self.stone_size:g} m must be at most half of crossover = "
                f"{self.crossover:g} m",
            )  # fmt: skip
        finest = min(8 * self.stone_size, self.crossover)
        if tile_places(self.stone_size, finest) > MOST_PLACES:
            raise ParameterError("stone_size", f"= {self.stone_size:g} m makes too fine a texture")

    def make(self) -> Layered:
        """The road: the sum of both parts."""
        long = Iso8608(road_class=self.road_class, shortest_wave=self.crossover, seed=self.seed)
        edges = bands(self.stone_size, self.crossover)
        power = np.maximum(band_power(self.wavelengths, self.levels, edges), 1e-30)
        return textured(edges, power, self.seed, long.make(), self.skewness)
