"""The stages that a scene needs, and reasons why the others are skipped."""

from dataclasses import fields

from tireroad.runs.files.names import STAGES
from tireroad.runs.scene.tables.scene import Scene, confined

_OF_CONTACT = "accuracy", "stretches", "spectra"


def skipped(scene: Scene, until: str | None = None) -> dict[str, str]:
    """The stages that will not run, each with its reason."""
    reasons: dict[str, str] = {}
    if scene.stiffness is None:
        reasons["stiffness"] = "no [stiffness]"
    if scene.rotation is None:
        reasons["rotating"] = "no [rotation]: the wheel stands"
    elif scene.rotation.speed == 0:
        reasons["rotating"] = "rotation.speed is 0: the wheel stands"
    if scene.modal is None:
        reasons["modes"] = "no [modal], and nothing that needs modes"
    if (idle := _no_response(scene)) is not None:
        reasons["response"] = idle
    if not scene.in_contact:
        reasons["contact"] = why = _no_contact(scene)
        reasons |= dict.fromkeys(_OF_CONTACT, f"{why}, hence no contact forces")
        if not scene.force:
            reasons["greens"] = f"no [[force]], and {why}"
    elif not scene.output.spectra:
        reasons["spectra"] = "output.spectra is false"
    if (small := _small(scene)) is not None:
        reasons["nonlinear"] = small
    if "stretches" not in reasons and (idle := _no_chance(scene)):
        reasons["stretches"] = idle
    if "accuracy" not in reasons and not scene.accuracy.estimate:
        reasons["accuracy"] = "accuracy.estimate is false"
    if not scene.output.vibration:
        reasons["vibration"] = "output.vibration is false"
    if scene.sound is None:
        reasons["radiation"] = reasons["sound"] = "no [sound]"
    elif scene.time is None or not (scene.force or scene.in_contact):
        reasons["sound"] = "no [time] with [contact] or a [[force]]"
    if not scene.output.fields:
        reasons["motion"] = "output.fields is false"
    if until is not None:
        for stage in STAGES[STAGES.index(until) + 1 :]:
            reasons.setdefault(stage, f"--until {until}")
    return reasons


def meets_road(until: str | None) -> bool:
    """Whether a stage that reads the road's heights is within a run that ends with stage `until`.

    The contact points, which are chosen with the Green's functions, reach as high as the road.
    """
    return until is None or STAGES.index(until) >= STAGES.index("greens")


def _no_chance(scene: Scene) -> str | None:
    """Why no further stretches of road are rolled over; None if there are."""
    if scene.accuracy.chance_db is None:
        return "no accuracy.chance_db"
    if not scene.output.spectra:
        return "output.spectra is false"
    if not scene.road.surface.sampled:
        return f'road.kind = "{scene.road.kind}" is a shape, whose levels are not by chance'
    return None


def _small(scene: Scene) -> str | None:
    """Why the motion of the tire stays linear; None if it does not, or if its road will tell."""
    if not scene.in_contact:
        return _no_contact(scene)
    if scene.motion.kind == "linear":
        return 'motion.kind is "linear"'
    reason = next(confined(scene), None) if scene.motion.kind == "auto" else None
    return (
        f'motion.kind = "auto" takes a linear tire: {".".join(reason[0])} {reason[1]}'
        if reason
        else None
    )


def _no_contact(scene: Scene) -> str:
    """Why the contact is not followed in time."""
    if scene.contact is None:
        return "no [contact]"
    return "no [time]" if scene.time is None else "no road in [static]: it has no load (N)"


def _no_response(scene: Scene) -> str | None:
    """Why there is no response to the prescribed forces; None if there is one."""
    if not scene.force:
        of_contact = any(kind.of == "contact" for _, kind in scene.output.kinds)
        return None if of_contact and scene.in_contact else "no [[force]]"
    in_frequency = any(fields(kind) for _, kind in scene.output.kinds)
    if scene.time is None and not in_frequency:
        return "no [time], and no output.receptance"
    return None
