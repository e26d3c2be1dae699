"""Which stages a scene needs, and why the others are skipped."""

from tireroad.runs.scene.tables.scene import Scene

STAGES = (
    "static",
    "stiffness",
    "modes",
    "rotating",
    "greens",
    "contact",
    "accuracy",
    "response",
    "spectra",
    "vibration",
    "motion",
    "report",
)


def skipped(scene: Scene, until: str | None = None) -> dict[str, str]:
    """The stages that will not run, each with its reason."""
    reasons: dict[str, str] = {}
    if scene.stiffness is None:
        reasons["stiffness"] = "no [stiffness]"
    if scene.rotation is None:
        reasons["rotating"] = "no [rotation]: the wheel stands"
    elif scene.rotation.speed == 0:
        reasons["rotating"] = "rotation.speed is 0: the wheel stands"
    if not scene.force and not any(kind.of == "contact" for _, kind in scene.output.kinds):
        reasons["response"] = "no [[force]]"
    if scene.contact is None:
        reasons["contact"] = "no [contact]"
        reasons["accuracy"] = reasons["spectra"] = "no [contact], hence no contact forces"
        if not scene.force:
            reasons["greens"] = "neither [[force]] nor [contact]"
    elif not scene.output.spectra:
        reasons["spectra"] = "output.spectra is false"
    if "accuracy" not in reasons and not scene.accuracy.estimate:
        reasons["accuracy"] = "accuracy.estimate is false"
    if not scene.output.vibration:
        reasons["vibration"] = "output.vibration is false"
    if not scene.output.fields:
        reasons["motion"] = "output.fields is false"
    if until is not None:
        for stage in STAGES[STAGES.index(until) + 1 :]:
            reasons.setdefault(stage, f"--until {until}")
    return reasons
