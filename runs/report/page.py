"""report.html: one self-contained page about a result folder, with a summary on top."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from tireroad.contact.results.spectra import SILENT, deviation
from tireroad.fem.errors import InputError
from tireroad.runs.files import folder
from tireroad.runs.files.disk import is_as_signed, is_table_as_signed, write_text
from tireroad.runs.files.names import STAGES
from tireroad.runs.report import live
from tireroad.runs.report.kit import page_of
from tireroad.runs.report.ratings import FAIR, GOOD, POOR, verdict
from tireroad.runs.report.read import (
    Absent,
    Results,
    Section,
    TextTable,
    about,
    bounded,
    digits,
    quantity,
)
from tireroad.runs.report.realism import unusual
from tireroad.runs.report.scene_keys import scene_keys
from tireroad.runs.report.sections import forces, modes, sound, spectra, tire
from tireroad.runs.report.sections.speeds import speeds
from tireroad.runs.results.datasets import ABSENT
from tireroad.runs.scene.files import HEAD
from tireroad.runs.scene.parts import Listing, listed
from tireroad.runs.version import PROGRAM

Fact = tuple[str, str]
_MODES = 4
_HEARD = 3  # microphones among the first figures
_SPREAD = "error of the deviation of the"
Indicator = Callable[[str, str], float | None]
_KNOWN = 0.9  # least part of a total that lies in bands of known error

SECTIONS: Mapping[str, Callable[[Results], Section]] = {
    "static.h5": tire.static,
    "contact.h5": forces.contact,
    "spectra.h5": spectra.spectra,
    "sound.h5": sound.sound,
    "vibration.h5": modes.vibration,
    "response.h5": forces.response,
    "stiffness.h5": tire.stiffness,
    "modes.h5": tire.modes,
    "rotating.h5": modes.rotating,
}


def answer(results: Results, stages: Mapping[str, Any]) -> list[Fact]:
    """Facts (what, value) from the result files and the summary's `stages`, as far as available."""
    facts: list[Fact] = []
    for part in (_heard, _standing, _rolling, _levels, _modes):
        try:
            facts += part(results, _Headlines(stages))
        except (Absent, InputError, LookupError, ValueError):
            continue  # the file's own section reports the problem
    return facts


class _Headlines:
    """Headline figures and indicators of the summary, by stage and name."""

    def __init__(self, stages: Mapping[str, Any]) -> None:
        self._stages = stages

    def __call__(self, stage: str, name: str) -> float | None:
        groups = [
            self._stages.get(stage, {}).get(kind) or {} for kind in ("headline", "indicators")
        ]
        value = (groups[0].get(name) or groups[1].get(name) or {}).get("value")
        return float(value) if isinstance(value, int | float) else None


def _standing(results: Results, indicator: Indicator) -> list[Fact]:
    """Load, deflection and footprint."""
    load, sunk, length, width = (
        float(results.attribute("static.h5", name) or 0.0)
        for name in ("load", "deflection", "footprint_length", "footprint_width")
    )
    facts: list[Fact] = []
    if load and results.optional("static.h5", "contact/force") is not None:
        error = indicator("static", "estimated error of the load")
        known = f" ± {quantity(float(f'{error:.2g}'), '%')}" if error else ", error unknown"
        facts.append(("load at rest", quantity(load, "N") + known))
        facts.append(("deflection", quantity(sunk, "m")))
    if length and width:
        facts.append(("footprint at rest", f"{digits(1e3 * length)} × {digits(1e3 * width)} mm"))
    return facts


