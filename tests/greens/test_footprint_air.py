"""Air that leaves a footprint: grooves against closed forms of pipes, slits against their limits."""

import numpy as np
import pytest
from scipy import sparse

from tireroad.greens.footprint_air import (
    FLANGED,
    Groove,
    Line,
    Medium,
    Outlets,
    inertia,
    radiation_resistance,
    reaching,
)
from tireroad.greens.tire_sound import FAR, SoundAir, Transfer, directions, solved_frequencies

AIR = SoundAir.at(293.15)
GROOVE = Groove(y=0.0, width=0.009, depth=0.008)
LENGTH = 0.13


def on_plane(frequency, count=1):
    """Radiation resistance (o, o, f) of sources far apart on a plane, a flanged pipe's: rho w^2 / (2 pi c)."""
    own = AIR.density * (2 * np.pi * frequency) ** 2 / (2 * np.pi * AIR.speed)
    return np.eye(count)[:, :, None] * own


def to_ends(groove, length, stations, frequency, air, beside=0.0):
    """Volume velocities (2, f, s) out of the flanged ends of a groove on a plane per unit at the stations."""
    line = Line.of(groove, length, stations, frequency, air, beside)
    met = np.moveaxis(
        on_plane(frequency, 2) + np.eye(2)[:, :, None] * inertia(groove, frequency, air), -1, 0
    )
    held = np.moveaxis(line.admittance, -1, 0)
    return np.moveaxis(
        np.linalg.solve(np.eye(2) + held @ met, np.moveaxis(line.shorted, 1, 0)), 0, 1
    )


def peak(groove, length, station, frequency=None):
    """Frequency (Hz) at which most leaves at the front, and the response there."""
    frequency = np.arange(200.0, 2500.0, 0.5) if frequency is None else frequency
    out = np.abs(to_ends(groove, length, np.array([station]), frequency, AIR)[1, :, 0])
    return frequency[out.argmax()], out.max()


@pytest.mark.parametrize("width", [0.003, 0.009, 0.02])
@pytest.mark.parametrize("length", [0.08, 0.13, 0.2])
def test_a_groove_resonates_at_half_a_wave_with_flanged_ends(width, length):
    """f = c / 2 (l + 2 * 0.8217 a): Norris and Sheng, J. Sound Vib. 135 (1989) 85; losses lower it by a percent or two."""
    groove = Groove(0.0, width, width)
    radius = np.sqrt(groove.area / np.pi)
    ideal = AIR.speed / (2 * (length + 2 * FLANGED * radius))
    found, most = peak(groove, length, length / 2)
    layer = np.sqrt(1.81e-5 / (np.pi * ideal * AIR.density)) / groove.hydraulic_radius
    assert ideal * (1 - 1.1 * layer) < found < ideal
    assert most > 3.0


def test_the_losses_are_kirchhoffs_in_a_wide_tube():
    """Attenuation sqrt(w nu / 2) (1 + (gamma - 1) / sqrt(Pr)) / (r c) (Kirchhoff 1868), within the next order of the layer."""
    frequency, radius = np.array([200.0, 1000.0, 3000.0]), 0.01
    found = -Medium.in_tube(radius, frequency, AIR).wave_number(frequency).imag
    nu = 1.81e-5 / AIR.density
    wanted = np.sqrt(np.pi * frequency * nu) * (1 + 0.4 / np.sqrt(0.71)) / (radius * AIR.speed)
    assert found == pytest.approx(wanted, rel=0.02)


def test_a_narrow_slit_is_poiseuille_flow_at_constant_temperature():
    """i w rho_h -> 12 eta / h^2, K -> the pressure of the air."""
    frequency, height = np.array([20.0]), 5e-5
    medium = Medium.in_slit(height, frequency, AIR)
    flow = 2j * np.pi * frequency * medium.density
    assert flow[0].real == pytest.approx(12 * 1.81e-5 / height**2, rel=1e-3)
    assert medium.modulus[0].real == pytest.approx(AIR.density * AIR.speed**2 / 1.4, rel=1e-3)


def test_slow_squeezing_leaves_by_the_nearer_end():
    """Far below resonance the ends share as the lengths, with their end corrections, are inertias in parallel."""
    stations = np.array([0.02, 0.05, 0.11])
    out = to_ends(Groove(0.0, 0.02, 0.02), LENGTH, stations, np.array([60.0]), AIR)[:, 0]
    assert np.abs(out.sum(axis=0) - 1) == pytest.approx(0, abs=0.02)
    more = FLANGED * np.sqrt(4e-4 / np.pi)
    front = (stations + more) / (LENGTH + 2 * more)
    assert out[1].real == pytest.approx(front, abs=0.02)


