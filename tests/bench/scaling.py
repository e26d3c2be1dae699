"""Cost of each stage over its sizes and number of processes, and its lower bound."""

from __future__ import annotations

import json
import os
import tempfile
import time
from pathlib import Path

import numpy as np
from mpi4py import MPI
from threadpoolctl import threadpool_limits

from tireroad.contact.loop import Drive, roll
from tireroad.contact.solver.active_set import ActiveSet
from tireroad.contact.tread.compliance import half_space_compliance
from tireroad.greens.recursion import Recursion
from tireroad.runs.process import console
from tireroad.runs.validation.tables import Table
from tireroad.tests.bench.accuracy.rough_road import Mesh, prepared, write_scene
from tireroad.tests.bench.parts.floors import bandwidth, exponent, fastest, flop_rate
from tireroad.tests.bench.parts.launched import launched
from tireroad.tests.validation.cases import RollingStrip, oval_patch

ABOUT = "cost exponents over unknowns, modes, points, steps; processes; memory; floors"

MESHES = Mesh(16, 8, 0.4), Mesh(24, 10, 0.35), Mesh(32, 12, 0.3), Mesh(40, 14, 0.3)
STRONG = Mesh(32, 12, 0.3)
MODES = 150
SIZES = (8, 11, 16, 22, 32)  # points along and across
STATES = (100, 200, 400, 800)
STEPS = (500, 1000, 2000, 4000)


def run() -> list[Table]:
    """Stages over unknowns, the loop over its sizes, stages over processes, machine rates."""
    with tempfile.TemporaryDirectory() as folder:
        return [
            machine_rates(),
            unknowns(Path(folder), MESHES, MODES),
            loop(SIZES, STATES, STEPS),
            processes(Path(folder), STRONG, MODES, os.cpu_count() or 1),
        ]


def machine_rates() -> Table:
    rows = [
        ["memory bandwidth, triad", bandwidth() / 1e9, "GB/s"],
        ["dense product", flop_rate() / 1e9, "Gflop/s"],
    ]
    columns = [("rate", ""), ("measured", "-"), ("unit", "")]
    return Table("The machine's own rates, one process", columns, rows)


def unknowns(folder: Path, meshes: tuple[Mesh, ...], modes: int) -> Table:
    """Static state, modes and Green's functions over the unknowns, and one factorisation of K."""
    rows = []
    for mesh in meshes:
        console.say(f"  {mesh} elements ...")
        rows.append(_size(folder / str(mesh), mesh, modes))
    sizes = [row[0] for row in rows]
    named = {"factorisation": 1, "static state": 3, "modes": 5, "Green's functions": 7}
    slopes = {name: exponent(sizes, [row[k] for row in rows]) for name, k in named.items()}
    fits = ", ".join(f"{name} n^{slope:.2f}" for name, slope in slopes.items())
    columns = [
        ("unknowns", "-"),
        ("factorisation", "s"),
        ("of it at the dense rate", "%"),
        ("static state", "s"),
        ("a Newton step / factorisation", "-"),
        ("modes", "s"),
        ("a mode / pair of solves", "-"),
        ("Green's functions", "s"),
        ("largest memory", "GB"),
    ]
    notes = [
        f"Cost grows like {fits}, n the unknowns; {modes} modes. Floors: one factorisation of K by MUMPS, "
        "and how much of its time its own operations take at the dense rate of the machine; a step of "
        "Newton's method assembles, factorises once and solves; a mode takes solves with that factor.",
        "Memory: the largest of the process so far; it never falls.",
    ]
    plot = {
        "x": "unknowns",
        "y": ["factorisation", "static state", "modes", "Green's functions"],
        "log": "xy",
    }
    return Table("Finite elements and modes over unknowns", columns, rows, notes, plot)


def _size(folder: Path, mesh: Mesh, modes: int) -> list:
    from tireroad.fem.matrices.compliance import factorise, solve_columns

    operators = prepared(folder, mesh, modes=modes).run.motions.operators
    stages = json.loads((folder / "summary.json").read_text(encoding="utf-8"))["stages"]
    stiffness = operators.stiffness
    size = stiffness.getSize()[0]
    began = time.perf_counter()
    pc = factorise(stiffness)
    factorisation = time.perf_counter() - began
    flops = pc.getFactorMatrix().getMumpsRinfog(3)
    columns = np.random.default_rng(0).normal(size=(len(operators.mass), 32))
    solve = fastest(lambda: solve_columns(pc, stiffness, columns), 2) / 32
    pc.destroy()
    seconds = {name: entry["seconds"] for name, entry in stages.items()}
    newton = stages["static"]["indicators"]["Newton steps"]["value"]
    memory = max(
        entry["indicators"].get("largest memory of a process so far", {"value": 0.0})["value"]
        for entry in stages.values()
    )
    return [
        size,
        factorisation,
        100 * flops / flop_rate() / factorisation,
        seconds["static"],
        seconds["static"] / newton / factorisation,
        seconds["modes"],
        seconds["modes"] / modes / solve,
        seconds["greens"],
        memory,
    ]


