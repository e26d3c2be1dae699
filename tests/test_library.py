"""The library refuses what does not fit together in one message; its example shows a result."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import tireroad as tr
from tireroad.fem.matrices import probe
from tireroad.fem.model import SmallMotions
from tireroad.runs.library import RollingTire, in_arguments

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parent.parent
TIRE = {"youngs_modulus": 48e6, "segments": 16, "elements_arc": 6, "order": 1}


@pytest.fixture(scope="module")
def tire():
    return tr.torus(**TIRE)


@pytest.fixture(scope="module")
def static(tire):
    return tr.press(tire, inflation=2e5, load=300.0)


@pytest.fixture(scope="module")
def rolling(tire, static) -> RollingTire:
    return tr.roll(tr.modes(tire, static, count=12), tr.Turning(speed=50.0, damping=(500.0, 0.0)))


@pytest.mark.parametrize(
    "wrong",
    [
        {"segments": 7},
        {"segments": 7.5},
        {"elements_arc": 1},
        {"elements_thickness": 21},
        {"footprint_size": 0.01},
        {"outer_radius": 320},
        {"half_angle": 0.1},
    ],
)
def test_a_torus_has_the_ranges_of_a_scene(wrong: dict) -> None:
    tr.torus(**TIRE | {"segments": np.int64(16), "half_angle": np.radians(175), "outer_radius": 1})
    with pytest.raises(tr.InputError, match=f"{next(iter(wrong))} must be"):
        tr.torus(**TIRE | wrong)


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"segments": 18}, "it has .* nodes, and the tire"),
        ({"outer_radius": 0.33}, "its nodes lie elsewhere"),
        ({"youngs_modulus": 47e6}, "its tire is of other materials"),
    ],
)
def test_modes_refuse_the_state_of_another_tire(static, change: dict, why: str) -> None:
    with pytest.raises(tr.InputError, match=f"another tire .{why}"):
        tr.modes(tr.torus(**TIRE | change), static, count=4)


def test_a_wall_of_another_thickness_is_another_tire(static) -> None:
    """Its outer face has the same nodes, and so many: the state of 12 mm gave modes of 20 mm."""
    with pytest.raises(tr.InputError, match="another tire .its mesh is another within"):
        tr.modes(tr.torus(**TIRE | {"thickness": 0.02}), static, count=4)


def test_modes_and_rolling_tires_of_two_tires_are_refused(rolling, static) -> None:
    thick = tr.torus(**TIRE | {"thickness": 0.02})
    other = tr.modes(thick, tr.press(thick, inflation=2e5, load=400.0), count=12)
    mixed = replace(rolling.standing, motions=other.motions)
    with pytest.raises(tr.InputError, match="modes of another tire or static state"):
        tr.roll(mixed, tr.Turning(speed=20.0))
    with pytest.raises(tr.InputError, match="states and standing are of two tires"):
        replace(rolling, standing=other)


@pytest.mark.parametrize(
    "kind", [np.float64, np.float32, np.array], ids=["float64", "float32", "0-d"]
)
def test_numbers_of_numpy_are_numbers(kind) -> None:
    whole = np.array if kind is np.array else np.int64
    sizes = {name: whole(value) for name, value in TIRE.items() if isinstance(value, int)}
    reals = {name: kind(value) for name, value in TIRE.items() if isinstance(value, float)}
    tire = tr.torus(**TIRE | sizes | reals)
    turning = tr.Turning(speed=kind(50.0), damping=(kind(500.0), kind(0.0)))
    static = tr.press(tire, inflation=kind(2e5), load=kind(500.0), turning=turning)
    assert static.load == pytest.approx(500, rel=1e-6)
    modes = tr.modes(tire, static, count=whole(4))
    assert len(modes.frequency) == 4
    road = tr.make_road(kind="sine", amplitude=kind(1e-4), wavelength=kind(0.1))
    run = tr.drive(
        tr.roll(modes, turning), road, duration=kind(1e-3), step=kind(1e-4), spacing=kind(0.02)
    )
    assert len(run.time) in (10, 11)  # 1e-3 of float32 is a little more than ten steps
    rubber = tr.compound(
        "neo-hookean", kind(1200.0), youngs_modulus=kind(48e6), poisson_ratio=kind(0.45)
    )
    assert rubber.density == 1200.0 and isinstance(rubber.density, float)
    with pytest.raises(tr.InputError):
        tr.press(tire, inflation=np.array([2e5, 3e5]), load=500.0)


def test_modes_take_the_state_of_an_equal_tire(rolling, static) -> None:
    again = tr.modes(tr.torus(**TIRE), static, count=12)
    assert again.frequency == pytest.approx(rolling.standing.frequency, rel=1e-9)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"tread": "rubber"}, "tread = 'rubber' is not a tread law.*HalfSpace"),
        ({"duration": float("nan")}, "duration = nan s must be positive and finite"),
        ({"duration": -1.0}, "duration = -1 s must be"),
        ({"step": 0.0}, "step = 0 s must be"),
        ({"step": float("inf")}, "step = inf s must be"),
        ({"spacing": 0.0}, "spacing = 0.0 must be"),
        ({"spacing": (0.01, 0.01, 0.01)}, "spacing = .* must be one length or two"),
        ({"spacing": "fine"}, "spacing = 'fine' must be"),
        ({"spacing": 5}, "spacing = 5 m .* less than two points in a footprint of 0.036"),
        ({"spacing": (0.01, 0.1)}, "across leaves less than two points.*take 0.005 m"),
        ({"residual": "statics"}, 'residual = "statics" is unknown: take none, .*static'),
    ],
)
def test_drive_says_what_it_does_not_take(rolling, given: dict, message: str) -> None:
    with pytest.raises(tr.InputError, match=message):
        tr.drive(rolling, tr.make_road(kind="flat"), **{"duration": 0.01} | given)


@pytest.mark.parametrize(
    ("key", "argument"),
    [
        ("contact.points = { dx, dy } (m)", "spacing = (dx, dy) (m)"),
        ("take a smaller [time] step, or time.step", "take a smaller step, or step"),
        ("Lower static.load, raise static.inflation", "Lower load, raise inflation"),
        ("docs/static.load_curve and tire.segmentsx", "docs/static.load_curve and tire.segmentsx"),
    ],
)
def test_errors_name_arguments_and_not_keys_of_a_scene(key: str, argument: str) -> None:
    assert in_arguments(key) == argument


def test_a_load_out_of_reach_names_the_argument(tire) -> None:
    with pytest.raises(
        tr.ConvergenceError, match=r"Lower load, raise inflation, or give deflection"
    ):
        tr.press(tire, inflation=2e5, load=1e7)
    with pytest.raises(tr.InputError, match="load = -1 N"):
        tr.press(tire, inflation=2e5, load=-1.0)


def test_a_tire_is_pressed_as_if_for_the_first_time(static) -> None:
    """Its body is shared, and held the state of the press before: another inflation stopped at 0 Pa."""
    again = tr.torus(**TIRE)
    tr.press(again, inflation=1e5, deflection=0.004)
    assert np.array_equal(
        tr.press(again, inflation=2e5, load=300.0).displacement, static.displacement
    )


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"road": "held"}, 'road = "held" fixes the nodes'),
        ({"rim": "free"}, 'rim = "free" leaves nothing'),
    ],
)
def test_drive_refuses_modes_that_cannot_carry_the_contact(
    rolling, tire, static, change: dict, why: str
) -> None:
    standing = replace(rolling.standing, motions=SmallMotions(tire, static, **change))
    with pytest.raises(tr.InputError, match=why):
        tr.drive(replace(rolling, standing=standing), tr.make_road(kind="flat"), duration=0.01)


def test_a_response_has_one_of_the_known_residuals(rolling) -> None:
    with pytest.raises(tr.InputError, match='residual = "x" is unknown: take none'):
        rolling.at([(0.0, 0.0)], residual="x")


def test_a_response_has_a_point(rolling) -> None:
    with pytest.raises(tr.InputError, match="at: no point given"):
        rolling.at([])


def test_modes_and_states_say_what_they_are(rolling, tire) -> None:
    """The tire's mass and its inertia about the axle bound the effective ones; viscous damping is that asked for."""
    standing = rolling.standing
    assert standing.name[:4].tolist() == ["T0", "L1", "L1", "L0"]
    assert standing.wave_number[:4].tolist() == [0, 1, 1, 0]
    mass = standing.effective_mass
    assert mass.shape == (12, 6) and (mass >= 0).all()
    body = tire.body
    place, own = body.lattice.points(body.ids), body.nodal_mass()[::3]
    whole = body.comm.allreduce(own.sum())
    turned = body.comm.allreduce(own @ (place[:, 0] ** 2 + place[:, 2] ** 2))
    every = mass.sum(axis=0)
    assert (0.4 * whole < every[:3]).all() and (every[:3] < whole).all()
    assert 0.4 * turned < every[4] < turned
    assert np.isnan(standing.damping).all()  # no compound of it loses
    oscillates = rolling.frequency > 0
    size = 500.0 / 2 / np.abs(rolling.eigenvalue[oscillates])
    np.testing.assert_allclose(rolling.damping[oscillates], size, rtol=0.05)
    assert {"L1+", "L1-", "R1+", "R1-"} <= set(rolling.name)
    free = tr.modes(tire, tr.press(tire, inflation=2e5), count=8, rim="free")
    assert free.name[:6].tolist() == ["rigid"] * 6 and free.name[6] != "rigid"
    assert np.isnan(free.damping).all()


