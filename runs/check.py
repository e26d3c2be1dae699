"""`tireroad check`: the resolved scene, its stages and its memory; no solver runs."""

from pathlib import Path
from typing import Any

from tireroad.runs.files.names import STAGES
from tireroad.runs.process.demand import check_demand, out_of_core
from tireroad.runs.process.surroundings import crowded
from tireroad.runs.scene import files
from tireroad.runs.scene.estimate import duration, estimate, memory_of
from tireroad.runs.scene.plan import meets_road, skipped
from tireroad.runs.scene.resolved import literal
from tireroad.runs.scene.rules import check_road, remarks
from tireroad.runs.scene.schema import applies, entries, key_of, table_of
from tireroad.runs.scene.tables.scene import Scene
from tireroad.runs.search.settings import Ladders, applied, bounds

Row = tuple[str, str, str, str, str]
HEAD: Row = ("key", "value", "unit", "range", "meaning")


def _rows(holder: Any, path: str, title: str) -> list[tuple[str, list[Row]]]:
    """One (title, rows) per table, in the order of the scene."""
    own: list[Row] = []
    below: list[tuple[str, list[Row]]] = []
    for owner, item in entries(holder):
        value = getattr(owner, item.name)
        part = table_of(item)
        inner = f"{path}.{item.name}" if path else item.name
        if part is None:
            key = key_of(item)
            if applies(key, owner):
                shown = "absent" if value is None else literal(value)
                own.append((item.name, shown, key.unit, key.allowed, key.doc))
        elif part.many:
            for number, one in enumerate(value):
                below += _rows(one, f"{inner}.{number}", f"[[{inner}]] {number}: {part.doc}")
        elif value is None:
            below.append((f"[{inner}] absent: {part.doc}", []))
        else:
            below += _rows(value, inner, f"[{inner}] {part.doc}")
    return [(title, own), *below]


def _aligned(rows: list[Row], widths: list[int]) -> list[str]:
    return [
        "  "
        + "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in rows
    ]


def explain(scene: Scene, processes: int = 1, until: str | None = None) -> str:
    """The text of `check` for so many processes, and a run that ends with stage `until`.

    Raises InputError for an unusable road, if the run meets it."""
    on_road = meets_road(until)
    if on_road:
        check_road(scene)
    groups = _rows(scene, "", "scene")
    everything = [HEAD, *(row for _, rows in groups for row in rows)]
    widths = [min(max(len(row[column]) for row in everything), 44) for column in range(len(HEAD))]
    lines = _aligned([HEAD], widths)
    for title, rows in groups:
        lines += ["", title, *_aligned(rows, widths)]
    reasons = skipped(scene, until)
    lines += ["", "stages"]
    for stage in STAGES:
        lines.append(
            f"  {stage:10}" + (f"skipped: {reasons[stage]}" if stage in reasons else "runs")
        )
    described = [*scene.tire.shape.described(scene.tire), *(remarks(scene) if on_road else [])]
    lines += ["", *described] if described else []
    read = files.table(files.read_of(scene, until))
    lines += ["", *read] if read else []
    if scene.accuracy.searches:
        lines += ["", *bounds(scene)]
        scene = applied(scene, Ladders.of(scene).first())
    return "\n".join([*lines, *_demand(scene, processes, until)])


def _demand(scene: Scene, processes: int, until: str | None) -> list[str]:
    """Memory, disk and time, with warnings where the machine falls short.

    Raises InputError if it has far too little.
    """
    demand = estimate(scene, until)
    on_disk = out_of_core(demand, processes)
    size, parts = demand.sizes, memory_of(demand, processes, on_disk)
    counts = [f"{size.free} unknowns not held by the rim"]
    if scene.modal is not None:
        counts.append(f"{size.modes} modes")
    if scene.in_contact and meets_road(until):
        counts.append(f"about {size.points} contact points")
    if scene.time is not None and meets_road(until):
        about = "about " if scene.time.step == "auto" else ""
        counts.append(f"{about}{size.steps} time steps")
    if size.frequencies:
        counts.append(f"{size.frequencies} frequencies")
    if size.speeds:
        counts.append(f"{size.speeds} speeds")
    lines = [
        "",
        f"estimated sizes   {', '.join(counts)}",
        f"estimated time    {duration(sum(demand.seconds.values()))} of one core",
        f"estimated disk    {sum(demand.disk.values()) / 1e9:.2g} GB",
        f"estimated memory  {sum(parts.values()) / processes / 1e9:.2f} GB in {_each(processes)}"
        + (", factors on disk" if on_disk else ""),
        *(f"  {name:26}{part / processes / 1e9:6.2f} GB" for name, part in parts.items()),
    ]
    warnings = [*check_demand(demand, Path.cwd(), processes), *crowded(processes)]
    return lines + [f"warning: {text}" for text in warnings]


def _each(processes: int) -> str:
    return "one process" if processes == 1 else f"each of {processes} processes"
