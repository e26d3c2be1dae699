"""Modes with the moduli and losses of a run against full finite elements in time whose rubber relaxes, rolling.

Both have the same Prony series. A run takes from them moduli and viscous losses of each mode at its own frequency, what couples
modes by them, and states of slow rubber; the elements have them as they are (fem.transient.Relaxation). What is between
the two is told part by part: with internal variables on the same modes, an exact law on a truncated basis,

    q'' + 2 Omega G q' + (Lambda + sum_c (e_c - 1) P_c + Omega^2 S) q - sum_k P_k z_k = Phi^T f,    z_k' = (q - z_k) / t_k - Omega B z_k,

P_c = Phi^T K_c Phi, P_k = sum_c g_ck P_c, what is off is their number alone; and so it is of a tire of one modulus with Rayleigh damping.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI
from scipy import sparse

from tireroad.contact.results.spectra import distance
from tireroad.contact.rolling import rolling_steadily
from tireroad.fem.collective import collect
from tireroad.fem.sections.inflated import InflatedRing
from tireroad.fem.sections.radial import radial
from tireroad.fem.tire.material import REFERENCE, Kind
from tireroad.fem.transient import FullTire
from tireroad.fem.wheel import StrainEnergy, Turning
from tireroad.greens.basis import Basis, Probes
from tireroad.greens.recursion import Recursion
from tireroad.greens.response import Response
from tireroad.greens.responses import make_response
from tireroad.modal.basis import Projection
from tireroad.modal.rolling import RollingModes, rolling_modes
from tireroad.modal.rotating import held_matrices
from tireroad.runs import library
from tireroad.runs.process import console
from tireroad.runs.scene.load import load
from tireroad.runs.scene.physics import compounds, make_tire, turning_of
from tireroad.runs.validation.full_elements import Conditions, FullHistory, digits, follow, percent
from tireroad.runs.validation.tables import Table
from tireroad.tests.validation.comparison import Tires
from tireroad.tests.validation.mobility import HALF, PRESSURE, SIZE, Bench, level

ABOUT = "modes of rubber that relaxes by a Prony series, rolling, against full finite elements in time with the same series"

SCENE = """
name = "validate"
[tire]
section = "radial"
size = "205/60 R15"
segments = {segments}
elements_arc = {along}
footprint_size = 1.0
{rubber}
[tire.cavity]
gas = "none"                 # full elements with air begin without horizontal forces
[static]
inflation = 2.2e5
load = 4000.0
error_estimate = false
[modal]
up_to = {up_to}
[rotation]
speed = {speed}
[contact]
points = {{ dx = 0.01, dy = 0.01 }}
friction = {friction}
[road]
{road}
[time]
duration = {duration}
step = {step}
"""
# Loss factors of 0.30 (tread), 0.20 and 0.05 within 5 % from 20 to 500 Hz.
_TIMES = "prony_times = [2e-2, 4e-3, 8e-4, 1.6e-4]\n"
_SERIES = {
    "": "[0.11, 0.12, 0.12, 0.26]",
    "tread": "[0.11, 0.13, 0.14, 0.37]",
    "bead": "[0.054, 0.044, 0.043, 0.07]",
}
RUBBER = "".join(
    "[[tire.region]]\n"
    + (f'name = "{name}"\n' if name else "")
    + f"prony_shares = {shares}\n{_TIMES}"
    for name, shares in _SERIES.items()
)
# The same moduli at 100 Hz at all frequencies.
ONE_MODULUS = """
[[tire.region]]
dynamic = 1.6
exponent = 0.0
[[tire.region]]
name = "tread"
dynamic = 2.0
exponent = 0.0
[[tire.region]]
name = "bead"
dynamic = 1.13
exponent = 0.0
[damping]
mass = 100.0
"""
ROADS = {
    "flat": 'kind = "flat"',
    "sine of 0.5 mm": 'kind = "sine"\namplitude = 5e-4\nwavelength = {length}',
    "cleat of 3 mm": 'kind = "cleat"\nheight = 3e-3\nlength = 0.03\nramp = 0.01\nposition = {place}',
}
SEGMENTS, ALONG, UP_TO = (
    20,
    8,
    560.0,
)  # equal elements around and from bead to bead; Hz, of the modes
# Roads and coefficients of friction by speed, rad/s.
CASES = {
    72.0: (("sine of 0.5 mm", 0.0), ("sine of 0.5 mm", 1.0), ("cleat of 3 mm", 0.0)),
    20.0: (("sine of 0.5 mm", 0.0), ("cleat of 3 mm", 0.0)),
}
STEP, DURATION = 1e-4, 0.06  # s, of the loops
# The wave passes 80 times a second, and the cleat enters the footprint a quarter into the loop, at both speeds.
WAVES, ENTERS, RADIUS, REACH = 80.0, 0.25, 0.309, 0.09  # Hz, -, m, m
PULSE, PULSE_STEP, PULSE_LAST = 4e-3, 2e-4, 0.2  # s
FREQUENCY = np.array([31.5, 40, 50, 63, 80, 100, 125, 160, 200])  # Hz
ANGLES = np.radians([0.0, 90.0, -90.0])  # positive: ahead of the axle, if the patch is under it
FORCES, AXES = ("contact force", "axle force"), {"along the road": 0, "vertical": 2}
LAWS = ("the run", "without slow rubber", "each mode alone", "internal variables on its modes")
Array = np.ndarray


def run() -> list[Table]:
    """Mobility and forces. Serial."""
    with tempfile.TemporaryDirectory() as folder:
        return [*_mobilities(Path(folder)), _forces(Path(folder))]


def scene(rubber: str, speed: float, road: str = "flat", friction: float = 0.0) -> str:
    """The scene of a tire on a road, rolling at a speed, rad/s."""
    travel = RADIUS * speed
    place = REACH + ENTERS * DURATION * travel
    return SCENE.format(
        segments=SEGMENTS,
        along=ALONG,
        rubber=rubber,
        up_to=UP_TO,
        speed=speed,
        friction=friction,
        road=ROADS[road].format(length=travel / WAVES, place=place),
        duration=DURATION,
        step=STEP,
    )


def _mobilities(folder: Path) -> list[Table]:
    """Of the inflated tire without a road at each speed: elements in time against Fourier series around, modes against both."""
    file = folder / "inflated.toml"
    file.write_text(scene(RUBBER, max(CASES)))
    tire = load(file).tire
    rubbers: dict[str, Any] = {
        name: {
            "youngs_modulus": one.law.youngs,
            "poisson_ratio": one.law.poisson,
            "density": one.density,
            "dynamic": one.dynamic,
            "loss_factor": one.loss_factor,
            "spectrum": one.spectrum,
        }
        for name, one in compounds(tire, REFERENCE).items()
    }
    ring = InflatedRing(replace(radial(SIZE), compounds=rubbers), ALONG, 2, PRESSURE)
    bench = Bench(ring, make_tire(MPI.COMM_SELF, tire))
    probes = sparse.csr_matrix([bench.patch(0.0, angle, HALF) for angle in ANGLES])
    return [_mobility(ring, bench, probes, speed) for speed in CASES]


def _mobility(ring: InflatedRing, bench: Bench, probes: sparse.csr_matrix, speed: float) -> Table:
    exact = level(
        ring.receptance(ring.patch(0.0, HALF[0]), HALF[1], FREQUENCY, ANGLES, 40, -speed), FREQUENCY
    )
    turning = Turning(speed=speed, damping=StrainEnergy())
    standing = library.modes(bench.tire, bench.static, up_to=UP_TO, turning=turning)
    rolling = library.roll(standing, turning)
    modes = level(
        rolling.respond(probes, probes[:1], "attachment").receptance(FREQUENCY)[:, :, 0], FREQUENCY
    )
    elements = level(by_pulse(rolling, probes), FREQUENCY)
    rows = [
        [float(f), *(round(float(value), 2) for value in np.concatenate(of))]
        for f, *of in zip(FREQUENCY, exact, elements - exact, modes - elements, strict=True)
    ]
    columns = [("frequency", "Hz")]
    for name, unit in (
        ("", "dB"),
        ("elements in time, ", "dB more"),
        ("modes, ", "dB more than these"),
    ):
        columns += [(f"{name}{np.degrees(angle):.0f}\u00b0", unit) for angle in ANGLES]
    off = np.abs(modes - elements)
    return Table(
        f"Mobility of the crown at {speed:g} rad/s, {SIZE}, {PRESSURE / 1e3:.0f} kPa, rim held, no road, {SEGMENTS} x {ALONG} elements",
        columns,
        rows,
        [
            "dB re 1 m/(N s), radial, of a patch at rest in space: complex moduli of each wave by Fourier series around; full finite "
            f"elements in time under a pulse of {1e3 * PULSE:g} ms, whose rubber relaxes; rotating modes to {UP_TO:g} Hz with "
            "attachment modes, whose moduli and losses are those of their frequencies",
            f"Modes are at most {off[:, 0].max():.2f} dB off the elements at the patch, {off[:, 1:].max():.2f} dB a quarter turn away",
        ],
    )


def by_pulse(
    rolling: library.RollingTire, probes: sparse.csr_matrix, step: float = PULSE_STEP
) -> Array:
    """H (f, a) m/N of full finite elements whose rubber relaxes, in steps of `step` s from a pulse on the first of the probes."""
    wheel = rolling.wheel
    tire = FullTire(
        operators=wheel.operators,
        rotation=wheel.rotation,
        speed=wheel.speed,
        damping=(0.0, 0.0),
        step=step,
        outputs=probes,
        loads=probes[:1],
        spectral_radius=1.0,
        relaxes=True,
    )
    time = step * np.arange(1, round(PULSE_LAST / step) + 1)
    force = np.where(time < PULSE, np.sin(np.pi * time / PULSE) ** 4, 0.0)
    moved = np.empty((len(time), probes.shape[0]))
    for row, value in zip(moved, force[:, None], strict=True):
        row[:] = tire.predict() + tire.same_step @ value
        tire.advance(value)
    turned = np.exp(-2j * np.pi * np.outer(FREQUENCY, time))
    return (turned @ moved) / (turned @ force)[:, None]


def _forces(folder: Path) -> Table:
    """Of every loop what the forces vary by, and how far modes are off the elements, by each law of rubber."""
    rows = []
    for speed, cases in CASES.items():
        tires = {
            rubber: Tires(scene(rubber, speed), _made(folder / f"{speed:g} {number}"))
            for number, rubber in enumerate((RUBBER, ONE_MODULUS))
        }
        for road, friction in cases:
            at = speed, road, friction
            console.say(f"{speed:g} rad/s, {road}, friction {friction:g}")
            exact, *others = _histories(tires[RUBBER], scene(RUBBER, *at), (STEP, 2 * STEP))
            pairs = [(exact, other) for other in others]
            right, modes = _histories(tires[ONE_MODULUS], scene(ONE_MODULUS, *at), (STEP,))
            pairs.append((right, modes))
            for name, (along, axis) in product(FORCES, AXES.items()):
                varies = digits(float(exact.values[name][:, axis].std()))
                off = [percent(_distance(*pair, name, axis)) for pair in pairs]
                rows.append([speed, road, friction, f"{name}, {along}", varies, *off])
            collect(MPI.COMM_SELF)
        del tires
        collect(MPI.COMM_SELF)
    columns = [
        ("speed", "rad/s"),
        ("road", ""),
        ("friction", "-"),
        ("force", ""),
        ("standard deviation", "N"),
    ]
    columns += [(name, "%") for name in ("full FE at twice the step", *LAWS, "one modulus")]
    return Table(
        f"Forces, {SIZE}, {SEGMENTS} x {ALONG} elements, modes to {UP_TO:g} Hz, steps of {1e3 * STEP:g} ms",
        columns,
        rows,
        [
            "Relative L2 norms of what varies, in the band of the other validations, against full finite elements in time in the same steps, "
            "on the same points. Those have the Prony series of the compounds, as all columns but the last.",
            "The run: moduli and viscous losses of each mode at its own frequency, coupled, with slow rubber; then without the latter; each "
            "mode alone; the Prony series as internal variables on the same modes. One modulus: modes and elements that have it at all frequencies, "
            "with Rayleigh damping: truncation and step alone.",
        ],
    )


def _made(folder: Path) -> Path:
    folder.mkdir()
    return folder


def _distance(exact: FullHistory, found: FullHistory, name: str, axis: int) -> float:
    right, other = (one.values[name][:, axis : axis + 1] for one in (exact, found))
    return distance(right, other, exact.step * len(right)).mean


def _histories(tires: Tires, text: str, steps: Sequence[float]) -> list[FullHistory]:
    """Full finite elements in each of the steps (s), and modes by each law.

    With friction all begin in steady rolling: the elements, and internal variables, in that of the latter, whose flexibility at rest
    in space is the nearest to theirs; other laws in that of the run.
    """
    tires.change(text)
    spec, settled = tires.job.scene.contact, tires.trial.setup
    responses, begun = laws(tires), {}

    def trial(response: Response, step: float) -> Conditions:
        if (id(response), step) not in begun:
            rolls = rolling_steadily(spec, settled, response, step)
            begun[id(response), step] = replace(tires.trial, setup=rolls)
        return begun[id(response), step]

    out = [follow(trial(responses[-1], step), *tires.full(step)) for step in steps]
    for response in responses:
        resolved = response.resolved(STEP)
        tire = Recursion(response=resolved, step=STEP, scheme="linear", comm=MPI.COMM_SELF)
        own = response if response is responses[-1] else responses[0]
        out.append(follow(trial(own, STEP), tire, STEP, 0.0))
    return out


def laws(tires: Tires) -> list[Response]:
    """Responses by the laws of LAWS, in their order; of rubber with one modulus the first."""
    turning, basis = turning_of(tires.job.scene, tires.job.speed), tires.modes
    projection, face = basis.projection, tires.probes.on_face

    def made(own: Projection) -> tuple[Response, RollingModes]:
        changed = replace(basis, projection=own)
        rolling = rolling_modes(changed, turning, MPI.COMM_SELF)
        arguments = face.outputs, face.loads, "static", lambda: changed
        return make_response(lambda: tires.wheel, rolling, *arguments).response, rolling

    run, rolling = made(projection)
    if projection.parts is None:
        return [run]
    assert projection.rise is not None and projection.losses is not None, "rubber that relaxes"
    rise, losses = (np.diag(np.diag(one)) for one in (projection.rise, projection.losses))
    alone, _ = made(replace(projection, rise=rise, losses=losses))
    kinds = [kind for kind, _ in tires.motions.body.wall.kinds()]
    return [run, run.without_slow(), alone, relaxing(run, rolling, kinds, face.outputs, face.loads)]


def relaxing(
    run: Response, rolling: RollingModes, kinds: Sequence[Kind], outputs: Probes, loads: Probes
) -> Response:
    """The response of the same modes with the Prony series of the `kinds` as internal variables, all else that of the `run`."""
    basis, turning = Basis.of(rolling), rolling.turning
    projection = rolling.basis.projection
    parts, series = projection.parts, [kind.spectrum.relaxing() for kind in kinds]
    assert parts is not None and projection.body is not None, (
        "a rolling tire of rubber that relaxes"
    )
    rise = sum((instant - 1) * part for (instant, _), part in zip(series, parts, strict=True))
    elastic = replace(projection, rise=rise, losses=np.zeros_like(rise))
    drag, stiffness = held_matrices(elastic, turning.speed, turning.damping, turning.inertia)
    times = sorted({time for _, shares in series for time in shares})
    n, m = len(drag), projection.own
    matrix = np.zeros((2 * n + m * len(times),) * 2)
    coordinates, rates = slice(n), slice(n, 2 * n)
    matrix[coordinates, rates] = np.eye(n)
    matrix[rates, coordinates], matrix[rates, rates] = -stiffness, -drag
    for k, time in enumerate(times):
        own = slice(2 * n + k * m, 2 * n + (k + 1) * m)
        held = sum(
            shares.get(time, 0.0) * part for (_, shares), part in zip(series, parts, strict=True)
        )
        matrix[n : n + m, own], matrix[own, :m] = held, np.eye(m) / time
        matrix[own, own] = -np.eye(m) / time - turning.speed * projection.body
    values, right = np.linalg.eig(matrix)
    left = np.linalg.inv(right)[:, rates]
    upper = values.imag >= 0
    right = (right[coordinates] * np.where(values.imag > 0, 2.0, 1.0))[:, upper]
    none = np.zeros((0, 0))
    return replace(
        run.without_slow(),
        eigenvalue=values[upper],
        output=basis.seen(outputs) @ right,
        input=left[upper] @ basis.seen(loads).T,
        momentum=basis.carried @ right,
        block=none,
        block_output=np.zeros((outputs.shape[0], 0)),
        block_input=np.zeros((0, loads.shape[0])),
        block_momentum=np.zeros((len(run.momentum), 0)),
        rigid=0,
    )
