"""A tire-like body on the road: closed, exact for sources inside, and the power of small bodies."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI

from tireroad.fem.errors import InputError
from tireroad.fem.static.road import FLAT, RoadShape
from tireroad.greens.tire_sound import (
    FAR,
    SoundAir,
    SoundingTire,
    Transfer,
    directions,
    elements_for,
    solved_frequencies,
    source_errors,
    transfer,
)

AIR = SoundAir.at(293.15)
MICROPHONES = np.array([[0.2, 0.33, 0.1], [-0.2, 0.33, 0.1], [0.0, 7.5, 1.2], [1.0, 0.0, 0.2]])


def ring(
    around: int = 60, along: int = 25, sunk: float = 0.02, camber: float = 0.0
) -> SimpleNamespace:
    """A ring of radius 0.32 m and width 0.2 m, pressed flat by `sunk` m; its beads are at 0.2 m."""
    turn = 2 * np.pi * np.arange(around) / around
    arc = np.linspace(-np.radians(125), np.radians(125), along)
    r, y = 0.22 + 0.1 * np.cos(arc), 0.1 * np.sin(arc)
    r, y = r - 0.01 * (np.abs(arc) > 2), y
    place = np.stack(
        [np.outer(np.sin(turn), r), np.tile(y, (around, 1)), -np.outer(np.cos(turn), r)], axis=-1
    ).reshape(-1, 3)
    low = -0.32 + sunk
    road = RoadShape(camber=camber)
    under = place[:, 2] < low + road.height(*place[:, :2].T)
    place[under, 2] = low + road.height(*place[under, :2].T)
    return SimpleNamespace(
        positions=place,
        points=place,
        force=np.where(under, 1.0, 0.0),
        shape=(around, along),
        road=road,
        road_height=low,
    )


def heard(tire: SoundingTire, places: np.ndarray, frequency: np.ndarray) -> Transfer:
    ahead = transfer(tire, places, frequency, AIR, MPI.COMM_SELF)
    apart = np.linalg.norm(places, axis=1)
    return Transfer(frequency=frequency, ahead=ahead, distance=apart, air=AIR)


def test_air() -> None:
    assert AIR.speed == pytest.approx(343.2, abs=0.1) and AIR.density == pytest.approx(
        1.204, abs=1e-3
    )
    assert elements_for(1000.0, AIR) == pytest.approx(0.0429, abs=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("camber", [0.0, 0.05])
@pytest.mark.parametrize("size", [0.06, 0.04])
def test_the_body_is_closed_and_has_the_areas_of_the_face(size: float, camber: float) -> None:
    """The discs face along the axle; the nodes in the air share the face's area and its vector sum."""
    state = ring(camber=camber)
    tire = SoundingTire.of(state, size)
    body = tire.body.checked("sound")
    sideways = body.vector[~tire.face].sum(axis=0)
    assert np.abs(sideways).max() < 1e-12 and np.abs(body.normal[~tire.face, 1]).min() > 0.99
    area = np.linalg.norm(tire.area, axis=1).sum()
    assert area == pytest.approx(body.area[tire.face].sum(), rel=0.03)
    # What is open of face and discs is the contact, which faces down.
    whole = tire.area.sum(axis=0) @ tire.axes.T
    assert np.abs(whole[:2]).max() < 1e-12 and whole[2] > 0
    sums = np.asarray(tire.nodes.sum(axis=1)).ravel()
    assert np.abs(sums[np.linalg.norm(tire.area, axis=1) > 0] - 1).max() < 1e-12
    angle, place = np.moveaxis(tire.outline[tire.face], 2, 0)
    assert np.ptp(angle, axis=1).max() < 30 and place.min() >= 0 and place.max() <= 1
    assert np.isnan(tire.outline[~tire.face]).all()


def test_g_is_linear_between_the_elements() -> None:
    """A linear function of place is exact on the flat parts, and good on all."""
    tire = SoundingTire.of(ring(), 0.04)
    place = ring().positions + [0, 0, 0.3]
    slope = np.array([0.3, -1.0, 0.7])
    found = tire.nodes @ (tire.body.center @ slope)
    some = np.linalg.norm(tire.area, axis=1) > 0
    assert np.abs(found - place @ slope)[some].max() < 0.03 * np.abs(place @ slope).max()


def test_a_body_that_moves_as_a_whole_displaces_nothing() -> None:
    """And one that grows displaces its area; the discs move with the wheel."""
    state = ring(sunk=-0.01)
    tire = SoundingTire.of(state, 0.05)
    s = len(state.positions)
    rigid, shape = np.eye(6)[:, :3], np.zeros((3 * s, 3))
    for k in range(3):
        shape[k::3, k] = 1.0
    moved = tire.volumes(shape, rigid)
    assert np.abs(moved.sum(axis=0)).max() < 1e-9
    alone = tire.volumes(shape)
    assert np.abs(alone[~tire.face]).max() == 0 and moved[~tire.face].any()
    turned = np.cross([0, 1, 0], state.positions).reshape(-1, 1)
    assert np.abs(tire.volumes(turned).sum()) < 1e-9, "a wheel that turns displaces nothing"