def _rolling(results: Results, indicator: Indicator) -> list[Fact]:
    """The vertical contact force while rolling, after the run-in as in the spectra.

    Errors are estimated on part of that time: that of the deviation as a share of it there.
    """
    step = float(results.attribute("contact.h5", "step") or 1.0)
    start = round((_of_spectra(results, "left_out") or 0.0) / step)
    force = results.array("contact.h5", "total_force")[start:, 2]
    if not len(force):
        return []
    end = _of_spectra(results, "limit")
    varies = float(deviation(force[:, None], step, float(end or np.inf))[0])
    error, spread = (
        indicator("accuracy", f"{what} contact force") for what in ("error of the mean", _SPREAD)
    )
    there = indicator("accuracy", "deviation of the contact force in the window of the error bars")
    off = spread / there * varies if spread and there else spread
    part = _partly(results)
    after = f" from {quantity(start * step, 's')} on" if start else ""
    what = "its standard deviation" + (f" to {quantity(end, 'Hz')}" if end else "")
    return [
        (
            f"vertical contact force, rolling (mean{after})",
            bounded(float(force.mean()), error, "N") + (part if error else ", error unknown"),
        ),
        (what, bounded(varies, off, "N") + (part if off else ", error unknown")),
        *_large(indicator),
    ]


def _large(indicator: Indicator) -> list[Fact]:
    """Whether motions were large, and what the road feels of what their training leaves out."""
    share = indicator("contact", "force left out by the nonlinear training")
    if share is None:
        return []
    told = f"large; the nonlinear training leaves out {digits(share)} % of what the road's force has changed by"
    return [("motion of the tire", told)]


def _of_spectra(results: Results, name: str) -> Any:
    """`limit` of the model (Hz) or `left_out` (s) as run-in; None in a run without spectra."""
    try:
        return results.attribute("spectra.h5", name)
    except Absent:
        return None


def _levels(results: Results, indicator: Indicator) -> list[Fact]:
    """Levels of the vertical forces over all lines up to the frequency limit, and their errors."""
    end = results.attribute("spectra.h5", "limit")
    levels = []
    held = str(results.attribute("spectra.h5", "axle_force_is") or "")
    axle = "hub force" if held.startswith("force on the hub") else "blocked axle force"
    upto = f", to {quantity(end, 'Hz')}" if end else ""
    for key, what, name in (
        ("level", axle, "force on the axle"),
        ("contact_level", "contact force", "contact force"),
    ):
        level = results.optional("spectra.h5", f"third_octave/{key}")
        total = indicator("spectra", f"level of the vertical {name}")
        if total is not None:
            error = results.optional("spectra.h5", f"third_octave/{key}_error")
            off = _error_of(total, level, error)
            part = _partly(results) if np.isfinite(off) else ""
            text = f"{total:.1f} dB re 1 N, error {about(off)}{part}"
            weighted = indicator("spectra", f"A-weighted level of the vertical {name}")
            text += f"; {weighted:.1f} dB(A) re 1 N" if weighted is not None else ""
            levels.append((f"{what} z{upto}", text.replace("-", "−")))
        elif level is not None and level[:, 2].max(initial=-np.inf) <= SILENT:
            levels.append((f"{what} z", "constant: no level"))
    return [*levels, ("valid up to", quantity(end, "Hz"))] if end else levels


def _error_of(total: float, level: np.ndarray | None, error: np.ndarray | None) -> float:
    """Upper bound (dB) of the error of a vertical total, by those of the bands; NaN where too little is known."""
    if level is None or error is None:
        return np.nan
    power, off = 10 ** (level[:, 2] / 10), error[:, 2]
    known = np.isfinite(off)
    held = power[known].sum()
    if held < _KNOWN * 10 ** (total / 10):
        return np.nan
    return float((power * off)[known].sum() / held)


def _partly(results: Results) -> str:
    """The causes that the error bars leave out: ", without that by the points"; empty if none."""
    try:
        attributes = results.file("accuracy.h5").attrs
    except (Absent, InputError):
        return ""
    causes = sorted(key.removeprefix(ABSENT) for key in attributes if key.startswith(ABSENT))
    return f", without that by the {' and the '.join(causes)}" if causes else ""


