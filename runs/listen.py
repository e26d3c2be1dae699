"""`tireroad.listen`: the sound pressure of a finished run at other microphones."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from functools import partial
from pathlib import Path
from typing import Any

from mpi4py import MPI

from tireroad.fem.errors import InputError
from tireroad.greens.absorbing_road import PorousLayer
from tireroad.runs.pipeline import PARTS
from tireroad.runs.results.reader import RunResults
from tireroad.runs.scene.load import load
from tireroad.runs.scene.plan import skipped
from tireroad.runs.scene.schema import key_of
from tireroad.runs.scene.tables.sound import SoundTable
from tireroad.runs.stages.sound import RadiationStage, SoundPressure, SoundStage
from tireroad.runs.stages.stage import Job, Record, Result, Shared, Stage


def listen(
    run: str | Path | Mapping[str, Any],
    microphones: Any = ("cpx",),
    *,
    temperature: float = 293.15,
    up_to: float | None = None,
    road: PorousLayer | Mapping[str, float] | None = None,
) -> SoundPressure:
    """Sound pressure of a finished run at other microphones: its folder, or tireroad.load of it. Not collective.

    `microphones`: as sound.microphones in a scene, names or places (x, y, z) in m; `temperature` K of the
    air; `up_to` Hz; `road`: as sound.road, a porous layer or its keys, None rigid. The air of the footprint as `sound.air` of the scene
    has it. Nothing is written. Raises InputError for a folder without the results of a
    rolling contact, for places inside the tire or under the road, and values out of range.
    """
    return finished(run, microphones, temperature, up_to, road)[1]["sound"].product


def finished(
    run: str | Path | Mapping[str, Any],
    microphones: Any,
    temperature: float,
    up_to: float | None,
    road: PorousLayer | Mapping[str, float] | None,
) -> tuple[Job, dict[str, Result]]:
    """The job of a finished run with a table [sound] of its own, and its results, "sound" among them.

    Arguments and errors are those of `listen`. Not collective.
    """
    results = run if isinstance(run, RunResults) else RunResults(run)  # type: ignore[arg-type]
    scene = load(results.directory / "scene.toml")
    settings = {"microphones": microphones, "temperature": temperature, "up_to": up_to}
    table = SoundTable(
        **{
            item.name: _read(item, settings[item.name])
            for item in fields(SoundTable)
            if item.name in settings
        },
        air=scene.sound.air if scene.sound else None,
        road=_layer(road),
    )
    job = Job(replace(scene, sound=table), results.directory, MPI.COMM_SELF)
    done: dict[str, Result] = {}
    for kind in PARTS:
        part = kind.with_inputs(job, done)
        if isinstance(part, RadiationStage | SoundStage):
            done[kind.name] = Result("", partial(part.compute, Record()))
        elif isinstance(part, Shared):
            done[kind.name] = Result("", part.make)
        elif isinstance(part, Stage) and kind.name not in skipped(scene):
            if f"{kind.name}.h5" in results.left_out or not job.path(kind.name).is_file():
                continue
            done[kind.name] = Result("", part.stored)
        job.settle(done)
    if "sound" not in done:
        raise InputError(
            f"{results.directory}: listen needs the results of a tire that rolls or is driven over time: run "
            "the scene with [time] and [contact] to its end"
        )
    return job, done


def _layer(road: PorousLayer | Mapping[str, float] | None) -> PorousLayer | None:
    if road is None or isinstance(road, PorousLayer):
        return road
    try:
        return PorousLayer(**road)
    except TypeError:
        names = ", ".join(item.name for item in fields(PorousLayer))
        raise InputError(f"listen: road has the keys {names}, not {', '.join(road)}") from None


def _read(item: Any, value: Any) -> Any:
    key = key_of(item)
    assert key is not None
    if value is None and key.optional:
        return None
    try:
        return key.read(value)
    except ValueError as error:
        raise InputError(f"listen: {item.name} {error}") from None
