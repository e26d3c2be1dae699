"""Sound over a road that absorbs: the half-space against Sommerfeld's integral, layers, and bodies over it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import j0

import tireroad as tr
from tireroad.greens.absorbing_road import AbsorbingPlane, PorousLayer
from tireroad.greens.sound import MIRROR, SoundBody
from tireroad.tests.bench.sound import ball

C, RHO = 343.0, 1.2
PLACES = [(1.0, 0.3), (0.05, 0.02), (0.01, 0.5), (7.5, 1.2), (0.0, 0.1), (0.3, 0.06), (20.0, 3.0)]
EARS = np.array([[0.2, 0.5, 0.1], [-0.2, 0.5, 0.1], [0.5, 0.3, 0.076], [7.5, 0.0, 1.2]])


def sommerfeld(k: float, b: complex, along: float, heights: float) -> complex:
    """What an admittance b adds to the rigid plane: plane waves, and waves that decay upwards."""

    def wave(up: complex) -> complex:  # of vertical wave number k up, but for the angle's measure
        flat = k * np.sqrt(1 - up**2)
        return -2 * b / (up + b) * j0(flat.real * along) * np.exp(-1j * k * up * heights)

    def both(f, a: float, z: float) -> complex:
        parts = np.linspace(a, z, 40)
        return sum(
            quad(lambda t: f(t).real, *ends, limit=200)[0]
            + 1j * quad(lambda t: f(t).imag, *ends, limit=200)[0]
            for ends in zip(parts, parts[1:], strict=False)
        )

    flat = both(lambda t: wave(np.cos(t) + 0j) * k * np.sin(t), 0.0, np.pi / 2)
    end = np.arcsinh(40 / (k * heights))
    decaying = both(lambda t: wave(-1j * np.sinh(t)) * 1j * k * np.cosh(t), 0.0, end)
    return -1j / (4 * np.pi) * (flat + decaying)


@pytest.mark.parametrize("k", [2.0, 18.0])
@pytest.mark.parametrize(
    "b", [0.07 + 0.078j, 0.4, 0.1 + 0.5j, 0.3 + 0.9j, 0.4 - 0.6j, 2.0, 3 - 2j, 0.1 + 2j, 0.005]
)
def test_the_half_space_is_sommerfelds_integral(k: float, b: complex) -> None:
    """Springs and masses, hard and soft, at grazing and normal incidence, and next to the plane."""
    plane = AbsorbingPlane(k, b)
    for along, heights in PLACES:
        found = plane.correction(np.array([along]), np.array([heights]))[0][0]
        assert found == pytest.approx(sommerfeld(k, b, along, heights), rel=2e-6, abs=1e-9)


@pytest.mark.parametrize("b", [0.07 + 0.078j, 1.0, 0.02 + 2j, 0.4 - 0.6j, 0.5j])
def test_its_gradient_and_its_table(b: complex) -> None:
    """Differences of the values, the plane's condition, and bilinear interpolation to 1 %."""
    k, step = 18.0, 1e-5
    plane = AbsorbingPlane(k, b)
    source = np.array([0.1, -0.2, 0.05])
    at = np.array([[0.4, 0.3, 0.2], [0.11, -0.19, 0.01], [3.0, 2.0, 0.0], [0.1, -0.2, 0.4]])
    _, rise = plane.source(at, source)
    for axis in np.eye(3)[:2]:
        ends = [plane.source(at + side * step * axis, source)[0] for side in (1, -1)]
        slope = (ends[0] - ends[1]) / (2 * step)
        assert np.abs(rise @ axis - slope).max() < 1e-5 * np.abs(rise).max()
    ground = at * [1, 1, 0]
    value, rise = plane.source(ground, source)
    apart = np.linalg.norm(ground - source, axis=1)
    whole = value + 2 * np.exp(-1j * k * apart) / (4 * np.pi * apart)  # source and image alike
    np.testing.assert_allclose(rise[:, 2], 1j * k * b * whole, rtol=1e-12)
    random = np.random.default_rng(1)
    apart, steep = 2 * random.random(2000) ** 3 + 1e-4, random.random(2000)
    table = plane.tabulated(2.1).at(apart.astype("f4"), (apart * steep).astype("f4"))
    exact = plane.correction(apart * np.sqrt(1 - steep**2), apart * steep)
    for one, other in zip(table, exact, strict=True):
        image = np.abs(k * b) * (1 if one is table[0] else 1 / apart**2)
        assert np.abs(one - other).max() < 0.01 * np.max(np.abs(other) + image)
        assert np.median(np.abs(one / other - 1)) < 3e-4


