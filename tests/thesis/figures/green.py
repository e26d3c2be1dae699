"""Figures 4.2, 4.3, 4.5: Green's functions of the tire at rest and rolling."""

from __future__ import annotations

from typing import Any

import numpy as np

from tireroad.greens.response import Response
from tireroad.tests.thesis.claim import Claim
from tireroad.tests.thesis.figure import Reproduced, figure
from tireroad.tests.thesis.plots import Curve, Panel, lines
from tireroad.tests.thesis.runner import Scenes

SCENE = "figure-4.2"
LONGEST, HIGHEST = 0.2, 40e3  # s and Hz of the inverse Fourier transform
SHOWN = 0.02  # s
FULL = "full inertia", "rotation.inertia=full"
DOPPLER = "the thesis's inertia", "rotation.inertia=doppler"
# Figure 4.5: 50 modes, gamma1 = 100 1/s.
MODES, DAMPING, SPEED = 50, 100.0, 100.0


def by_fourier(response: Response) -> tuple[np.ndarray, np.ndarray]:
    """Times (n,) s and Green's functions (n, r, k) by inverse Fourier transform of H, (4.16)."""
    frequency = np.arange(round(LONGEST * HIGHEST / 2) + 1) / LONGEST
    values = np.fft.irfft(response.receptance(frequency), axis=0) * HIGHEST
    return np.arange(len(values)) / HIGHEST, values


def along(response: Response) -> Response:
    """The vertical displacements of both points under the vertical force on the first."""
    return response.between(slice(2, None, 3), slice(0, 1))


def _two_ways(
    scenes: Scenes, *settings: str
) -> tuple[np.ndarray, np.ndarray, np.ndarray, Response]:
    """Times, g (n, 2) by eigenpairs and by the inverse transform, and the response. Collective."""
    run = scenes.run(SCENE, *settings, until="greens")
    response = along(run.greens.force)
    times, fourier = by_fourier(response)
    few = times <= SHOWN
    return times[few], response.impulse(times[few])[:, :, 0], fourier[few][:, :, 0], response


def _agreement(g: np.ndarray, fourier: np.ndarray, what: str, source: str) -> Claim:
    off = np.abs(g - fourier).max() / np.abs(g).max()
    return Claim(
        what=f"distance of eigenpairs (4.14) from the inverse Fourier transform (4.16), over the largest value, {what}",
        unit="-", thesis=0.0, source=source, found=float(off), tolerance=0.01,
    )  # fmt: skip


def _at_once(g: np.ndarray) -> Claim:
    return Claim(what="|g(0)| over the largest value: by (3.11) and (5.3) it answers the present force", unit="-", thesis=0.0,
                 source="(3.11), (5.3): g(0) Δt", relation="above", tolerance=1e-9, found=float(np.abs(g[0]).max() / np.abs(g).max()),
                 because="g(0) = 0: the sum over all eigenpairs u wᵀ/a vanishes; here the force is taken linear over the step",
                 right=0.0, by="Σ u wᵀ/a = 0")  # fmt: skip


def _decay(response: Response, what: str, source: str, because: str = "") -> Claim:
    rate = float(-response.every.real.mean())
    return Claim(what=f"mean decay rate of the states, {what}", unit="1/s", thesis=250.0, source=source, found=rate,
                 tolerance=1e-6, because=because, right=250.0, by="γ1/2")  # fmt: skip


def _panel(title: str, times: np.ndarray, g: np.ndarray, fourier: np.ndarray) -> Panel:
    names = "actuated node, j = i", "neighbour, j ≠ i"
    curves = {f"{name}, (4.14)": Curve(times, g[:, k], k) for k, name in enumerate(names)}
    curves |= {
        f"{name}, (4.16)": Curve(times, fourier[:, k], k + 2, ":") for k, name in enumerate(names)
    }
    return Panel(title=title, x="time in s", y="g in m/(N s)", curves=curves)


@figure(
    "figure-4.2",
    "Green's functions of the standing tire, 10 modes",
    "By eigenpairs (4.14) and by the inverse Fourier transform of the frequency response (4.16), γ1 = 500 1/s, the "
    "Green's functions of the actuated node and of its neighbour agree.",
)
def standing(scenes: Scenes) -> Reproduced:
    """Ω = 0."""
    times, g, fourier, response = _two_ways(scenes)
    source = "section 4.2, figure 4.2"
    return Reproduced(
        shows=f"They do; the largest value is {g.max():.3g} m/(N s), {g[:, 1].max() / g[:, 0].max():.3f} of it at the neighbour.",
        claims=(
            _agreement(g, fourier, "Ω = 0", source),
            _decay(response, "Ω = 0", "caption of figure 4.2, γ1 = 500"),
            _at_once(g),
        ),
        picture=lambda: lines([_panel("Ω = 0", times, g, fourier)], 1),
        caption="Both ways lie on each other.",
    )


