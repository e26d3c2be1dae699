"""Upper frequency up to which the results of a run are valid.

Stage accuracy: error estimates of a run's forces from cheap companion runs of known orders.
"""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from tireroad.contact.results.error_bars import CAUSES, Bars, Measured, measured, total
from tireroad.contact.results.limits import Limit, limits, lowest, pitch
from tireroad.contact.setup import ContactSetup
from tireroad.fem.errors import ConvergenceError, InputError
from tireroad.fem.static.state import StaticState
from tireroad.modal.rolling import RollingModes
from tireroad.runs.files.disk import Refused
from tireroad.runs.files.store import put
from tireroad.runs.process import observe
from tireroad.runs.process.mpi import on_root
from tireroad.runs.stages.companions import COARSER, Budget, Given, companions, least_steps
from tireroad.runs.stages.contact_file import ContactHistory
from tireroad.runs.stages.greens import Responses
from tireroad.runs.stages.record import Record
from tireroad.runs.stages.rolling import first_step, recursive
from tireroad.runs.stages.stage import Computed, Done


def all_limits(setup: ContactSetup, rolling: RollingModes, step: float) -> tuple[Limit, ...]:
    """Limits by the modes, the spacing of the contact points and the `step` (s)."""
    return limits(
        step=step,
        highest=rolling.highest / (2 * np.pi),
        pitch=pitch(setup.patch),
        speed=setup.rolled.speed,
    )


def model_limit(setup: ContactSetup, rolling: RollingModes, step: float) -> Limit:
    """The lowest of the limits."""
    return lowest(all_limits(setup, rolling, step))


FORCES = ("contact_force", "axle_force")
_UNITS = {"mean": "N", "deviation": "N", "level": "dB", "history": "-"}


@dataclass(frozen=True, kw_only=True)
class Accuracy:
    """Error estimates of each force by cause, `by_cause[force][cause]`.

    `centre` (b,) Hz: the third octaves; `window` s: the part of the run they were estimated on,
    from its start; `up_to` Hz: upper frequency of the histories compared; `mean` (3,) N of each
    force over the window; `absent`: why a cause has no estimate.
    """

    centre: np.ndarray
    window: float
    up_to: float
    mean: Mapping[str, np.ndarray]
    by_cause: Mapping[str, Mapping[str, Bars]]
    absent: Mapping[str, str] = field(default_factory=dict)

    def total(self, force: str) -> Bars | None:
        """Combined error of all causes with an estimate; None if there is none."""
        found = self.by_cause.get(force, {})
        return total(found) if found else None

    def levels(self, force: str, centre: np.ndarray) -> np.ndarray | None:
        """Error estimates (b, 3) dB at other bands; NaN where unknown."""
        found = self.total(force)
        if found is None:
            return None
        level = np.full((len(centre), 3), np.nan)
        for k, band in enumerate(centre):
            same = np.flatnonzero(np.isclose(self.centre, band))
            level[k] = found.level[same[0]] if len(same) else np.nan
        return level