def test_a_pair_splits_as_a_turning_ring_does() -> None:
    """Yaw, of a belt with inertia Iyy about the axle and Ixx about a diameter: +- Omega (1 - Iyy / 2 Ixx) n."""
    tire = tr.radial("205/60 R15", segments=16, elements_arc=8)
    modes = tr.modes(tire, tr.press(tire, inflation=2.2e5), count=12)
    lines = tr.campbell(modes, tr.Turning(speed=20.0, damping=tr.StrainEnergy()), branches=10)
    found = dict(zip(lines.name, lines.frequency.T, strict=True))
    split = (found["L1+"] - found["L1-"])[-1]
    assert split == pytest.approx(2 * 3.0, abs=0.3)  # (2 pi)^-1 20 rad/s x 0.94
    ring = (found["R2+"] - found["R2-"])[-1]  # of an inextensible ring n - 2 n / (n^2 + 1) = 1.2
    assert ring == pytest.approx(2 * 1.2 * 20 / (2 * np.pi), abs=0.3)
    assert (lines.damping[:, list(lines.name).index("T0")] > 0.05).all()
    assert lines.speed[0] == 0 and lines.speed[-1] == 20.0 and len(lines.speed) == 21


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"speeds": [10.0, 5.0]}, "speeds must ascend"),
        ({"speeds": [-1.0, 5.0]}, "speeds must ascend"),
        ({"speeds": []}, "speeds must ascend"),
        ({"branches": 0}, "branches = 0 must be a whole number"),
        ({"branches": 2.5}, "branches = 2.5 must be"),
    ],
)
def test_a_campbell_diagram_refuses(rolling, given: dict, message: str) -> None:
    with pytest.raises(tr.InputError, match=message):
        tr.campbell(rolling.standing, tr.Turning(speed=50.0, damping=(500.0, 0.0)), **given)