def test_an_open_wheel_is_a_barrel_between_the_beads() -> None:
    """The body is a ring: closed, of the right volume, and air can be where the disc's middle would be."""
    tire = SoundingTire.of(ring(), 0.05, wheel="open")
    body = tire.body.checked("sound")
    barrel = ~tire.face
    assert np.abs(body.normal[barrel, 1]).max() < 0.01
    inwards = -(body.center[barrel] - [0, 0, tire.height])
    assert ((body.normal[barrel] * inwards).sum(axis=1) > 0).all()
    solid = SoundingTire.of(ring(), 0.05).body
    volume = [float((one.center * one.vector).sum()) / 3 for one in (body, solid)]
    beads = ring().positions.reshape(60, 25, 3)[:, [0, -1]]
    radius, width = np.hypot(beads[..., 0], beads[..., 2]).mean(), np.ptp(beads[..., 1])
    hole = np.pi * radius**2 * width
    assert volume[1] - volume[0] == pytest.approx(hole, rel=0.03)
    body.check_microphones(np.array([[0.0, 0.0, tire.height]]), "sound", ["hub"])
    moved = tire.volumes(np.zeros((3 * len(ring().positions), 1)), np.eye(6)[:, 2:3])
    assert np.abs(moved.sum()) < 1e-9, "a barrel that moves as a whole displaces nothing"


@pytest.mark.slow
@pytest.mark.parametrize(("leak", "wheel"), [(0.0, "disc"), (0.002, "disc"), (0.0, "open")])
def test_sources_inside(leak: float, wheel: str) -> None:
    """Their fields are known: within 0.1 dB to 400 Hz and 0.4 dB at 1 kHz; larger elements do worse."""
    frequency, worst = np.array([0.0, 100.0, 400.0, 1000.0]), []
    for coarser in (1.0, 2.0):
        tire = SoundingTire.of(ring(), 0.043, coarser=coarser, wheel=wheel, leak=leak)
        worst.append(
            np.abs(source_errors(tire, heard(tire, MICROPHONES, frequency), MICROPHONES)).max(
                axis=(0, 1)
            )
        )
    assert (worst[0] < [0.1, 0.1, 0.4 if wheel == "disc" else 0.5]).all()
    assert worst[0][1] < worst[1][1] and worst[1].max() < 3.0


def test_between_the_solved_frequencies() -> None:
    """g at a frequency between those solved is the one solved there."""
    tire = SoundingTire.of(ring(40, 15), 0.06)
    given = heard(tire, MICROPHONES, solved_frequencies(360.0))
    lines = np.array([10.0, 90.0, 203.0, 333.0])
    volume = np.random.default_rng(1).standard_normal((len(tire.body.area), 4)) + 0j
    found = given.pressure(volume, lines)
    for k, line in enumerate(lines):
        wave = 2 * np.pi * line
        g = tire.body.solve(wave / AIR.speed, MICROPHONES)
        exact = -(wave**2) * AIR.density * (g.T @ volume[:, k])
        assert np.abs(found[:, k] - exact).max() < 1e-2 * np.abs(exact).max()


def test_the_power_of_a_small_body_is_that_of_its_volume() -> None:
    """Where its size is small against the wave, W = w^2 rho |Q|^2 / (4 pi c) over a plane."""
    tire = SoundingTire.of(ring(40, 15), 0.06)
    way, angle = directions()
    assert angle.sum() == pytest.approx(2 * np.pi)
    volume = 1e-6 * tire.body.area[:, None] * np.ones(1)
    given = heard(tire, FAR * way, np.array([0.0, 5.0, 10.0]))
    pressure = given.pressure(volume + 0j, np.array([5.0]))[:, 0]
    power = (np.abs(pressure) ** 2 * angle).sum() * FAR**2 / (2 * AIR.impedance)
    flow = 2 * np.pi * 5.0 * volume.sum()
    exact = (2 * np.pi * 5.0) ** 2 * AIR.density * flow**2 / (8 * np.pi * AIR.speed) * 2
    assert power == pytest.approx(exact, rel=0.02)


@pytest.mark.mpi
def test_processes_share_the_frequencies() -> None:
    tire = SoundingTire.of(ring(30, 13), 0.08)
    frequency = solved_frequencies(200.0)
    together = transfer(tire, MICROPHONES, frequency, AIR, MPI.COMM_WORLD)
    alone = transfer(tire, MICROPHONES, frequency, AIR, MPI.COMM_SELF)
    assert np.abs(together - alone).max() < 1e-5 * np.abs(alone).max()


def test_refusals() -> None:
    state = ring()
    with pytest.raises(InputError, match="not a drum"):
        SoundingTire.of(SimpleNamespace(**vars(state) | {"road": RoadShape(drum_radius=1.0)}), 0.05)
    with pytest.raises(InputError, match="not on a road"):
        SoundingTire.of(SimpleNamespace(**vars(state) | {"road": FLAT, "road_height": None}), 0.05)
    tire = SoundingTire.of(state, 0.06)
    with pytest.raises(InputError, match="microphone ear lies inside"):
        tire.body.check_microphones(np.array([[0.0, 0.0, 0.3]]), "sound", ["ear"])
