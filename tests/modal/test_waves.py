"""Names of modes: of known waves on the outer face, and of the radial tire beside other analyses of it."""

from __future__ import annotations

import numpy as np
import pytest

import tireroad as tr
from tireroad.fem.sections.inflated import InflatedRing
from tireroad.fem.sections.radial import radial
from tireroad.fem.sections.torus import Torus
from tireroad.fem.tire.mesh import NodeGrid, field_lattice
from tireroad.modal.waves import STILL, FaceWaves, air_waves

PRESSURE, COUNT = 2.2e5, 20


def lattice(order: int = 2) -> NodeGrid:
    """A torus with elements of unequal length around."""
    size = {"outer_radius": 0.32, "minor_radius": 0.1, "thickness": 0.012, "half_angle": 2.0}
    elements = {"segments": 24, "elements_arc": 16, "elements_thickness": 1, "footprint_size": 0.4}
    return field_lattice(Torus(order=order, **size, **elements))


def field(grid: NodeGrid, n: int, phase: complex, profile) -> np.ndarray:
    """exp(i n theta) times a phase and a profile (tangential, axial, radial) of y, (3 s,) complex."""
    place = grid.points(grid.face)
    angle, y = np.arctan2(place[:, 0], -place[:, 2]), place[:, 1] / np.abs(place[:, 1]).max()
    t, a, r = (np.broadcast_to(part, y.shape) for part in profile(y))
    sine, cosine = np.sin(angle), np.cos(angle)
    turned = np.stack([t * cosine + r * sine, a, t * sine - r * cosine], axis=1)
    return (phase * np.exp(1j * n * angle)[:, None] * turned).ravel()


KNOWN = {
    "T0": (0, lambda y: (1, 0, 0)),
    "L0": (0, lambda y: (0, 1, 0)),
    "R0": (0, lambda y: (0, 0, 1)),
    "R1": (1, lambda y: (1j, 0, 1)),
    "L1": (1, lambda y: (0, 1, 0.2 * y)),
    "R3": (3, lambda y: (0.3j, 0.5 * y, 1)),
    "L5": (5, lambda y: (0, 0.3, y)),
    "[2,2]": (2, lambda y: (0, 0, y**2 - 0.08)),
    "[4,3]": (4, lambda y: (0, 0, y**3 - 0.3 * y)),
}


@pytest.mark.parametrize("order", [1, 2, 3])
def test_known_waves_are_named(order: int) -> None:
    """Standing: both of a pair; travelling: with the rotation (towards -theta) and against it."""
    grid = lattice(order)
    waves = FaceWaves(grid)
    for name, (n, profile) in KNOWN.items():
        both = np.stack([field(grid, n, phase, profile) for phase in (1, np.exp(0.7j))], axis=1)
        found = waves.named(waves.read(both.real), {})
        count = 1 if n == 0 else 2
        assert found.name[:count].tolist() == [name] * count
        assert (found.wave == n).all() and (found.share > 0.98).all()
        assert np.abs(found.travel).max() == 0 if n == 0 else np.abs(found.travel).max() < 0.02
        if n:
            moving = np.stack([field(grid, k, 1, profile) for k in (n, -n)], axis=1)
            found = waves.named(waves.read(moving), {})
            assert found.name.tolist() == [f"{name}+", f"{name}-"]
            np.testing.assert_allclose(found.travel, [1, -1], atol=0.02)


def test_mixed_waves_say_both_and_what_is_given_keeps_its_name() -> None:
    grid = lattice()
    waves = FaceWaves(grid)
    parts = [field(grid, n, 1, lambda y: (0, 0, 1)).real for n in (3, 4, 5)]
    mixed = parts[0] + 0.9 * parts[1] + 0.8 * parts[2]
    found = waves.named(waves.read(np.stack([parts[1], mixed, parts[0]], axis=1)), {0: STILL})
    assert found.name.tolist() == ["overdamped", "R3/4", "R3"]
    assert found.share[1] == pytest.approx(1 / (1 + 0.81 + 0.64), rel=0.02)


