"""Decay of a tire's waves on their way around it: the effect of each simplification of a run alone, at the bench of `mobility`.

Everything here is solved wave by wave around, so that one cause changes at a time.

- Elements: K*(omega) - omega^2 M of three-dimensional elements of one length around. On a ring of N equal
  elements a wave n multiplies the unknowns of one element by exp(2 pi i n / N) from each to the next (Bloch), and
  one element's unknowns are left. Nothing is truncated, moduli are complex and those of the frequency.
- Modes: those of the Fourier series to 1 kHz, with the static response of all others. First with complex
  moduli between all of them, then as each mode alone has moduli and damping of its own frequency, then with what
  couples modes at their own frequencies, which is a run's (modal.basis.Projection).

The same of a tire that turns, in which a wave of n meets the rubber at the frequency of the force and n turns a second. There the
modes are those to 1410 Hz, as a run takes for a band to 1 kHz.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy import sparse
from scipy.sparse.linalg import splu
from scipy.spatial import cKDTree

from tireroad.fem.matrices.operators import Operators
from tireroad.fem.sections.inflated import InflatedRing, patch_share
from tireroad.fem.sections.radial import radial
from tireroad.fem.tire.material import Kind, own_moduli
from tireroad.runs import library
from tireroad.runs.validation.tables import Table
from tireroad.tests.validation import rolling_mobility
from tireroad.tests.validation.mobility import ALONG, ANGLES, HALF, PRESSURE, SIZE, level

ABOUT = "what weakens waves around the tire: elements around, moduli and losses of modes, what couples them"
UP_TO = 1000.0, 1410.0  # Hz, of the modes, standing and rolling
SPEED = rolling_mobility.SPEED  # rad/s, of the rolling tire
FREQUENCY = np.array([100, 200, 250, 315, 400, 500, 630, 800.0])  # Hz
WAVES = 80
ELEMENTS = (29, 48, 72, 144)  # around: 12.4, 7.5, 5 and 2.5 degrees each
MODES = ("complex moduli", "each mode alone", "coupled")
Array = np.ndarray


def run() -> list[Table]:
    """Levels less those of complex moduli, a table for each angle from the force, of the standing and of the rolling tire."""
    ring = InflatedRing(radial(SIZE), ALONG, 2, PRESSURE)
    return [
        *_tables(ring, 0.0, ANGLES, ELEMENTS),
        *_tables(ring, SPEED, rolling_mobility.ANGLES, ELEMENTS[2:]),
    ]


def _tables(
    ring: InflatedRing, speed: float, angles: Array, elements: Sequence[int]
) -> list[Table]:
    """A table for each angle from the force, of a tire that turns at a speed (rad/s) towards smaller angles."""
    weights = ring.patch(0.0, HALF[0])
    place = HALF[1], FREQUENCY, angles
    exact = level(ring.receptance(weights, *place, WAVES, speed=-speed), FREQUENCY)
    found = [_summed(_of_elements(ring, weights, count, speed), angles) for count in elements]
    found += [
        _summed(answers, angles) for answers in zip(*_of_modes(ring, weights, speed), strict=True)
    ]
    off = [level(H, FREQUENCY) - exact for H in found]
    names = [f"{360 / count:.1f}\u00b0 elements" for count in elements]
    columns = [("frequency", "Hz"), ("complex moduli, Fourier series", "dB")]
    columns += [(name, "dB more") for name in [*names, *(f"modes: {count}" for count in MODES)]]
    motion = f"rolling at {speed:g} rad/s" if speed else "standing"
    return [
        Table(
            f"Crown of {SIZE}, {PRESSURE / 1e3:.0f} kPa, {motion}: {np.degrees(angle):.0f}\u00b0 from the force",
            columns,
            [
                [
                    f,
                    *(
                        round(float(x), 1)
                        for x in (exact[row, k], *(value[row, k] for value in off))
                    ),
                ]
                for row, f in enumerate(FREQUENCY)
            ],
            [
                "dB re 1 m/(N s); every column but the second: one simplification alone, less the second"
            ],
        )
        for k, angle in enumerate(angles)
    ]


def _waves(speed: float) -> range:
    """The waves around of a tire at a speed; those of -n are those of n where it stands."""
    return range(-WAVES if speed else 0, WAVES + 1)


def _summed(answers: Sequence[Array] | Iterator[Array], angles: Array) -> Array:
    """H (f, a) m/N at angles from the force, of the answers (f,) m rad/N of all `_waves`."""
    found = np.array(list(answers))
    waves = range(WAVES + 1 - len(found), WAVES + 1)
    both = len(found) > WAVES + 1
    out = np.zeros((len(FREQUENCY), len(angles)), complex)
    for wave, answer in zip(waves, found, strict=True):
        around = np.exp(1j * wave * angles) / 2 if both and wave else np.cos(wave * angles)
        out += patch_share(abs(wave), HALF[1]) * answer[:, None] * around
    return out


def _of_modes(ring: InflatedRing, weights: Array, speed: float) -> Iterator[list[Array]]:
    """For each wave the answers (f,) of `MODES`."""
    circular, highest = 2 * np.pi * FREQUENCY, 2 * np.pi * UP_TO[bool(speed)]
    for wave in _waves(speed):
        modes = ring.modes(wave, weights)
        stored = np.array([np.diag(part).real for part in modes.parts])
        rise, loss = own_moduli(modes.squares, stored, ring.kinds)
        own = modes.squares + rise
        count = int(np.count_nonzero(own <= highest**2))
        modes, own, loss = modes.first(count), np.sqrt(own[:count]), loss[:count]
        push, squares = modes.push, modes.squares
        rest = modes.flexibility - float((np.abs(push) ** 2 / squares).sum())
        moduli = [kind.spectrum.modulus(own / (2 * np.pi)) for kind in ring.kinds]
        coupled, lost = np.diag(squares).astype(complex), np.zeros((count, count), complex)
        for kind, part, g in zip(ring.kinds, modes.parts, moduli, strict=True):
            eta = kind.loss_factor * kind.spectrum.loss_factor(own / (2 * np.pi)) * g / own
            coupled += (np.sqrt(np.outer(g, g)) - 1) * part
            lost += np.sqrt(np.outer(eta, eta)) * part
        out = np.full((len(MODES), len(FREQUENCY)), rest, complex)
        for k, w in enumerate(circular):
            met, inertia = w - wave * speed, modes.inertia(w, -speed)
            moved = sum(
                (_modulus(kind, met / (2 * np.pi)) - 1) * part
                for kind, part in zip(ring.kinds, modes.parts, strict=True)
            )
            alone = np.diag(own**2 + 1j * met * own * loss)
            for row, stiffness in enumerate(
                (np.diag(squares) + moved, alone, coupled + 1j * met * lost)
            ):
                out[row, k] += push.conj() @ np.linalg.solve(stiffness - inertia, push)
        yield list(out)


def _modulus(kind: Kind, frequency: float) -> complex:
    """The complex modulus over the dynamic one, at a frequency (Hz) of either sign."""
    found = kind.modulus(abs(frequency))
    return found if frequency >= 0 else np.conj(found)


def _of_elements(ring: InflatedRing, weights: Array, count: int, speed: float) -> Iterator[Array]:
    """For each wave the answer (f,) of a ring of `count` equal three-dimensional elements around."""
    cell = _Cell(ring, weights, count)
    for wave in _waves(speed):
        yield cell.answers(wave, speed)


class _Cell:
    """One of `count` equal elements around, with what couples it to the next ones, in (r, theta, y)."""

    def __init__(self, ring: InflatedRing, weights: Array, count: int) -> None:
        tire = library.radial(
            SIZE, segments=count, elements_arc=ALONG, footprint_size=1.0, comm=MPI.COMM_SELF
        )
        body, lattice = tire.body, tire.lattice
        _, same = cKDTree(ring.section.nodes).query(lattice.section)
        _inflated(body, ring.displacement[same])
        operators = Operators(body, PRESSURE)
        self._count, self._edge = count, lattice.edge
        node = body.ids[operators.unknowns.free[::3] // 3]
        place, section = np.divmod(node, lattice.shape[1])
        used, local = np.unique(section, return_inverse=True)
        per = lattice.shape[0] // count
        self._per, self._size = per, 3 * per * len(used)
        first = np.flatnonzero(place < per)
        first = first[np.lexsort((local[first], place[first]))]
        rows = (3 * first[:, None] + np.arange(3)).ravel()
        turn = _cylindrical(lattice.ring[place])
        column = 3 * (local + len(used) * (place % per))[:, None] + np.arange(3)
        apart = np.repeat(place // per, 3)  # cells from the first one

        def own_rows(matrix: PETSc.Mat) -> tuple[Array, Array, Array, Array]:
            csr = sparse.csr_matrix(matrix.getValuesCSR()[::-1], shape=matrix.getSize())
            block = (turn[rows] @ csr @ turn.T).tocoo()
            return block.row, column.ravel()[block.col], apart[block.col], block.data

        compounds = operators.compounds()
        self._kinds: list[Kind] = [compound.kind for compound in compounds]
        self._whole = own_rows(operators.stiffness)
        self._parts = [own_rows(compound.stiffness) for compound in compounds]
        rotation = operators.rotation()
        self._turning = own_rows(rotation.gyroscopic), own_rows(rotation.convective)
        self._mass = operators.mass[rows]
        self._across = weights[same][used]

    def answers(self, wave: int, speed: float) -> Array:
        """w . (K_n*(omega - n Omega) + 2 i omega Omega G_n + Omega^2 S_n - omega^2 M)^-1 w (f,), m rad/N, of a tire that
        turns at a speed Omega towards smaller angles, as of InflatedRing.receptance."""
        load = np.zeros(self._size, complex)
        load[::3] = np.outer(self._around(wave), self._across).ravel()
        whole, *parts = (self._of(wave, part) for part in (self._whole, *self._parts))
        gyroscopic, convective = (self._of(wave, part) for part in self._turning)
        out = np.empty(len(FREQUENCY), complex)
        for k, f in enumerate(FREQUENCY):
            omega = 2 * np.pi * float(f)
            matrix = whole + speed**2 * convective + 2j * omega * speed * gyroscopic
            matrix = matrix - sparse.diags(omega**2 * self._mass)
            for kind, part in zip(self._kinds, parts, strict=True):
                matrix = matrix + (_modulus(kind, f - wave * speed / (2 * np.pi)) - 1) * part
            out[k] = load.conj() @ splu(matrix.tocsc()).solve(load)
        return out * 2 * np.pi / self._count

    def _of(self, wave: int, entries: tuple[Array, Array, Array, Array]) -> sparse.csc_matrix:
        row, column, apart, values = entries
        phase = np.exp(2j * np.pi * wave * apart / self._count)
        return sparse.csc_matrix((values * phase, (row, column)), (self._size,) * 2)

    def _around(self, wave: int) -> Array:
        """Means (p,) of exp(i n theta) over a cell by the shape functions of its nodes around, quadratic ones."""
        t, weight = np.polynomial.legendre.leggauss(20)
        t, weight = (t + 1) / 2, weight / 2
        length = 2 * np.pi * wave / self._count
        here, before = (np.exp(1j * length * at) * weight for at in (t, t - 1))
        corner = here @ ((1 - t) * (1 - 2 * t)) + before @ (t * (2 * t - 1))
        return np.array([corner, here @ (4 * t * (1 - t))])


def _inflated(body, displacement: Array) -> None:
    """Set the displacement of an inflated ring, (r, theta, y) by node of the section."""
    place, section = np.divmod(body.ids, body.lattice.shape[1])
    r, y = displacement[section][:, [0, 2]].T
    around = displacement[section][:, 1]
    sine, cosine = np.sin(body.lattice.ring[place]), np.cos(body.lattice.ring[place])
    moved = np.stack([r * sine + around * cosine, y, around * sine - r * cosine], axis=-1)
    body.u.x.array[: moved.size] = moved.ravel()
    body.u.x.scatter_forward()


def _cylindrical(ring: Array) -> sparse.csr_matrix:
    """(r, theta, y) from (x, y, z) at nodes of angles (k,)."""
    turn = np.zeros((len(ring), 3, 3))
    turn[:, 0, 0] = turn[:, 1, 2] = np.sin(ring)
    turn[:, 0, 2], turn[:, 1, 0], turn[:, 2, 1] = -np.cos(ring), np.cos(ring), 1.0
    return sparse.block_diag(turn, format="csr")
