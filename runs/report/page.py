"""report.html: one self-contained page about a result folder."""

import json
import tomllib
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from tireroad.fem.errors import InputError
from tireroad.runs.files import present
from tireroad.runs.files.checksum import is_as_signed, is_table_as_signed
from tireroad.runs.files.disk import write_text
from tireroad.runs.files.read import Absent, Results, Section
from tireroad.runs.report import live
from tireroad.runs.report.answer import answer
from tireroad.runs.report.quantities import quantity
from tireroad.runs.report.realism import unusual
from tireroad.runs.report.sections import (
    forces,
    rotating,
    spectra,
    stiffness,
    tire,
    vibration,
)
from tireroad.runs.report.verdicts import verdicts
from tireroad.runs.scene.plan import STAGES
from tireroad.runs.scene.schema import key_of, table_of
from tireroad.runs.scene.tables.scene import Scene
from tireroad.runs.scene.walk import every_field
from tireroad.runs.version import PROGRAM

SECTIONS: Mapping[str, Callable[[Results], Section]] = {
    "static.h5": tire.static,
    "contact.h5": forces.contact,
    "spectra.h5": spectra.spectra,
    "vibration.h5": vibration.vibration,
    "response.h5": forces.response,
    "stiffness.h5": stiffness.section,
    "modes.h5": tire.modes,
    "rotating.h5": rotating.rotating,
}


def write_report(directory: Path) -> Path:
    """Write directory/report.html from the existing result files; returns its path.

    The page needs no network and no other file. A missing or damaged file drops its section, and
    the page says so. It is written to a temporary name and renamed. Not collective: call it on one
    process. Raises InputError if the folder holds no results or cannot be written to.
    """
    if not directory.is_dir():
        raise InputError(f"{directory} is no folder: give the result folder of a run")
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
    ended = [("run", text)] if (text := present.ending(summary)) else []
    judged = verdicts(summary.get("stages_known", {}))
    sections, left_out, provenance = build_sections(directory, scene, stages, problems)
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
    loader = FileSystemLoader(Path(__file__).parent / "pages")
    pages = Environment(loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True)
    pages.filters |= {"quantity": quantity, "in_script": in_script}
    return pages.get_template("report.html.j2").render(
        name=summary.get("scene") or scene.get("name") or directory.resolve().name,
        program={"name": PROGRAM, "version": ""} | summary.get("program", {}),
        processes=summary.get("processes"),
        computed=computed(directory),
        too_short=short,
        answer=facts,
        script=live.script(),
        style=live.style(),
        warnings=ended + [("report", problem) for problem in problems] + remarked,
        stages=stages,
        judged=judged,
        costs=costs(stages),
        parameters=parameters(scene),
        provenance=provenance,
        sections=sections,
        left_out=left_out,
        scene_text=scene_text,
    )


def too_short(results: Results) -> str:
    """What the spectra say of a run without its low third octaves, for the head of the page."""
    try:
        return str(results.attribute("spectra.h5", "too_short") or "")
    except (Absent, InputError):
        return ""


def remarks(directory: Path) -> str | None:
    """Figures of a run that no real tire has (runs.report.realism); None if all are usual."""
    with Results(directory, read_scene(directory / "scene.toml", [])[1]) as results:
        return unusual(results)


def in_script(given: Mapping) -> str:
    """JSON that is safe inside a <script> element."""
    return json.dumps(given, separators=(",", ":")).replace("<", "\\u003c")


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
    names = {*SECTIONS, "summary.json", "scene.toml"} - present.left_out(directory).keys()
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


def parameters(scene: Mapping) -> list[tuple[str, list[tuple[str, str]]]]:
    """The scene's tables as (title, [(key, value with unit)]), sub-tables listed separately."""
    found: list[tuple[str, list[tuple[str, str]]]] = []

    def visit(title: str, table: Mapping, kind: type | None) -> None:
        known = every_field(kind) if kind else {}
        rows: list[tuple[str, str]] = []
        if title:
            found.append((title, rows))
        for name, value in table.items():
            part = table_of(known[name]) if name in known else None
            below, path = part.of if part else None, f"{title}.{name}" if title else name
            if isinstance(value, dict):
                visit(path, value, below)
            elif isinstance(value, list) and value and isinstance(value[0], dict):
                for number, one in enumerate(value):
                    visit(f"{path} {number + 1}", one, below)
            else:
                key = key_of(known[name]) if name in known else None
                rows.append((name.replace("_", " "), quantity(value, key.unit if key else "")))

    visit("", scene, Scene)
    return [(title, rows) for title, rows in found if rows]
