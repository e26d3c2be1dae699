"""Modal runs against full finite elements at several time steps: errors, run times, targets."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from mpi4py import MPI

from tireroad.contact.results.spectra import BAND, Distance, distance
from tireroad.greens.recursion import Recursion
from tireroad.greens.response import Response
from tireroad.greens.responses import make_response
from tireroad.modal.rolling import RollingModes, rolling_modes
from tireroad.modal.standing import fewer
from tireroad.runs.pipeline import run_scene
from tireroad.runs.process import console
from tireroad.runs.scene.load import load
from tireroad.runs.scene.physics import turning_of
from tireroad.runs.stages.setup import probes, scene_setup
from tireroad.runs.validation.full_elements import (
    Conditions,
    Elements,
    FullHistory,
    digits,
    follow,
    percent,
)
from tireroad.runs.validation.tables import Table

LOADED = """
name = "validate"
[tire]
segments = {segments}
elements_arc = {elements_arc}
footprint_size = 0.35
[tire.material]
youngs_modulus = 48e6
[static]
load = 500.0
"""
"""Beginning of a scene: the soft torus under 500 N, with the elements left open."""
TIMES = 3  # repetitions: a modal loop takes 0.1 s, and its CPU time scatters threefold
NOTES = [
    f"Errors: relative L2 of what varies in 0 to {BAND:g} Hz (Hann window); worst: largest difference "
    "there in time over the largest variation. All against the full finite elements at their smallest "
    "step, whose own error is estimated: a third of its distance from the step before (second order).",
    "Ratio: loop of the full finite elements, at the largest step at which they are as accurate, over "
    f"the loop of the row, both in processor seconds of one thread, of modes the least of {TIMES}. Set-up: second eigenproblem (once for "
    "all roads) and residual, or factorisation; static state and modes are shared.",
]


@dataclass(frozen=True)
class Choice:
    """Settings of a modal run: modes, residual option, time step in s."""

    modes: int
    residual: str
    step: float


class Tires(Elements):
    """A scene run up to its modes; its road, and the modes kept, can then be changed at low cost.

    `static_seconds`, `modes_seconds`: duration of those stages. Files go to `folder`.
    """

    def __init__(self, scene: str, folder: Path):
        self._file = folder / "scene.toml"
        self._file.write_text(scene)
        with console.quiet():
            run = run_scene(
                load(self._file),
                folder,
                MPI.COMM_SELF,
                until="modes",
                fresh=False,
                petsc_options=[],
            )
        stages = json.loads((folder / "summary.json").read_text(encoding="utf-8"))["stages"]
        self.static_seconds, self.modes_seconds = (
            stages[name]["seconds"] for name in ("static", "modes")
        )
        super().__init__(run, run.job, None)
        self._rolling: dict[int, RollingModes] = {}
        self.change(scene)

    @property
    def setting(self) -> str:
        """Size, and cost before any road, for a title."""
        top = self.modes.frequency[-1]
        return (
            f"{self.unknowns} unknowns; static state {self.static_seconds:.1f} s, "
            f"{len(self.modes.frequency)} modes to {top:.0f} Hz {self.modes_seconds:.1f} s"
        )

    def change(self, scene: str) -> None:
        """Switch to a scene that differs only after its modes: road, forces, contact, time."""
        self._file.write_text(scene)
        self.job = replace(self.run.job, scene=load(self._file))
        self._responses: dict[tuple[int, str], tuple[Response, float]] = {}
        static, contact = self.run.static, self.job.scene.contact
        setup = scene_setup(self.job, static) if contact else None
        self.probes = probes(self.job, static, setup)
        if setup and contact:
            exact = self.response(len(self.modes.frequency), "static")
            setup = setup.equilibrated(exact, static.normal_force, contact)[0]
            begins = contact.has_friction and self.wheel.speed > 0
            self.trial = Conditions(
                contact, setup, self.job.scene.time.duration, exact if begins else None
            )

    def modal(self, choice: Choice) -> tuple[Recursion, float, float]:
        """The lowest modes with their residual between the scene's points; step; set-up in s."""
        key = choice.modes, choice.residual
        if key not in self._responses:
            began = time.perf_counter()
            self._responses[key] = self.response(*key), time.perf_counter() - began
        response, seconds = self._responses[key]
        began = time.perf_counter()
        resolved = response.resolved(choice.step)
        tire = Recursion(response=resolved, step=choice.step, scheme="linear", comm=self.job.comm)
        return tire, choice.step, seconds + time.perf_counter() - began

    def response(self, count: int, residual: str, counted: bool = True) -> Response:
        """The response of the lowest modes as the stages make it; the `counted` part, or all."""
        if count not in self._rolling:
            turning = turning_of(self.job.scene, self.job.speed)
            few = fewer(self.modes, self.motions, count, turning, self.job.axle)
            self._rolling[count] = rolling_modes(few, turning, self.job.comm)
        rolling, points = self._rolling[count], self.probes
        points = points.on_face if counted else points
        arguments = points.outputs, points.loads, residual, lambda: rolling.basis
        return make_response(lambda: self.wheel, rolling, *arguments).response


