"""A scene of one's own: its run against full finite elements in time, on the same mesh, road and points.

Full finite elements have the scene's rubber where all its compounds are Prony series (fem.transient.Relaxation), and, of a tire
that turns, nodes lie at equal angles. Others have one modulus for all frequencies, that of 100 Hz
(fem.tire.material.DYNAMIC_FREQUENCY), beside the losses of the modes. Where moduli depend on frequency, the modes are
then run with these moduli too: what they are off is their truncation and the step, and what the run differs from them is its rubber.
"""

from __future__ import annotations

import tempfile
import time
from dataclasses import replace
from pathlib import Path

from mpi4py import MPI

from tireroad.contact.results.spectra import distance
from tireroad.fem.errors import InputError
from tireroad.greens.recursion import Recursion
from tireroad.greens.responses import make_response
from tireroad.modal.rolling import rolling_modes
from tireroad.runs.pipeline import Finished, run_scene
from tireroad.runs.process import console
from tireroad.runs.scene.load import load
from tireroad.runs.stages.contact import ContactHistory
from tireroad.runs.stages.rolling import recursive
from tireroad.runs.stages.setup import probes
from tireroad.runs.validation.full_elements import (
    Conditions,
    Elements,
    FullHistory,
    digits,
    follow,
    percent,
)
from tireroad.runs.validation.tables import Table

LONGEST = 0.05  # s of the road: full finite elements take a second of CPU for a few of their steps
REFINED = 2  # steps of the full finite elements in one of the run's, in the reference
AXES = ("along the road", "across it", "vertical")
_RELAXES = "The full finite elements have the Prony series of the compounds: what the run is off contains its law of the rubber."
_RUBBER = (
    "The full finite elements have the moduli of 100 Hz at all frequencies; 'modes with its rubber': so have the modes, and "
    "nothing relaxes. What the run differs from them is what its moduli over frequency change."
)


def against_elements(scene: Path, duration: float = LONGEST) -> list[Table]:
    """Error of a scene's modes and time step: its forces against full finite elements, direction by direction.

    The scene is run as it stands but for its first `duration` s of road (or what it has), on one process. Full finite
    elements of the same mesh, in the same state, with the same points, tread, friction and damping, their wheel at a given rate, take steps of the same
    size and of half of it: the second are the reference, and what the first are off from it bounds its own error. Where
    moduli depend on frequency, its modes are run with those of the elements besides. The mesh's
    own error is not in it (`[accuracy] estimate`). InputError for a scene without contact, or that forces drive.
    """
    given = load(scene)
    if given.contact is None:
        raise InputError(
            f"{scene}: without [contact] nothing is to be validated in time: give [contact] and [road]"
        )
    if given.force:
        raise InputError(
            f"{scene}: [[force]] drives the tire besides the road, which validate does not repeat: leave it out"
        )
    length = min(duration, given.time.duration)
    changes = [
        f"time.duration={length!r}",
        "accuracy.estimate=false",
        "static.error_estimate=false",
        *(["rotation.wheel=held"] if given.rotation else []),
    ]
    with tempfile.TemporaryDirectory(prefix="tireroad-validate-") as folder:
        began = time.process_time()
        run = run_scene(
            load(scene, changes),
            Path(folder),
            MPI.COMM_SELF,
            until="contact",
            fresh=False,
            petsc_options=[],
        )
        seconds = time.process_time() - began
        return [_compared(scene, run, seconds)]


def _compared(scene: Path, run: Finished, seconds: float) -> Table:
    """The run, whose stages took `seconds` of CPU, beside full finite elements."""
    job, static, history = run.job, run.static, run.done["contact"].product
    setup, response = run.setup, run.greens.contact
    contact = job.scene.contact
    assert contact is not None, "a scene with contact"
    elements = Elements(run, job, probes(job, static, setup))
    settled, _ = setup.equilibrated(response, static.normal_force, contact)
    trial = Conditions(contact, settled, history.step * len(history.time), response)
    found = []
    for parts in (1, REFINED):
        console.say(
            f"full finite elements: {len(history.time) * parts} steps of {history.step / parts:.3g} s"
        )
        found.append(follow(trial, *elements.full(history.step / parts)))
    coarser, reference = found
    axle = history.axle_force
    values = {"contact force": history.total_force} | ({} if axle is None else {"axle force": axle})
    compared = {
        "full FE at the run's step": coarser,
        "the run": FullHistory(history.step, values, seconds, 0.0),
    }
    varies = run.rolling.basis.projection.rise is not None and not elements.relaxes
    if varies:
        compared["modes with its rubber"] = _with_its_rubber(elements, trial, history)
    rows = [
        _row(*of, reference, list(compared.values()))
        for of in ((name, axis) for name in values for axis in range(3))
    ]
    columns = [("force", ""), ("direction", ""), ("mean", "N"), ("standard deviation", "N")]
    columns += [(name, "%") for name in compared]
    columns += [(f"mean of {name} less that", "N") for name in list(compared)[1:]]
    kept = len(run.fields.frequency)
    title = (
        f"{scene.name}: {trial.duration:.3g} s, {elements.unknowns} unknowns, {kept} modes, {len(settled.patch.points)} "
        f"contact points, steps of {history.step:.3g} s"
    )
    notes = [
        f"Against full finite elements in steps of {reference.step:.3g} s, on the same mesh, road, points, tread and friction: relative "
        "L2 norms of what varies, in the band of the other validations. What halving the step changes in the full finite elements stands "
        "beside what the run is off: where that is not smaller, the figure is of the reference.",
        *([_RUBBER] if varies else []),
        *([_RELAXES] if elements.relaxes else []),
        f"CPU time: the scene's stages and loop {seconds:.0f} s; loops of the full finite elements {coarser.seconds:.0f} and "
        f"{reference.seconds:.0f} s, and {reference.setup:.0f} s for a factor.",
    ]
    return Table(title, columns, rows, notes)


def _with_its_rubber(elements: Elements, trial: Conditions, history: ContactHistory) -> FullHistory:
    """The run's modes with the moduli of the full finite elements, at the step and by the scheme of the run."""
    run, points = elements.run, elements.probes
    assert points is not None, "points of a contact"
    of_run = run.rolling
    projection = replace(of_run.basis.projection, rise=None, band_rise=None, parts=None)
    basis = replace(run.fields, projection=projection)
    rolling = rolling_modes(basis, of_run.turning, MPI.COMM_SELF)
    wheel = replace(run.wheel, growth=None)
    face, residual = points.on_face, run.job.scene.greens.residual
    made = make_response(
        lambda: wheel, rolling, face.outputs, face.loads, residual, lambda: basis
    ).response
    step = history.step
    tire = Recursion(
        response=made.resolved(step),
        step=step,
        scheme=recursive(history.scheme),
        comm=MPI.COMM_SELF,
    )
    return follow(trial, tire, step, 0.0)


def _row(force: str, axis: int, reference: FullHistory, compared: list[FullHistory]) -> list:
    """A force in a direction: mean and deviation by the reference, and how far the others are off, in what varies and on average."""
    right, *found = (of.values[force][:, axis : axis + 1] for of in (reference, *compared))
    length = reference.step * len(right)
    off = [percent(distance(right, other, length).mean) for other in found]
    mean = float(right.mean())
    more = [digits(float(other.mean()) - mean) for other in found[1:]]
    return [force, AXES[axis], digits(mean), digits(float(right.std())), *off, *more]
