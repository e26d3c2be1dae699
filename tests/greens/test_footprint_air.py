"""Air that leaves a footprint: grooves against closed forms of pipes, slits against their limits."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import optimize, sparse

from tireroad.greens.air_network import (
    FLANGED,
    Lengths,
    Medium,
    Mouth,
    Network,
    Pipe,
    reaching,
)
from tireroad.greens.footprint_air import (
    Groove,
    LateralGroove,
    Outlets,
    radiation_resistance,
)
from tireroad.greens.tire_sound import FAR, SoundAir, Transfer, directions, solved_frequencies

AIR = SoundAir.at(293.15)
PIPE = Pipe(width=0.009, depth=0.008)
SLITS = replace(PIPE, reach=0.012)
LENGTH = 0.13
THIN = 1e-6  # m: slits that no air gets through


def on_plane(frequency, count=1):
    """Radiation resistance (o, o, f) of sources far apart on a plane, a flanged pipe's: rho w^2 / (2 pi c)."""
    own = AIR.density * (2 * np.pi * frequency) ** 2 / (2 * np.pi * AIR.speed)
    return np.eye(count)[:, :, None] * own


def joined(pipe, pairs, lengths, mouths):
    """Network of the nodes in `pairs`, which are `lengths` of a pipe apart, open at some."""
    nodes = int(np.max(pairs)) + 1
    along = Lengths(pipe, np.array(pairs), np.array(lengths), np.ones(len(lengths)))
    return Network(nodes, (along,), tuple(Mouth(node, pipe) for node in mouths))


def to_ends(pipe, length, stations, frequency, air, height=THIN):
    """Volume velocities (2, f, s) out of the flanged ends of a groove on a plane per unit at the stations."""
    at = np.concatenate([[0.0], stations, [length]])
    count = len(at)
    pairs = [(k, k + 1) for k in range(count - 1)]
    groove = joined(pipe, pairs, np.diff(at), (0, count - 1))
    flow = np.eye(count)[1:-1, :, None] * np.ones(len(frequency))
    out = groove.leaving(flow, frequency, height, air, on_plane(frequency, 2))
    return np.moveaxis(out, 0, -1)


def peak(pipe, length, station, frequency=None):
    """Frequency (Hz) at which most leaves at the front, and the response there."""
    frequency = np.arange(200.0, 2500.0, 1.0) if frequency is None else frequency
    out = np.abs(to_ends(pipe, length, np.array([station]), frequency, AIR)[1, :, 0])
    return frequency[out.argmax()], out.max()


@pytest.mark.parametrize("width", [0.003, 0.009, 0.02])
@pytest.mark.parametrize("length", [0.08, 0.13, 0.2])
def test_a_groove_resonates_at_half_a_wave_with_flanged_ends(width, length):
    """f = c / 2 (l + 2 * 0.8217 a): Norris and Sheng, J. Sound Vib. 135 (1989) 85; losses lower it by a percent or two."""
    groove = Pipe(width, width)
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
    out = to_ends(Pipe(0.02, 0.02), LENGTH, stations, np.array([60.0]), AIR)[:, 0]
    assert np.abs(out.sum(axis=0) - 1) == pytest.approx(0, abs=0.02)
    more = FLANGED * np.sqrt(4e-4 / np.pi)
    front = (stations + more) / (LENGTH + 2 * more)
    assert out[1].real == pytest.approx(front, abs=0.02)


def test_it_is_the_same_from_either_side():
    frequency = np.array([300.0, 1200.0])
    stations = np.array([0.03, 0.1])
    rear, front = to_ends(PIPE, LENGTH, stations, frequency, AIR)
    other = to_ends(PIPE, LENGTH, LENGTH - stations, frequency, AIR)
    assert np.allclose(rear, other[1], rtol=1e-10) and np.allclose(front, other[0], rtol=1e-10)


def stepped(station, frequency, beside):
    """What leaves at both ends per unit squeezed in at a place, and the impedance there: the line's equations stepped from
    its ends by the midpoint rule."""
    omega, area = 2 * np.pi * frequency, PIPE.area
    medium = Medium.in_tube(PIPE.hydraulic_radius, frequency, AIR)
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


def slits(frequency, height):
    """2 Y (f,) m3 s/kg/m of the texture beside a pipe."""
    shut = 2j * np.pi * frequency * height * SLITS.reach
    part = reaching(SLITS.reach, height, frequency, AIR)
    return 2 * shut * part / Medium.in_slit(height, frequency, AIR).modulus