@dataclass(frozen=True, kw_only=True)
class AccuracyStage(Computed[Accuracy]):
    """Error bars of mean, deviation and third octaves of the contact force and the axle force."""

    name: ClassVar[str] = "accuracy"
    static: Done[StaticState]
    rotating: Done[RollingModes]
    greens: Done[Responses]
    setup: Done[ContactSetup]
    contact: Done[ContactHistory]

    def inputs(self) -> dict:
        """The key of the contact forces, and the upper frequency."""
        return {"contact": self.contact.key, "up_to": self.job.scene.accuracy.up_to}

    def compute(self, record: Record) -> Accuracy:
        """Run the companions one by one; a failed one is reported, its cause absent. Collective."""
        history, setup = self.contact.product, self.setup.product
        if self._at_rest:
            return self._none("nothing excites the tire: its forces vary by rounding only")
        start = first_step(setup, self.job.scene.road, history.time)
        start += start % 2  # even: where a step of the companion with twice the step begins
        limit = model_limit(setup, self.rotating.product, history.step).frequency
        up_to = min(limit, self.job.scene.accuracy.up_to)
        least = start + least_steps(history.step, up_to)
        budget = Budget.of(self.job.scene, len(history.time))
        given = self._given(budget.steps, budget.most_touching(least))
        steps = budget.window(least, given)
        if steps - start < 2:
            return self._none("the run is too short for a companion run with twice the step")
        given = given.first(steps)
        runs = {"contact_force": history.total_force, "axle_force": history.axle_force}
        runs = {name: values[start:steps] for name, values in runs.items() if values is not None}
        exact = {
            name: measured(values, history.step, limit, up_to) for name, values in runs.items()
        }
        found: dict[str, dict[str, Bars]] = {name: {} for name in exact}
        absent: dict[str, str] = {}
        for cause in CAUSES:
            try:
                with record.timing(cause):
                    told = companions(cause, given)
            except Refused:
                raise  # a full disk is no property of the run: it must not be kept as one
            except (ConvergenceError, InputError) as error:
                absent[cause] = str(error)
                continue
            parts = [one.bars(exact, start * history.step, limit, up_to) for one in told]
            for name in exact:
                found[name][cause] = total(dict(enumerate(part[name] for part in parts)))
        product = Accuracy(
            centre=exact["contact_force"].centre,
            window=steps * history.step,
            up_to=up_to,
            mean={name: one.mean for name, one in exact.items()},
            by_cause=found,
            absent=absent,
        )
        record.indicators["errors are estimated from"] = (start * history.step, "s")
        record.indicators["errors are estimated up to"] = (product.window, "s")
        _describe(record, product, exact, limit)
        return product

    def produce(self, key: str, record: Record) -> Accuracy:
        """As any stage; also removes the coarser companion's folder, kept to resume. Collective."""
        product = super().produce(key, record)
        folder = self.job.directory / COARSER
        on_root(self.job.comm, lambda: shutil.rmtree(folder, ignore_errors=True))
        return product

    @property
    def _at_rest(self) -> bool:
        scene = self.job.scene
        still = scene.road.kind == "flat" and scene.road.motion.kind == "none"
        return still and not scene.force

    def _none(self, reason: str) -> Accuracy:
        observe.say(f"  no error bars: {reason}")
        absent = dict.fromkeys(CAUSES, reason)
        return Accuracy(
            centre=np.zeros(0), window=0.0, up_to=0.0, mean={}, by_cause={}, absent=absent
        )

    def _given(self, steps: int, most: float) -> Given:
        return Given(
            job=self.job,
            static=self.static,
            setup=self.setup.product.with_slip(self.contact.product.free_slip),
            free_slip=self.contact.product.free_slip,
            response=self.greens.product.contact,
            rolling=self.rotating.product,
            step=self.contact.product.step,
            steps=steps,
            scheme=recursive(self.contact.product.scheme),
            most=most,
        )

    def write(self, file, product: Accuracy) -> None:
        """Bars by force and cause; totals are formed on reading."""
        put(file, "centre", product.centre, "Hz")
        file.attrs["window"], file.attrs["up_to"] = product.window, product.up_to
        for force, mean in product.mean.items():
            put(file, f"{force}_mean", mean, "N")
        for cause, reason in product.absent.items():
            file.attrs[f"absent_{cause}"] = reason
        for force, causes in product.by_cause.items():
            for cause, bar in causes.items():
                for name, unit in _UNITS.items():
                    put(file, f"{force}/{cause}/{name}", getattr(bar, name), unit)

    def read(self, file) -> Accuracy:
        """The same, read back."""
        by_cause = {
            force: {
                cause: Bars(*(held[name][:] for name in _UNITS))
                for cause, held in file[force].items()
            }
            for force in FORCES
            if force in file
        }
        absent = {
            key.removeprefix("absent_"): str(reason)
            for key, reason in file.attrs.items()
            if key.startswith("absent_")
        }
        return Accuracy(
            centre=file["centre"][:],
            window=float(file.attrs["window"]),
            up_to=float(file.attrs["up_to"]),
            mean={force: file[f"{force}_mean"][:] for force in FORCES if force in file},
            by_cause=by_cause,
            absent=absent,
        )


def _describe(
    record: Record, product: Accuracy, exact: Mapping[str, Measured], limit: float
) -> None:
    """Record the vertical force's errors: mean, deviation (up to `limit` Hz), worst band."""
    record.indicators["deviations are taken up to"] = (limit, "Hz")
    for name, figures in exact.items():
        bar, what = product.total(name), name.replace("_", " ")
        if bar is None:
            continue
        record.headline |= {
            f"error of the mean {what}": (float(bar.mean[2]), "N"),
            f"error of the deviation of the {what}": (float(bar.deviation[2]), "N"),
            f"deviation of the {what}": (float(figures.deviation[2]), "N"),
            f"error of the {what}'s history up to {product.up_to:.4g} Hz": (
                100 * float(bar.history[2]),
                "%",
            ),
        }
        known = bar.level[np.isfinite(bar.level[:, 2]), 2]
        if len(known):
            record.headline[f"largest error of a third octave of the {what}"] = (
                float(known.max()),
                "dB",
            )
        for cause, part in product.by_cause[name].items():
            record.indicators[f"error of the deviation of the {what} by the {cause}"] = (
                float(part.deviation[2]),
                "N",
            )
    for cause, reason in product.absent.items():
        observe.say(f"  error by the {cause} not estimated: {reason}")
        record.headline[f"error by the {cause}"] = (f"not estimated: {reason}", "-")
    observe.say(f"  error bars from the first {product.window:.4g} s of the run")
