"""Part of `bench contact`: a step on a grid with friction, and the cost of a tread that shears."""

from __future__ import annotations

import time
from dataclasses import replace
from functools import partial

import numpy as np
from mpi4py import MPI
from scipy import sparse

from tireroad.contact.loop import Drive, roll
from tireroad.contact.solver.active_set import ActiveSet
from tireroad.contact.solver.projected_cg import SpreadCompliance
from tireroad.contact.solver.stick_slip import BrushFriction
from tireroad.contact.tread.brush import Brush, BrushLaw
from tireroad.contact.tread.compliance import half_space_compliance, half_space_influence
from tireroad.contact.tread.kernel import GridPlaces, KernelTread
from tireroad.contact.tread.shear import KernelShear, half_space_shear
from tireroad.greens.recursion import Recursion
from tireroad.runs.validation.tables import Table
from tireroad.tests.validation.cases import RollingStrip, oval_patch

STEP = 1e-4
ELASTIC = 5e6, 0.45
NODES, STATES, FINER = (12, 9), 200, 4
BRUSH = 3e4  # N/m per point
BLOCKS, STEPS = 7, 64  # as many steps as the loop takes at once


def parts_of(shape: tuple[int, int], modes: int, horizontal: bool = False):
    """Patch, tire with `modes` complex states, tread; 500 N on an oval of about 0.1 m."""
    patch = oval_patch(shape, (0.15 / shape[0], 0.12 / shape[1]), 500.0)
    around = max(modes // 20, 2)
    strip = RollingStrip(speed=20.0)
    if horizontal:
        response = strip.horizontal_response(patch.points, around // 2, 10, 1e2)
        response = replace(response, residual=_local(patch.points))
    else:
        response = strip.response(patch.points, around, 10)
    tire = Recursion(response=response, step=STEP, scheme="linear", comm=MPI.COMM_SELF)
    tread = half_space_compliance(patch.points[:, :2], patch.half_sizes, *ELASTIC)
    return patch, tire, tread, response


def _local(points: np.ndarray) -> np.ndarray:
    """Local flexibility of truncated modes, m/N in z, x, y: smooth over 2 cm, like a wall's."""
    away = ((points[:, None] - points[None]) ** 2).sum(axis=-1)
    return np.kron([[1.0, 0.1, 0.0], [0.1, 0.5, 0.0], [0.0, 0.0, 0.5]], 1e-6 * np.exp(-away / 4e-4))


def wavy(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return 2e-4 * np.minimum(np.maximum(x, 0) / 0.3, 1.0) ** 3 * np.sin(80 * x + 10 * y)


def on_a_grid(brush: float | None, has_shear: bool = False):
    """The loop on a grid `FINER` times finer than the nodes that carry it, and its friction.

    `brush`: bristle stiffness N/m, inf if rigid, None: frictionless. `sheared`: the tread shears
    too.
    """
    patch, tire, _, _ = parts_of(NODES, STATES, True)
    count = len(patch.points)
    counts = (NODES[0] - 1) * FINER + 1, (NODES[1] - 1) * FINER + 1
    spacing = 0.15 / NODES[0] / FINER, 0.12 / NODES[1] / FINER
    points = oval_patch(counts, spacing, 500.0)
    along, across = (
        np.maximum(1 - np.abs(np.arange(c)[:, None] / FINER - np.arange(n)), 0.0)
        for c, n in zip(counts, NODES, strict=True)
    )
    weights = sparse.csr_matrix(np.kron(along, across))
    places = GridPlaces(counts, spacing, np.arange(len(points.points)))
    pressed, dragged = (
        partial(law, youngs_modulus=ELASTIC[0], poisson_ratio=ELASTIC[1])
        for law in (half_space_influence, half_space_shear)
    )
    kernel = KernelTread(places, pressed)
    normal = tire.same_step[:count, :count]
    every = np.arange(len(points.points))
    solver = ActiveSet(SpreadCompliance(normal, weights, kernel).block(every, every))
    points = replace(points, weights=weights)
    drive = Drive(wavy, lambda t: 0.0, 20.0)
    if brush is None:
        tire = Recursion(
            response=RollingStrip(speed=20.0).response(patch.points, STATES // 20, 10),
            step=STEP,
            scheme="linear",
            comm=MPI.COMM_SELF,
        )
        return roll(tire, solver, points, drive, STEP, 10**6), None
    bristles = Brush(
        BrushLaw(brush, 0.8, (0.02, 0.01)), points.points[:, 0], points.line, 20.0, STEP
    )
    bristles.begin(points.force > 0)
    shear = KernelShear(places, dragged) if has_shear else None
    coupling = BrushFriction(bristles, tire.same_step, weights, shear)
    loop = roll(tire, solver, points, drive, STEP, 1024, coupling)
    return loop, coupling


def shearing() -> Table:
    """Blocks of steps alternately, in CPU seconds, so that disturbances affect all equally."""
    cases = {
        ("gives way", "bristles"): (BRUSH, True),
        ("gives way", "none"): (np.inf, True),
        ("rigid", "bristles"): (BRUSH, False),
    }
    loops = {name: on_a_grid(*given) for name, given in cases.items()}
    times: dict[tuple, list[float]] = {name: [] for name in loops}
    turns: dict[tuple, list[int]] = {name: [] for name in loops}
    touching = 0
    for _ in range(BLOCKS):
        for name, (loop, friction) in loops.items():
            began = time.process_time()
            for _ in range(STEPS):
                touching = max(touching, next(loop).active)
                turns[name].append(friction.turns)
            times[name].append((time.process_time() - began) / STEPS)
    plain = np.array(times["rigid", "bristles"])
    rows = [
        [*name, 1e3 * float(np.median(taken)), float(np.median(taken / plain)),
         float(np.mean(turns[name]))]
        for name, taken in times.items()
    ]  # fmt: skip
    columns = [("tread sideways", ""), ("brush", ""), ("a step", "ms"), ("over rigid", "times"),
               ("turns", "-")]  # fmt: skip
    notes = [
        f"{45 * 33} points on 108 nodes, up to {touching} touch; friction 0.8 at a slip of 2 % and 1 %, wavy road; processor "
        f"time, medians of {BLOCKS} blocks of {STEPS} steps in turns. Turns: rounds between normal and horizontal problem."
    ]
    return Table("One step with a tread that shears", columns, rows, notes)
