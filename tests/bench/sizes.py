"""The built-in radial tire from 125/80 R12 to 335/25 R22: does each size build and inflate?"""

from __future__ import annotations

import numpy as np

from tireroad.fem.errors import ConvergenceError, InputError
from tireroad.fem.sections.inflated import InflatedRing, lowest
from tireroad.fem.sections.radial import radial
from tireroad.runs.validation.tables import Table

ABOUT = "the built-in radial tire in many sizes: mass, inflated shape, first modes"
SIZES = (
    *("125/80 R12", "145/80 R13", "155/65 R14", "165/70 R14", "175/65 R14", "175/80 R14"),
    *("185/65 R15", "195/50 R15", "195/65 R15", "195/80 R15", "205/60 R15", "205/55 R16"),
    *("205/45 R17", "215/65 R16", "225/45 R17", "225/40 R18", "235/35 R19", "245/40 R19"),
    *("245/30 R20", "255/55 R18", "255/35 R20", "275/30 R20", "285/25 R20", "305/30 R19"),
    *("315/35 R20", "335/25 R22"),
)
ELEMENTS, ORDER, PRESSURE = 26, 2, 2.2e5  # the defaults; Pa
WAVES = 10, 14, 20, 34  # around, of waves that stand on the road
TURNING = 160.0  # rad/s, of the state that they stand in
COLUMNS = [
    ("size", ""),
    ("mass", "kg"),
    ("moves", "mm"),
    ("width", "mm"),
    ("radius", "mm"),
    ("lateral", "Hz"),
    ("wind-up", "Hz"),
    ("yaw", "Hz"),
    ("vertical", "Hz"),
    *((f"stands, n = {wave}", "rad/s") for wave in WAVES),
    ("", ""),
]
NOTE = (
    "Inflated to 220 kPa and their first modes by Fourier series around (fem.sections.inflated), rim held. "
    "'moves': the largest displacement of inflation; width and radius are those of the inflated tire. "
    f"'stands': the lowest speed at which a wave of n around stands on the road, in the state at {TURNING:g} rad/s."
)


ROLLED = "205/60 R15", "205/55 R16", "225/45 R17"
SPEEDS = 30.0, 60.0, 100.0, 140.0, 160.0, 180.0, 200.0, 220.0, 240.0  # rad/s
LOAD = 4000.0  # N
PATCH = 0.06, 0.2  # m, rad: half width and half angle of the footprint
LOSS_NOTE = (
    f"{LOAD:g} N spread over {2e3 * PATCH[0]:g} mm by {2 * PATCH[1]:g} rad on the inflated tire that turns (InflatedRing.rolling): "
    "the moment of the compounds' losses over load and radius, in the state at each speed. Linear, without friction."
)


def run() -> list[Table]:
    """One row per size; rolling resistance of three of them over the speed. Not collective."""
    table = Table("The built-in radial tire", COLUMNS, [row(size) for size in SIZES], [NOTE])
    columns = [("size", ""), *((f"{speed:g} rad/s", "%") for speed in SPEEDS)]
    rows = [[size, *(rolling_resistance(size, speed) for speed in SPEEDS)] for size in ROLLED]
    return [table, Table("Rolling resistance", columns, rows, [LOSS_NOTE])]


def rolling_resistance(size: str, speed: float) -> float:
    """Rolling resistance over the load, %, by the losses of the compounds."""
    tire = InflatedRing(radial(size), ELEMENTS, ORDER, PRESSURE, speed)
    width, angle = PATCH
    deflection, moment = tire.rolling(tire.patch(0.0, width), angle)
    radius = tire.section.nodes[:, 0].max() - LOAD * deflection
    return float(100 * LOAD * moment / radius)


def row(size: str) -> list:
    """A size with its figures, or with its error."""
    try:
        tire = InflatedRing(radial(size), ELEMENTS, ORDER, PRESSURE)
        turning = InflatedRing(radial(size), ELEMENTS, ORDER, PRESSURE, TURNING)
    except (InputError, ConvergenceError) as error:
        return [size, *[float("nan")] * (len(COLUMNS) - 2), str(error)]
    line = tire.section.chain(tire.section.outer)
    moved = 1e3 * (tire.section.nodes[line] + tire.displacement[line][:, [0, 2]])
    largest = 1e3 * float(np.abs(tire.displacement).max())
    shape = [tire.weight, largest, 2 * float(moved[:, 1].max()), float(moved[:, 0].max())]
    standing = [turning.standing(wave)[0] for wave in WAVES]
    return [size, *shape, *(float(value) for value in lowest(tire)), *standing, ""]