def test_the_half_space_at_its_limits() -> None:
    """A soft plane takes the image away twice; 100 m over grass (200 kPa s/m2) are 12.7 dB lost at 395 Hz."""
    along, heights = np.array([0.1, 1.0, 10.0, 0.0]), np.array([0.2, 0.1, 1.0, 0.3])
    apart = np.hypot(along, heights)
    soft = AbsorbingPlane(10.0, 1e4).correction(along, heights)[0]
    assert np.abs(soft * 4 * np.pi * apart * np.exp(10j * apart) + 2).max() < 2e-3
    hertz = 395.0
    grass = 1 + 9.08 * (hertz / 200) ** -0.75 - 11.9j * (hertz / 200) ** -0.73  # Delany and Bazley
    k, apart = 2 * np.pi * hertz / C, np.hypot(100.0, 4.0)
    more = AbsorbingPlane(k, 1 / grass).correction(np.array([100.0]), np.array([4.0]))[0][0]
    image = np.exp(-1j * k * apart) / (4 * np.pi * apart)
    level = 20 * np.log10(abs(1 + (image + more) * 4 * np.pi * 100.0 * np.exp(100j * k)))
    assert level == pytest.approx(-12.72, abs=0.05)


def test_a_layer_is_its_limits() -> None:
    """A spring of its air at low frequencies, rho c at full porosity without resistance and great depth,
    absorption at a quarter wave, and as rigid as its resistivity is large."""
    low = PorousLayer(resistivity=1e3, porosity=0.3, tortuosity=2.0, thickness=0.05)
    spring = low.impedance(np.array([1.0]), C, RHO)[0]
    assert spring == pytest.approx(-1j * C / (2 * np.pi * 0.3 * 0.05) / 1.4, rel=0.02)  # isothermal
    open_air = PorousLayer(resistivity=2e3, porosity=1.0, tortuosity=1.0, thickness=10.0)
    wide = open_air.impedance(np.array([1e5]), C, RHO)[0]
    assert wide == pytest.approx(1.0, abs=0.01)
    layer = PorousLayer()
    hertz = np.linspace(200.0, 2000.0, 361)
    z = layer.impedance(hertz, C, RHO)
    absorbed = 1 - np.abs((z - 1) / (z + 1)) ** 2
    quarter = C / (4 * layer.thickness * np.sqrt(layer.tortuosity))
    assert hertz[absorbed.argmax()] == pytest.approx(quarter, rel=0.15) and absorbed.max() > 0.8
    assert (z.real > 0).all() and (z.imag[hertz < 0.7 * quarter] < 0).all()
    hard = PorousLayer(resistivity=1e15).impedance(hertz, C, RHO)
    assert np.isfinite(hard).all() and np.abs(hard).min() > 1e5


def field(place: np.ndarray, at: np.ndarray, k: float, b: complex) -> tuple:
    """A monopole over the plane and its gradient at places (n, 3)."""
    value, rise = AbsorbingPlane(k, b).source(place, at)
    for mirror in (np.ones(3), MIRROR):
        d = place - at * mirror
        r = np.linalg.norm(d, axis=1)
        wave = np.exp(-1j * k * r) / (4 * np.pi * r)
        value, rise = value + wave, rise - ((1j * k + 1 / r) * wave / r)[:, None] * d
    return value, rise


@pytest.mark.parametrize("z", [3 - 5j, 1 - 1j, 0.7 + 0.5j, 10 - 12j])
@pytest.mark.parametrize("height", [0.26, 0.3005, 0.35])
def test_sources_inside_a_body_over_the_plane(height: float, z: complex) -> None:
    """Outside, their field is known: a body standing flat on the road, 0.5 mm and 50 mm over it."""
    points, quads = ball(8, height=height)
    points[:, 2] = np.maximum(points[:, 2], 0.0)
    body = SoundBody.of(points, quads, True)
    place, weight = body.points_and_weights(4)
    f = np.array([100.0, 400.0, 1000.0])
    at = np.array([0.1, 0.05, height / 3])
    velocity, exact = (
        np.zeros((len(quads), len(f)), complex),
        np.empty((len(EARS), len(f)), complex),
    )
    for n, k in enumerate(2 * np.pi * f / C):
        rise = field(place.reshape(-1, 3), at, k, 1 / z)[1].reshape(place.shape)
        flux = (rise * weight).sum(axis=(1, 2)) / np.linalg.norm(weight, axis=2).sum(axis=1)
        velocity[body.kept, n] = -flux / (1j * k * C * RHO)
        exact[:, n] = field(EARS, at, k, 1 / z)[0]
    found = tr.radiate(points, quads, velocity, f, EARS, impedance=np.full(3, z))
    assert (20 * np.abs(np.log10(np.abs(found / exact))).max(axis=0) < [0.03, 0.12, 0.6]).all()


