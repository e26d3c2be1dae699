"""Codes for missing heights: found by how they lie, and never ladders, cleats or plateaus."""

from __future__ import annotations

import numpy as np
import pytest

from tireroad.contact.roads.missing import codes

RNG = np.random.default_rng(5)
N = 3000
X = np.arange(N)
NOISE = RNG.standard_normal(N)
SMOOTH = (
    np.convolve(RNG.standard_normal(N + 20), np.ones(21) / 21, "valid") * 4
)  # mm, rms about 0.9


def ladder(step: float) -> np.ndarray:
    return np.round(SMOOTH / step) * step


def cleats(top: float, width: int, ground: np.ndarray | float = 0.0, ramp: int = 0) -> np.ndarray:
    z = np.zeros(N) + ground
    for begin in range(300, N - 200, 500):
        z[begin : begin + width] = top
        if ramp:
            z[begin - ramp : begin] = np.linspace(0, top, ramp, endpoint=False)
            z[begin + width : begin + width + ramp] = np.linspace(top, 0, ramp, endpoint=False)
    return z


def stones() -> np.ndarray:
    """Plates with joints of one depth and of unlike widths, with steep flanks."""
    z, at = SMOOTH * 0.2, 0
    while at < N - 60:
        at += int(RNG.integers(60, 140))
        width = int(RNG.integers(4, 9))
        z[at : at + width] = -10.0
    return z


ROADS = {
    "rough": SMOOTH,
    "white": NOISE,
    **{f"rounded to {step} mm": ladder(step) for step in (0.01, 0.1, 0.5, 1.0, 2.0)},
    "white, rounded to 1 mm": np.round(NOISE),
    "white, rounded to 0.1 mm": np.round(NOISE, 1),
    "rounded, with spikes": np.where(X % 701 == 0, 7.3, ladder(0.1)),
    "cleats on a plate": cleats(10.0, 20),
    "cleats on a rough road": cleats(10.0, 20, 0.2 * SMOOTH),
    "cleats with ramps": cleats(25.0, 40, 0.0, 12),
    "one kerb": np.where(X > 1200, 150.0, 0.0) + np.round(0.1 * NOISE, 2),
    "kerb of a plate": np.where(X > 1200, 150.0, 0.0),
    "stairs": 10.0 * (X // 400) + 0.0,
    "clipped": np.clip(SMOOTH, -0.8, 0.8),
    "clipped white": np.clip(NOISE, -1.0, 1.2),
    "clipped at zero": np.maximum(SMOOTH, 0.0),
    "flat with a bump": np.where(abs(X - 1500) < 200, 30 * np.cos((X - 1500) * np.pi / 400) ** 2, 0.0),
    "sine": np.round(5 * np.sin(X / 50), 2),
    "plate": np.full(N, 1.5),
    "about 99 mm": np.round(99 + SMOOTH, 1),
    "about -1 mm": np.round(-1 + 0.2 * SMOOTH, 1),
    "narrow joints of one depth": stones(),
}  # fmt: skip


@pytest.mark.parametrize("name", [name for name in ROADS if name != "narrow joints of one depth"])
@pytest.mark.parametrize("unit", [1e-3, 1.0], ids=["mm", "m"])
def test_roads_have_no_codes(name: str, unit: float) -> None:
    """The same road told in mm and in m."""
    z = ROADS[name] if unit < 1 else 1e-3 * ROADS[name]
    assert codes(z[None, :], unit) == []


CODES = -9999.0, 9999.0, 0.0, -1.0, 99.99, -32768.0, -999.9, 1e30, 65535.0, -99.0, 32.767


@pytest.mark.parametrize("code", CODES)
@pytest.mark.parametrize("offset", [0.0, 20.0, -15.0])
@pytest.mark.parametrize("digits", [2, 4])
def test_codes_are_found(code: float, offset: float, digits: int) -> None:
    """In runs of unlike lengths, in a road of 0.9 mm rms about zero, 20 and -15 mm; in one height out of 80."""
    z = np.round(SMOOTH + offset, digits)
    for begin, width in ((200, 4), (700, 9), (1200, 3), (1700, 6), (2300, 12)):
        z[begin : begin + width] = code
    assert codes(z[None, :], 1e-3) == [code]


@pytest.mark.parametrize("code", CODES)
def test_codes_in_a_block_of_a_grid(code: float) -> None:
    """Twelve heights of 3120 in a block of 4 x 3, white heights with five digits about 20 mm."""
    z = np.round(np.random.default_rng(1).normal(20, 1, (240, 13)), 2)
    z[100:104, 4:7] = code
    assert codes(z, 1e-3) == [code]


def test_two_codes_at_once() -> None:
    z = np.round(SMOOTH, 3)
    z[100:110], z[500:520], z[1000:1004] = -9999.0, -9998.0, 9999.0
    assert codes(z[None, :], 1e-3) == [-9999.0, -9998.0, 9999.0]


def test_a_single_code_is_found_and_a_spike_is_left_to_the_outliers() -> None:
    z = np.round(SMOOTH, 3)
    z[100] = -9999.0
    assert codes(z[None, :], 1e-3) == [-9999.0]
    z[100] = 17.3
    assert codes(z[None, :], 1e-3) == []


def test_what_is_missing_already_is_no_neighbour() -> None:
    z = np.round(SMOOTH, 3)
    z[100:105], z[300:330], z[700:703] = 0.0, 0.0, 0.0
    z[98:100] = z[105:107] = np.nan
    assert codes(z[None, :], 1e-3) == [0.0]


@pytest.mark.parametrize("code", [0.0, -1.0])
@pytest.mark.parametrize("rough", [SMOOTH, NOISE], ids=["smooth", "white"])
def test_a_code_within_the_range_of_heights(code: float, rough: np.ndarray) -> None:
    """One number in several short runs where no other height repeats."""
    z = np.round(rough, 6)
    for begin, count in ((300, 2), (900, 3), (1500, 1), (2200, 2)):
        z[begin : begin + count] = code
    assert codes(z[None, :], 1e-3) == [code]


@pytest.mark.parametrize("digits", [2, 3, 4, 6])
def test_heights_that_pass_or_fade_out_to_zero_are_no_codes(digits: int) -> None:
    window = np.hanning(N)
    for z in (
        SMOOTH * window,
        SMOOTH - SMOOTH[0],
        5 * np.sin(X / 20 * 2 * np.pi),
        NOISE * window,
        np.sin(X / 10 * np.pi) + np.sin(X / 15 * np.pi),
        np.tile(SMOOTH[:750], 4),
        np.where(X % 40 < 20, 10.0, 0.0),
    ):
        assert codes(np.round(z, digits)[None, :], 1e-3) == []  # fmt: skip
