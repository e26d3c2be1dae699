"""Requirements and limits of a scene's outputs."""

from collections.abc import Callable, Iterator
from typing import Any

from tireroad.fem.errors import InputError
from tireroad.runs.scene.outputs import Output, check_steps
from tireroad.runs.scene.tables.scene import Scene

Where = Callable[[tuple[str, ...], str], InputError]

MOST_SPEEDS = 10_000


def check_outputs(scene: Scene, raw: dict[str, Any], error: Where) -> Iterator[InputError]:
    """The error of each kind of output at the driven points, checked against the scene."""
    for name, kind in scene.output.kinds:
        try:
            _check_kind(scene, kind, ("output", name), error)
        except InputError as found:
            yield found


def _check_kind(scene: Scene, kind: Output, path: tuple[str, ...], error: Where) -> None:
    if scene.in_contact and not kind.in_contact:
        raise error(
            path,
            "is not available in scenes with [contact]: leave it out, or take out [contact]",
        )
    if kind.of == "contact" and not scene.in_contact:
        raise error(
            path, "is of the forces of the road: add [contact], [time], and load (N) to [static]"
        )
    kind.check(scene, path, error)


def check_campbell(scene: Scene, raw: dict[str, Any], error: Where) -> None:
    """Check that the Campbell diagram has at least one speed and not too many."""
    campbell = scene.rotation.campbell if scene.rotation else None
    if campbell is not None:
        path = "rotation", "campbell", "step"
        check_steps(path, "speeds", campbell.to, campbell.step, "rad/s", error, most=MOST_SPEEDS)


def check_vibration(scene: Scene, raw: dict[str, Any], error: Where) -> Iterator[InputError]:
    """Check what the motion of the whole tire needs, in frequency and in time."""
    output, rotation = scene.output, scene.rotation
    full = rotation is not None and rotation.speed and rotation.method == "full"
    for key in ("vibration", "fields"):
        path = "output", key
        if not getattr(output, key):
            continue
        if scene.time is None or not (scene.force or scene.in_contact):
            yield error(path, "needs forces in time: add [time] with [contact] or a [[force]]")
        if full:
            yield error(path, 'is seen through the modes: take rotation.method = "projected"')
    if output.vibration and scene.in_contact and not output.spectra:
        yield error(
            ("output", "vibration"), "needs output.spectra, which find the run-in and the limit"
        )
