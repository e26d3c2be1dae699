"""A self-affine road texture: blended random tiles with a given spectrum; nothing repeats."""

from tireroad.contact.roads.random_texture import MOST_PLACES, Tiles, tile_places, tile_size
from tireroad.contact.roads.road import RoadKind, road_kind
from tireroad.fem.parameters import ParameterError, integer, number


@road_kind("texture", "an isotropic, self-affine random texture")
class TextureRoad(RoadKind):
    """Spectrum and seed of a texture."""

    drawn = True

    rms: float = number(2e-4, "m", "root mean square of the heights", least=0, most=1)
    hurst: float = number(
        0.8, "-", "Hurst exponent H: the spectrum falls as wave number^(-2-2H)", least=0, most=1
    )
    roll_off: float = number(0.05, "m", "longest wavelength", least=1e-4, most=100)
    cut_off: float = number(0.004, "m", "shortest wavelength", least=1e-5, most=100)
    seed: int = integer(0, "seed of the random generator", least=0, most=2**31 - 1)

    def validate(self) -> None:
        """Require a band of waves, and a tile that fits into memory."""
        if self.cut_off >= self.roll_off:
            raise ParameterError(
                "cut_off", f"= {self.cut_off:g} m must be less than roll_off = {self.roll_off:g} m"
            )
        (along, across), places = tile_size(self.roll_off), tile_places(self.cut_off, self.roll_off)
        if places > MOST_PLACES:
            raise ParameterError(
                "cut_off",
                f"= {self.cut_off:g} m makes {places:.3g} places of a tile of "
                f"{along:.3g} m x {across:.3g} m (roll_off = {self.roll_off:g} m), more than "
                f"{MOST_PLACES:g}: take a longer cut_off or a shorter roll_off",
            )

    def make(self) -> Tiles:
        """The road of this texture: power of a wave vector q ~ |q|^(-2 - 2H), H the Hurst exponent.

        Source: Persson et al., J. Phys. Condens. Matter 17 (2005) R1.
        """
        return Tiles(
            lambda q: q ** (-1.0 - self.hurst),
            shortest=self.cut_off,
            longest=self.roll_off,
            rms=self.rms,
            seed=(self.seed,),
        )
