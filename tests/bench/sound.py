"""Sound: closed forms, a sphere over the road, the horn, and tires beside the emission of CNOSSOS-EU."""

from __future__ import annotations

import json
import os
import subprocess
import tempfile
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import h5py
import numpy as np
from mpi4py import MPI
from scipy.special import eval_legendre, spherical_jn, spherical_yn

from tireroad.contact.roads.kinds.two_slope import LEVELS
from tireroad.fem.static.road import FLAT
from tireroad.greens.sound import SoundBody, radiate
from tireroad.greens.tire_sound import FAR, SoundAir, SoundingTire, Transfer, directions, transfer
from tireroad.runs.process import console
from tireroad.runs.validation.tables import Table

ABOUT = "sound: spheres in closed form and over the road, horn, power, and tires beside CNOSSOS-EU"
ROOT = Path(__file__).resolve().parents[2]
RADIUS, C, RHO = 0.31, 343.0, 1.2
AIR = SoundAir(speed=C, density=RHO)
FREQUENCIES = np.array([100.0, 200.0, 400.0, 800.0, 1600.0])
EARS = np.array([[0.6, 0.3, 0.1], [0.0, 0.5, 0.4], [7.5, 0.0, 1.2]])
GAPS = (0.5e-3, 5e-3, 30e-3)  # m
ORDERS = 90  # of the multipoles
SPEEDS = (50, 80, 110)  # km/h
# CNOSSOS-EU, Directive (EU) 2021/1226, rolling noise of passenger cars, octaves from 63 Hz: L_W at 70 km/h and
# its rise by a decade of speed; a tire has a quarter of the car's power.
OCTAVES = np.array([63.0, 125.0, 250.0, 500.0, 1000.0])
CNOSSOS = np.array([[83.1, 89.2, 87.7, 93.1, 100.1], [30.0, 41.5, 38.9, 25.7, 32.5]])
QUARTER = 6.0


def run() -> list[Table]:
    """All tables. Not collective: the tires are run by processes of their own."""
    return [_spheres(), _over_the_road(), _power(), _horn(), _tires()]


