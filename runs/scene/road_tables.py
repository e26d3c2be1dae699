"""The table of the road, key by key, with units, ranges and defaults (contract: Scene)."""

from dataclasses import dataclass

from tireroad.runs.scene.schema import choice, flag, integer, number, table, text

SINE = ("kind", ("sine",))
STONES = ("kind", ("cobblestones",))
UNEVEN = ("kind", ("cobblestones", "iso8608", "grid", "crg"))
OBSTACLE = ("kind", ("step", "cleat"))
TEXTURE = ("kind", ("texture",))
RANDOM = ("kind", ("cobblestones", "iso8608", "texture"))
GRID = ("kind", ("grid",))
UNITS = ("m", "cm", "mm", "um", "in")
MEASURED = ("kind", ("grid", "crg"))


@dataclass(frozen=True)
class Motion:
    kind: str = choice("none", ("none", "ramp", "sine"), "vertical motion of the whole road")
    amplitude: float = number(1.0e-3, "m", "upwards", least=-1, most=1)
    frequency: float = number(
        50.0, "Hz", "of the sine", above=0, most=1e6, only_for=("kind", ("none", "sine"))
    )
    duration: float = number(
        0.01, "s", "of the ramp", above=0, most=1e5, only_for=("kind", ("none", "ramp"))
    )


@dataclass(frozen=True)
class Road:
    kind: str = choice(
        "flat",
        ("flat", "sine", "step", "cleat", "cobblestones", "iso8608", "texture", "grid", "crg"),
        "of road",
    )
    run_in: float = number(0.1, "m", "over which the road grows from flat", least=0, most=1e4)
    lateral: float = number(0.0, "m", "road y under the tire's middle", least=-1e4, most=1e4)
    start: float = number(0.0, "m", "road x under the axle at t = 0", least=-1e6, most=1e6)
    offset: float = number(0.0, "m", "added to all heights", least=-10, most=10)
    datum: str = choice(
        "mean", ("mean", "zero"), "road height laid on the static road plane", only_for=UNEVEN
    )
    longest_wave: float | None = number(
        None,
        "m",
        "longer waves are taken out: the axle follows them; absent: all stay",
        above=0,
        most=1e4,
        only_for=UNEVEN,
    )
    amplitude: float = number(1.0e-3, "m", "of the waves", least=0, most=1, only_for=SINE)
    wavelength: float = number(0.1, "m", "of the waves", above=0, most=1e4, only_for=SINE)
    phase: float = number(
        0.0, "deg", "of the waves at the start", least=-360, most=360, only_for=SINE
    )
    block_length: float = number(
        0.14,
        "m",
        "length of a block along x; the pitch is joint_width more",
        above=0,
        most=10,
        only_for=STONES,
    )
    block_width: float = number(
        0.12,
        "m",
        "width of a block along y; the pitch is joint_width more",
        above=0,
        most=10,
        only_for=STONES,
    )
    joint_width: float = number(0.012, "m", "between two blocks", above=0, most=10, only_for=STONES)
    joint_depth: float = number(0.006, "m", "below the blocks", above=0, most=1, only_for=STONES)
    edge_radius: float = number(
        0.006, "m", "of the rounded edges", least=0, most=1, only_for=STONES
    )
    height_scatter: float = number(
        0.001, "m", "standard deviation of the blocks' heights", least=0, most=1, only_for=STONES
    )
    stagger: bool = flag(True, "every second row is shifted by half a block", only_for=STONES)
    seed: int = integer(0, "of what is random", least=0, most=2**31 - 1, only_for=RANDOM)
    position: float = number(
        0.3, "m", "of its foot, road x from the start", least=-1e6, most=1e6, only_for=OBSTACLE
    )
    height: float = number(0.01, "m", "of the step or cleat", least=-1, most=1, only_for=OBSTACLE)
    length: float = number(
        0.02, "m", "from foot to foot", above=0, most=1e4, only_for=("kind", ("cleat",))
    )
    ramp: float = number(0.005, "m", "length of each edge", least=0, most=1e4, only_for=OBSTACLE)
    angle: float = number(
        0.0, "deg", "between its edge and the axle", above=-90, below=90, only_for=OBSTACLE
    )
    road_class: str = choice("C", tuple("ABCDEFGH"), "of ISO 8608", only_for=("kind", ("iso8608",)))
    shortest_wave: float = number(
        0.1, "m", "of the profile", least=0.001, most=50, only_for=("kind", ("iso8608",))
    )
    rms: float = number(2e-4, "m", "of the heights", least=0, most=1, only_for=TEXTURE)
    hurst: float = number(0.8, "-", "exponent", least=0, most=1, only_for=TEXTURE)
    roll_off: float = number(0.05, "m", "longest wave", above=0, most=100, only_for=TEXTURE)
    cut_off: float = number(0.004, "m", "shortest wave", above=0, most=100, only_for=TEXTURE)
    file: str | None = text(
        None,
        "of the measured road, relative to the scene; grid: .npz or .h5 with x, y, z, or .csv: a line of a "
        "corner and all y, then lines of x and heights; or x,y,z and lines of points; crg: OpenCRG",
        only_for=MEASURED,
    )
    length_unit: str | None = choice(
        None,
        UNITS,
        "of x and y in the file; absent: m, and the sizes must be plausible",
        only_for=GRID,
    )
    height_unit: str | None = choice(
        None, UNITS, "of the heights in the file; absent: as length_unit", only_for=GRID
    )
    holes: str = choice("refuse", ("refuse", "fill"), "in the measured road", only_for=MEASURED)
    end: str = choice(
        "refuse", ("refuse", "mirror"), "when the run is longer than the road", only_for=MEASURED
    )
    motion: Motion = table(Motion, "of the whole road, vertical")
