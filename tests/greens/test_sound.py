"""Boundary elements of the air: spheres in closed form, sources inside bodies on the road, refusals."""

import numpy as np
import pytest

import tireroad as tr
from tireroad.greens.sound import MIRROR, SoundBody, potentials, solid_angles, transfer
from tireroad.tests.bench.sound import ball

C, RHO = 343.0, 1.2
HERE = np.array([[1.0, 0.0, 0.0], [0.0, 2.0, 1.0], [-0.5, 0.3, 0.8]])
BESIDE = np.array([[0.2, 0.5, 0.1], [-0.2, 0.5, 0.1], [0.6, 0.0, 0.05], [7.5, 0.0, 1.2]])


def db(found: np.ndarray, exact: np.ndarray) -> np.ndarray:
    return np.abs(20 * np.log10(np.abs(found / exact)))


@pytest.mark.parametrize("n", [10, 14])
def test_a_pulsating_and_an_oscillating_sphere(n: int) -> None:
    """Between first and second order in the elements; at 571.66 Hz, ka = pi, the inside resonates.
    Of 600 elements the amplitude is 0.5, 2.2 and 3.4 % off, the level 0.04, 0.07 and 0.15 dB."""
    points, quads = ball(n)
    f = np.array([100.0, 571.66, 1000.0])
    k, r = 2 * np.pi * f / C, np.linalg.norm(HERE, axis=1)[:, None]
    center = points[quads].mean(axis=1)
    normal = center / np.linalg.norm(center, axis=1, keepdims=True)
    found = tr.radiate(points, quads, np.ones((len(quads), 3)), f, HERE, road=False)
    pulse = 1j * k * RHO * C * 0.09 * np.exp(-1j * k * (r - 0.3)) / (r * (1 + 0.3j * k))
    worst = np.abs(found / pulse - 1).max(axis=0)
    assert (worst < np.array([0.5, 3.0, 4.5]) / n**2).all()
    assert (db(found, pulse).max(axis=0) < [0.05, 0.1, 0.2]).all()
    found = tr.radiate(points, quads, normal[:, :1] * np.ones(3), f, HERE, road=False)

    def wave(z):  # spherical Hankel function of the second kind and order 1, but for a factor
        return np.exp(-1j * z) * (1 / z) * (1 - 1j / z)

    slope = -1j * wave(0.3 * k) + np.exp(-0.3j * k) * (-1 / (0.3 * k) ** 2 + 2j / (0.3 * k) ** 3)
    swing = 1j * RHO * C * wave(k * r) / slope * HERE[:, :1] / r
    some = np.abs(HERE[:, 0]) > 0
    assert (np.abs(found[some] / -swing[some] - 1).max(axis=0) < 3.0 / n**2).all()


def source(place: np.ndarray, at: np.ndarray, k: np.ndarray) -> np.ndarray:
    """The field (..., f) of a monopole over the road."""
    both = [np.linalg.norm(place * m - at, axis=-1)[..., None] for m in (np.ones(3), MIRROR)]
    return sum(np.exp(-1j * k * r) / (4 * np.pi * r) for r in both)


@pytest.mark.parametrize("height", [0.26, 0.3005, 0.35])
def test_sources_inside_a_body_on_the_road(height: float) -> None:
    """Outside, their field is known exactly: standing flat on the road, 0.5 mm and 50 mm over it."""
    points, quads = ball(10, height=height)
    points[:, 2] = np.maximum(points[:, 2], 0.0)
    f = np.array([100.0, 400.0, 1000.0])
    k, body = 2 * np.pi * f / C, SoundBody(points[quads], np.arange(len(quads)), True)
    place, weight = body.points_and_weights(4)
    area = np.linalg.norm(weight, axis=2)[..., None]
    step = 1e-5 * body.normal[:, None]
    for at in ([0, 0, height / 4], [0.1, 0.05, height / 3], [-0.1, 0.1, height]):
        near = (source(place + s * step, np.array(at), k) for s in (-1, 1))
        rise = -np.subtract(*near) / 2e-5
        velocity = -(rise * area).sum(axis=1) / area.sum(axis=1) / (2j * np.pi * f * RHO)
        exact = np.stack([source(x, np.array(at), k) for x in BESIDE])
        far = db(tr.radiate(points, quads, velocity, f, BESIDE), exact).max(axis=0)
        assert (far < [0.1, 0.15, 0.5]).all()


