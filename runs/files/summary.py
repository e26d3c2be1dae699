"""`summary.json`: what each stage of the folder's scene has given, and what other scenes left there."""

import json
import math
from pathlib import Path
from typing import Any

from tireroad.runs.files.checksum import signed, signed_table, text_digest
from tireroad.runs.files.disk import write_text
from tireroad.runs.files.folder import earlier_summary
from tireroad.runs.files.present import has_result
from tireroad.runs.files.store import plain
from tireroad.runs.version import PROGRAM, RESULT_FORMAT, VERSION


class Summary:
    """`summary.json`: one entry per stage, rewritten completely after each. Root process only.

    The file of a stage is a result of the folder's scene only if `stages` says so
    (runs.files.present). Entries of a run of another scene, and of stages whose inputs have changed
    since, are moved to `earlier`: their files stay, so that a run that goes back to that scene
    finds them, with their figures. A run of the same scene begins with the entries it finds.
    """

    def __init__(
        self, directory: Path, scene_name: str, processes: int, scene_text: str = ""
    ) -> None:
        self.path = directory / "summary.json"
        self._scene = directory / "scene.toml", signed(scene_text)
        self._entered: set[str] = set()
        found = earlier_summary(directory) or {"stages": {}}
        self.data: dict[str, Any] = {
            "program": {"name": PROGRAM, "version": VERSION, "format": RESULT_FORMAT},
            "scene": scene_name,
            "resolved_scene": text_digest(scene_text),
            "processes": processes,
            "stages": found["stages"],
            "earlier": found.get("earlier", {}),
        }
        self._of_another = not self._is_scene()
        if self._of_another:
            self._set_aside()
        self.data["stages"].pop("report", None)  # it tells a finished run

    def begin(self) -> None:
        """Write scene.toml, after the summary if it has results of another scene to set aside."""
        if self._of_another and self.path.exists():
            self._write()
        write_text(*self._scene)

    def record(
        self,
        stage: str,
        status: str,
        *,
        reason: str = "",
        seconds: float = 0.0,
        input_hash: str = "",
        headline: dict[str, tuple[Any, str]] | None = None,
        indicators: dict[str, tuple[Any, str]] | None = None,
        warnings: list[str] | None = None,
        cost: dict[str, float] | None = None,
    ) -> None:
        """Enter a stage and write the file. Figures are given as name: (value, unit).

        A reused stage keeps the figures of the run that computed it. A skipped stage keeps its
        result of a run of the same scene: it is only this run that ends before it.
        """
        if status == "skipped" and has_result(self.data["stages"].get(stage)):
            return
        kept = self._known(stage, input_hash) if status == "reused" else {}
        self._displace(stage, status, input_hash)
        self.data["stages"][stage] = {
            "status": status,
            "reason": reason,
            "seconds": seconds,
            "input_hash": input_hash,
            "headline": _figures(headline) or kept.get("headline", {}),
            "indicators": _figures(indicators) or kept.get("indicators", {}),
            "warnings": warnings or kept.get("warnings", []),
            "cost": cost or kept.get("cost", {}),
        }
        self._write()

    def end(self, stage: str, reason: str) -> None:
        """Enter that the run ends in a stage, failed or stopped, for those that read the results."""
        self.data["ended"] = {"stage": stage, "reason": reason}
        self._write()

    def _is_scene(self) -> bool:
        """Whether the folder's scene.toml is that of this run."""
        path, text = self._scene
        try:
            return path.read_text(encoding="utf-8") == text
        except (OSError, UnicodeDecodeError):
            return False

    def _known(self, stage: str, input_hash: str) -> dict[str, Any]:
        """The entry of the file that a stage reuses, {} if there is none."""
        for group in (self.data["stages"], self.data["earlier"]):
            if stage in group and group[stage].get("input_hash", input_hash) == input_hash:
                return group[stage]
        return {}

    def _displace(self, stage: str, status: str, input_hash: str) -> None:
        """Set aside what the entry of a stage makes out of date: its own, and those after it."""
        before = self.data["stages"].get(stage, {})
        if before.get("input_hash", input_hash) != input_hash:
            self._set_aside()
        if status != "skipped":
            self.data["earlier"].pop(stage, None)
        self._entered.add(stage)

    def _set_aside(self) -> None:
        """Move the entries that this run has not made itself to `earlier`."""
        for stage in self.data["stages"].keys() - self._entered:
            entry = self.data["stages"].pop(stage)
            if has_result(entry) and stage != "report":
                self.data["earlier"][stage] = entry

    def _write(self) -> None:
        data = json.loads(json.dumps(_finite(self.data), default=plain))
        text = json.dumps(signed_table(data), indent=1, ensure_ascii=False)
        write_text(self.path, text + "\n")


def _figures(given: dict[str, tuple[Any, str]] | None) -> dict[str, Any]:
    return {name: {"value": value, "unit": unit} for name, (value, unit) in (given or {}).items()}


def _finite(value: Any) -> Any:
    """Replace infinities and NaN, which JSON does not have, by null."""
    if isinstance(value, dict):
        return {key: _finite(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(part) for part in value]
    if hasattr(value, "item") and getattr(value, "ndim", 1) == 0:
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value
