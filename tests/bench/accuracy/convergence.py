"""Convergence of a rolling tire's forces, and the error of the default settings.

Mesh, points, modes, step and residual are varied one at a time.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from tireroad.contact.results.error_bars import measured
from tireroad.contact.results.spectra import distance
from tireroad.fem.timing import by_processor
from tireroad.runs.files.cache import Cache
from tireroad.runs.files.store import identity
from tireroad.runs.process import console
from tireroad.runs.validation.tables import Table
from tireroad.tests.bench.accuracy.rough_road import TEXTURE, Mesh, Rolled, rolled
from tireroad.tests.bench.parts.kept import read_kept, write_kept

ABOUT = "contact and axle force over mesh, points, modes, step and residual, on three roads; and by default"
ROADS = {
    "smooth": 'kind = "sine"\namplitude = 2e-4\nwavelength = 0.15',
    "cleat": 'kind = "cleat"\nheight = 0.004\nlength = 0.02\nposition = 0.35',
    "rough": TEXTURE,
}
SPEED, DURATION = 50.0, 0.16  # rad/s, s
BANDS = (20.0, 1000.0)  # Hz
# dB below the strongest band: a sine has all its force in one band, and residues 50 dB below it in
# another are irrelevant.
WEAK = 30.0
# Elements far from the footprint must be fine too: modes of 36 x 14 elements with a footprint size
# of 0.1 are 1 % higher than those of the default mesh.
FINEST = {"segments": 34, "arc": 18, "order": 3, "footprint": 0.15}
BASE = {"modes": 500, "residual": "static", "pitch": 0.003, "step": 5e-5}
"""The converged run; single settings are made coarser, or finer to confirm convergence."""
DEFAULT = "default settings"
CHANGES: dict[str, tuple[dict, ...]] = {
    DEFAULT: ({},),
    "mesh": ({"segments": 22, "arc": 12}, {"segments": 42, "arc": 22}),
    # No divisor of the cleat's length: otherwise both its edges fall between points at the same
    # time, and errors add.
    "points": ({"pitch": 0.004}, {"pitch": 0.0021}),
    "modes": ({"modes": 250}, {"modes": 700}),
    "step": ({"step": 1e-4}, {"step": 2.5e-5}),
    "residual": ({"residual": "none"}, {"residual": "attachment"}),
}


@dataclass(frozen=True)
class Apart:
    """Distance of a run from the converged one.

    Relative L2 error of the varying part of the `history` up to the band's end, errors of `mean`
    and `deviation`, %; the largest difference of a third octave within `WEAK` of the strongest
    (`level`, dB, at `at`, Hz), and of `every` one, dB.
    """

    history: float
    mean: float
    deviation: float
    level: float
    at: float
    every: float


def apart(exact: Rolled, found: Rolled, force: str, duration: float) -> Apart:
    """Distance of a vertical force in two runs over one road, up to half the lower highest mode."""
    steps = [run.figure("contact", "step") for run in (exact, found)]
    top = 0.5 * min(run.figure("modes", "highest mode") for run in (exact, found))
    values = [run.forces[force][:, 2:] for run in (exact, found)]
    one, other = (measured(v, step, top) for v, step in zip(values, steps, strict=True))
    reference, varying = (v - v.mean(axis=0) for v in values)
    return Apart(
        100 * distance(reference, varying, duration, top).mean,
        100 * abs(float(other.mean[0] / one.mean[0]) - 1),
        100 * abs(float(other.deviation[0] / one.deviation[0]) - 1),
        *levels((one.centre, one.level[:, 0]), (other.centre, other.level[:, 0])),
    )


def levels(exact: tuple, found: tuple) -> tuple[float, float, float]:
    """Largest difference (dB) of common bands within BANDS; each run as (centres Hz, levels dB).

    Of those within `WEAK` of the strongest, with its frequency (Hz), and of all; NaN without common
    bands.
    """
    centre, level = (np.asarray(part) for part in exact)
    other = dict(zip(np.round(found[0], 6), found[1], strict=True))
    off = np.array([other.get(at, np.nan) for at in np.round(centre, 6)]) - level
    known = np.isfinite(off) & (centre >= BANDS[0]) & (centre <= BANDS[1])
    if not known.any():
        return np.nan, np.nan, np.nan
    strong = known & (level >= level[known].max() - WEAK)
    size = np.abs(off)
    worst = np.argmax(np.where(strong, size, -1.0))
    return float(size[worst]), float(centre[worst]), float(size[known].max())


def run(kept: Path | None = None) -> list[Table]:
    """One table per road: errors one step coarser, and changes one step finer.

    Roads whose results are in the folder `kept` are not computed again. On one process.
    """
    with tempfile.TemporaryDirectory() as folder:
        return [_kept(Path(folder), road, kept or Path(folder) / "kept") for road in ROADS]


def _kept(folder: Path, road: str, kept: Path) -> Table:
    file = kept / "convergence" / f"{road}.json"
    of = [identity("contact").code, FINEST, BASE, CHANGES, ROADS[road], SPEED, DURATION]
    known = read_kept(file, of)
    if known is None:
        known = [asdict(table(folder, road, FINEST, BASE, CHANGES))]
        write_kept(file, of, known)
    return Table(**known[0])


def table(folder: Path, road: str, finest: dict, base: dict, changes: dict) -> Table:
    """The table of one road: `finest` mesh and `base` keys of the converged run, and `changes`."""
    console.say(f"  {road}: the converged run ...")
    exact = _rolled(folder, road, finest, base, {})
    rows: list[list] = [["converged", "", "", *[""] * 6, exact.cost]]
    for what, changed in _each(changes):
        console.say(f"  {road}: {what} {_named(changed)}")
        plain = what == DEFAULT
        mesh, keys = (dict.fromkeys(own) if plain else own for own in (finest, base))
        found = _rolled(folder, road, mesh, keys, changed)
        for force in ("total_force", "axle_force"):
            off = apart(exact, found, force, DURATION)
            name = "contact" if force == "total_force" else "axle"
            rows.append([what, _named(changed), name, *vars(off).values(), found.cost])
    return Table(
        f"Convergence of rolling on a {road} road",
        [
            ("what", ""),
            ("value", ""),
            ("force", ""),
            ("history", "%"),
            ("mean", "%"),
            ("deviation", "%"),
            ("largest of the third octaves", "dB"),
            ("at", "Hz"),
            ("weak ones too", "dB"),
            ("processor time of all stages", "s"),
        ],
        rows,
        [
            f"Soft torus at {SPEED:g} rad/s under 500 N, {DURATION:g} s. Against {_named(finest | base)}. Third "
            f"octaves between {BANDS[0]:g} and {BANDS[1]:g} Hz, below half the highest mode of both; weak: more than "
            f"{WEAK:g} dB below the strongest. {DEFAULT}: no key of mesh, modes, residual, points or step but the one "
            "named. What the converged run itself leaves: its rows of the finer mesh, more modes, closer points, half the step.",
        ],
    )


def _each(changes: dict) -> Iterator[tuple[str, dict]]:
    for what, choices in changes.items():
        for changed in choices:
            yield what, changed


def _named(keys: dict) -> str:
    return ", ".join(
        f"{key} {value}" if isinstance(value, str) else f"{key} {value:g}"
        for key, value in keys.items()
    )


def _rolled(folder: Path, road: str, finest: dict, base: dict, changed: dict) -> Rolled:
    """A run with changed keys; common stages are shared between runs. Collective."""
    mesh = finest | {key: value for key, value in changed.items() if key in finest}
    keys = base | {key: value for key, value in changed.items() if key in base}
    name = "-".join(str(value) for value in (*mesh.values(), keys["modes"]))
    order = () if mesh["order"] is None else (f"tire.order={mesh['order']}",)
    sets = (*order, "static.error_estimate=false")
    given = Mesh(mesh["segments"], mesh["arc"], mesh["footprint"])
    keys |= {"speed": SPEED, "duration": DURATION, "road": ROADS[road]}
    with by_processor():
        return rolled(folder / name, given, *sets, cache=Cache(folder / "cache"), **keys)
