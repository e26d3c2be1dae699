"""Error bars from companions whose error is larger by a known ratio."""

import numpy as np
import pytest

from tireroad.contact.results.error_bars import (
    Bars,
    Measured,
    bars,
    estimated,
    measured,
    random_share,
    similar,
    total,
)


def at(size: float, rate: float) -> Measured:
    """Figures whose error is known: 0.3 N, 0.2 N and 0.1 dB at size 1."""
    off = size**rate
    return Measured(
        np.full(3, 7.0 + 0.3 * off),
        np.full(3, 2.0 - 0.2 * off),
        np.array([100.0, 200.0]),
        np.full((2, 3), 20.0 + 0.1 * off),
        np.full((5, 3), 1.0 + 0.04j * off),
    )


@pytest.mark.parametrize("rate", [1.5, 2.0, 3.0])
def test_the_error_of_a_known_order_is_told_exactly(rate):
    found = bars(at(1.0, rate), at(2.0, rate), 1 / (2**rate - 1))
    assert found.mean == pytest.approx(0.3)
    assert found.deviation == pytest.approx(0.2)
    assert found.level == pytest.approx(0.1)
    assert found.history == pytest.approx(0.04 / abs(1 + 0.04j))


def test_a_band_that_the_companion_lacks_is_unknown():
    companion = at(2.0, 2.0)
    companion = Measured(
        companion.mean,
        companion.deviation,
        companion.centre[1:],
        companion.level[1:],
        companion.lines,
    )
    found = bars(at(1.0, 2.0), companion, 1 / 3)
    assert np.isnan(found.level[0]).all()
    assert found.level[1] == pytest.approx(0.1)


def test_causes_add_up_as_squares():
    one, other = (
        Bars(np.full(3, a), np.full(3, a), np.full((1, 3), a), np.full(3, a)) for a in (3.0, 4.0)
    )
    found = total({"step": one, "mesh": other})
    assert found.mean == pytest.approx(5.0)
    assert found.level == pytest.approx(5.0)


def test_figures_of_a_sine():
    step, amplitude = 1e-3, 2.0
    time = step * np.arange(4000)
    force = np.outer(amplitude * np.sin(2 * np.pi * 100.0 * time) + 5.0, [0.0, 0.0, 1.0])
    found = measured(force, step, 300.0)
    assert found.mean[2] == pytest.approx(5.0)
    assert found.deviation[2] == pytest.approx(amplitude / np.sqrt(2))
    assert found.centre.max() < 300.0
    band = np.abs(found.centre - 100.0).argmin()
    assert found.level[band, 2] == pytest.approx(10 * np.log10(amplitude**2 / 2), abs=0.01)


def test_the_deviation_ends_where_the_model_does():
    """100 Hz counts, 400 Hz, beyond the limit, does not."""
    step, count = 1e-3, 4000
    time = step * np.arange(count)
    force = np.zeros((count, 3))
    force[:, 2] = 3.0 * np.sin(2 * np.pi * 100.0 * time) + 5.0 * np.sin(2 * np.pi * 400.0 * time)
    assert measured(force, step, 300.0).deviation[2] == pytest.approx(3.0 / np.sqrt(2), rel=1e-9)
    assert measured(force, step, np.inf).deviation == pytest.approx(force.std(axis=0), rel=1e-9)
    assert measured(force[:-1], step, np.inf).deviation == pytest.approx(force[:-1].std(axis=0))
    assert measured(force[:3], step, 300.0).deviation == pytest.approx(force[:3].std(axis=0))


@pytest.mark.parametrize("ratio", [0.5, 2.0])
def test_errors_that_fall_anywhere_on_every_grid(ratio):
    """The edge of a contact lies anywhere in a cell: in the mean square the share of the difference is the error."""
    rng, order = np.random.default_rng(3), 1.5
    own, companion = (
        size**order * np.sin(2 * np.pi * rng.random(200_000)) for size in (1.0, ratio)
    )
    share = random_share(ratio, order)
    assert share * np.std(companion - own) == pytest.approx(np.std(own), rel=0.01)


def truncated(top: float, order: float, step: float, count: int) -> np.ndarray:
    """White noise, as far off at each frequency as a model with modes to `top` Hz: 0.05 (f / top)^order."""
    lines = np.fft.rfftfreq(count, step)
    phase = np.exp(2j * np.pi * np.random.default_rng(5).random(len(lines)))
    spectrum = count * phase * (1 + 0.05 * (lines / top) ** order)
    spectrum[0] = 0.0
    return np.outer(np.fft.irfft(spectrum, count), [1.0, 1.0, 1.0]) + 10.0