def test_it_is_the_same_from_either_side():
    frequency = np.array([300.0, 1200.0])
    stations = np.array([0.03, 0.1])
    rear, front = to_ends(GROOVE, LENGTH, stations, frequency, AIR)
    other = to_ends(GROOVE, LENGTH, LENGTH - stations, frequency, AIR)
    assert np.allclose(rear, other[1], rtol=1e-10) and np.allclose(front, other[0], rtol=1e-10)


def stepped(station, frequency, beside):
    """What leaves at both ends per unit squeezed in at a place, and the impedance there: the line's equations stepped from
    its ends by the midpoint rule."""
    omega, area = 2 * np.pi * frequency, GROOVE.area
    medium = Medium.in_tube(GROOVE.hydraulic_radius, frequency, AIR)
    along, across = (
        1j * omega * medium.density / area,
        1j * omega * area / medium.modulus + beside,
    )
    ka = omega / AIR.speed * np.sqrt(area / np.pi)
    end = AIR.impedance / area * (ka**2 / 2 + 1j * FLANGED * ka)
    sides = []
    for length in (station, LENGTH - station):
        pressure, flow = end, np.ones_like(end)
        d = length / 2000
        for _ in range(2000):
            middle = pressure + d / 2 * along * flow, flow + d / 2 * across * pressure
            pressure, flow = pressure + d * along * middle[1], flow + d * across * middle[0]
        sides.append((pressure / flow, 1 / flow))
    (rear, out_rear), (front, out_front) = sides
    both = rear + front
    return np.stack([front / both * out_rear, rear / both * out_front]), rear * front / both, end


@pytest.mark.parametrize("loaded", [False, True])
def test_the_transfer_is_that_of_the_equations_stepped_along_the_groove(loaded):
    frequency = np.linspace(50.0, 3000.0, 30)
    beside = (1e-9 + 2e-12j * frequency) * 50 if loaded else 0.0 * frequency
    out = to_ends(GROOVE, LENGTH, np.array([0.05]), frequency, AIR, beside)[:, :, 0]
    wanted, pressure, end = stepped(0.05, frequency, beside)
    assert np.allclose(out, wanted, rtol=2e-4)
    # What comes in, Re p at the source of a unit, is more than the ends radiate: the rest is lost at the walls.
    leaving = (np.abs(out) ** 2 * end.real).sum(axis=0)
    assert np.all((leaving > 0) & (leaving < pressure.real))


def test_texture_beside_a_groove_lowers_and_damps_its_resonance():
    frequency = np.arange(400.0, 2000.0, 1.0)
    height, reach = 0.8e-3, 0.012
    part = reaching(reach, height, frequency, AIR)
    beside = (
        2
        * 2j
        * np.pi
        * frequency
        * height
        * reach
        / Medium.in_slit(height, frequency, AIR).modulus
        * part
    )
    alone = np.abs(to_ends(GROOVE, LENGTH, np.array([0.065]), frequency, AIR)[1, :, 0])
    loaded = np.abs(to_ends(GROOVE, LENGTH, np.array([0.065]), frequency, AIR, beside)[1, :, 0])
    # Slower by the air that has to be compressed beside: sqrt(1 + 2 h b / A), all of it moving freely.
    share = frequency[loaded.argmax()] / frequency[alone.argmax()]
    assert share == pytest.approx((1 + 2 * height * reach / GROOVE.area) ** -0.5, abs=0.03)
    assert loaded.max() < alone.max()


def test_a_short_wide_slit_lets_everything_out_and_a_thin_long_one_little():
    frequency = np.array([500.0, 1000.0])
    assert np.abs(reaching(0.005, 1e-3, frequency, AIR) - 1) == pytest.approx(0, abs=5e-3)
    long = Medium.in_slit(2e-5, frequency, AIR).wave_number(frequency) * 0.05
    assert np.abs(reaching(0.05, 2e-5, frequency, AIR)) == pytest.approx(1 / np.abs(long), rel=1e-3)
    assert np.all(np.abs(long) > 6)
    assert np.all(reaching(0.0, 1e-3, frequency, AIR) == 1)


