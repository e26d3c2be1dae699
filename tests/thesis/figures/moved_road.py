"""Figures 6.5 and C.2: the simplified tire on a moving flat road, by modes and all unknowns."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tireroad.runs.stages.setup import probes
from tireroad.runs.validation.full_elements import Conditions, follow
from tireroad.tests.thesis.claim import Claim
from tireroad.tests.thesis.figure import Reproduced, figure
from tireroad.tests.thesis.figures.simplified import Array, Simplified, full_tire
from tireroad.tests.thesis.plots import Curve, Panel, lines
from tireroad.tests.thesis.runner import Scenes

SCENE = "figure-6.5"
ROAD = 1e-4  # m: amplitude of the road, section 6.3
RADIUS = 0.5  # spectral radius of the finite elements' scheme, as in runs.validation.full_elements
SOURCE = "section 6.3, figure 6.5"


@dataclass(frozen=True)
class PrescribedMotion:
    """Motion of the lowest node, from t = `step` s on.

    `lowest` (n, 3) m: its displacement; `beside`: that 5° along the section from it; vertical
    `force` (n,) N.
    """

    step: float
    lowest: Array
    force: Array
    beside: Array | None = None

    @property
    def time(self) -> Array:
        """Times (n,) s."""
        return self.step * np.arange(1, len(self.force) + 1)


def by_modes(scenes: Scenes, *settings: str) -> PrescribedMotion:
    """The motion by modes. Collective."""
    run = scenes.run(SCENE, *settings, until="contact")
    history = run.done["contact"].product
    skip = int(history.time[0] == 0.0)
    driven = history.driven[skip:]
    return PrescribedMotion(history.step, driven[:, 0], history.total_force[skip:, 2], driven[:, 1])


def by_all_unknowns(scenes: Scenes) -> PrescribedMotion:
    """Full finite elements on the same points, without the brush, which by symmetry does not act.

    Computed once. Collective.
    """
    return scenes.once("moved road, all unknowns", lambda: _by_all_unknowns(scenes))


def _by_all_unknowns(scenes: Scenes) -> PrescribedMotion:
    run = scenes.run(SCENE, "contact.brush_stiffness=", until="greens")
    job, step = run.job, float(run.job.scene.time.step)
    alone = replace(job, scene=replace(job.scene, force=()))
    tire = full_tire(run, probes(alone, run.static, run.setup).on_face, step, RADIUS)
    found = follow(
        Conditions(job.scene.contact, run.setup, job.scene.time.duration), tire, step, 0.0
    )
    lowest = int(np.linalg.norm(run.setup.patch.points[:, :2], axis=1).argmin())
    moved = np.zeros((len(found.values["displacement"]), 3))
    moved[:, 2] = found.values["displacement"][:, lowest]
    return PrescribedMotion(step, moved, found.values["contact force"][:, 2])


def distance(found: Array, exact: Array) -> float:
    """Largest distance relative to half the range of `exact`."""
    return float(np.abs(found - exact).max() / (np.ptp(exact) / 2))


@figure(
    "figure-6.5",
    "Lowest node on a flat road that moves by 0.1 mm",
    "The displacement is close to Abaqus's; a little less than the road's, which the contact model lets in; none in x.",
)
def moved_road(scenes: Scenes) -> Reproduced:
    """With γ1 = 500 1/s of the caption, and 5000 1/s of table B.3."""
    exact, caption, table = by_all_unknowns(scenes), by_modes(scenes), by_modes(scenes, "damping.mass=5000")  # fmt: skip
    share = np.ptp(caption.lowest[:, 2]) / (2 * ROAD)
    off = distance(caption.lowest[:, 2], exact.lowest[:, 2])
    sideways = float(np.abs(caption.lowest[:, 0]).max() / np.abs(caption.lowest[:, 2]).max())
    change = distance(table.lowest[:, 2], caption.lowest[:, 2])
    time = caption.time
    vertical = {"1000 modes": Curve(time, 1e6 * caption.lowest[:, 2]), "1000 modes, γ1 = 5000 1/s": Curve(time, 1e6 * table.lowest[:, 2], 2, ":"),
                "all unknowns of the same mesh": Curve(exact.time, 1e6 * exact.lowest[:, 2], 1, "--")}  # fmt: skip
    lateral = {"lowest node": Curve(time, 1e6 * caption.lowest[:, 1]), "5° beside it": Curve(time, 1e6 * caption.beside[:, 1], 1)}  # fmt: skip
    return Reproduced(
        shows=f"The node follows {share:.3f} of the road's motion, {100 * off:.2g} % from full finite elements at worst; γ1 = 5000 1/s of table B.3 "
        f"in the place of the caption's 500 changes it by {100 * change:.2g} %.",
        claims=(
            Claim(what="largest distance from the finite elements, over the amplitude", unit="-", thesis=0.0, source=SOURCE, found=off, tolerance=0.05),
            Claim(what="amplitude of the lowest node over the road's", unit="-", thesis=1.0, source=SOURCE, found=float(share), relation="below"),
            Claim(what="displacement in x over that in z", unit="-", thesis=0.0, source="section 6.3", found=sideways, tolerance=0.01),
        ),
        picture=lambda: lines([Panel(title="vertical", x="time in s", y="displacement in µm", curves=vertical),
                               Panel(title="lateral", x="time in s", y="displacement in µm", curves=lateral)]),
        caption="The frequency, 50 Hz, is chosen here: the thesis has it in figure 6.4 only. By symmetry the lowest node does not move sideways.",
    )  # fmt: skip


@figure(
    "figure-C.2",
    "Green's functions with residual flexibility, and its use in contact",
    "The residual is a peak of the Green's function at t = 0. The contact model uses that value, finds other forces, and so "
    "residual flexibility cannot be used.",
)
def residual_in_contact(scenes: Scenes) -> Reproduced:
    """The residual as part of the compliance of a step, in the contact of figure 6.5."""
    tire, step = Simplified(scenes, 50.0), 1e-4
    times = step * np.arange(201)
    many, kept = tire.response(100), tire.kept(100, 10)
    g, few = (one.impulse(times)[:, 0, 0] for one in (many, kept))
    peak = few + np.where(times == 0.0, kept.residual[0, 0] / step, 0.0)
    exact = by_all_unknowns(scenes).force
    cases = {"none": "without residual", "static": "with residual"}
    forces = {residual: by_modes(scenes, "modal.count=100", f"greens.residual={residual}") for residual in cases}  # fmt: skip
    error = {residual: distance(one.force, exact) for residual, one in forces.items()}
    time = forces["none"].time
    curves = {f"100 modes {cases[name]}": Curve(time, one.force, k + 1, "-" if k else ":") for k, (name, one) in enumerate(forces.items())}  # fmt: skip
    curves["all unknowns"] = Curve(time, exact, 0, "--")
    return Reproduced(
        shows=f"In the contact of figure 6.5, 100 modes are {100 * error['none']:.3g} % off the finite elements' contact force; with residual "
        f"flexibility {100 * error['static']:.2g} %: it can be used.",
        claims=(
            Claim(what="value of the Green's function at t = 0 with residual, over the largest of 100 modes", unit="-", thesis=1.0,
                  source="appendix C, figure C.2", relation="above", found=float(peak[0] / g.max())),
            Claim(what="error of the contact force with residual over that without", unit="-", thesis=1.0, relation="above",
                  source='appendix C: "residual flexibility can not be used"', found=error["static"] / error["none"],
                  because="the residual adds to the compliance between forces and gaps of a step, and the complementarity problem is solved with it"),
        ),
        picture=lambda: lines([
            Panel(title="Green's functions, point force", x="time in s", y="g in m/(N s)", scales=("linear", "symlog"),
                  curves={"100 modes": Curve(times, g), "10 modes and residual / Δt": Curve(times, peak, 1, "--")}),
            Panel(title="contact force on the moved road", x="time in s", y="force in N", curves=curves)]),
        caption=f"Δt = {step:g} s.",
    )  # fmt: skip