@threadpool_limits.wrap(limits=1, user_api="blas")
def loop(sizes, states, steps) -> Table:
    """Steps of the contact loop over points, states and number, and one pass over memory."""
    rows = []
    middle, few = sizes[len(sizes) // 2], states[1]
    for size in sizes:
        rows.append(["points", size**2, *_steps(size, few, steps[0])])
    for count in states:
        rows.append(["states", count, *_steps(middle, count, steps[0])])
    for count in steps:
        rows.append(["steps", count, *_steps(middle, few, count)])
    fits = []
    for name in ("points", "states", "steps"):
        part = [row for row in rows if row[0] == name]
        cost = [row[6] if name == "steps" else row[5] for row in part]
        fits.append(f"{name}^{exponent([row[1] for row in part], cost):.2f}")
    columns = [
        ("varied", ""),
        ("size", "-"),
        ("points", "-"),
        ("states", "-"),
        ("steps", "-"),
        ("time a step", "us"),
        ("loop", "s"),
        ("one pass over the matrices", "us"),
        ("step / pass", "-"),
    ]
    notes = [
        f"Cost grows like {', '.join(fits)}; a wavy road, a tenth of the points or more touching. Floor: "
        "one product with each of the two matrices between points and states.",
    ]
    plot = {"x": "size", "y": ["time a step"], "log": "xy", "by": "varied"}
    return Table("The contact loop over points, states and steps", columns, rows, notes, plot)


def _steps(size: int, states: int, steps: int) -> list:
    """(points, states, steps, us per step, s in all, us per pass, ratio) for a synthetic tire."""
    step, speed = 1e-4, 20.0
    patch = oval_patch((size, size), (0.16 / size, 0.12 / size), 500.0)
    response = RollingStrip(speed=speed).response(patch.points, max(states // 20, 1), 10)
    tire = Recursion(response=response, step=step, scheme="linear", comm=MPI.COMM_SELF)
    tread = half_space_compliance(patch.points[:, :2], patch.half_sizes, 5e6, 0.45)
    solver = ActiveSet(tire.same_step + tread)
    drive = Drive(_wavy, lambda t: 0.0, speed)
    instants = roll(tire, solver, patch, drive, step, steps)
    began, block, blocks = time.perf_counter(), max(steps // 10, 1), []
    for _ in range(steps // block):
        start = time.perf_counter()
        for _ in range(block):
            next(instants)
        blocks.append((time.perf_counter() - start) / block)
    whole = time.perf_counter() - began
    count = len(response.eigenvalue)
    matrices, vector = np.ones((2, len(patch.points), 2 * count)), np.ones(2 * count)
    floor = fastest(lambda: (matrices[0] @ vector, matrices[1] @ vector), 30)
    each = float(np.median(blocks))
    return [len(patch.points), count, steps, each * 1e6, whole, floor * 1e6, each / floor]


def _wavy(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return 2e-4 * np.minimum(np.maximum(x, 0) / 0.3, 1.0) ** 3 * np.sin(80 * x + 10 * y)


def processes(folder: Path, mesh: Mesh, modes: int, most: int) -> Table:
    """Strong scaling on one mesh, and weak scaling on one that grows with the processes."""
    counts = [2**k for k in range(most.bit_length()) if 2**k <= most]
    rows = []
    for count in counts:
        console.say(f"  {count} process{'es' if count > 1 else ''} ...")
        rows.append(_on(folder, "strong", mesh, modes, count))
        if count > 1:
            grown = Mesh(mesh.segments * count, mesh.arc, mesh.footprint)
            rows.append(_on(folder, "weak", grown, modes, count))
    together = 6
    for row in rows:
        gain = rows[0][together] / row[together]
        row.append(gain / (row[1] if row[0] == "strong" else 1))
    rows.sort(key=lambda row: row[0])
    columns = [
        ("scaling", ""),
        ("processes", "-"),
        ("unknowns", "-"),
        ("static state", "s"),
        ("modes", "s"),
        ("Green's functions", "s"),
        ("together", "s"),
        ("memory of a process", "GB"),
        ("a step of the loop", "us"),
        ("efficiency", "-"),
    ]
    notes = [
        f"{modes} modes; strong: the same mesh, efficiency t1 / (p tp); weak: as many elements more around as "
        f"processes, efficiency t1 / tp. One BLAS thread a process; this machine has {most} cores. The "
        "second eigenproblem, small and dense, is solved by one process and not in here. A step of "
        "the contact loop has so little to share out that more processes need not make it faster.",
    ]
    plot = {"x": "processes", "y": ["efficiency"], "log": "x", "by": "scaling"}
    return Table("Strong and weak scaling over processes", columns, rows, notes, plot)


def _on(folder: Path, kind: str, mesh: Mesh, modes: int, count: int) -> list:
    """A separate run, started as by a user."""
    place = folder / f"{kind}-{count}"
    place.mkdir()
    scene = write_scene(place / "given.toml", mesh, modes=modes, duration=0.05)
    stages = launched(scene, place / "out", "contact", count)
    seconds = [stages[name]["seconds"] for name in ("static", "modes", "greens")]
    memory = stages["greens"]["indicators"]["largest memory of a process so far"]["value"]
    size = stages["static"]["headline"]["unknowns"]["value"]
    step = stages["contact"]["headline"]["time a step"]["value"]
    return [kind, count, size, *seconds, sum(seconds), memory, step]