def oval(nx=21, ny=15):
    x, y = 0.006 * (np.arange(nx) - nx // 2), 0.01 * (np.arange(ny) - ny // 2)
    inside = (x[:, None] / 0.055) ** 2 + (y / 0.065) ** 2 <= 1
    return x, y, inside, np.argwhere(inside)


def test_every_cell_has_one_way_out_and_it_is_the_nearest():
    x, y, inside, cell = oval()
    grooves = [Groove(at, 0.01, 0.008) for at in (-0.03, 0.03, 0.2)]
    outlets = Outlets.of(inside, cell, x, y, grooves)
    assert len(outlets.grooves) == 2  # the third lies beside the footprint
    assert np.all(np.asarray(outlets.sums.sum(axis=0)) == 1)
    first, counts = len(outlets.edge), [len(s) for s in outlets.stations]
    assert outlets.sums.shape == (first + sum(counts), len(cell))
    assert len(outlets.places) == first + 4
    # A cell on the edge leaves there, one in a groove through it.
    column = np.abs(y - 0.03).argmin()
    middle = np.flatnonzero((cell[:, 0] == len(x) // 2) & (cell[:, 1] == column))[0]
    assert outlets.sums[first:, middle].sum() == 1
    rim = np.flatnonzero(cell[:, 0] == cell[:, 0].min())[0]
    assert outlets.sums[:first, rim].sum() == 1
    assert outlets.ends[0] == pytest.approx([-0.051, 0.051])


def test_a_slick_leaves_over_its_edge():
    x, y, inside, cell = oval()
    outlets = Outlets.of(inside, cell, x, y)
    assert outlets.sums.shape[0] == len(outlets.edge) and not outlets.grooves
    frequency = np.array([50.0, 200.0])
    rate = np.ones((len(outlets.edge), 2), complex)
    count = len(outlets.places)
    out = outlets.leaving(
        rate, frequency, 2e-3, AIR, on_plane(frequency, count)[len(outlets.edge) :]
    )
    assert out == pytest.approx(rate, rel=0.02)


def test_all_that_is_squeezed_slowly_leaves():
    x, y, inside, cell = oval()
    outlets = Outlets.of(inside, cell, x, y, [Groove(0.0, 0.02, 0.02)])
    rate = np.ones((len(cell), 1), complex)
    frequency = np.array([30.0])
    given = outlets.sums @ rate, frequency, 2e-3, AIR
    met = on_plane(frequency, len(outlets.places))[len(outlets.edge) :]
    out = outlets.leaving(*given, met)
    assert abs(out.sum() - len(cell)) < 0.02 * len(cell)


def test_ends_that_radiate_together_hold_each_other_back():
    """Two equal grooves side by side, close to each other: R of both is twice that of one."""
    x, y, inside, cell = oval()
    near = Outlets.of(inside, cell, x, y, [Groove(-0.01, 0.009, 0.008), Groove(0.01, 0.009, 0.008)])
    frequency = np.linspace(900.0, 1500.0, 601)
    rate = np.ones((near.sums.shape[0], len(frequency)), complex)
    rate[: len(near.edge)] = 0
    count, first = len(near.places), len(near.edge)
    alone = on_plane(frequency, count)
    together = alone + 0
    for end in (0, 1):
        together[first + end, first + 2 + end] = together[first + 2 + end, first + end] = alone[
            0, 0
        ]
    peaks = [
        np.abs(near.leaving(rate, frequency, 1e-4, AIR, one[first:])[-1]).max()
        for one in (alone, together)
    ]
    assert 0.5 < peaks[1] / peaks[0] < 0.95


def test_the_radiation_resistance_of_sources_on_a_plane():
    """R = rho w^2 / (2 pi c), with each other that times sin(k d) / (k d) (Morse and Ingard, Theoretical Acoustics)."""
    places = np.array([[0.0, 0.0, 0.0], [0.12, 0.05, 0.0]])
    frequency = solved_frequencies(1200.0)
    way = directions()[0]
    wave = 2 * np.pi * frequency[:, None, None] / AIR.speed
    ahead = np.exp(1j * wave * (way @ places.T)) / (2 * np.pi * FAR)
    far = Transfer(
        frequency=frequency,
        ahead=ahead.astype(np.complex64),
        distance=np.full(len(way), FAR),
        air=AIR,
    )
    lines = np.array([100.0, 433.0, 1111.0])
    found = radiation_resistance(far, *2 * (sparse.identity(2, format="csr"),), lines)
    own = on_plane(lines)[0, 0]
    apart = 2 * lines / AIR.speed * np.linalg.norm(places[1])
    assert found[0, 0] == pytest.approx(own, rel=1e-4)
    assert found[0, 1] == pytest.approx(own * np.sinc(apart), rel=2e-3, abs=1e-3 * own.min())
    assert np.allclose(found, np.swapaxes(found, 0, 1))
