"""Names in a result folder: of its stages, in order, of its scene, and the mark of a resolved scene."""

import re

from tireroad.runs.version import PROGRAM, RESULT_FORMAT, VERSION

STAGES = (
    "static",
    "radiation",
    "stiffness",
    "modes",
    "rotating",
    "greens",
    "nonlinear",
    "contact",
    "accuracy",
    "stretches",
    "response",
    "spectra",
    "vibration",
    "sound",
    "motion",
    "report",
)
MARK = f"# {PROGRAM} "
HEADER = f"{MARK}{VERSION}, format {RESULT_FORMAT}: the resolved scene, every default written back"


def scene_name(text: str) -> str:
    """The name of a scene made of a file's or folder's: letters, digits, dots and dashes."""
    return re.sub(r"[^A-Za-z0-9._-]", "-", text).lstrip(".-") or "scene"