@dataclass(frozen=True)
class Run:
    """A history, its errors by quantity, and `error`, the largest one among the counted quantities.

    `choice` is None for full finite elements.
    """

    choice: Choice | None
    history: FullHistory
    errors: dict[str, Distance]
    error: float


class Comparison:
    """Full finite elements at falling steps (two or more); modal runs compared with the last.

    `counts`: the quantities whose error a run is selected by.
    """

    def __init__(self, full: list[FullHistory], counts: tuple[str, ...]):
        self._reference, self._counts = full[-1], counts
        errors = [self._between(history) for history in full[:-1]]
        last = {name: Distance(far.mean / 3, far.worst / 3) for name, far in errors[-1].items()}
        self.full = [self._run(None, *pair) for pair in zip(full, [*errors, last], strict=True)]
        self.modal: list[Run] = []

    def add(self, choice: Choice, history: FullHistory) -> None:
        """Add a modal run."""
        self.modal.append(self._run(choice, history, self._between(history)))

    def _run(self, choice: Choice | None, history: FullHistory, errors: dict[str, Distance]) -> Run:
        return Run(choice, history, errors, max(errors[name].mean for name in self._counts))

    def _between(self, history: FullHistory) -> dict[str, Distance]:
        exact = self._reference.values
        return {
            name: distance(exact[name], values, self._duration)
            for name, values in history.values.items()
        }

    def full_within(self, error: float) -> Run:
        """The full run with the largest step whose error is within the given one, or the finest."""
        return next((run for run in self.full if run.error <= error), self.full[-1])

    def table(self, title: str) -> Table:
        """The table of all runs."""
        names = list(self._reference.values)
        columns = [("modes", "-"), ("residual", ""), ("step", "s")]
        columns += [(part, "%") for name in names for part in (name, f"worst {name}")]
        columns += [("set-up", "s"), ("loop", "s"), ("ratio", "-"), ("ratio, same step", "-")]
        rows = [self._row(run) for run in [*self.full, *self.modal]]
        plot = {"x": "loop", "y": names[:1], "log": "xy", "by": "residual"}
        return Table(title, columns, rows, list(NOTES), plot)

    def _row(self, run: Run) -> list:
        history, choice = run.history, run.choice
        head: list = ["all", "full FE"] if choice is None else [choice.modes, choice.residual]
        errors = [percent(part) for far in run.errors.values() for part in (far.mean, far.worst)]
        gain = self.full_within(run.error).history.seconds / history.seconds
        same = [
            other.history.seconds / history.seconds
            for other in self.full
            if other.history.step == history.step
        ]
        times = [digits(t) for t in (history.setup, history.seconds, gain, *same)]
        return [*head, history.step, *errors, *times, *([] if same else [""])]

    def verdict(self, case: str, error: float, asked: float, modes_seconds: float) -> list:
        """A row of `verdicts`: the fastest modal run within `error`, or the most accurate one.

        The target is reached if it is within `error` and `asked` times as fast as full finite
        elements of that accuracy.
        """
        within = [run for run in self.modal if run.error <= error]
        if within:
            best = min(within, key=lambda run: run.history.seconds)
        else:
            best = min(self.modal, key=lambda run: run.error)
        reference = self.full_within(error)
        ours, theirs = best.history, reference.history
        gain = theirs.seconds / ours.seconds
        reached = "yes" if within and gain >= asked else "no"
        named = f"{best.choice.modes} {best.choice.residual}, {ours.step:g} s"
        full = f"{theirs.step:g} s, {percent(reference.error):g} %"
        before, saved = modes_seconds + ours.setup - theirs.setup, theirs.seconds - ours.seconds
        # Simulated time after which the modes have paid off, too.
        pays = digits(max(self._duration * before / saved, 0.0)) if saved > 0 else "never"
        figures = [percent(best.error), full, digits(gain), pays]
        return [case, 100 * error, asked, named, *figures, reached]

    @property
    def _duration(self) -> float:
        """Simulated time, s."""
        first = next(iter(self._reference.values.values()))
        return self._reference.step * len(first)


def compare(
    tires: Tires, steps: Sequence[float], choices: Sequence[Choice], counts: tuple[str, ...]
) -> Comparison:
    """Full finite elements at the steps (s), and the choices, on the tires' present road."""
    trial = tires.trial
    comparison = Comparison([follow(trial, *tires.full(step)) for step in steps], counts)
    for choice in choices:
        alike = (follow(trial, *tires.modal(choice)) for _ in range(TIMES))
        comparison.add(choice, min(alike, key=lambda history: history.seconds))
    return comparison


def verdicts(title: str, rows: list[list], notes: list[str]) -> Table:
    """The table of targets."""
    columns = [
        ("case", ""),
        ("target error", "%"),
        ("target ratio", "-"),
        ("fastest run within it, or best", ""),
        ("its error", "%"),
        ("full FE within it, or finest", ""),
        ("ratio", "-"),
        ("set-up paid back after", "s"),
        ("reached", ""),
    ]
    about = (
        "Ratio: of the loops. Set-up paid back: simulated time after which modes, their residual and the "
        "loop together take less than full finite elements (factorisation and loop); both need the static "
        "state."
    )
    return Table(title, columns, rows, [about, *notes])