@pytest.mark.parametrize("loaded", [False, True])
def test_the_transfer_is_that_of_the_equations_stepped_along_the_groove(loaded):
    frequency = np.linspace(50.0, 3000.0, 30)
    pipe, height = (SLITS, 0.8e-3) if loaded else (PIPE, THIN)
    beside = slits(frequency, height) if loaded else 0.0 * frequency
    out = to_ends(pipe, LENGTH, np.array([0.05]), frequency, AIR, height)[:, :, 0]
    wanted, pressure, end = stepped(0.05, frequency, beside)
    assert np.allclose(out, wanted, rtol=2e-4)
    # What comes in, Re p at the source of a unit, is more than the ends radiate: the rest is lost at the walls.
    leaving = (np.abs(out) ** 2 * end.real).sum(axis=0)
    assert np.all((leaving > 0) & (leaving < pressure.real))


def test_texture_beside_a_groove_lowers_and_damps_its_resonance():
    frequency = np.arange(400.0, 2000.0, 1.0)
    height = 0.8e-3
    alone, loaded = (
        np.abs(to_ends(pipe, LENGTH, np.array([0.065]), frequency, AIR, height)[1, :, 0])
        for pipe in (PIPE, SLITS)
    )
    # Slower by the air that has to be compressed beside: sqrt(1 + 2 h b / A), all of it moving freely.
    share = frequency[loaded.argmax()] / frequency[alone.argmax()]
    assert share == pytest.approx((1 + 2 * height * SLITS.reach / PIPE.area) ** -0.5, abs=0.03)
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
    first = len(outlets.edge)
    assert outlets.sums.shape == (first + outlets.network.nodes, len(cell))
    assert len(outlets.places) == first + 4
    # A cell on the edge leaves there, one in a groove through it.
    column = np.abs(y - 0.03).argmin()
    middle = np.flatnonzero((cell[:, 0] == len(x) // 2) & (cell[:, 1] == column))[0]
    assert outlets.sums[first:, middle].sum() == 1
    rim = np.flatnonzero(cell[:, 0] == cell[:, 0].min())[0]
    assert outlets.sums[:first, rim].sum() == 1
    assert outlets.mouths[:2] == pytest.approx(np.array([[-0.051, -0.03], [0.051, -0.03]]))


def test_a_slick_leaves_over_its_edge():
    x, y, inside, cell = oval()
    outlets = Outlets.of(inside, cell, x, y)
    assert outlets.sums.shape[0] == len(outlets.edge) and not outlets.grooves
    frequency = np.array([50.0, 200.0])
    rate = np.ones((1, len(outlets.edge), 2), complex)
    out = leaving(outlets, rate, frequency, 2e-3)
    assert out == pytest.approx(rate, rel=0.02)


def leaving(outlets, rate, frequency, height, together=()):
    """From outlets on a plane, of which the mouths in `together` are close to each other."""
    met = on_plane(frequency, len(outlets.places))
    first = len(outlets.edge)
    for one, two in together:
        met[first + one, first + two] = met[first + two, first + one] = met[0, 0]
    return outlets.leaving(rate, frequency, height, AIR, met[first:])


LATERAL = LateralGroove(0.008, 0.008, 0.03, (-0.1, 0.1))
GROOVES = {
    "around": ([Groove(0.0, 0.02, 0.02)], []),
    "across": ([], [LATERAL]),
    "both": ([Groove(0.0, 0.02, 0.02)], [LATERAL]),
    "slanted": ([Groove(0.0, 0.02, 0.02)], [replace(LATERAL, slope=0.6)]),
    "dead ends": ([Groove(0.0, 0.02, 0.02)], [replace(LATERAL, span=(-0.035, 0.035))]),
}


@pytest.mark.parametrize("grooves", GROOVES.values(), ids=GROOVES)
def test_all_that_is_squeezed_slowly_leaves(grooves):
    x, y, inside, cell = oval()
    outlets = Outlets.of(inside, cell, x, y, *grooves)
    assert np.all(np.asarray(outlets.sums.sum(axis=0)) == 1)
    rate = outlets.sums @ np.ones((len(cell), 1), complex)
    out = leaving(outlets, rate[None], np.array([20.0]), 2e-3)
    assert out.sum() == pytest.approx(len(cell), rel=0.02)


def test_ends_that_radiate_together_hold_each_other_back():
    """Two equal grooves side by side, close to each other: R of both is twice that of one."""
    x, y, inside, cell = oval()
    near = Outlets.of(inside, cell, x, y, [Groove(-0.01, 0.009, 0.008), Groove(0.01, 0.009, 0.008)])
    frequency = np.linspace(900.0, 1500.0, 601)
    rate = np.ones((1, near.sums.shape[0], len(frequency)), complex)
    rate[:, : len(near.edge)] = 0
    peaks = [
        np.abs(leaving(near, rate, frequency, 1e-4, pairs)[0, -1]).max()
        for pairs in ((), ((0, 2), (1, 3)))
    ]
    assert 0.5 < peaks[1] / peaks[0] < 0.95


@pytest.mark.parametrize("length", [0.04, 0.06, 0.09])
def test_a_dead_end_beside_a_groove_takes_a_quarter_wave(length):
    """Nothing leaves ahead of a closed branch at c / 4 L, where it is a short; losses lower that by a percent or two."""
    groove = [(0, 1), (1, 2), (2, 3)]
    at = Lengths(
        PIPE, np.array([*groove, (2, -1)]), np.array([0.03, 0.03, 0.07, length]), np.ones(4)
    )
    network = Network(4, (at,), (Mouth(0, PIPE), Mouth(3, PIPE)))
    ideal = AIR.speed / (4 * length)
    frequency = np.linspace(0.9 * ideal, 1.1 * ideal, 801)
    flow = np.zeros((1, 4, len(frequency)), complex)
    flow[:, 1] = 1.0
    front = np.abs(network.leaving(flow, frequency, THIN, AIR, on_plane(frequency, 2))[0, 1])
    notch = frequency[front.argmin()]
    assert 0.97 * ideal < notch < ideal
    alone = np.abs(to_ends(PIPE, LENGTH, np.array([0.03]), np.array([notch]), AIR)[1, 0, 0])
    assert front.min() < 0.1 * alone


@pytest.mark.parametrize("branch", [0.01, 0.035, 0.065])
def test_a_branch_to_the_shoulder_resonates_as_a_star_of_pipes(branch):
    """Open pipes L1, L2, L3 from one node: the sum of cot(k L) is 0, each with its flanged end. The shorter the branch, the nearer it is to two
    grooves of which each has its own half wave."""
    own = FLANGED * np.sqrt(PIPE.area / np.pi)
    arms = np.array([0.045, 0.085, branch])
    star = joined(PIPE, [(0, 1), (1, 4), (4, 2), (4, 3)], [0.02, 0.025, *arms[1:]], (0, 2, 3))

    def closed(hertz):
        return (1 / np.tan(2 * np.pi * hertz / AIR.speed * (arms + own))).sum()

    pole = AIR.speed / (2 * (arms.max() + own))
    ideal = optimize.brentq(closed, 50.0, pole - 1e-3)
    frequency = np.arange(0.8 * ideal, 1.15 * ideal, 1.0)
    flow = np.zeros((1, 5, len(frequency)), complex)
    flow[:, 1] = 1.0
    out = star.leaving(flow, frequency, THIN, AIR, on_plane(frequency, 3))[0]
    found = frequency[np.abs(out).max(axis=0).argmax()]
    assert 0.96 * ideal < found < 1.005 * ideal
    alone, _ = peak(PIPE, arms[:2].sum(), 0.02)
    assert (found > alone) == (branch < LENGTH / 2)


def test_lateral_grooves_open_at_the_shoulders_and_join_those_around():
    """A rectangle of 20 rows: with grooves around, the strings between them have no mouth of their own."""
    x, y = 0.006 * np.arange(20.0), 0.006 * np.arange(21.0)
    y -= y.mean()
    inside = np.ones((20, 21), bool)
    cell = np.argwhere(inside)
    around = [Groove(-0.02, 0.009, 0.008), Groove(0.021, 0.009, 0.008)]
    given = inside, cell, x, y
    across = Outlets.of(*given, (), [LATERAL])
    both = Outlets.of(*given, around, [LATERAL])
    inner = Outlets.of(*given, around, [replace(LATERAL, span=(-0.02, 0.02))])
    dead = Outlets.of(*given, around, [replace(LATERAL, span=(-0.05, 0.05))])
    assert [len(one.mouths) for one in (across, both, inner, dead)] == [40, 44, 4, 4]
    edge = both.mouths[4:]
    assert np.unique(edge[:, 1]) == pytest.approx([y[0] - 0.003, y[-1] + 0.003])
    assert np.unique(edge[:, 0]) == pytest.approx(x)
    # Lengths of the pipe add up to the width less the grooves, on each row.
    for outlets, wide in ((across, 0.126), (both, 0.108), (inner, 0.032), (dead, 0.082)):
        pipe = Pipe(0.008, 0.008, LATERAL.apart / 2)
        length = next(one for one in outlets.network.lengths if one.pipe == pipe)
        assert length.length.sum() == pytest.approx(20 * wide, rel=0.02)
        assert np.all(length.count == pytest.approx(0.2))
    # A slope shifts the ends, and lets some out ahead and behind; within a wide groove it joins nothing.
    slanted = replace(LATERAL, slope=1.0)
    assert len(Outlets.of(*given, (), [slanted]).mouths) > 40
    wide = Outlets.of(*given, [Groove(0.0, 0.03, 0.008)], [slanted])
    least = min(one.length.min() for one in wide.network.lengths)
    assert least > 2e-3


def test_lateral_grooves_are_a_flanged_pipe_from_shoulder_to_shoulder():
    """Squeezed alike on all rows they resonate at c / 2 (l + 2 * 0.8217 a), without slits of air."""
    x, y = 0.006 * np.arange(8.0), 0.006 * np.arange(21.0)
    inside = np.ones((8, 21), bool)
    groove = LateralGroove(0.008, 0.008, 0.0081, (-1.0, 1.0))
    outlets = Outlets.of(inside, np.argwhere(inside), x, y, (), [groove])
    pipe = Pipe(0.008, 0.008)
    more = FLANGED * np.sqrt(pipe.area / np.pi)
    ideal = AIR.speed / 2 / (y[-1] - y[0] + 0.006 + 2 * more)
    frequency = np.arange(0.9 * ideal, 1.05 * ideal, 2.0)
    rate = outlets.sums @ np.ones((outlets.sums.shape[1], 1))
    out = leaving(outlets, rate[None] + 0j * frequency, frequency, THIN)
    first = len(outlets.edge)
    found = frequency[np.abs(out[0, first:]).sum(axis=0).argmax()]
    assert 0.97 * ideal < found < ideal


def test_grooves_that_pass_are_met_as_their_mean():
    """Open branches 30 mm apart along a groove, at eight places within their pitch: the mean square of what leaves is within 1 dB of
    that of the grooves in the mean."""
    length, spacing, pitch = 0.12, 0.005, 0.03
    rows = np.arange(24)
    at = np.concatenate([[0.0], spacing * (rows + 0.5), [length]])
    frequency = np.array([300.0, 500.0, 700.0, 900.0, 1100.0])
    branch = Pipe(0.004, 0.008)

    def leaves(count):
        """From a groove whose row k meets `count` k branches of 25 mm."""
        own = np.array([(k + 1, 26 + k) for k in rows])
        pairs = np.array([(k, k + 1) for k in range(25)])
        met = count > 0
        network = Network(
            50,
            (
                Lengths(PIPE, pairs, np.diff(at), np.ones(25)),
                Lengths(branch, own[met], np.full(met.sum(), 0.025), count[met]),
            ),
            (
                Mouth(0, PIPE),
                Mouth(25, PIPE),
                *(Mouth(26 + k, branch, count[k]) for k in rows[met]),
            ),
        )
        used = np.concatenate([np.arange(26), 26 + rows[met]])
        number = np.full(50, -1)
        number[used] = np.arange(len(used))
        network = Network(
            len(used),
            tuple(replace(one, ends=number[one.ends]) for one in network.lengths),
            tuple(replace(one, node=int(number[one.node])) for one in network.mouths),
        )
        flow = np.zeros((1, len(used), len(frequency)), complex)
        flow[:, 19:24] = 0.2
        met_there = on_plane(frequency, len(network.mouths))
        return np.abs(network.leaving(flow, frequency, THIN, AIR, met_there)[0, :2]) ** 2

    frozen = np.mean([leaves(1.0 * (rows % 6 == phase)) for phase in range(6)], axis=0)
    passing = leaves(np.full(24, spacing / pitch))
    without = leaves(np.zeros(24))
    assert np.abs(10 * np.log10(passing / frozen)).max() < 1.0
    assert np.abs(10 * np.log10(without / frozen)).max() > 3.0


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
