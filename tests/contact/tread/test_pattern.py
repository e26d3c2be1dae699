"""A tread pattern in the loop: orders by hand, a slick as its limit, pitches, files, and what is refused."""

import numpy as np
import pytest

from tireroad.contact.tread.pattern import Heights, Pattern, pitch_starts
from tireroad.fem.errors import InputError
from tireroad.runs.scene.tables.contact import GrooveTable, PatternTable
from tireroad.runs.stages.setup import make_pattern
from tireroad.tests.validation import contact_closed_forms
from tireroad.tests.validation.contact_closed_forms import AROUND, grooves, rolled


def test_orders_of_equal_pitches_by_hand() -> None:
    """Grooves that never touch, a rigid road: F(t) = sum over the land of the slick's forces; its order n has the
    groove's Fourier coefficient sin(n pi w/l)/(n pi) times the transform of the force along x."""
    pitch = contact_closed_forms.AROUND / contact_closed_forms.PITCHES
    steps = round(
        contact_closed_forms.TIMES * pitch / contact_closed_forms.SPEED / contact_closed_forms.STEP
    )
    force, _ = rolled(grooves(width=contact_closed_forms.WIDTH, depth=0.05, flank=1e-4), steps)
    assert force.mean() == pytest.approx(500.0 * (1 - contact_closed_forms.WIDTH / pitch), rel=0.01)
    for order, found in zip((1, 2, 3), contact_closed_forms.orders(force), strict=True):
        assert found == pytest.approx(contact_closed_forms.by_hand(order), rel=0.02)
    lines = 2 * np.abs(np.fft.rfft(force - force.mean())) / len(force)
    between = np.delete(lines, np.arange(0, len(lines), 10))
    assert between.max() < 0.01 * lines[10]


def test_a_slick_is_the_limit() -> None:
    """Grooves beside the footprint change no bit."""
    plain, _ = rolled(None, 50)
    beside = grooves(direction="circumferential", position=0.5, width=0.01)
    assert (rolled(beside, 50)[0] == plain).all()


def test_it_comes_again_after_one_turn_and_turns_with_the_tire() -> None:
    pattern = Pattern(
        AROUND,
        [
            GrooveTable(width=0.01, angle=30.0, span=(-0.02, 0.05)),
            GrooveTable(direction="circumferential"),
        ],
        pitch_starts(23, [1.0, 1.3], 4, AROUND),
    )
    s, y = np.meshgrid(np.linspace(0, AROUND, 400), np.linspace(-0.06, 0.06, 30), indexing="ij")
    assert pattern.depth(s + AROUND, y) == pytest.approx(pattern.depth(s, y), abs=1e-9)
    outside = (y < -0.02) & (np.abs(y) > 0.01)
    assert not pattern.depth(s, y)[outside].any()
    # Along its own direction a slanted groove is as deep everywhere.
    on = pattern.starts[3] + np.tan(np.radians(30.0)) * np.array([0.01, 0.03, 0.045])
    assert pattern.depth(on, np.array([0.01, 0.03, 0.045])) == pytest.approx(0.008)


def test_pitches_in_random_order_spread_the_tone() -> None:
    """Of three lengths: all of them, in an order of the seed; the strongest line of the grooves falls."""
    even, mixed = (pitch_starts(60, lengths, 1, AROUND) for lengths in ([1.0], [1.0, 1.25, 1.5]))
    assert np.diff(even) == pytest.approx(AROUND / 60)
    assert len(np.unique(np.round(np.diff(mixed), 9))) == 3
    assert not np.array_equal(mixed, pitch_starts(60, [1.0, 1.25, 1.5], 2, AROUND))
    s, strongest = np.arange(8192) * AROUND / 8192, []
    for starts in (even, mixed):
        depth = Pattern(AROUND, [GrooveTable()], starts).depth(s, 0 * s)
        strongest.append(np.abs(np.fft.rfft(depth)[1:]).max())
    assert strongest[1] < 0.6 * strongest[0]


def test_heights_from_arrays_and_images(tmp_path) -> None:
    from matplotlib.image import imsave

    depth = np.zeros((40, 5))
    depth[10:20, 2] = 0.006
    np.savez(tmp_path / "p.npz", depth=depth, y=np.linspace(-0.1, 0.1, 5))
    found = make_pattern(PatternTable(file=str(tmp_path / "p.npz")), AROUND / (2 * np.pi))
    place = np.array([15.0, 15.5, 30.0]) / 40 * AROUND
    assert found.depth(place, np.zeros(3)) == pytest.approx([0.006, 0.006, 0.0])
    picture = np.ones((10, 40))
    picture[2, 5] = 0.0  # the third row from +y
    imsave(tmp_path / "p.png", picture, cmap="gray", vmin=0, vmax=1)
    drawn = make_pattern(
        PatternTable(file=str(tmp_path / "p.png"), width=0.1), AROUND / (2 * np.pi)
    )
    assert drawn.depth(np.array(5 / 40 * AROUND), np.array(0.025)) == pytest.approx(0.008, rel=0.01)


@pytest.mark.parametrize(
    "arrays",
    [
        {"depth": np.zeros((4, 3))},
        {"depth": np.full((4, 3), np.nan), "y": np.arange(3.0)},
        {"depth": -np.ones((4, 3)), "y": np.arange(3.0)},
        {"depth": np.zeros((4, 3)), "y": np.zeros(3)},
        {"depth": np.zeros(4), "y": np.arange(4.0)},
    ],
)
def test_files_that_are_no_pattern(tmp_path, arrays) -> None:
    np.savez(tmp_path / "p.npz", **arrays)
    with pytest.raises(InputError, match=r"p\.npz"):
        make_pattern(PatternTable(file=str(tmp_path / "p.npz")), 0.3)


def test_a_damaged_archive_is_no_pattern(tmp_path) -> None:
    depth = np.random.default_rng(0).random((40, 5))
    np.savez_compressed(tmp_path / "p.npz", depth=depth, y=np.arange(5.0))
    data = bytearray((tmp_path / "p.npz").read_bytes())
    data[100:200] = bytes(100)  # in the stream of the depths: zlib's error
    (tmp_path / "p.npz").write_bytes(data)
    with pytest.raises(InputError, match=r"p\.npz: no pattern"):
        make_pattern(PatternTable(file=str(tmp_path / "p.npz")), 0.3)


def test_a_pattern_without_land_is_refused() -> None:
    y = np.linspace(-0.05, 0.05, 11)
    assert grooves(width=0.01).land(y) == pytest.approx(1 - 0.011 / 0.05, abs=0.01)
    with pytest.raises(InputError, match="no contact area"):
        grooves(width=0.06).land(y)
    with pytest.raises(InputError, match="no contact area"):
        Pattern(AROUND, heights=Heights(np.full((4, 2), 0.001), np.array([-1.0, 1.0]))).land(y)
