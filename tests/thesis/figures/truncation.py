"""Figures 6.2, 6.3 and C.1: mode truncation error, and residual flexibility in place of modes."""

from __future__ import annotations

import numpy as np

from tireroad.tests.thesis.claim import Claim
from tireroad.tests.thesis.figure import Reproduced, figure
from tireroad.tests.thesis.figures.simplified import Simplified, amplitude, sine
from tireroad.tests.thesis.plots import Curve, Panel, lines
from tireroad.tests.thesis.runner import Scenes

FEW, MANY, ALL = 10, 100, 1000  # modes
STEP = 2e-4  # s
TINY = 1e-6  # relative to a compliance: rounding
OTHER_TIRE = "the size of the section stands in figure 2.2, a picture, and the mesh is another: this torus is stiffer"  # fmt: skip
FULL_FE = "all unknowns of the same mesh"


@figure(
    "figure-6.2",
    "Receptance of the simplified tire with and without residual flexibility",
    "With 10 of 100 modes the curve shifts: the structure is stiffer. With the residual flexibility of the 90 others it "
    "lies on that of 100 modes.",
)
def receptance(scenes: Scenes) -> Reproduced:
    """With low damping, to show the peaks."""
    tire, frequency = Simplified(scenes, 50.0), np.arange(0.0, 301.0, 1.0)
    responses = {f"{MANY} modes": tire.response(MANY), f"{FEW} modes": tire.response(FEW),
                 f"{FEW} modes and residual": tire.kept(MANY, FEW)}  # fmt: skip
    found = {name: one.receptance(frequency)[:, 0, 0] for name, one in responses.items()}
    many, few, helped = found.values()
    direct = np.linspace(0.0, 300.0, 13)
    curves = {name: Curve(frequency, np.abs(H), k, "-:-"[k] if k < 2 else "--") for k, (name, H) in enumerate(found.items())}  # fmt: skip
    curves |= {FULL_FE: Curve(direct, np.abs(tire.full(direct)), 3, "", "o")}
    band = frequency <= tire.frequency[FEW - 1] / 2
    off = np.abs(helped - many)[band].max() / np.abs(many[band]).max()
    whole = float(many[0].real) / tire.compliance
    return Reproduced(
        shows=f"{FEW} modes have {few[0].real / many[0].real:.3f} of the compliance of {MANY}; with the residual they have all of it. "
        f"{MANY} modes have {whole:.3f} of that of {FULL_FE}.",
        claims=_receptance_claims(few[0].real / many[0].real, helped[0].real / many[0].real, off, whole),
        picture=lambda: lines(
            [Panel(x="frequency in Hz", y="|u/F| in m/N", scales=("linear", "log"), curves=curves)], 1
        ),
        caption="Vertical displacement of the driven node.",
    )  # fmt: skip


def _receptance_claims(few: float, helped: float, off: float, whole: float) -> tuple[Claim, ...]:
    source = "section 6.1.3, figure 6.2"
    return (
        Claim(what="compliance of 10 modes over that of 100", unit="-", thesis=1.0, source=source, relation="below", found=few),
        Claim(what="compliance of 10 modes with residual over that of 100", unit="-", thesis=1.0, source=source, tolerance=TINY, found=helped),
        Claim(what="largest distance from 100 modes up to half the tenth frequency, over the largest value", unit="-", thesis=0.0,
              source=source, tolerance=0.05, found=float(off)),
        Claim(what="compliance of 100 modes over that of all (\"not the total residual flexibility is calculated\")", unit="-", thesis=1.0,
              source="section 6.1.3", relation="below", found=whole),
    )  # fmt: skip