@figure(
    "figure-4.3",
    "Green's functions of the rolling tire, 10 modes",
    "The same at 100 rad/s: the two ways agree.",
)
def rolling(scenes: Scenes) -> Reproduced:
    """Ω = 100 rad/s with both kinds of inertia."""
    panels, claims = [], []
    for name, setting in (DOPPLER, FULL):
        times, g, fourier, response = _two_ways(scenes, "rotation.speed=100", setting)
        panels.append(_panel(f"Ω = 100 rad/s, {name}", times, g, fourier))
        claims += [
            _agreement(g, fourier, name, "section 4.2, figure 4.3"),
            _decay(response, name, "caption of figure 4.3, γ1 = 500"),
        ]
    shares = ", ".join(f"{panel.curves['actuated node, j = i, (4.14)'].y.max():.3g} m/(N s) by {name}"
                       for panel, (name, _) in zip(panels, (DOPPLER, FULL), strict=True))  # fmt: skip
    return Reproduced(
        shows=f"They do, by either inertia; the largest values are {shares}.",
        claims=tuple(claims),
        picture=lambda: lines(panels),
        caption="Left with the thesis's inertia, right with Coriolis and centrifugal forces.",
    )


@figure(
    "figure-4.5",
    "Green's function and admittance at 0 and 100 rad/s, 50 modes",
    "Rotation shifts the frequencies and lowers the amplitude; the thesis lays the latter to damping by rotation.",
)
def admittance(scenes: Scenes) -> Reproduced:
    """γ1 = 100 1/s."""
    frequency, times = np.arange(0.0, 500.5, 0.5), np.linspace(0, 0.05, 1001)
    more = f"modal.count={MODES}", f"damping.mass={DAMPING:g}"
    cases = (("Ω = 0", ()), *((f"Ω = 100, {name}", (f"rotation.speed={SPEED:g}", setting)) for name, setting in (DOPPLER, FULL)))  # fmt: skip
    responses = {name: along(scenes.run(SCENE, *more, *settings, until="greens").greens.force) for name, settings in cases}  # fmt: skip
    g = {name: one.impulse(times)[:, 0, 0] for name, one in responses.items()}
    mobility = {name: np.abs(2j * np.pi * frequency * one.receptance(frequency)[:, 0, 0]) for name, one in responses.items()}  # fmt: skip
    rest, doppler, full = mobility.values()
    panels = [
        Panel(title="admittance", x="frequency in Hz", y="|v/F| in m/(N s)",
              curves={name: Curve(frequency, y, k) for k, (name, y) in enumerate(mobility.items())}),
        Panel(title="Green's function", x="time in s", y="g in m/(N s)",
              curves={name: Curve(times, y, k) for k, (name, y) in enumerate(g.items())}),
    ]  # fmt: skip
    rates = [float(-one.every.real.mean()) for one in responses.values()]
    return Reproduced(
        shows=f"The highest peak falls to {doppler.max() / rest.max():.2f} of that at rest ({full.max() / rest.max():.2f} with full inertia) "
        f"while the mean decay rate stays at {rates[1]:.4g} 1/s: a pair that splits shares its peak.",
        claims=_admittance_claims(doppler.max() / rest.max(), full.max() / rest.max(), rates),
        picture=lambda: lines(panels),
        caption="Driven at the lowest node and read there.",
    )


def _admittance_claims(doppler: float, full: float, rates: list[float]) -> tuple[Claim, ...]:
    known: dict[str, Any] = {
        "unit": "-",
        "thesis": 1.0,
        "source": "section 4.3, figure 4.5",
        "relation": "below",
    }
    skew = "rotation adds no damping: what it adds to the damping matrix, 2ΩP, is skew (Φᵀ G Φ)"
    damping: dict[str, Any] = {"unit": "1/s", "thesis": DAMPING / 2, "relation": "above", "tolerance": 1e-6, "because": skew,
               "source": "section 4.3: \"the increase of damping due to rotation\"", "right": DAMPING / 2,
               "by": "γ1/2, the trace of the damping matrix"}  # fmt: skip
    return (
        Claim(
            what="highest admittance at 100 rad/s over that at rest, the thesis's inertia",
            found=doppler,
            **known,
        ),
        Claim(
            what="highest admittance at 100 rad/s over that at rest, full inertia",
            found=full,
            **known,
        ),
        Claim(what="mean decay rate at 100 rad/s, the thesis's inertia", found=rates[1], **damping),
        Claim(what="mean decay rate at 100 rad/s, full inertia", found=rates[2], **damping),
    )