def _heard(results: Results, indicator: Indicator) -> list[Fact]:
    """A-weighted levels at the microphones, in the band of the run."""
    names = results.dataset("sound.h5", "microphones").attrs["names"]
    level = results.array("sound.h5", "total/level_a")
    error = results.optional("sound.h5", "total/level_a_error")
    error = np.full_like(level, np.nan) if error is None else error
    part = _partly(results)
    top = float(results.array("sound.h5", "frequency")[-1])
    return [
        (
            f"A-weighted sound pressure level at {name}, to {quantity(top, 'Hz')}",
            f"{value:.1f} dB(A) re 20 µPa, error {about(off)}{part if np.isfinite(off) else ''}",
        )
        for name, value, off in list(zip(names, level, error, strict=True))[:_HEARD]
    ]


def _modes(results: Results, _: Indicator) -> list[Fact]:
    """The lowest undamped modes of the non-rotating tire."""
    lowest = results.array("modes.h5", "frequency")[:_MODES]
    name = results.optional("modes.h5", "name")
    names = [""] * len(lowest) if name is None else [f"{mode} " for mode in name[:_MODES]]
    told = ", ".join(f"{mode}{value:.4g} Hz" for mode, value in zip(names, lowest, strict=True))
    return [("lowest modes, undamped", told)] if len(lowest) else []


def verdicts(stages: Mapping[str, Mapping[str, Any]]) -> list[tuple[str, str, Any, str, str]]:
    """(stage, indicator, value, unit, verdict) of every indicator in a summary; poor ones first."""
    rows = [
        (stage, name, entry["value"], entry.get("unit", ""), verdict(stage, name, entry["value"]))
        for stage, found in stages.items()
        for name, entry in (found.get("indicators") or {}).items()
    ]
    order = {POOR: 0, FAIR: 1, GOOD: 2, "": 3}
    return sorted(rows, key=lambda row: order[row[4]])


def write_report(directory: Path) -> Path:
    """Write directory/report.html from the existing result files; returns its path.

    The page needs no network and no other file. A missing or damaged file drops its section, and
    the page says so. It is written to a temporary name and renamed. Not collective: call it on one
    process. Raises InputError if the folder holds no results or cannot be written to.
    """
    if not directory.is_dir():
        raise InputError(f"{directory} is not a folder: give the result folder of a run")
    if not any((directory / name).is_file() for name in (*SECTIONS, "summary.json", "scene.toml")):
        raise InputError(
            f"{directory} holds no results (no summary.json, scene.toml or *.h5 of a run): "
            "give the result folder of a run"
        )
    target = directory / "report.html"
    write_text(target, render(directory))
    return target


def render(directory: Path) -> str:
    """The page as text."""
    problems: list[str] = []
    summary = read_summary(directory / "summary.json", problems)
    scene_text, scene = read_scene(directory / "scene.toml", problems)
    stages = summary.get("stages", {})
    ended = [("run", text)] if (text := folder.ending(summary)) else []
    judged = verdicts(summary.get("stages_known", {}))
    known = summary.get("stages_known", {})
    sections, left_out, provenance = build_sections(directory, scene, known, problems)
    with Results(directory, scene) as results:
        facts, strange = answer(results, summary.get("stages_known", {})), unusual(results)
        short = too_short(results)
    remarked = [("realism", strange)] if strange else []
    remarked += [
        (name, warning)
        for name, stage in stages.items()
        for warning in stage["warnings"]
        if warning != short
    ]
    remarked += [(section.title, warning) for section in sections for warning in section.warnings]
    tables = [*files_read(summary), *built_of(scene)]
    program = {"name": PROGRAM, "version": ""} | summary.get("program", {})
    return page_of(
        "report",
        summary.get("scene") or scene.get("name") or directory.resolve().name,
        filters={"in_script": in_script},
        program=f"{program['name']} {program['version']}",
        processes=summary.get("processes"),
        computed=computed(directory),
        too_short=short,
        answer=facts,
        script=live.script(),
        uplot=live.style(),
        warnings=ended + [("report", problem) for problem in problems] + remarked,
        stages=stages,
        judged=judged,
        costs=costs(stages),
        parameters=parameters(scene),
        built_of=[(title, TextTable(head, rows)) for title, head, rows in tables],
        provenance=provenance,
        sections=sections,
        left_out=left_out,
        scene_text=scene_text,
    )


