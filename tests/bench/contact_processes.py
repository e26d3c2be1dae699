"""The contact loop on several processes: one solves the contact, all share the states."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
from mpi4py import MPI
from threadpoolctl import threadpool_limits

from tireroad.contact.loop import Drive, roll
from tireroad.contact.solver.solvers import make_solver
from tireroad.contact.tread.compliance import half_space_compliance
from tireroad.fem.errors import ConvergenceError
from tireroad.greens.recursion import SHARED_FROM, Recursion, loop_communicator
from tireroad.runs.validation.tables import Table
from tireroad.tests.validation.cases import RollingStrip, oval_patch

ABOUT = (
    "a step of the contact loop on 1 and 2 processes: few points and modes, 1,000 and more of both"
)
SIZES = ((400, 25), (1000, 36), (2000, 50))
"""(states, points per side of the grid, of which an oval takes part)."""
STEPS, BLOCK, STEP, SPEED = 600, 50, 1e-4, 20.0
ROOT = Path(__file__).resolve().parents[2]


def run() -> list[Table]:
    """Microseconds per step, and the speed-up on two processes."""
    rows = []
    for states, side in SIZES:
        one, two = (_launched(states, side, count) for count in (1, 2))
        gain = one["step"] / two["step"]
        same = abs(one["load"] - two["load"]) / abs(one["load"])
        shared = "yes" if two["sharing"] > 1 else "no: each does all"
        rows.append(
            [one["points"], one["states"], 1e6 * one["step"], 1e6 * two["step"], gain, shared, same]
        )
    columns = [
        ("points", "-"),
        ("states", "-"),
        ("a step, 1 process", "us"),
        ("a step, 2 processes", "us"),
        ("faster", "times"),
        ("spread", ""),
        ("difference of the mean load", "-"),
    ]
    notes = [
        "Medians over blocks of steps on a wavy road; one BLAS thread a process. States are spread where the "
        f"two matrices between points and states have {SHARED_FROM / 1e6:.0f} MB or more: below, processes do not wait "
        "for each other."
    ]
    return [Table("The contact loop on several processes", columns, rows, notes)]


def _launched(states: int, side: int, count: int) -> dict:
    command = [sys.executable, "-P", "-m", "tireroad.tests.bench.contact_processes"]
    command = ["mpirun", "-n", str(count), *command, str(states), str(side)]
    path = os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH"))))
    environment = {**os.environ, "PYTHONPATH": path, "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(command, env=environment, capture_output=True, text=True)
    if done.returncode:
        raise ConvergenceError(f"bench: {' '.join(command)} failed:\n{done.stderr[-2000:]}")
    return json.loads(done.stdout.splitlines()[-1])


@threadpool_limits.wrap(limits=1, user_api="blas")
def measured(states: int, side: int, comm: MPI.Comm) -> dict:
    """Seconds per step (median over blocks), mean load N, sizes. Collective."""
    patch = oval_patch((side, side), (0.16 / side, 0.12 / side), 500.0)
    response = RollingStrip(speed=SPEED).response(patch.points, max(states // 20, 1), 10)
    sharing = loop_communicator(response, comm)
    tire = Recursion(response=response, step=STEP, scheme="linear", comm=sharing, look_ahead=True)
    tread = half_space_compliance(patch.points[:, :2], patch.half_sizes, 5e6, 0.45)
    drive = Drive(_wavy, lambda t: 0.0, SPEED)
    solver = make_solver("active-set", tire.same_step + tread)
    instants = roll(tire, solver, patch, drive, STEP, STEPS)
    blocks, load = [], 0.0
    for _ in range(STEPS // BLOCK):
        began = time.perf_counter()
        load += sum(next(instants).force.sum() for _ in range(BLOCK))
        blocks.append((time.perf_counter() - began) / BLOCK)
    sizes = {"points": len(patch.points), "states": len(response.eigenvalue)}
    return sizes | {
        "step": comm.allreduce(float(np.median(blocks)), op=MPI.MAX),
        "load": load / STEPS,
        "sharing": sharing.size,
    }


def _wavy(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return 2e-4 * np.minimum(np.maximum(x, 0) / 0.3, 1.0) ** 3 * np.sin(80 * x + 10 * y)


if __name__ == "__main__":
    result = measured(int(sys.argv[1]), int(sys.argv[2]), MPI.COMM_WORLD)
    if MPI.COMM_WORLD.rank == 0:
        print(json.dumps(result))
