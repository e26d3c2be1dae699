"""Figures 7.1 to 7.3: distribution of the contact force in the patch, at rest, rolling, damped."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tireroad.runs.report.surface_figures import footprints
from tireroad.tests.thesis.claim import Claim
from tireroad.tests.thesis.figure import Reproduced, figure
from tireroad.tests.thesis.figures.simplified import Array
from tireroad.tests.thesis.runner import Scenes, kept

SCENE = "figure-7.1"
RISE = 1e-3  # m, section 7.1.1
MIDDLE = 2e-5  # m: offset from the middle that counts as symmetric
SPEEDS, DAMPINGS = (0.0, 100.0, 150.0), (0.0, 2500.0, 5000.0)  # rad/s, figure 7.2; 1/s, figure 7.3
AT_REST = "state at rest, small motions"
STEADY = "steadily rolling state"


@dataclass(frozen=True)
class Spread:
    """Vertical `force` (c,) N at points (c, 3) m of the patch, each for `area` (c,) m2."""

    points: Array
    force: Array
    area: Array

    @property
    def load(self) -> float:
        """Load, N."""
        return float(self.force.sum())

    @property
    def middle(self) -> Array:
        """Centre of pressure (x, y), m."""
        return self.force @ self.points[:, :2] / self.load

    @property
    def inside(self) -> float:
        """Mean pressure on the middle line over that beside it, away from the ends of the patch."""
        pressure, touching = self.force / self.area, self.force > 0
        across = np.abs(self.points[:, 0]) < np.abs(self.points[touching, 0]).max() / 2
        width = np.abs(self.points[touching, 1]).max()
        beside = across & touching & (np.abs(self.points[:, 1]) > width / 2)
        middle = across & (np.abs(self.points[:, 1]) < MIDDLE)
        return float(pressure[middle].mean() / pressure[beside].mean())


def as_thesis(scenes: Scenes, speed: float, damping: float) -> Spread:
    """By modes about the state at rest under 500 N, with the road raised by 1 mm. Collective.

    Mean over the second half of the run.
    """
    run = scenes.run(SCENE, *_settings(speed, damping), until="contact")

    def last(file) -> tuple[Array, Array, Array]:
        half = len(file["time"]) // 2
        return file["points"][:], file["normal_force"][half:].mean(axis=0), file["area"][:]

    return Spread(*kept(run, "contact", last))


def steady(scenes: Scenes, speed: float, damping: float) -> Spread:
    """By steadily rolling elements, the thesis's inertia, at that road height. Collective."""
    rest = scenes.run(SCENE, *_settings(0.0, damping), until="static").static
    height = f"static.road_height={rest.road_height + RISE!r}"
    more = "static.load=", height, "static.steady_rolling=true"
    state = scenes.run(SCENE, *_settings(speed, damping), *more, until="static").static
    near = state.gap < 2e-3
    return Spread(state.positions[near], state.force[near], state.area[near])


def _settings(speed: float, damping: float) -> tuple[str, str]:
    return f"rotation.speed={speed:g}", f"damping.mass={damping:g}"


def _picture(found: Sequence[Spread], titles: Sequence[str]) -> str:
    """Figure of the pressure in kPa; all cases share their points."""
    first = found[0]
    maps = [1e-3 * one.force / first.area for one in found]
    return footprints(first.points, maps, titles, "pressure in kPa", 10.2)


def _centre(what: str, source: str, found: float, **more: float | str) -> Claim:
    return Claim(what=what, unit="m", source=source, found=found, **({"thesis": 0.0} | more))  # type: ignore[arg-type]


@figure(
    "figure-7.1",
    "Contact force under the standing tire",
    "Pressed by 500 N and 1 mm more, the distribution is symmetric about both axes, and larger at the lateral sides of the "
    "patch than inside.",
)
def standing(scenes: Scenes) -> Reproduced:
    """Ω = 0."""
    found, source = as_thesis(scenes, 0.0, 5000.0), "section 7.1.1, figure 7.1"
    x, y = found.middle
    return Reproduced(
        shows=f"{found.load:.0f} N on {int((found.force > 0).sum())} nodes, its centre at ({round(1e3 * x, 3) + 0.0:.3f}, {round(1e3 * y, 3) + 0.0:.3f}) mm; in the middle half of the patch's length the "
        f"pressure on the middle line is {found.inside:.2f} of that beside it, and the ends carry most.",
        claims=(
            _centre("centre of pressure, x", source, float(x), tolerance=MIDDLE),
            _centre("centre of pressure, y", source, float(y), tolerance=MIDDLE),
            Claim(what="mean pressure on the middle line over that at the sides, in the middle half of the patch's length", unit="-", thesis=1.0, source=source,
                  relation="below", found=found.inside),
        ),
        picture=lambda: _picture([found], ["Ω = 0"]),
    )  # fmt: skip


@figure(
    "figure-7.2",
    "Contact force by speed",
    "Rolling at 100 and 150 rad/s the force moves to the front of the patch, the more the faster.",
)
def by_speed(scenes: Scenes) -> Reproduced:
    """γ1 = 5000 1/s."""
    ways = {AT_REST: [as_thesis(scenes, speed, 5000.0) for speed in SPEEDS], STEADY: [steady(scenes, speed, 5000.0) for speed in SPEEDS]}  # fmt: skip
    return _forward(ways, [f"Ω = {speed:g} rad/s" for speed in SPEEDS], "section 7.1.2, figure 7.2")


@figure(
    "figure-7.3",
    "Contact force by damping at 150 rad/s",
    "Without damping the distribution stays symmetric; with γ1 = 2500 and 5000 1/s the force moves forward, the more the larger.",
)
def by_damping(scenes: Scenes) -> Reproduced:
    """Ω = 150 rad/s."""
    ways = {AT_REST: [as_thesis(scenes, 150.0, damping) for damping in DAMPINGS], STEADY: [steady(scenes, 150.0, damping) for damping in DAMPINGS]}  # fmt: skip
    return _forward(ways, [f"γ1 = {damping:g} 1/s" for damping in DAMPINGS], "section 7.1.2, figure 7.3")  # fmt: skip


def _forward(ways: dict[str, list[Spread]], titles: list[str], source: str) -> Reproduced:
    """Three cases by both methods: the first symmetric, each further one further forward."""
    claims: list[Claim] = []
    for way, cases in ways.items():
        x = [float(one.middle[0]) for one in cases]
        claims.append(_centre(f"centre of pressure, {titles[0]}, {way}", source, x[0], tolerance=0.05 * abs(x[-1])))  # fmt: skip
        for k in (1, 2):
            claims.append(
                Claim(
                    what=f"centre of pressure, {titles[k]}, {way}: ahead of that at {titles[k - 1]}",
                    unit="m",
                    thesis=max(x[k - 1], 0.0),
                    source=source,
                    found=x[k],
                    relation="above",
                )
            )
    told = {way: ", ".join(f"{round(1e3 * one.middle[0], 2) + 0.0:.2f}" for one in cases) for way, cases in ways.items()}  # fmt: skip
    loads = ", ".join(f"{one.load:.0f}" for one in ways[AT_REST])
    return Reproduced(
        shows="; ".join(f"{way}: centre of pressure {x} mm ahead of the middle" for way, x in told.items())
        + f". Loads by the first way {loads} N: at this height of the road they change with the speed.",
        claims=tuple(claims),
        picture=lambda: _picture(ways[AT_REST], titles),
        caption="The thesis's way: small motions about the state at rest. That state lacks the damping of the steadily rolling shape, which tilts the "
        "patch as well.",
    )  # fmt: skip