def too_short(results: Results) -> str:
    """The remark of the spectra on a run without its low third octaves, for the head of the page."""
    try:
        return str(results.attribute("spectra.h5", "too_short") or "")
    except (Absent, InputError):
        return ""


def remarks(directory: Path) -> str | None:
    """Figures of a run that no real tire has (runs.report.realism); None if all are usual."""
    with Results(directory, read_scene(directory / "scene.toml", [])[1]) as results:
        return unusual(results)


def in_script(data: Mapping) -> str:
    """JSON that is safe inside a <script> element."""
    return json.dumps(data, separators=(",", ":")).replace("<", "\\u003c")


def read_summary(path: Path, problems: list[str]) -> dict:
    """summary.json with missing keys of stages filled in and stages in order; {} if unreadable."""
    if not path.is_file():
        problems.append(
            "There is no summary.json: times, warnings and error indicators are unknown."
        )
        return {}
    try:
        summary = json.loads(path.read_text(encoding="utf-8"))
        if not is_table_as_signed(summary):
            problems.append("summary.json is not what the run wrote (checksum) and is left out.")
            return {}
        stages = summary.get("stages", {})
        summary["stages_known"] = stages
        known = sorted(stages, key=lambda name: (*STAGES, name).index(name))
        summary["stages"] = {name: whole_stage(stages[name]) for name in known}
    except (ValueError, AttributeError, TypeError, KeyError) as error:
        problems.append(f"summary.json cannot be read ({error}).")
        return {}
    return summary


def whole_stage(stage: Mapping) -> dict:
    return {
        "status": str(stage.get("status", "computed")),
        "reason": str(stage.get("reason") or ""),
        "seconds": float(stage.get("seconds") or 0.0),
        "headline": quantities(stage.get("headline") or {}),
        "warnings": [str(warning) for warning in stage.get("warnings") or []],
        "cost": {key: float(value) for key, value in (stage.get("cost") or {}).items()},
    }


def quantities(named: Mapping) -> dict[str, str]:
    """{name: {"value": v, "unit": u}} as {name: text}."""
    return {key: quantity(entry["value"], entry.get("unit", "")) for key, entry in named.items()}


def read_scene(path: Path, problems: list[str]) -> tuple[str, dict]:
    """The resolved scene as text and as tables; both empty if it is unreadable."""
    if not path.is_file():
        problems.append("There is no scene.toml: the settings of this run are unknown.")
        return "", {}
    try:
        text = path.read_text(encoding="utf-8")
        if not is_as_signed(text):
            problems.append("scene.toml is not what the run wrote (checksum).")
        return text, tomllib.loads(text)
    except ValueError as error:  # also covers UnicodeDecodeError and TOMLDecodeError
        problems.append(f"scene.toml cannot be read ({error}).")
        return "", {}


def build_sections(
    directory: Path, scene: Mapping, stages: Mapping, problems: list[str]
) -> tuple[list[Section], list[tuple[str, str]], list[tuple[str, str]]]:
    """Sections of the existing files; those left out and why; provenance of the first file."""
    sections: list[Section] = []
    left_out: list[tuple[str, str]] = []
    provenance: list[tuple[str, str]] = []
    with Results(directory, scene) as results:
        for name, build in SECTIONS.items():
            try:
                sections.append(build(results))
                provenance = provenance or short_attributes(results, name)
                if name == "rotating.h5" and (ends := speeds(results, stages)) is not None:
                    sections.append(ends)
            except Absent as absence:
                skipped = stages.get(name.removesuffix(".h5"), {}).get("reason")
                reason = results.left_out.get(name) or skipped or str(absence)
                left_out.append((name, reason))
            except InputError as error:
                problems.append(f"{name} is damaged and left out: {error}")
                left_out.append((name, "the file is damaged"))
    return sections, left_out, provenance


