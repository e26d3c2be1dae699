"""Run time against error of a tire rolling on a rough road: modes x residual x step x mesh.

The reference has a converged mesh too: neither modes nor steps can remove the error of a mesh.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path

from threadpoolctl import threadpool_limits

from tireroad.fem.errors import ConvergenceError, InputError
from tireroad.runs.process import console
from tireroad.runs.validation.full_elements import FullHistory, follow
from tireroad.runs.validation.tables import Table
from tireroad.tests.bench.accuracy.rough_road import (
    BAND,
    SPEED,
    Mesh,
    Prepared,
    errors,
    fewer_modes,
    modal,
    prepared,
)

ABOUT = "modes x residual x step x mesh against a run converged in all of them: the Pareto front of rolling"

DEFAULT, COARSER = Mesh(28, 16, 0.2), Mesh(22, 12, 0.2)
CONVERGED = Mesh(34, 18, 0.15)  # of the reference: see bench convergence
ORDER, PITCH = 3, 0.004  # of the elements, and m between points, in all of them
MOST = 600  # modes of the reference, plus attachment modes
FINEST = 2.5e-5  # s: its step
DURATION = 0.2  # s
COUNTS = (50, 100, 200, 400)
RESIDUALS = ("none", "static", "attachment")
STEPS = (5e-5, 1e-4, 2e-4, 4e-4)
FULL_STEPS = (2e-4, 1e-4, 5e-5)
TARGETS = (1.0, 0.1)  # %
FULL = "full finite elements"


@dataclass(frozen=True)
class Choice:
    """A configuration, its cost (s per simulated second) and its errors (%)."""

    mesh: str
    modes: int
    residual: str
    states: int
    step: float
    cost: float
    contact: float
    axle: float

    @property
    def worst(self) -> float:
        return max(self.contact, self.axle)

    @property
    def name(self) -> str:
        """A short description."""
        modes = "" if self.residual == FULL else f"{self.modes} modes, "
        return f"{modes}{self.residual}, {self.step:g} s"


def run() -> list[Table]:
    """The front on one mesh, the fronts of two meshes, and full finite elements for comparison."""
    with tempfile.TemporaryDirectory() as folder:
        return tables(Path(folder), (DEFAULT, COARSER), COUNTS, MOST, FULL_STEPS, CONVERGED)


def tables(
    folder: Path, meshes: tuple[Mesh, Mesh], counts, most, full_steps, converged: Mesh
) -> list[Table]:
    """`meshes`: of all configurations, of some; `most` modes of the reference, on `converged`."""
    reference, exact = _reference(folder, converged, most)
    given, own = _reference(folder, meshes[0], most)
    found = _choices(given, exact, str(meshes[0]), counts, RESIDUALS, STEPS)
    full = [_full(given, exact, str(meshes[0]), step) for step in full_steps]
    coarse, coarser = _reference(folder, meshes[1], most)
    some = counts[1:], ("static", "attachment"), STEPS[1:]
    on_coarse = _choices(coarse, exact, str(meshes[1]), *some)
    apart = [errors(exact, one, DURATION) for one in (own, coarser)]
    return [
        _front(found, full, given, reference),
        _meshes(found, on_coarse, apart, given, coarse),
        _all(found + full + on_coarse),
    ]


def _reference(folder: Path, mesh: Mesh, modes: int) -> tuple[Prepared, FullHistory]:
    console.say(f"  {mesh} elements: modes and reference ...")
    keys = {"modes": modes, "residual": "attachment", "duration": DURATION, "step": FINEST}
    sets = f"tire.order={ORDER}", "static.error_estimate=false"
    given = prepared(folder / str(mesh), mesh, *sets, pitch=PITCH, **keys)
    return given, modal(given, given.run.greens.contact, FINEST)


def _choices(
    given: Prepared, exact: FullHistory, mesh: str, counts, residuals, steps
) -> list[Choice]:
    out = []
    for count in counts:
        for residual in residuals:
            response = fewer_modes(given, count, residual)
            states = len(response.eigenvalue) + len(response.block)
            for step in steps:
                try:
                    found = modal(given, response, step)
                except (ConvergenceError, InputError) as refused:
                    console.say(f"  {count} modes, {residual}, {step:g} s: {refused}")
                    continue
                cost, off = found.seconds / DURATION, errors(exact, found, DURATION)
                out.append(Choice(mesh, count, residual, states, step, cost, *off))
    return out


def _full(given: Prepared, exact: FullHistory, mesh: str, step: float) -> Choice:
    """All degrees of freedom of the same mesh, integrated in time."""
    from tireroad.fem.matrices.probe import nodes
    from tireroad.fem.transient import FullTire
    from tireroad.modal.damping import StrainEnergy

    console.say(f"  full finite elements, {step:g} s ...")
    wheel, turning = given.run.wheel, ("operators", "rotation", "speed", "damping")
    points = nodes(given.trial.setup.patch.index, len(given.run.static.points))
    assert not isinstance(wheel.damping, StrainEnergy), "the scene gives [damping]"
    tire = FullTire(
        **{name: getattr(wheel, name) for name in turning},
        step=step,
        outputs=points,
        loads=points,
    )
    with threadpool_limits(1, "blas"):
        found = follow(given.trial, tire, step, 0.0)
    size, cost = given.run.motions.unknowns, found.seconds / DURATION
    return Choice(mesh, size, FULL, 2 * size, step, cost, *errors(exact, found, DURATION))


def front(choices: list[Choice]) -> list[Choice]:
    """The choices that no other beats in both cost and error, the cheapest first."""
    best: list[Choice] = []
    for choice in sorted(choices, key=lambda c: (c.cost, c.worst)):
        if not best or choice.worst < best[-1].worst:
            best.append(choice)
    return best


_GUIDES = [(target, f"target: {target:g} %") for target in TARGETS]
_COLUMNS = [
    ("mesh", ""),
    ("modes", "-"),
    ("residual", ""),
    ("states", "-"),
    ("step", "s"),
    ("run time per simulated second", "s"),
    ("error of contact force", "%"),
    ("error of axle force", "%"),
    ("larger error", "%"),
]


def _row(choice: Choice) -> list:
    return [*vars(choice).values(), choice.worst]


def _front(found: list[Choice], full: list[Choice], given: Prepared, reference: Prepared) -> Table:
    best = front(found)
    named = [[_letter(k), *_row(choice)] for k, choice in enumerate(best)]
    beside = [["", *_row(choice)] for choice in full]
    notes = [
        f"Rolling at {SPEED:g} rad/s on a rough road (0.2 mm rms, waves of 30 to 200 mm) under 500 N: "
        f"{3 * given.run.motions.lattice.size} unknowns, {len(given.trial.setup.patch.points)} points that can touch. Error: "
        "the larger one of contact and axle force, relative L2 of what varies from 0 to "
        f"{BAND:g} Hz (Hann window), against {CONVERGED} elements of order {ORDER}, "
        f"{3 * reference.run.motions.lattice.size} unknowns, {given.run.job.scene.modal.count} modes with attachment "
        f"modes, a step of {FINEST:g} s. Points {1e3 * PITCH:g} mm apart in all. Run time: of the loop alone, CPU time.",
        *(_named(target, best, full) for target in TARGETS),
    ]
    plot = {
        "kind": "front",
        "x": "run time per simulated second",
        "y": ["larger error"],
        "by": "residual",
        "mark": "step",
        "size": "modes",
        "points": [["", *_row(choice)] for choice in found],
        "front": named,
        "label": "on the front",
        "beside": beside,
        "beside_name": FULL,
        "targets": _GUIDES,
        "limits": [(1.0, "real time")],
    }
    columns = [("on the front", ""), *_COLUMNS]
    return Table("Pareto front of rolling on a rough road", columns, named + beside, notes, plot)


def _letter(k: int) -> str:
    """A, B, ..., Z, A1, ..."""
    return "ABCDEFGHIJKLMNOPQRSTUVWXYZ"[k % 26] + (str(k // 26) if k >= 26 else "")


def _named(target: float, best: list[Choice], full: list[Choice]) -> str:
    """The cheapest configuration within `target` percent, and its gain on full finite elements."""
    good = next((choice for choice in best if choice.worst <= target), None)
    if good is None:
        return f"{target:g} %: none of these reaches it."
    text = f"Cheapest within {target:g} %: {good.name}, {good.cost:.3g} s a simulated second"
    slower = [choice for choice in full if choice.worst <= target]
    if slower:
        ratio = min(choice.cost for choice in slower) / good.cost
        return f"{text}; full finite elements within {target:g} % take {ratio:.0f} times as long."
    nearest = min(full, key=lambda choice: choice.worst, default=None)
    if nearest is None:
        return text + "."
    return (
        f"{text}; full finite elements at {nearest.step:g} s are off by {nearest.worst:.2g} % and "
        f"take {nearest.cost / good.cost:.0f} times as long."
    )


def _meshes(found, others, apart, one: Prepared, other: Prepared) -> Table:
    """The fronts of two meshes, and the error of each mesh itself."""
    rows = [_row(choice) for part in (found, others) for choice in front(part)]
    sizes = [
        f"{s.run.job.scene.tire.segments} x {s.run.job.scene.tire.proportions().along}"
        for s in (one, other)
    ]
    unknowns = [3 * s.run.motions.lattice.size for s in (one, other)]
    notes = [
        f"All against the mesh that is converged. With all modes at the finest step {sizes[0]} "
        f"({unknowns[0]} unknowns) is off by {apart[0][0]:.2g} % in the contact force and {apart[0][1]:.2g} % in the "
        f"axle force, {sizes[1]} ({unknowns[1]}) by {apart[1][0]:.2g} and {apart[1][1]:.2g} %: modes and steps "
        "cannot come below that.",
    ]
    plot = {
        "x": "run time per simulated second",
        "y": ["larger error"],
        "log": "xy",
        "by": "mesh",
        "targets": _GUIDES,
    }
    return Table("Fronts of two meshes", _COLUMNS, rows, notes, plot)


def _all(choices: list[Choice]) -> Table:
    order = sorted(choices, key=lambda c: (c.mesh, c.residual, c.modes, -c.step))
    return Table("All configurations", _COLUMNS, [_row(choice) for choice in order])