@pytest.mark.parametrize(("order", "part"), [(2.0, 0.71), (3.0, 1.09), (4.0, 1.5)])
def test_truncated_modes_are_told_by_similarity(order, part):
    """The companion differs by 1 - q^r of its error at q f, which is the run's at f; `part` is 2 sinh(r ln 2 / 4)."""
    step, count, top, within = 1e-3, 8192, 400.0, np.sqrt(0.5)
    own, exact = (truncated(highest, order, step, count) for highest in (top, 1e9))
    companion = truncated(within * top, order, step, count)
    run, true, other = (measured(force, step, 0.8 * top) for force in (own, exact, companion))
    found, wanted = similar(run, other, within), bars(run, true, 1.0)
    assert found.history == pytest.approx((1 - within**order) * wanted.history, rel=0.03)
    high = run.centre > 60.0
    assert np.isfinite(found.level).all()
    # Their error is in phase with them throughout, so that half of it is told.
    ratio = found.level[high] / (0.5 * part * wanted.level[high])
    assert (ratio > 0.8).all() and (ratio < 1.5).all()


def test_errors_of_any_phase_are_seldom_understated():
    """Of levels, the signed difference is below half of the true error in three cases of ten."""
    step, count, top, within, random = 1e-3, 1024, 400.0, np.sqrt(0.5), np.random.default_rng(2)
    lines = np.fft.rfftfreq(count, step)

    def noise(size: float) -> np.ndarray:
        turn = np.exp(2j * np.pi * random.random((len(lines), 3)))
        return size * count * turn

    under = []
    for _ in range(40):
        exact, shape = noise(1.0), noise(0.05)
        shape *= (lines[:, None] / top) ** 3
        forces = [np.fft.irfft(exact + a * shape, count, axis=0) for a in (0.0, 1.0, within**-3)]
        true, run, other = (measured(force, step, 0.8 * top) for force in forces)
        found, wanted = similar(run, other, within), bars(run, true, 1.0)
        under.append(found.level < 0.5 * wanted.level)
    assert np.mean(under) < 0.1


@pytest.mark.parametrize("count", [64, 256])
def test_a_short_record_tells_of_bands_by_the_lines_next_to_them(count):
    """Of an error in phase that grows as f^3, half counts: of all bands of a longer record, whether this one has levels or not."""
    step, bands = 1e-3, 1000 * 10 ** (np.arange(-10, -5) / 10)
    own, other = (truncated(top, 3.0, step, count) for top in (400.0, 283.0))
    run, companion = (measured(force, step, 320.0, bands=bands) for force in (own, other))
    assert (run.centre == bands).all() and np.isnan(run.level[0]).all() == (count == 64)
    true = 20 * np.log10(1 + 0.05 * (bands / 400.0) ** 3)
    found = estimated(run, companion, 1 / (2**1.5 - 1)).level[:, 2]
    alone = np.isnan(run.level[:, 2])
    assert (found[alone] / true[alone] < 1.0).all() and (found[alone] / true[alone] > 0.3).all()
    assert found[~alone] == pytest.approx(true[~alone], rel=0.25)
    assert np.isfinite(similar(run, companion, np.sqrt(0.5)).level).all()


@pytest.mark.parametrize("longer", [1, 4])
def test_independent_errors_are_seldom_understated(longer):
    """The difference of one figure is below half of the error in three cases of ten; its size by the lines is not."""
    step, count, random = 1e-3, 1024, np.random.default_rng(7)
    under: dict[str, list[float]] = {"one": [], "size": []}
    ratio = []
    for _ in range(60):
        exact, own, other = (random.standard_normal((longer * count, 3)) for _ in range(3))
        exact += 20.0
        true, run = (measured(force, step, 400.0) for force in (exact, exact + 0.05 * own))
        short, companion = (
            measured(force[:count], step, 400.0, bands=true.centre)
            for force in (exact + 0.05 * own, exact + 0.05 * other)
        )
        wanted = bars(run, true)
        share = random_share(1.0, 1.0)  # of two errors of one size
        for name, found in (
            ("one", bars(short, companion, share)),
            ("size", estimated(short, companion, share, longer)),
        ):
            for kind in ("mean", "deviation", "level"):
                off, told = getattr(wanted, kind), getattr(found, kind)
                some = np.isfinite(off) & np.isfinite(told)
                under[name] += list((told < 0.5 * off)[some])
                ratio += list((told / off)[some]) if name == "size" else []
    assert np.mean(under["size"]) < 0.12
    assert longer > 1 or np.mean(under["one"]) > 0.2
    assert 0.7 < np.median(ratio) < 2.0


def test_a_systematic_error_is_told_whole():
    """The gain of a response: with its phase in every line."""
    step, count = 1e-3, 1024
    force = 20.0 + np.random.default_rng(8).standard_normal((count, 3))
    run, companion = (
        measured(20.0 + a + b * (force - 20.0), step, 400.0) for a, b in ((0.0, 1.0), (0.3, 1.1))
    )
    known = bars(run, companion, 0.5)
    for longer in (None, 1.0):
        found = estimated(run, companion, 0.5, longer)
        assert found.mean == pytest.approx(known.mean, rel=0.02)
        assert found.deviation == pytest.approx(known.deviation, rel=0.02)
        assert found.level == pytest.approx(known.level, rel=0.1)