def short_attributes(results: Results, name: str) -> list[tuple[str, str]]:
    """Single-line text attributes of the file: versions, hash; libraries listed in full."""
    values = ((key, results.attribute(name, key)) for key in results.file(name).attrs)
    lines = {key: v for key, v in values if isinstance(v, str) and "\n" not in v}
    lines.pop("scene_name", None)  # maybe another's, that shared the file
    if lines.get("libraries", "").startswith("{"):
        versions = json.loads(lines["libraries"])
        lines["libraries"] = ", ".join(f"{key} {version}" for key, version in versions.items())
    return [(key.replace("_", " "), value) for key, value in lines.items()]


def computed(directory: Path) -> str:
    """Time of the newest result, UTC."""
    names = {*SECTIONS, "summary.json", "scene.toml"} - folder.left_out(directory).keys()
    files = [directory / name for name in names]
    newest = max(file.stat().st_mtime for file in files if file.is_file())
    return datetime.fromtimestamp(newest, UTC).strftime("%Y-%m-%d %H:%M UTC")


def costs(stages: Mapping) -> list[dict]:
    """Seconds of every stage that ran, its share of the slowest in percent, and its parts."""
    slowest = max((stage["seconds"] for stage in stages.values()), default=0.0) or 1.0
    rows = []
    for name, stage in stages.items():
        if stage["status"] == "skipped":
            continue
        parts = sorted(stage["cost"].items(), key=lambda part: -part[1])
        widths = [(key, seconds, 100.0 * seconds / slowest) for key, seconds in parts]
        rest = max(stage["seconds"] - sum(stage["cost"].values()), 0.0)
        rows.append({"name": name, "stage": stage, "parts": widths, "rest": 100.0 * rest / slowest})
    return rows


def files_read(summary: Mapping) -> list[Listing]:
    """Tables of what the run read of its files as what; none for a scene without files, and for a damaged table."""
    rows = summary.get("files") or []
    whole = isinstance(rows, list) and all(
        isinstance(row, list) and len(row) == len(HEAD) for row in rows
    )
    if not whole:
        return []
    return [("Files: what was read as what", HEAD, rows)] if rows else []


def built_of(scene: Mapping) -> list[Listing]:
    """Compounds and cords of a tire that has them all in its scene; empty for others, and for a damaged scene."""
    try:
        return listed(scene.get("tire", {}))
    except (InputError, KeyError, TypeError, ValueError):
        return []


def parameters(scene: Mapping) -> list[tuple[str, list[tuple[str, str]]]]:
    """The scene's tables as (title, [(key, value with unit)]), sub-tables listed separately.

    Without the compounds and cords that `built_of` lists.
    """
    if built_of(scene):
        tire = {k: v for k, v in scene["tire"].items() if k not in ("region", "cords")}
        scene = {**scene, "tire": tire}
    groups: dict[tuple, list[tuple[str, str]]] = {}
    for key in scene_keys(scene):
        rows = groups.setdefault(key.table, [])
        unit = "" if isinstance(key.value, str) else key.unit  # "auto" has none
        rows.append((key.name.replace("_", " "), quantity(key.value, unit)))
    return [(_title(table), rows) for table, rows in groups.items() if table]


def _title(table: tuple[str | int, ...]) -> str:
    """A table's name, such as tire.region 1."""
    text = ""
    for part in table:
        text += f" {part + 1}" if isinstance(part, int) else f".{part}" if text else part
    return text
