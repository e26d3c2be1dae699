"""Mobility of the built-in tire to 1 kHz: modes against complex moduli by Fourier series, and a plate.

A half turn about the vertical through the force maps the inflated tire, its belts and its equal elements onto themselves. Fields
that it keeps and fields that it reverses do not meet, so that each half is solved alone, on half the unknowns with half the modes
(a quarter of the numbers): forces and readings have parts in both, and their responses add up.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from petsc4py import PETSc
from scipy import sparse
from scipy.spatial import cKDTree

from tireroad.fem.collective import collect
from tireroad.fem.matrices.operators import FIXED, Operators, Unknowns
from tireroad.fem.matrices.probe import spot
from tireroad.fem.model import SmallMotions, TireModel
from tireroad.fem.sections.inflated import InflatedRing, mean_over
from tireroad.fem.sections.radial import BELT_ANGLE, STEEL, radial
from tireroad.fem.static.state import StaticState
from tireroad.fem.tire.body import Body
from tireroad.fem.wheel import StrainEnergy, Turning
from tireroad.modal.basis import ModalBasis
from tireroad.modal.solver.fields import congruent
from tireroad.modal.standing import standing_modes
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
Array = np.ndarray


def run() -> list[Table]:
    """Levels of both, and a plate like the belt."""
    ring, tables = InflatedRing(radial(SIZE), ALONG, 2, PRESSURE), []
    modes = by_halves(UP_TO, list(PLACES.values()), Bench(ring))
    for (name, y), found in zip(PLACES.items(), modes, strict=True):
        exact = ring.receptance(ring.patch(y, HALF[0]), HALF[1], FREQUENCY, ANGLES)
        tables.append(_table(name, level(exact, FREQUENCY), level(found, FREQUENCY)))
    return [*tables, _plate_table()]


def level(receptance: np.ndarray, frequency: np.ndarray) -> np.ndarray:
    """dB re 1 m/(N s) of receptances (f, ...) m/N at frequencies (f,) Hz."""
    return 20 * np.log10(np.abs((2j * np.pi * frequency * receptance.T).T))


def by_halves(up_to: float, places: list[float], bench: Bench) -> list[Array]:
    """H (f, a) m/N between patches at each place y (m) and those at the angles around, of modes to a frequency (Hz)."""
    found = [np.zeros((len(FREQUENCY), len(ANGLES)), complex) for _ in places]
    for parity in (1, -1):
        motions = HalfMotions(bench.tire, bench.static, parity)
        half = Chain(bench, standing_modes(motions, up_to=up_to, rotation=False), motions)
        for out, y in zip(found, places, strict=True):
            out += half.receptance(y)
        del half, motions
        collect(bench.tire.body.comm)  # matrices and factors, before those of the other half
    return found


class Bench:
    """The inflated `tire` of equal elements in its `static` state, by default the built-in one, and patches of its tread.

    The state is that of an inflated `ring` by Fourier series, on the nodes of the elements, or else their own, whose tangent takes
    more memory than all that comes later.
    """

    def __init__(self, ring: InflatedRing | None = None, tire: TireModel | None = None) -> None:
        self.tire = tire or library.radial(
            SIZE, segments=AROUND, elements_arc=ALONG, footprint_size=1.0
        )
        self.static = (
            library.press(self.tire, inflation=PRESSURE) if ring is None else self._as_in(ring)
        )

    def _as_in(self, ring: InflatedRing) -> StaticState:
        lattice = self.tire.lattice
        _, same = cKDTree(ring.section.nodes).query(lattice.section)
        r, around, y = ring.displacement[same].T
        sine, cosine = np.sin(lattice.ring)[:, None], np.cos(lattice.ring)[:, None]
        parts = r * sine + around * cosine, np.broadcast_to(y, (len(sine), len(y)))
        moved = np.stack([*parts, around * sine - r * cosine], axis=-1).reshape(-1, 3)
        points, face = lattice.points(lattice.face), moved[lattice.face]
        none = np.zeros(len(points))
        return StaticState(
            displacement=moved,
            points=points,
            moved=face,
            force=none,
            area=none,
            half_sizes=np.zeros((len(points), 2)),
            ring_rate=none,
            shape=lattice.face_shape,
            touch_height=float((points + face)[:, 2].min()),
            road_height=None,
            inflation=PRESSURE,
        )

    def patch(self, y: float, angle: float, half: tuple[float, float]) -> Array:
        """Weights (3 s,) of the radial motion of a patch, `half` of it across, m, and around, rad."""
        lattice = self.tire.lattice
        points = self.static.positions.reshape(*lattice.face_shape, 3)
        out, row = np.zeros_like(points), points[0, :, 1]
        around = spot(lattice, angle, 0.0, (half[1], 0.0)).reshape(lattice.face_shape).sum(axis=1)
        weight = np.outer(around, mean_over(row, y, half[0]))
        out[..., 0] = weight * np.sin(lattice.ring)[:, None]
        out[..., 2] = -weight * np.cos(lattice.ring)[:, None]
        return out.ravel()


class HalfUnknowns(Unknowns):
    """The unknowns of fields that the half turn about z keeps (`parity` 1) or reverses (-1), on one process.

    With x = T y, T^T T = 1: fields of one node and its image, (e_a + parity s e_b) / sqrt 2, or of a node on the axis.
    """

    def __init__(self, body: Body, parity: int) -> None:
        super().__init__(body, FIXED)
        sign = np.array([-1.0, -1.0, 1.0])
        node = body.lattice.ids(self.place * sign)
        where = np.full(body.lattice.size, -1)
        own = self.free // 3
        where[body.ids[own[::3]]] = np.arange(len(own) // 3)
        image, flip = 3 * where[node] + self.component, sign[self.component]
        each = np.arange(len(image))
        alone, first = each[(each == image) & (flip == parity)], each[each < image]
        count = len(alone) + len(first)
        values = np.r_[
            np.ones(len(alone)),
            np.full(len(first), np.sqrt(0.5)),
            parity * flip[first] * np.sqrt(0.5),
        ]
        places = np.r_[alone, first, image[first]], np.r_[np.arange(count), len(alone) : count]
        self._basis = sparse.csr_matrix((values, places), (len(image), count))
        kept = np.r_[alone, first]
        self.mass, self.place, self.component = (
            one[kept] for one in (self.mass, self.place, self.component)
        )
        self.carried = self.carried @ self._basis

    def reduced(self, matrix: PETSc.Mat) -> PETSc.Mat:
        """T^T X T for a matrix X over all dofs of the body."""
        whole = super().reduced(matrix)
        half = congruent(whole, self._basis)
        whole.destroy()
        return half

    def spread(self, values: Array) -> Array:
        """Owned nodal values (nodes, 3, ...) from own unknowns (n, ...)."""
        return super().spread(self._basis @ values)

    def loads(self, nodal: sparse.csr_matrix, on_rim: Array | None = None) -> sparse.csr_matrix:
        """T^T of forces on nodal dofs (3 nodes, k)."""
        return sparse.csr_matrix(self._basis.T @ super().loads(nodal, on_rim))


class HalfMotions(SmallMotions):
    """Small motions that the half turn keeps (`parity` 1) or reverses (-1), of a wheel that stands."""

    def __init__(self, tire: TireModel, static: StaticState, parity: int) -> None:
        super().__init__(tire, static)
        self._parity = parity

    @cached_property
    def operators(self) -> Operators:
        """Mass, stiffness and the map of unknowns."""
        unknowns = HalfUnknowns(self.body, self._parity)
        return Operators(self.body, self.static.inflation, unknowns=unknowns)

    def rim_motion(self, turns: bool) -> None:
        """None: nothing is read on the hub."""
        return


class Chain:
    """The modes of three-dimensional elements as a run has them, by default of all `motions` of the `bench`."""

    def __init__(self, bench: Bench, basis: ModalBasis, motions: SmallMotions) -> None:
        self.standing = library.Standing(motions=motions, basis=basis)
        self.patch = bench.patch

    @staticmethod
    def whole(up_to: float, speed: float = 0.0, bench: Bench | None = None) -> Chain:
        """Of all motions, with modes to a frequency (Hz), of a tire that can turn at a speed (rad/s)."""
        bench = bench or Bench()
        turning = Turning(speed=speed, damping=StrainEnergy()) if speed else None
        standing = library.modes(bench.tire, bench.static, up_to=up_to, turning=turning)
        return Chain(bench, standing.basis, standing.motions)

    def rolling(self, speed: float = 0.0) -> library.RollingTire:
        """The tire at a speed, rad/s."""
        return library.roll(self.standing, Turning(speed=speed, damping=StrainEnergy()))

    def receptance(self, y: float) -> Array:
        """H (f, a) m/N between the patch at y and those at the angles."""
        probes = sparse.csr_matrix([self.patch(y, angle, HALF) for angle in ANGLES])
        response = self.rolling().respond(probes, probes[:1], "attachment")
        return response.receptance(FREQUENCY)[:, :, 0]


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