def ball(n: int, radius: float = 0.3, height: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Points (p, 3) and outward quads of a sphere of 6 n^2 elements."""
    t, quads = np.tan(np.linspace(-np.pi / 4, np.pi / 4, n + 1)), []
    points: dict[tuple, int] = {}
    for axis in range(3):
        for side in (1, -1):
            w, u, v = (np.roll([1.0, 0, 0], axis + k) for k in range(3))
            for i, j in np.ndindex(n, n):
                ring = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)][::side]
                names = [tuple(np.round(side * w + t[a] * u + t[b] * v, 9)) for a, b in ring]
                quads.append([points.setdefault(name, len(points)) for name in names])
    place = np.array(list(points))
    return radius * place / np.linalg.norm(place, axis=1, keepdims=True) + [0, 0, height], np.array(
        quads
    )


def decibel(found: np.ndarray, exact: np.ndarray) -> np.ndarray:
    """Errors of level, dB."""
    return 20 * np.log10(np.abs(found / exact))


def _spheres() -> Table:
    rows = []
    k, r = 2 * np.pi * FREQUENCIES / C, np.linalg.norm(EARS, axis=1)[:, None]
    exact = (
        1j * k * RHO * C * RADIUS**2 * np.exp(-1j * k * (r - RADIUS)) / (r * (1 + 1j * k * RADIUS))
    )
    for n in (8, 10, 14):
        points, quads = ball(n, RADIUS)
        began = time.perf_counter()
        found = radiate(
            points, quads, np.ones((len(quads), len(k)), complex), FREQUENCIES, EARS, road=False
        )
        rows.append(
            [len(quads), time.perf_counter() - began, *np.abs(decibel(found, exact)).max(axis=0)]
        )
    columns = [("elements", "-"), ("time", "s"), *((f"{f:g} Hz", "dB") for f in FREQUENCIES)]
    note = "Largest error of level at three microphones, against the closed form; target: 0.1 dB at 600 elements to 1 kHz."
    return Table("A pulsating sphere of 0.31 m in free air", columns, rows, [note])


def multipoles(gap: float, k: float, places: np.ndarray, width: float = 0.3) -> np.ndarray:
    """Pressure (m,) at places (m, 3) of a sphere `gap` m over the rigid road, v = exp(-(theta / width)^2)
    around its lowest point: multipoles about its center and their images, by least squares on 4 points an order."""
    height, order = RADIUS + gap, np.arange(ORDERS)
    scale = spherical_jn(order, k * RADIUS) - 1j * spherical_yn(order, k * RADIUS)

    def fields(place: np.ndarray, normal: np.ndarray | None = None) -> np.ndarray:
        """Values (m, n), or slopes along the normals, of the multipoles with their images."""
        total = 0.0
        for up in (1, -1):
            d = place - [0, 0, up * height]
            r = np.linalg.norm(d, axis=1)[:, None]
            cosine = d[:, 2:] / r
            value = (spherical_jn(order, k * r) - 1j * spherical_yn(order, k * r)) / scale
            sign = 1.0 if up > 0 else (-1.0) ** order
            legendre = eval_legendre(order, cosine)
            if normal is None:
                total = total + sign * value * legendre
                continue
            rise = (
                k
                * (spherical_jn(order, k * r, True) - 1j * spherical_yn(order, k * r, True))
                / scale
            )
            below = np.maximum(1 - cosine**2, 1e-12)
            tilt = (
                order
                * (eval_legendre(np.maximum(order - 1, 0), cosine) - cosine * legendre)
                / below
            )
            along = (normal * d).sum(axis=1)[:, None] / r
            turn = (normal[:, 2:] - cosine * along) / r
            total = total + sign * (rise * along * legendre + value * turn * tilt)
        return np.asarray(total)

    cosine = np.polynomial.legendre.leggauss(4 * ORDERS)[0]
    normal = np.stack([np.sqrt(1 - cosine**2), 0 * cosine, cosine], axis=1)
    slopes = fields(RADIUS * normal + [0, 0, height], normal)
    wanted = -1j * k * C * RHO * np.exp(-((np.arccos(-cosine) / width) ** 2))
    return fields(places) @ np.linalg.lstsq(slopes, wanted, rcond=1e-13)[0]


def _over_the_road() -> Table:
    rows = []
    for gap in GAPS:
        for n in (8, 12):
            points, quads = ball(n, RADIUS, RADIUS + gap)
            body = SoundBody.of(points, quads, True)
            place, weight = body.points_and_weights(4)
            size = np.linalg.norm(weight, axis=2)
            way = place - [0, 0, RADIUS + gap]  # elements are flat: the directions are the sphere's
            angle = np.arccos(-way[..., 2] / np.linalg.norm(way, axis=2))
            velocity = (np.exp(-((angle / 0.3) ** 2)) * size).sum(axis=1) / size.sum(axis=1)
            found = radiate(
                points, quads, np.tile(velocity[:, None], len(FREQUENCIES)), FREQUENCIES, EARS
            )
            exact = [multipoles(gap, 2 * np.pi * f / C, EARS) for f in FREQUENCIES]
            rows.append(
                [1e3 * gap, len(quads), *np.abs(decibel(found, np.array(exact).T)).max(axis=0)]
            )
    columns = [("gap", "mm"), ("elements", "-"), *((f"{f:g} Hz", "dB") for f in FREQUENCIES)]
    notes = [
        "v = exp(-(angle from the lowest point / 0.3 rad)^2) on a sphere of 0.31 m; largest error of level at three "
        f"microphones against {ORDERS} multipoles and their images. The patch is 90 mm wide: few elements."
    ]
    return Table("A sphere over the rigid road", columns, rows, notes)


def cylinder(around: int = 120, along: int = 13) -> Any:
    """A cylinder of 0.32 m radius and 0.2 m width that touches the road, as a tire's static state."""
    turn = 2 * np.pi * np.arange(around) / around
    y = np.linspace(-0.1, 0.1, along)
    place = np.stack(
        np.broadcast_arrays(0.32 * np.sin(turn)[:, None], y, -0.32 * np.cos(turn)[:, None]), axis=-1
    )
    place = place.reshape(-1, 3)
    low = -0.32 + 1e-3
    under = place[:, 2] < low
    place[under, 2] = low
    force = np.where(under, 1.0, 0.0)
    return SimpleNamespace(
        positions=place,
        points=place,
        force=force,
        shape=(around, along),
        road=FLAT,
        road_height=low,
    )


def _horn() -> Table:
    tire = SoundingTire.of(cylinder(), 0.03)
    places = np.array([[7.5, 0.0, 0.0], [5.3, 5.3, 0.0], [0.0, 7.5, 0.0]])
    hertz = np.array([0.0, 200.0, 500.0, 800.0, 1000.0, 1600.0])
    ahead = transfer(tire, places, hertz, AIR, MPI.COMM_SELF)
    center = tire.body.center
    rows = []
    for d in (0.05, 0.1):
        middle = tire.face & (np.abs(center[:, 1]) < 0.02)
        e = np.flatnonzero(middle)[
            np.argmin(np.linalg.norm(center[middle][:, [0, 2]] - [d, d**2 / 0.64], axis=1))
        ]
        for name, m in (("ahead", 0), ("45 deg", 1), ("side", 2)):
            free = 1 / (2 * np.pi * np.linalg.norm(places[m]))
            rows.append(
                [1e3 * center[e, 0], name, *(20 * np.log10(np.abs(ahead[1:, m, e]) / free))]
            )
    columns = [
        ("from the contact", "mm"),
        ("listener", ""),
        *((f"{f:g} Hz", "dB") for f in hertz[1:]),
    ]
    notes = [
        "Pressure at 7.5 m on the road of a small part of a cylinder (0.32 m, 0.2 m wide, touching) over that of the same "
        "volume velocity on the road alone. Published of tires: 10 to 20 dB, independent of the place near the contact "
        "at low frequencies (Graf, Kuo, Dowling, Graham, J. Sound Vib. 256 (2002) 417, abstract); of the order of 20 dB "
        "in the plane, much lower in other directions (Kropp, Becot, Barrelet, Acustica 86 (2000) 769, abstract). Only "
        "the abstracts were at hand: no curve was compared."
    ]
    return Table("The horn between a cylinder and the road", columns, rows, notes)


def _power() -> Table:
    """A monopole inside has a known power over the road, rho c k^2 Q^2 / (8 pi) (1 + sin 2kh / 2kh), twice one half."""
    tire, source = SoundingTire.of(cylinder(), 0.04), np.array([0.05, 0.02, 0.25])
    way, angle = directions()
    hertz = np.array([0.0, 100.0, 200.0, 400.0, 800.0, 1000.0])
    given = Transfer(
        frequency=hertz,
        ahead=transfer(tire, FAR * way, hertz, AIR, MPI.COMM_SELF),
        distance=np.full(len(way), FAR),
        air=AIR,
    )
    row = []
    for f in hertz[1:]:
        k = 2 * np.pi * f / C
        flux = tire.flux_of(source, k)  # of a source of 1 / (i w rho) m3/s
        pressure = given.ahead[list(hertz).index(f)] @ flux
        found = (np.abs(pressure) ** 2 * angle).sum() * FAR**2 / (2 * RHO * C)
        exact = (1 + np.sin(2 * k * source[2]) / (2 * k * source[2])) / (8 * np.pi * RHO * C)
        row.append(10 * np.log10(found / exact))
    columns = [("elements", "-"), *((f"{f:g} Hz", "dB") for f in hertz[1:])]
    note = f"Error of the power over {len(way)} directions, of a monopole inside a cylinder on the road, against its closed form."
    return Table("Sound power", columns, [[len(tire.body.area), *row]], [note])


def _tires() -> Table:
    """Octaves of the sound power of the tire of noise.toml on two roads, beside CNOSSOS-EU."""
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for speed in SPEEDS:
            for road, less in (("smooth", 6.0), ("rough", 0.0)):
                power, seconds = _powers(Path(folder) / f"{road}-{speed}", speed, less)
                emission = CNOSSOS[0] + CNOSSOS[1] * np.log10(speed / 70.0) - QUARTER
                rows.append([road, speed, seconds, *power, *emission])
                console.say(
                    f"  {road} {speed} km/h: {np.round(power, 1)} dB, CNOSSOS {np.round(emission, 1)}"
                )
    columns = [("asphalt", ""), ("speed", "km/h"), ("run", "s")]
    columns += [(f"{what}{f:g} Hz", "dB re 1 pW") for what in ("", "CNOSSOS ") for f in OCTAVES]
    notes = [
        "The tire of noise.toml (bands to 1 kHz: the octave of 1 kHz without its band of 1.25 kHz) on two-slope roads of the "
        "default texture, a stone mastic asphalt of 11 mm with skewness -1, and 6 dB below it; CNOSSOS-EU (a mean of dense "
        "and stone mastic asphalt of 11 mm), passenger cars, less 6 dB for a tire."
    ]
    return Table(
        "Tires beside CNOSSOS-EU", columns, sorted(rows, key=lambda row: -ord(row[0][0])), notes
    )


def _powers(out: Path, speed: float, less: float) -> tuple[np.ndarray, float]:
    scene = ROOT / "runs" / "scenes" / "noise.toml"
    change = [
        f"rotation.speed={71.9 * speed / 80:.4g}",
        f"road.levels={[level - less for level in LEVELS]}",
        "road.skewness=-1.0",
        "accuracy.estimate=false",
        'sound.microphones=["cpx"]',
    ]
    command = [str(ROOT / "tireroad"), "run", str(scene), "--out", str(out), "-n", "2"]
    began = time.perf_counter()
    done = subprocess.run(
        [*command, *(part for one in change for part in ("--set", one))],
        env={**os.environ, "OMP_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
    )
    seconds = time.perf_counter() - began
    if done.returncode:
        raise RuntimeError(done.stdout[-2000:] + done.stderr[-2000:])
    stages = json.loads((out / "summary.json").read_text())["stages"]
    assert stages["sound"]["status"] == "computed"
    with h5py.File(out / "sound.h5") as file:
        centre, power = file["third_octave/centre"][:], 10 ** (file["power"][:] / 10)
    ends = OCTAVES[:, None] * [10**-0.15, 10**0.15]
    return np.array(
        [10 * np.log10(power[(centre > a) & (centre < b)].sum()) for a, b in ends]
    ), seconds