def test_many_frequencies_are_interpolated() -> None:
    points, quads = ball(5, height=0.31)
    body = SoundBody.of(points, quads, True)
    f = np.linspace(100.0, 500.0, 81)
    every = transfer(body, f, BESIDE, C)
    for j in (13, 40, 77):
        alone = transfer(body, f[j : j + 1], BESIDE, C)[0]
        assert np.abs(every[j] - alone).max() < 0.003 * np.abs(alone).max()


def test_low_tones_depend_on_the_volume_alone() -> None:
    """p -> i w rho U e^{-ikR} / (2 pi R) over a road, U the volume velocity."""
    points, quads = ball(6, 0.1, height=0.15)
    place = np.array([[20.0, 5.0, 0.0]])
    velocity = np.zeros((len(quads), 1))
    velocity[:40] = 1.0
    found = tr.radiate(points, quads, velocity, np.array([10.0]), place)
    flow = SoundBody.of(points, quads, True).area[:40].sum()
    far = np.linalg.norm(place)
    assert db(found[0], 20 * np.pi * RHO * flow / (2 * np.pi * far)) < 0.05


def test_integrals_in_closed_form() -> None:
    """Against many Gauss points, at heights down to a thousandth of the element."""
    corners = np.array([[[0, 0, 0], [1.0, 0.1, 0], [1.1, 0.9, 0.1], [0.1, 1, 0]]])
    halves = [corners[0, [0, 1, 2]], corners[0, [0, 2, 3]]]
    at, weight = np.polynomial.legendre.leggauss(200)
    s, t = (a.ravel() for a in np.meshgrid((at + 1) / 2, (at + 1) / 2))
    w = np.outer(weight, weight).ravel() / 4
    for x in ([0.4, 0.3, 0.3], [1.5, 0.5, 0.05], [-0.2, 0.4, 0.0]):
        angle = slow = 0.0
        for a, b, c in halves:
            y = a + s[:, None] * (b - a) + (s * t)[:, None] * (c - b)
            n = np.cross(b - a, c - a)
            r = np.linalg.norm(y - x, axis=1)
            angle += (w * s * ((y - x) @ n) / r**3).sum()
            slow += (w * s * np.linalg.norm(n) / r).sum()
        assert solid_angles(np.array([x]), corners)[0] == pytest.approx(angle, abs=1e-6)
        assert potentials(np.array([x]), corners)[0] == pytest.approx(slow, rel=1e-6)


POINTS, QUADS = ball(4, height=0.35)
SILENT = np.zeros((len(QUADS), 1))


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"quads": QUADS[:, ::-1]}, "faces inwards"),
        ({"quads": QUADS[1:], "normal_velocity": SILENT[1:]}, "not closed: its areas add up to"),
        ({"points": POINTS - [0, 0, 0.2]}, "reaches 150 mm under the road"),
        ({"microphones": [[0.0, 0.0, 0.35]]}, "microphone 0 lies inside"),
        ({"microphones": [[2.0, 0.0, 1.0], [0.0, 1.0, -0.1]]}, "microphone 1 lies under the road"),
        ({"microphones": [1.01 * POINTS[QUADS[5]].mean(axis=0)]}, "nearer to element"),
        ({"frequency": [3000.0]}, "3000 Hz is beyond these elements"),
        ({"frequency": [0.0]}, "must be positive"),
        ({"normal_velocity": np.zeros((5, 1))}, "normal_velocity has shape"),
    ],
)
def test_what_cannot_be_radiated_is_refused(change: dict, why: str) -> None:
    given = {
        "points": POINTS,
        "quads": QUADS,
        "normal_velocity": SILENT,
        "frequency": [100.0],
        "microphones": [[1.0, 1.0, 1.0]],
    }
    assert tr.radiate(**given).shape == (1, 1)
    with pytest.raises(tr.InputError, match=why):
        tr.radiate(**given | change)
