"""Rolling over a road, for scripts and notebooks: the time loop with its histories collected."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from tireroad.contact.patch import Patch
from tireroad.contact.results.chatter import choose, oscillation
from tireroad.contact.results.limits import Limit, limits, lowest, pitch
from tireroad.contact.results.spectra import amplitudes, third_octaves
from tireroad.contact.roads.under_tire import RoadUnderTire
from tireroad.contact.rolling import Instant, roll
from tireroad.contact.setup import ContactSetup, Rolled, contact_setup
from tireroad.contact.steps import Steps, equal_steps
from tireroad.contact.tread.law import TREADS, TreadLaw
from tireroad.fem.errors import ConvergenceError, InputError
from tireroad.fem.matrices import probe
from tireroad.greens.recursion import Recursion
from tireroad.greens.response import Response
from tireroad.runs.library import RollingTire
from tireroad.runs.stages.build.rolling.loop import make_loop

Array = NDArray[np.float64]
_TURN = 0.3  # rad that the fastest mode turns in a step by default: under a percent in its phase
_LEAST_STEPS = 200


@dataclass(frozen=True, kw_only=True)
class History:
    """What happened: `time` (n,) s; `force` (n, c) N of each contact point, `axle_force` (n, 3) N,
    `displacement` (n, c) m of the tire under the points, `gap` (n, c) m; the `patch` of points;
    the `limit` in frequency of what this is an answer to."""

    time: Array
    force: Array
    axle_force: Array
    displacement: Array
    gap: Array
    patch: Patch
    limit: Limit

    @property
    def total_force(self) -> Array:
        """Vertical force of the road (n,), N."""
        return self.force.sum(axis=1)

    def spectrum(self) -> tuple[Array, NDArray[np.complex128]]:
        """Frequencies (f,) Hz up to the limit and amplitudes (f, 3) N of the axle force (contact.results.spectra)."""
        frequency, amplitude = amplitudes(self.axle_force, self.time[1] - self.time[0])
        below = frequency <= self.limit.frequency
        return frequency[below], amplitude[below]

    def third_octaves(self) -> tuple[Array, Array]:
        """Band centres (b,) Hz below the limit and levels (b, 3), dB re 1 N rms, of the axle force."""
        return third_octaves(self.axle_force, self.time[1] - self.time[0], self.limit.frequency)


@dataclass(frozen=True, kw_only=True)
class _Spec:
    law: TreadLaw
    solver: str = "auto"
    rubs: bool = False
    sheared: bool = False


def drive(
    tire: RollingTire,
    road: RoadUnderTire,
    *,
    duration: float,
    step: float | None = None,
    tread: TreadLaw | None = None,
    spacing: tuple[float, float] | None = None,
    residual: str = "static",
) -> History:
    """Let the road pass under the tire for `duration` s, in steps of `step` s or as small as the modes ask.

    `tread`: a law of contact.tread.laws, by default a half-space of 10 MPa; `spacing` (m, m) of a grid of
    contact points, by default the nodes of the mesh. ConvergenceError where the road touches beyond the
    patch of points. Frictionless. Collective.
    """
    if duration <= 0:
        raise InputError(f"drive: duration = {duration:g} s must be above 0")
    motions, turning = tire.standing.motions, tire.states.turning
    static = motions.static
    if static.road_height is None:
        raise InputError("drive: the tire is not on a road: press it on one first")
    rolled = Rolled(
        speed=turning.speed * static.rolling_radius(), duration=duration, motion=lambda t: 0.0
    )
    setup = contact_setup(static, motions.lattice, road, rolled, spacing=spacing)
    loads = probe.nodes(setup.patch.index, len(static.points), 2)
    response = tire.respond(loads, loads, residual)
    spec = _Spec(law=tread or TREADS.make("half-space", youngs_modulus=1e7))
    setup, _ = setup.settled(response, static.force, spec)
    fastest = np.abs(response.eigenvalue).max(initial=1.0 / duration)
    chosen = equal_steps(duration, step or min(duration / _LEAST_STEPS, _TURN / fastest))
    instants = _instants(spec, setup, response, chosen, motions.body.comm)
    highest = tire.states.highest / (2 * np.pi)
    bounds = limits(step=chosen.size, highest=highest, pitch=pitch(setup.patch), speed=rolled.speed)
    return _history(setup.patch, instants, lowest(bounds))


def _instants(
    spec: _Spec, setup: ContactSetup, response: Response, chosen: Steps, comm: MPI.Comm
) -> list[Instant]:
    """The time loop by the scheme that the contact asks for. Collective."""
    kept = response.resolved(chosen.size)
    scheme = choose(oscillation(spec, setup.patch, kept, chosen.size)).scheme
    recursion = Recursion(response=kept, step=chosen.size, scheme=scheme, comm=comm)
    loop = make_loop(spec, setup, recursion, chosen.size)
    given = setup.patch, setup.drive, chosen.size, chosen.count
    return list(roll(loop.tire, loop.solver, *given, memory=loop.memory))


def _history(patch: Patch, instants: list[Instant], limit: Limit) -> History:
    """The instants one after the other. ConvergenceError where the road touches beyond the patch."""
    kept = {
        name: np.stack([getattr(instant, name) for instant in instants])
        for name in ("time", "force", "axle_force", "displacement", "gap")
    }
    if (kept["force"][:, patch.edge] > 0).any():
        raise ConvergenceError(
            "drive: the road touches the edge of the patch of contact points: it rises above the highest "
            "point that it states; take a smoother road or smaller steps"
        )
    return History(**kept, patch=patch, limit=limit)