def test_the_hub_carries_a_slow_force_with_its_moment(tire) -> None:
    """At 0 Hz force and moment about the axle's centre are those of the load at its displaced place.

    On no road, whose static forces move with the tire and have moments of their own, and with the centrifugal
    forces in the static state, too.
    """
    spots = [(0.0, 0.0), (0.7, 0.4)]
    turning = tr.Turning(speed=50.0, damping=(500.0, 0.0))
    static = tr.press(tire, inflation=2e5, turning=turning)
    rolling = tr.roll(tr.modes(tire, static, count=12), turning)
    found = rolling.hub(spots, np.array([1e-3, 60.0]))
    assert found.shape == (2, 6, 6)
    lattice = tire.lattice
    places = [
        sum(
            weight * static.positions[node]
            for node, weight in enumerate(probe.directed(probe.spot(lattice, *spot), axis)[k::3])
            if weight
        )
        for spot in spots
        for k, axis in enumerate(np.eye(3))
    ]
    expected = np.zeros((6, 6))
    for column, (place, force) in enumerate(zip(places, np.tile(np.eye(3), (2, 1)), strict=True)):
        expected[:3, column], expected[3:, column] = force, np.cross(place, force)
    np.testing.assert_allclose(found[0], expected, atol=1e-4)
    assert np.abs(found[1] - expected).max() > 0.1