def test_a_pulsating_box_over_patches() -> None:
    """Against a plane meshed in patches, each a source of its own admittance over the rigid road."""
    n, k, z = 5, 2 * np.pi * 250.0 / C, 2.0 - 2.0j
    points, quads = ball(n, radius=0.15, height=0.2)
    body = SoundBody.of(points, quads, True)
    step, reach = 0.05, 1.6
    line = np.arange(-reach, reach + step / 2, step)
    ground = np.array([(x, y, 0.0) for x in line for y in line if np.hypot(x, y) < reach])
    ears = np.array([[0.3, 0.2, 0.1], [0.5, 0.0, 0.3]])
    # Of the rigid road: g at the ears and at the patches gives what the body sends to both; the patches
    # answer with ik/z p A, and their fields with the body in place are g again, by reciprocity.
    raised = ground + [0, 0, 1e-6]
    every = np.vstack([ears, raised])
    sent = 1j * k * RHO * C * (body.solve(k, every).T @ body.area)  # v = 1

    def over(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """The rigid road's Green's function (x, y), and what the body scatters of it."""
        g = np.zeros((len(x), len(y)), complex)
        for mirror in (np.ones(3), MIRROR):
            r = np.maximum(
                np.linalg.norm(x[:, None] - y * mirror, axis=2), step / np.sqrt(np.pi) / 2
            )
            g += np.exp(-1j * k * r) / (4 * np.pi * r)
        centre, normal = body.center, body.normal
        slope = np.zeros((len(x), len(centre)), complex)
        for mirror in (np.ones(3), MIRROR):
            d = centre - (x * mirror)[:, None]
            r = np.linalg.norm(d, axis=2)
            slope -= (
                (1j * k + 1 / r)
                * np.exp(-1j * k * r)
                / (4 * np.pi * r**2)
                * (d * normal).sum(axis=2)
            )
        return g + (slope * body.area) @ body.solve(k, y)

    turn = -1j * k / z * step**2  # p = sent - ik b int G p
    taper = np.cos(np.clip((np.hypot(*ground.T[:2]) / reach - 0.6) / 0.4, 0, 1) * np.pi / 2) ** 2
    inner = over(raised, raised) * taper
    pressure = np.linalg.solve(np.eye(len(ground)) - turn * inner, sent[len(ears) :])
    patched = sent[: len(ears)] + turn * (over(ears, raised) * taper) @ pressure
    velocity = np.ones((len(quads), 1))
    found = tr.radiate(points, quads, velocity, [250.0], ears, impedance=[z])[:, 0]
    rigid = tr.radiate(points, quads, velocity, [250.0], ears)[:, 0]
    assert np.abs(20 * np.log10(np.abs(rigid / found))).min() > 0.5, "the road matters"
    assert np.abs(20 * np.log10(np.abs(patched / found))).max() < 0.3


def test_a_hard_road_is_rigid_and_others_are_refused() -> None:
    points, quads = ball(4, height=0.35)
    f, quiet = np.array([100.0, 300.0]), np.ones((len(quads), 2))
    rigid = tr.radiate(points, quads, quiet, f, EARS)
    layer = PorousLayer(resistivity=1e15).impedance(f, C, RHO)
    for hard, least in ((np.full(2, np.inf), 1e-10), (np.full(2, 1e12), 1e-10), (layer, 1e-5)):
        found = tr.radiate(points, quads, quiet, f, EARS, impedance=hard)
        assert np.abs(found / rigid - 1).max() < least
    for given, why in (
        ([1.0], "has shape"),
        ([0.0, 1.0], "other than 0"),
        ([-0.1j - 0.1, 1.0], "real part"),
        ([np.nan, 1.0], "number"),
    ):
        with pytest.raises(tr.InputError, match=why):
            tr.radiate(points, quads, quiet, f, EARS, impedance=given)
    with pytest.raises(tr.InputError, match="road = False"):
        tr.radiate(points, quads, quiet, f, EARS, road=False, impedance=[1.0, 1.0])
    with pytest.raises(tr.InputError, match=r"sound.road: porosity must be"):
        PorousLayer(porosity=1.5)
