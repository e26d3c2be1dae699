"""Mobility of the built-in tire: direct solution by Fourier series against three-dimensional modes, and a plate."""

import numpy as np
import pytest

from tireroad.fem.sections.inflated import InflatedRing
from tireroad.fem.sections.radial import radial
from tireroad.tests.validation import mobility, rolling_mobility, slow_motions, waves_around

FREQUENCY = np.array([20.0, 63.0, 100.0, 125.0])


@pytest.mark.long
def test_modes_against_complex_moduli_by_fourier_series(monkeypatch):
    """Two codes, two ways to lose energy, moduli of every frequency: 1 dB at the patch and a quarter turn from it."""
    small = {"FREQUENCY": FREQUENCY, "AROUND": 24, "ALONG": 12}
    for name, value in small.items():
        monkeypatch.setattr(mobility, name, value)
    ring = InflatedRing(radial(mobility.SIZE), 12, 2, mobility.PRESSURE)
    (across, around), places = mobility.HALF, list(mobility.PLACES.values())
    found = mobility.by_halves(300.0, places, mobility.Bench(ring))
    for y, receptance in zip(places, found, strict=True):
        exact = ring.receptance(ring.patch(y, across), around, FREQUENCY, mobility.ANGLES)
        found = mobility.level(receptance / exact, 1 / (2 * np.pi))
        assert np.abs(found[:, 0]).max() < 1.2
        assert np.abs(found[:, 2]).max() < 1.2


@pytest.mark.slow
def test_both_halves_are_the_whole(monkeypatch):
    """Forces on the crown move one half alone, on the shoulder both: modes and their static rest, each with what relaxes below
    its own lowest mode."""
    small = {"FREQUENCY": FREQUENCY, "AROUND": 12, "ALONG": 8}
    for name, value in small.items():
        monkeypatch.setattr(mobility, name, value)
    bench, places = mobility.Bench(), list(mobility.PLACES.values())
    chain = mobility.Chain.whole(200.0, bench=bench)
    for y, found in zip(places, mobility.by_halves(200.0, places, bench), strict=True):
        exact = chain.receptance(y)
        assert np.abs(found - exact).max() < 5e-3 * np.abs(exact).max()


def test_a_patch_is_the_mean_over_its_strip():
    """Weights of sum 1 whose mean place is the strip's middle."""
    ring = InflatedRing(radial(mobility.SIZE), 12, 2, mobility.PRESSURE)
    weights = ring.patch(0.02, 0.01)
    places = ring.section.nodes[:, 1] + ring.displacement[:, 2]
    assert weights.sum() == pytest.approx(1.0)
    assert weights @ places == pytest.approx(0.02, abs=2e-4)


@pytest.mark.long
def test_rotating_modes_hear_waves_that_run_with_and_against_the_tire(monkeypatch):
    """A quarter turn ahead and behind differ by 4 to 9 dB at 100 and 160 Hz; modes have it on elements of 15 degrees."""
    small = {
        "ALONG": 10,
        "UP_TO": 300.0,
        "FREQUENCY": np.array([100.0, 160.0]),
        "ANGLES": np.radians([0.0, 90.0, -90.0]),
    }
    for name, value in small.items():
        monkeypatch.setattr(rolling_mobility, name, value)
    monkeypatch.setattr(mobility, "ALONG", 10)
    monkeypatch.setattr(mobility, "AROUND", 24)
    (table,) = rolling_mobility.run()
    for _, _, ahead, behind, *off in table.rows:
        assert abs(ahead - behind) > 3
        assert np.abs(off).max() < 2


@pytest.mark.slow
@pytest.mark.parametrize("speed", [0.0, 72.0])
def test_waves_of_elements_and_of_modes_are_those_of_the_series(monkeypatch, speed):
    """The lowest waves, standing and rolling: three-dimensional elements by Bloch's condition within 1 % (3 % rolling), modes with
    complex moduli 2 %, and with viscous damping 7 %."""
    small = {"FREQUENCY": np.array([60.0, 200.0]), "WAVES": 4, "ALONG": 10}
    for name, value in small.items():
        monkeypatch.setattr(waves_around, name, value)
    ring = InflatedRing(radial(mobility.SIZE), 10, 2, mobility.PRESSURE)
    weights, angles = ring.patch(0.03, mobility.HALF[0]), rolling_mobility.ANGLES
    place = mobility.HALF[1], waves_around.FREQUENCY, angles
    exact = ring.receptance(weights, *place, 4, speed=-speed)
    largest = np.abs(exact).max()
    found = waves_around._summed(waves_around._of_elements(ring, weights, 40, speed), angles)
    assert np.abs(found - exact).max() < (0.03 if speed else 0.02) * largest
    every = zip(*waves_around._of_modes(ring, weights, speed), strict=True)
    for answers, limit in zip(every, (0.02, 0.07, 0.07), strict=True):
        found = waves_around._summed(answers, angles)
        assert np.abs(found - exact).max() < limit * largest


@pytest.mark.long
def test_slow_motions_find_moduli_between_static_and_modal_ones(monkeypatch):
    """Static moduli are the softest; what stands on a rolling tire is softer than the modes. The loop has them within 1.5 %
    of either on elements of 15 degrees."""
    for name, value in {"ALONG": 10, "WAVES": 40, "SPEEDS": (1.0, 20.0, 72.0)}.items():
        monkeypatch.setattr(slow_motions, name, value)
    monkeypatch.setattr(mobility, "AROUND", 24)
    waves, loop = slow_motions.run()
    for _, static, modes, *found in waves.rows:
        assert 1e3 < static < 1e4
        assert modes < found[1] < found[0] <= 1.0
        assert modes < min(0.97, found[2])  # whose inertia softens it
    for speed, _, modes, slow, wanted, off in loop.rows:
        assert modes < 0.99 * wanted
        assert off == pytest.approx(100 * (slow / wanted - 1), abs=0.2)
        assert abs(off) < 1.5, speed


def test_the_plate_by_hand():
    """Belts of 37.4 MN/m at +-22 degrees, 1.3 mm apart, 12.8 mm of rubber and cords of 15 kg/m2: 34.6 and 4.2 N m."""
    ((mass, around, across, level),) = mobility._plate_table().rows
    assert mass == pytest.approx(15.1, rel=0.01)
    cords = 37.4e6 * np.cos(np.radians(22)) ** 4
    assert cords * 2 * 0.75e-3**2 < around < cords * 2 * 0.75e-3**2 + 10
    by_hand = 1 / (8 * np.sqrt(mass * np.sqrt(around * across)))
    assert level == pytest.approx(20 * np.log10(by_hand), abs=0.06)