def test_the_hub_refuses(rolling, tire, static) -> None:
    for frequency in (0.0, [-1.0], [np.nan], [[1.0]]):
        with pytest.raises(tr.InputError, match="hub: frequency must be"):
            rolling.hub([(0.0, 0.0)], frequency)
    with pytest.raises(tr.InputError, match="hub: no point given"):
        rolling.hub([], [10.0])
    free = tr.roll(
        tr.modes(tire, static, count=12, road="held"),
        tr.Turning(speed=0.0, damping=(500.0, 0.0)),
    )
    with pytest.raises(tr.InputError, match="hub: these modes have a free rim or a held road"):
        free.hub([(0.0, 0.0)], [10.0])


def test_a_torus_is_of_a_material() -> None:
    with pytest.raises(tr.InputError, match="material = 'rubber' is not a material: take"):
        tr.torus(**TIRE, material="rubber")


def test_a_run_of_one_step_has_no_band(rolling) -> None:
    run = tr.drive(rolling, tr.make_road(kind="flat"), duration=1e-3, step=1e-3)
    assert run.time.tolist() == [1e-3] and run.step == 1e-3
    frequency, amplitude = run.spectrum()
    assert frequency.tolist() == [0.0] and not amplitude.any()
    centre, level = run.third_octaves()
    assert centre.shape == (0,) and level.shape == (0, 3)


def test_objects_of_the_wrong_kind_are_named_with_what_makes_the_right_ones(
    tire, static, rolling
) -> None:
    flat = tr.make_road(kind="flat")
    for call, message in (
        (lambda: tr.press("tire", inflation=2e5), "press: tire is of the type str: .*torus"),
        (lambda: tr.press(tire, inflation=2e5, turning=50.0), "turning .* float: .*Turning"),
        (lambda: tr.modes(tire, rolling, count=4), "static .* RollingTire: .*press"),
        (lambda: tr.modes(tire, static, count=4, turning=50), "turning .* int"),
        (lambda: tr.roll(static, tr.Turning()), "standing .* StaticState: .*modes"),
        (lambda: tr.roll(rolling.standing, None), "turning .* NoneType"),
        (lambda: tr.drive(rolling.standing, flat, duration=0.01), "tire .* Standing: .*roll"),
        (lambda: tr.drive(rolling, {"kind": "flat"}, duration=0.01), "road .* dict: .*make_road"),
        (lambda: tr.make_road({"kind": "flat"}), "make_road: .* give keys by name"),
        (lambda: tr.make_road(5), "make_road: 5 is not a road"),
    ):
        with pytest.raises(tr.InputError, match=message):
            call()


