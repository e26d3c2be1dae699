"""Mobility of the built-in tire to 1 kHz: modes against complex moduli by Fourier series, and a plate."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from tireroad.fem.matrices.probe import spot
from tireroad.fem.sections.inflated import InflatedRing, mean_over
from tireroad.fem.sections.radial import BELT_ANGLE, STEEL, radial
from tireroad.fem.wheel import StrainEnergy, Turning
from tireroad.runs import library
from tireroad.runs.validation.tables import Table

ABOUT = "drive-point and transfer mobility of the built-in tire to 1 kHz, against complex moduli and a plate"
SIZE, PRESSURE = "205/60 R15", 2.2e5
AROUND, ALONG = 72, 20  # equal elements; what fewer do: `validate waves_around`
UP_TO = 1410.0  # Hz, of the modes, as accuracy.up_to = 1000 chooses
FREQUENCY = np.array([50, 63, 80, 100, 125, 160, 200, 250, 315, 400, 500, 630, 800, 1000.0])  # Hz
PLACES = {"crown": 0.0, "shoulder": 0.055}  # y, m
ANGLES = np.radians([0.0, 30.0, 90.0, 180.0])
HALF = 0.010, np.radians(2.0)  # half of the patch across, m, and around, rad


def run() -> list[Table]:
    """Levels of both, and a plate like the belt."""
    ring = InflatedRing(radial(SIZE), ALONG, 2, PRESSURE)
    chain = Chain(UP_TO)
    tables = []
    for name, y in PLACES.items():
        exact = ring.receptance(ring.patch(y, HALF[0]), HALF[1], FREQUENCY, ANGLES)
        exact, modes = (level(H, FREQUENCY) for H in (exact, chain.receptance(y)))
        tables.append(_table(name, exact, modes))
    return [*tables, _plate_table()]


def level(receptance: np.ndarray, frequency: np.ndarray) -> np.ndarray:
    """dB re 1 m/(N s) of receptances (f, ...) m/N at frequencies (f,) Hz."""
    return 20 * np.log10(np.abs((2j * np.pi * frequency * receptance.T).T))


class Chain:
    """The modes of three-dimensional elements up to a frequency (Hz), as a run has them, of a tire that can turn at a speed."""

    def __init__(self, up_to: float, speed: float = 0.0) -> None:
        tire = library.radial(SIZE, segments=AROUND, elements_arc=ALONG, footprint_size=1.0)
        static = library.press(tire, inflation=PRESSURE)
        turning = Turning(speed=speed, damping=StrainEnergy()) if speed else None
        self.standing = library.modes(tire, static, up_to=up_to, turning=turning)
        self._lattice, self._points = self.standing.motions.lattice, static.positions

    def rolling(self, speed: float = 0.0) -> library.RollingTire:
        """The tire at a speed, rad/s."""
        return library.roll(self.standing, Turning(speed=speed, damping=StrainEnergy()))

    def receptance(self, y: float) -> np.ndarray:
        """H (f, a) m/N between the patch at y and those at the angles."""
        probes = sparse.csr_matrix([self.patch(y, angle, HALF) for angle in ANGLES])
        response = self.rolling().respond(probes, probes[:1], "attachment")
        return response.receptance(FREQUENCY)[:, :, 0]

    def patch(self, y: float, angle: float, half: tuple[float, float]) -> np.ndarray:
        """Weights (3 s,) of the radial motion of a patch, `half` of it across, m, and around, rad."""
        lattice = self._lattice
        points = self._points.reshape(*lattice.face_shape, 3)
        out, row = np.zeros_like(points), points[0, :, 1]
        around = spot(lattice, angle, 0.0, (half[1], 0.0)).reshape(lattice.face_shape).sum(axis=1)
        weight = np.outer(around, mean_over(row, y, half[0]))
        out[..., 0] = weight * np.sin(lattice.ring)[:, None]
        out[..., 2] = -weight * np.cos(lattice.ring)[:, None]
        return out.ravel()


def _table(name: str, exact: np.ndarray, modes: np.ndarray) -> Table:
    off = modes - exact
    rows = [[f, *level, *less] for f, level, less in zip(FREQUENCY, exact, off, strict=True)]
    degrees = [f"{np.degrees(angle):.0f}\u00b0" for angle in ANGLES]
    columns = [("frequency", "Hz"), *((f"at {d}", "dB") for d in degrees)]
    columns += [(f"modes, {d}", "dB more") for d in degrees]
    driven = off[:, 0]
    return Table(
        f"Mobility of the {name}, {SIZE}, {PRESSURE / 1e3:.0f} kPa, standing, rim held, no road",
        columns,
        [[round(float(value), 1) for value in row] for row in rows],
        [
            f"dB re 1 m/(N s), radial, of a patch {2e3 * HALF[0]:.0f} mm wide and {np.degrees(2 * HALF[1]):.0f}\u00b0 long: "
            "complex moduli at every frequency, by Fourier series around",
            f"Modes to {UP_TO:.0f} Hz with attachment modes, three-dimensional elements: at the driven patch "
            f"{driven.mean():+.1f} dB on the average, {np.abs(driven).max():.1f} dB at most",
        ],
    )


def _plate_table() -> Table:
    """The mobility 1 / (8 sqrt(m sqrt(B_x B_y))) of an endless plate like the belt, with the tread on it."""
    layers = (("tread", 8.0e-3), ("skim", 1.3e-3), ("skim", 1.5e-3), ("ply", 2.0e-3))
    compounds = radial(SIZE).compounds
    modulus = np.array(
        [compounds[n]["youngs_modulus"] * compounds[n]["dynamic"] for n, _ in layers]
    )
    thick = np.array([height for _, height in layers])
    middle = np.cumsum(thick) - thick / 2
    cords = STEEL["youngs_modulus"] * STEEL["area"] / STEEL["spacing"]
    heavy = STEEL["density"] * STEEL["area"] / STEEL["spacing"]
    mass = float(sum(compounds[name]["density"] * height for name, height in layers)) + 2 * heavy
    plies = np.array([thick[:2].sum(), thick[:3].sum()])
    stiffness = []
    for direction in (np.cos(BELT_ANGLE), np.sin(BELT_ANGLE)):
        wall, steel = modulus * thick / (1 - 0.49**2), cords * direction**4
        neutral = (wall @ middle + steel * plies.sum()) / (wall.sum() + 2 * steel)
        bending = wall @ ((middle - neutral) ** 2 + thick**2 / 12)
        stiffness.append(float(bending + steel * ((plies - neutral) ** 2).sum()))
    mobility = 1 / (8 * np.sqrt(mass * np.sqrt(stiffness[0] * stiffness[1])))
    return Table(
        "An endless plate like the crown",
        [("mass", "kg/m2"), ("bending around", "N m"), ("across", "N m"), ("mobility", "dB")],
        [[mass, *stiffness, round(float(20 * np.log10(mobility)), 1)]],
        [
            "1 / (8 sqrt(m sqrt(B_x B_y))) of Cremer and Heckl, layers and belts bonded rigidly: what the crown tends "
            "to above its ring modes"
        ],
    )