def test_states_of_the_air_have_the_wave_of_its_pressure() -> None:
    grid = lattice()
    waves = FaceWaves(grid)
    wall = np.stack([field(grid, 4, 1, lambda y: (0, 0, 1))] * 2, axis=1)
    # cos theta + i sin theta = exp(i theta), with the rotation; and half of each direction of n = 2.
    air = air_waves(np.array([0.9, 0.1]), np.array([[1, 0], [0, 1]]), np.array([[1j, 0], [0, 0]]))
    assert waves.named(waves.read(wall), {}, air).name.tolist() == ["C1+", "R4+"]


@pytest.fixture(scope="module")
def tire():
    return tr.radial("205/60 R15", segments=24, elements_arc=14)


def by_fourier_series(count: int) -> list[tuple[float, str]]:
    """The lowest modes of the inflated radial tire by another program: one problem for each wave number.

    Its fields are symmetric in y or not, and turn about the axle, without a mesh around.
    """
    ring = InflatedRing(radial("205/60 R15"), 14, 2, PRESSURE)
    r, y = ring.section.nodes.T
    across = np.argmin(np.hypot(r[:, None] - r, y[:, None] + y), axis=1)
    found = []
    for n in range(8):
        squares, _, fields = ring._lowest(n, 2, ring.mass)
        whole = np.zeros((ring._size, fields.shape[1]), complex)
        whole[ring._free] = fields
        lowest: set[str] = set()
        for square, one in sorted(zip(squares, whole.T, strict=True), key=lambda pair: pair[0]):
            u = one.reshape(-1, 3)  # radial, tangential, axial
            mirrored = u[across] * (1, 1, -1)
            size = np.abs(u) ** 2
            letter = "R" if (u.conj() * mirrored).real.sum() > 0 else "L"
            if n == 0 and letter == "R" and size[:, 1].sum() > size[:, [0, 2]].sum():
                letter = "T"
            assert letter not in lowest
            lowest.add(letter)
            found += [(float(np.sqrt(square) / (2 * np.pi)), f"{letter}{n}")] * (2 if n else 1)
    return sorted(found)[:count]


@pytest.mark.slow
def test_first_modes_of_the_radial_tire_beside_fourier_series(tire) -> None:
    static = tr.press(tire, inflation=PRESSURE)
    modes = tr.modes(tire, static, count=COUNT)
    frequency, name = zip(*by_fourier_series(COUNT), strict=True)
    assert modes.name.tolist() == list(name)
    # 24 elements around: five waves are 1 % stiffer than without a mesh.
    np.testing.assert_allclose(modes.frequency, frequency, rtol=0.015)


@pytest.mark.long
def test_first_modes_of_the_loaded_tire_beside_a_fit_of_waves(tire) -> None:
    """Waves fitted to three lines of nodes by least squares; the crown says whether it moves in the plane."""
    static = tr.press(tire, inflation=PRESSURE, load=4000.0)
    modes = tr.modes(tire, static, count=COUNT)
    around, along = static.shape
    place = static.points.reshape(around, along, 3)
    shape = modes.basis.shape[: 3 * around * along].reshape(around, along, 3, -1)
    angle = np.arctan2(place[:, along // 2, 0], -place[:, along // 2, 2])
    table = np.concatenate(
        [np.cos(np.outer(angle, range(12))), np.sin(np.outer(angle, range(1, 12)))], axis=1
    )
    for k in range(COUNT):
        crown = shape[:, along // 2, :, k]
        radial = crown[:, 0] * np.sin(angle) - crown[:, 2] * np.cos(angle)
        tangential = crown[:, 0] * np.cos(angle) + crown[:, 2] * np.sin(angle)
        in_plane = (radial**2 + tangential**2).sum() > (crown[:, 1] ** 2).sum()
        lines = np.stack([radial, tangential, crown[:, 1]], axis=1)
        squares = (np.linalg.lstsq(table, lines, rcond=None)[0] ** 2).sum(axis=1)
        power = np.append(2 * squares[0], squares[1:12] + squares[12:])
        n = int(power.argmax())
        turns = n == 0 and (tangential**2).sum() > (radial**2).sum()
        letter = "T" if in_plane and turns else "R" if in_plane else "L"
        assert modes.name[k] == f"{letter}{n}", k