def test_figures_may_begin_after_the_run_in(rolling) -> None:
    """A growing road lifts the mean: in the whole record this outweighs a band below the tone."""
    road = tr.make_road(kind="sine", amplitude=2e-4, offset=1e-3, wavelength=0.2)
    run = tr.drive(rolling, road, duration=0.1, step=5e-4, spacing=0.01)
    patch = np.ptp(run.patch.points[:, 0])
    speed = rolling.states.turning.speed * rolling.standing.motions.static.rolling_radius()
    assert run.run_in == pytest.approx((0.1 + patch) / speed, rel=0.2)
    frequency, _ = run.spectrum(start=run.run_in)
    assert frequency[1] == pytest.approx(1 / (0.1 - run.run_in), rel=0.02)
    whole, later = run.spectrum(), run.spectrum(start=run.run_in)
    assert abs(later[1][1, 2]) < 0.5 * abs(whole[1][1, 2])
    assert len(run.third_octaves(start=run.run_in)[0]) <= len(run.third_octaves()[0])
    assert tr.drive(rolling, tr.make_road(kind="flat"), duration=0.01).run_in == 0.0
    for start in (-0.1, 0.2, float("nan")):
        with pytest.raises(tr.InputError, match="must be from 0 to the end, 0.1 s"):
            run.third_octaves(start=start)


def test_one_spacing_is_that_of_both_ways(rolling) -> None:
    road = tr.make_road(kind="sine", amplitude=2e-4)
    one, two = (
        tr.drive(rolling, road, duration=0.005, step=5e-4, spacing=spacing)
        for spacing in (0.01, (0.01, 0.01))
    )
    assert np.array_equal(one.force, two.force) and one.force.any()


def _example(page: str) -> str:
    text = (ROOT / page).read_text(encoding="utf-8")
    return re.findall(r"```python\n(import tireroad as tr\n.*?)```", text, re.DOTALL)[0]


def test_the_example_is_the_same_on_both_pages() -> None:
    assert _example("README.md") == _example("docs/how-to/library.md")


@pytest.mark.long
def test_the_example_says_what_each_figure_is(capfd) -> None:
    """A load near that of the static state, and levels of the axle with the tire's vertical mode on top."""
    exec(_example("README.md"), {})
    printed = capfd.readouterr().out
    mean, deviation = map(
        float, re.match(r"road on tire: mean (\d+) N, deviation (\d+) N", printed).groups()
    )
    assert 3900 < mean < 4200 and 20 < deviation < 400
    found = re.findall(r"tire on axle, vertical: (\d+) Hz (-?[\d.]+) dB re 1 N", printed)
    levels = {int(hz): float(db) for hz, db in found}
    assert len(levels) >= 3 and max(levels, key=levels.__getitem__) == 79


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"size": "205"}, 'radial: size = "205": must be like'),
        ({"segments": 3}, "segments must be"),
        ({"elements_arc": 1}, "elements_arc must be"),
    ],
)
def test_a_radial_tire_has_the_ranges_of_a_scene(given: dict, message: str) -> None:
    with pytest.raises(tr.InputError, match=message):
        tr.radial(**given)


def test_the_radial_tire_is_that_of_a_scene(tmp_path: Path) -> None:
    """The same mesh and mass as of `section = "radial"`."""
    from mpi4py import MPI

    from tireroad.runs.scene.load import load
    from tireroad.runs.scene.physics import make_tire

    scene = tmp_path / "scene.toml"
    scene.write_text(
        '[tire]\nsection = "radial"\nsegments = 16\nelements_arc = 8\n[static]\nload = 1\n'
    )
    ours, theirs = (
        tr.radial(segments=16, elements_arc=8),
        make_tire(MPI.COMM_WORLD, load(scene).tire),
    )
    assert ours.lattice.size == theirs.lattice.size
    at = [tire.lattice.points(tire.lattice.face) for tire in (ours, theirs)]
    assert np.allclose(*at, rtol=0, atol=1e-12)
