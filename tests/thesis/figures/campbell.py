"""Figure 4.4: eigenfrequencies over the speed of rotation."""

from __future__ import annotations

import numpy as np

from tireroad.tests.thesis.claim import Claim
from tireroad.tests.thesis.figure import Reproduced, figure
from tireroad.tests.thesis.figures.green import DOPPLER, FULL, SCENE
from tireroad.tests.thesis.plots import Curve, Panel, lines
from tireroad.tests.thesis.runner import Scenes, kept

BRANCHES, HIGHEST = 10, 100.0  # as in the thesis's figure; rad/s
SETTINGS = (
    "modal.count=50",
    "damping.mass=0.001",  # 1/s, table B.1
    f"rotation.speed={HIGHEST:g}",
    f"rotation.campbell={{ to = {HIGHEST:g}, step = 10.0, branches = {BRANCHES} }}",
)
LEFT_OUT = "the thesis leaves Coriolis and centrifugal forces out: with them the waves that move in the wheel's plane split less"  # fmt: skip


def off_lines(frequency: np.ndarray, wave: np.ndarray) -> np.ndarray:
    """Distance (b,) Hz of branches (v, b), wave numbers (b,), from the nearer line f ± n Ω/2π."""
    shift = np.abs(frequency[-1] - frequency[0])
    return np.abs(shift - wave * HIGHEST / (2 * np.pi))


@figure(
    "figure-4.4",
    "Eigenfrequencies of the first ten modes over speed",
    "Pairs of n waves around the tire, equal at rest, shift by ± n Ω/2π.",
)
def campbell(scenes: Scenes) -> Reproduced:
    """With both kinds of inertia."""
    panels, claims, worst = [], [], []
    for name, setting in (DOPPLER, FULL):
        run = scenes.run(SCENE, *SETTINGS, setting, until="rotating")
        wave = kept(run, "modes", lambda file: file["wave_number"][:BRANCHES])
        speed, frequency = kept(
            run, "rotating", lambda file: (file["campbell/speed"][:], file["campbell/frequency"][:])
        )
        off = off_lines(frequency, wave)
        worst.append(off.max())
        panels.append(_panel(name, speed, frequency, wave))
        claims.append(
            Claim(
                what=f"largest distance of a frequency at {HIGHEST:g} rad/s from f ± n Ω/2π, {name}",
                unit="Hz",
                thesis=0.0,
                source="section 4.3, figure 4.4",
                found=float(off.max()),
                tolerance=0.1,
                because=LEFT_OUT,
            )
        )
    return Reproduced(
        shows=f"By the thesis's inertia to {worst[0]:.2g} Hz; with Coriolis and centrifugal forces some modes are {worst[1]:.3g} Hz off those lines.",
        claims=tuple(claims),
        picture=lambda: lines(panels),
        caption="Dotted: f ± n Ω/2π.",
    )


def _panel(title: str, speed: np.ndarray, frequency: np.ndarray, wave: np.ndarray) -> Panel:
    names = dict.fromkeys(int(n) for n in wave)
    curves = {}
    for k, n in enumerate(wave):
        label = f"n = {n}" if names.pop(int(n), 0) is None else f"_{k}"
        curves[label] = Curve(speed, frequency[:, k], int(n), marker=".")
        for sign in (-1, 1):
            line = frequency[0, k] + sign * n * speed / (2 * np.pi)
            curves[f"_{k}{sign}"] = Curve(speed, line, int(n), ":")
    return Panel(title=title, x="speed in rad/s", y="frequency in Hz", curves=curves)