@figure(
    "figure-6.3",
    "Displacement under a point force of 1 N at 5 Hz by number of modes",
    "The fewer modes, the less the tire yields; with 1000 modes, the highest almost at 4000 Hz, it agrees with Abaqus.",
)
def point_force(scenes: Scenes) -> Reproduced:
    """With γ1 = 5000 1/s; all unknowns of the same mesh instead of Abaqus."""
    tire = Simplified(scenes, 5000.0)
    time, force = sine(5.0, 0.2, STEP)
    full = tire.full_history(force, STEP)
    found = {count: tire.history(tire.response(count), force, STEP) for count in (FEW, MANY, ALL)}
    helped = tire.history(tire.response(FEW, "static"), force, STEP)
    share = {count: amplitude(one, 5.0, STEP) / amplitude(full, 5.0, STEP) for count, one in found.items()}  # fmt: skip
    curves = {f"{count} modes": Curve(time, 1e6 * one, k) for k, (count, one) in enumerate(found.items())}  # fmt: skip
    curves |= {f"{FEW} modes, all of the residual": Curve(time, 1e6 * helped, 3, "--"), FULL_FE: Curve(time, 1e6 * full, 4, ":")}  # fmt: skip
    with_residual = amplitude(helped, 5.0, STEP) / amplitude(full, 5.0, STEP)
    return Reproduced(
        shows=", ".join(f"{count} modes: {part:.3f}" for count, part in share.items())
        + f" of the amplitude of {FULL_FE}; 10 modes with all of the residual: {with_residual:.3f}. Mode {ALL} has {tire.frequency[-1]:.0f} Hz.",
        claims=_point_force_claims(share, float(tire.frequency[ALL - 1])),
        picture=lambda: lines([Panel(x="time in s", y="displacement in µm", curves=curves)], 1),
        caption="Vertical displacement of the driven node over the first wave.",
    )  # fmt: skip


def _point_force_claims(share: dict[int, float], highest: float) -> tuple[Claim, ...]:
    source = "section 6.2, figure 6.3"
    return (
        Claim(what="amplitude with 1000 modes over the finite elements'", unit="-", thesis=1.0, source=source, tolerance=0.05, found=share[ALL]),
        Claim(what="amplitude with 100 modes over that with 1000", unit="-", thesis=1.0, source=source, relation="below", found=share[MANY] / share[ALL]),
        Claim(what="amplitude with 10 modes over that with 100", unit="-", thesis=1.0, source=source, relation="below", found=share[FEW] / share[MANY]),
        Claim(what="frequency of mode 1000", unit="Hz", thesis=4000.0, source="section 6.2", tolerance=0.05, found=highest, because=OTHER_TIRE),
    )  # fmt: skip


@figure(
    "figure-C.1",
    "Displacement under a point force of 1 N at 20 Hz with residual flexibility",
    "Of 100 modes, γ1 = 50 1/s: 10 modes alone are too stiff; with the residual of the 90 others, a pulse at t = 0 in the "
    "Green's function, they give the response of 100.",
)
def residual_response(scenes: Scenes) -> Reproduced:
    """The residual responds instantaneously; the pulse (C.4) is its equivalent over one step."""
    tire = Simplified(scenes, 50.0)
    time, force = sine(20.0, 0.2, STEP)
    responses = {f"{MANY} modes": tire.response(MANY), f"{FEW} modes": tire.response(FEW), f"{FEW} modes and residual": tire.kept(MANY, FEW)}  # fmt: skip
    found = {name: tire.history(one, force, STEP) for name, one in responses.items()}
    many, few, helped = found.values()
    ratio, restored = (amplitude(one, 20.0, STEP) / amplitude(many, 20.0, STEP) for one in (few, helped))  # fmt: skip
    off = float(np.abs(helped - many).max() / np.abs(many).max())
    source = "appendix C, figure C.1"
    shown = time <= 0.1
    curves = {name: Curve(time[shown], 1e6 * u[shown], k, ("-", "-", "--")[k]) for k, (name, u) in enumerate(found.items())}  # fmt: skip
    return Reproduced(
        shows=f"10 modes have {ratio:.3f} of the amplitude of 100, with the residual {restored:.3f}; the histories are {100 * off:.2g} % apart at worst.",
        claims=(
            Claim(what="amplitude of 10 modes over that of 100", unit="-", thesis=1.0, source=source, relation="below", found=ratio),
            Claim(what="amplitude with residual over that of 100 modes", unit="-", thesis=1.0, source=source, tolerance=0.02, found=restored),
            Claim(what="largest distance from 100 modes over the largest value", unit="-", thesis=0.0, source=source, tolerance=0.05, found=off),
        ),
        picture=lambda: lines([Panel(x="time in s", y="displacement in µm", curves=curves)], 1),
        caption="Vertical displacement of the driven node.",
    )  # fmt: skip
