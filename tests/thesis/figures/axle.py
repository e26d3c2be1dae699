"""Figure 7.4: the vertical axle force under a point force on the tread."""

from __future__ import annotations

import numpy as np

from tireroad.runs.stages.outputs.transmissibility import FREE_RIM, FREQUENCY, MOMENTUM, apart
from tireroad.tests.thesis.claim import Claim
from tireroad.tests.thesis.figure import Reproduced, figure
from tireroad.tests.thesis.figures.simplified import Array
from tireroad.tests.thesis.plots import Curve, Panel, lines
from tireroad.tests.thesis.runner import Scenes, kept

SCENE = "figure-7.4"
SPEED = 125.0  # rad/s
# A section found by trial with the thesis's two frequencies in its order of modes (figure 2.2 gives
# no numbers).
FITTED = "tire.outer_radius=0.34", "tire.minor_radius=0.12", "tire.half_angle=136", "modal.count=12"
PEAKS = 90.0, 188.0  # Hz, tire at rest, section 7.2
SOURCE = "section 7.2, figure 7.4"
VERTICAL = 2


def peaks(frequency: Array, size: Array) -> Array:
    """Frequencies (Hz) of the local maxima of a curve."""
    inside = (size[1:-1] > size[:-2]) & (size[1:-1] > size[2:])
    return frequency[1:-1][inside]


def _curves(scenes: Scenes, *settings: str) -> tuple[Array, Array, Array, Array]:
    """Frequencies (f,) Hz; vertical axle force per N (f,), two ways; natural frequencies.

    The force is by momentum and by the free rim, the frequencies with held rim. Collective.
    """
    run = scenes.run(SCENE, *settings, until="response")
    names = FREQUENCY, MOMENTUM, FREE_RIM
    frequency, *found = kept(run, "response", lambda file: [file[name][:] for name in names])
    natural = kept(run, "modes", lambda file: file["frequency"][:])
    return frequency, *(one[:, VERTICAL, 0] for one in found), natural


def _rolling(inertia: str) -> tuple[str, str]:
    return f"rotation.speed={SPEED:g}", f"rotation.inertia={inertia}"


@figure(
    "figure-7.4",
    "Vertical axle force under 1 N at the lowest node, at 0 and 125 rad/s",
    "Peaks at 90 and 188 Hz, the frequencies of the 2nd and 3rd and of the 5th and 6th mode of the tire whose rim is held; rotation "
    "splits and shifts them.",
)
def axle_force(scenes: Scenes) -> Reproduced:
    """By the free rim as in the thesis, corrected, and by momentum."""
    frequency, momentum, free, natural = _curves(scenes)
    fitted = kept(
        scenes.run(SCENE, *FITTED, until="modes"), "modes", lambda file: file["frequency"][:]
    )
    _, _, doppler, _ = _curves(scenes, *_rolling("doppler"))
    _, full_momentum, full, _ = _curves(scenes, *_rolling("full"))
    damped = {0.0: _curves(scenes, "damping.mass=50"), SPEED: _curves(scenes, *_rolling("full"), "damping.mass=50")}  # fmt: skip
    off = {speed: apart(one[2][frequency <= 300], one[1][frequency <= 300]) for speed, one in damped.items()}  # fmt: skip
    highest = peaks(frequency, np.abs(free))
    split = peaks(frequency, np.abs(doppler))
    rest = {"free rim": Curve(frequency, np.abs(free)), "momentum": Curve(frequency, np.abs(momentum), 1, "--")}  # fmt: skip
    turns = {"free rim, full inertia": Curve(frequency, np.abs(full)), "momentum, full inertia": Curve(frequency, np.abs(full_momentum), 1, "--"),
             "free rim, the thesis's inertia": Curve(frequency, np.abs(doppler), 2, ":")}  # fmt: skip
    return Reproduced(
        shows=f"Standing, a peak at {_listed(highest)} Hz; at {SPEED:g} rad/s at {_listed(split)} Hz by the thesis's inertia and {_listed(peaks(frequency, np.abs(full)))} Hz "
        f"by full inertia. Free rim and momentum are {100 * off[0.0]:.2g} % apart standing and {100 * off[SPEED]:.2g} % rolling, up to 300 Hz (γ1 = 50 1/s).",
        claims=(*_of_modes(natural, fitted), *_claims(natural, highest, split, off)),
        picture=lambda: lines([Panel(title=title, x="frequency in Hz", y="|axle force| in N per N", scales=("linear", "log"), curves=curves)
                               for title, curves in (("Ω = 0", rest), (f"Ω = {SPEED:g} rad/s", turns))]),
        caption="On the axisymmetric tire only waves of n = 1 pass a net force on to the axle: other modes leave no peak.",
    )  # fmt: skip


def _listed(values: Array) -> str:
    return " and ".join(f"{value:.0f}" for value in values) or "no"


def _of_modes(natural: Array, fitted: Array) -> tuple[Claim, ...]:
    """The frequencies named in the thesis, for the torus here and for a section that fits them."""
    because = (
        f"the section's size stands in figure 2.2, a picture; one of 120 mm radius and 136° on an outer radius of 340 mm has "
        f"{fitted[1]:.1f} and {fitted[4]:.1f} Hz"
    )
    section = {"": natural, " (a section that fits, found by trial)": fitted}
    return tuple(
        Claim(
            what=f"{name} mode, rim held{which}",
            unit="Hz",
            thesis=peak,
            source=SOURCE,
            found=float(frequency[number]),
            tolerance=0.02,
            because=because,
        )
        for which, frequency in section.items()
        for name, number, peak in (("2nd and 3rd", 1, PEAKS[0]), ("5th and 6th", 4, PEAKS[1]))
    )


def _claims(natural: Array, highest: Array, split: Array, off: dict[float, float]) -> tuple[Claim, ...]:  # fmt: skip
    """Claims on the peaks, their shift, and the two methods."""
    nearest = np.abs(natural[:, None] - highest).min(axis=0).max(initial=0.0) if len(highest) else np.nan  # fmt: skip
    shift = np.abs(np.abs(split - highest[0]) - SPEED / (2 * np.pi)).max(initial=0.0) if len(split) else np.nan  # fmt: skip
    two = "distance of the free rim (7.4), put right, from the momentum form up to 300 Hz"
    return (
        Claim(what="largest distance of a peak from a frequency of the tire whose rim is held", unit="Hz", thesis=0.0, source=SOURCE, found=float(nearest), tolerance=1.0),
        Claim(what="largest distance of the shift from Ω/2π, n = 1, the thesis's inertia", unit="Hz", thesis=0.0, source="section 7.2", found=float(shift), tolerance=1.0),
        Claim(what=f"{two}, standing", unit="-", thesis=0.0, source="(7.4)", found=off[0.0], tolerance=0.02),
        Claim(what=f"{two}, {SPEED:g} rad/s, full inertia", unit="-", thesis=0.0, source="(7.4)", found=off[SPEED], tolerance=0.02),
    )  # fmt: skip
