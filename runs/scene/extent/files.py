"""Size of a run's files, estimated before anything is computed."""

from tireroad.runs.scene.extent.sizes import Sizes, highest_frequency
from tireroad.runs.scene.tables.scene import Scene

PACKED = 0.3
"""Size of contact.h5 relative to its raw numbers: most forces are 0 (measured: 0.24 on stones, 0.29
on texture)."""
REPORT = 1.6e6
"""Bytes of report.html and the text files: 0.9 to 2.1 MB in twenty runs (2026-11-25)."""
HEADER = 3e4
"""Bytes of a file's scene, settings and empty datasets."""
INSTANTS = 400
"""Instants of the outer face in motion.h5 at most (runs.stages.motion)."""
SHAPES = 2e8
"""Bytes of the outer face's spectra in vibration.h5 at most (runs.stages.vibration)."""


def disk(scene: Scene, size: Sizes, left_out: dict[str, str]) -> dict[str, float]:
    """Peak bytes of the result folder by file, without stages that are `left_out`."""
    parts = {"static.h5": HEADER + 40.0 * size.free}
    if "modes" not in left_out:
        every = face(scene, size) + 5 * size.coordinates
        parts["modes.h5"] = HEADER + 8.0 * size.coordinates * every
    if "rotating" not in left_out:
        branches = scene.rotation.campbell.branches if scene.rotation.campbell else 0
        parts["rotating.h5"] = (
            HEADER + 16.0 * 2 * size.coordinates**2 + 40.0 * size.speeds * branches
        )
    if "contact" not in left_out:
        # A checkpoint is a copy of contact.h5 so far.
        numbers = size.points * (3 + 2 * (scene.contact.rubs)) + 10
        parts["contact.h5"] = HEADER + 2 * PACKED * 8.0 * size.steps * numbers
        parts["greens.h5"] = HEADER + 16.0 * 2 * size.nodes * (2 * size.coordinates + size.nodes)
    if "response" not in left_out:
        k = max(size.driven, 1)
        more = sum(kind.numbers(k) for _, kind in scene.output.kinds)
        series = size.steps * (4 * k + 3 + more)
        parts["response.h5"] = 8.0 * (series + 2 * size.frequencies * k * k)
    if "report" not in left_out:
        parts["report.html"] = REPORT
    return parts | _in_frequency(scene, size, left_out)


def face(scene: Scene, size: Sizes) -> float:
    """Unknowns of the outer face, one layer of nodes."""
    return size.free / (scene.tire.proportions().through * scene.tire.order + 1)


def _in_frequency(scene: Scene, size: Sizes, left_out: dict[str, str]) -> dict[str, float]:
    """Files of lines up to half the highest mode, one in each 1 / duration."""
    if scene.time is None:
        return {}
    parts, outer = {}, face(scene, size)
    lines = 0.5 * highest_frequency(scene, size.modes) * scene.time.duration
    if "spectra" not in left_out:
        parts["spectra.h5"] = HEADER + 8.0 * (1 + 6 * 3) * lines
    if "vibration" not in left_out:
        parts["vibration.h5"] = HEADER + min(16.0 * lines * outer, SHAPES)
    if "motion" not in left_out:
        # Eight instants a period of the highest line, the last ones of the run.
        parts["motion.h5"] = HEADER + 4.0 * min(8 * lines, INSTANTS) * outer
    return parts
