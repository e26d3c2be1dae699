"""Rolling over a road, for scripts and notebooks: runs the time loop and collects its histories."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from tireroad.contact.loop import Instant, Steps, check_times, equal_steps, roll
from tireroad.contact.patch import Patch
from tireroad.contact.results.chatter import choose, oscillation
from tireroad.contact.results.limits import Limit, limits, lowest, pitch
from tireroad.contact.results.spectra import amplitudes, third_octaves
from tireroad.contact.roads.under_tire import RoadUnderTire
from tireroad.contact.setup import ContactSetup, Rolled, contact_setup
from tireroad.contact.tread.law import TREADS, TreadLaw
from tireroad.fem.errors import ConvergenceError, InputError
from tireroad.fem.matrices import probe
from tireroad.fem.model import SmallMotions
from tireroad.fem.static.footprint import Footprint
from tireroad.greens.recursion import Recursion
from tireroad.greens.response import Response
from tireroad.runs.library import RollingTire
from tireroad.runs.scene.rules import barred_from_contact
from tireroad.runs.stages.build.rolling.loop import make_loop
from tireroad.runs.stages.build.rolling.run_in import grown
from tireroad.runs.typed import typed

Array = NDArray[np.float64]
_TURN = 0.3  # rad: default turn of the fastest mode per step; its phase error is below 1 %
_LEAST_STEPS = 200


@dataclass(frozen=True, kw_only=True)
class History:
    """Histories of a run over n instants and c contact points.

    `time` (n,) s; `force` (n, c) N of each contact point; `axle_force` (n, 3) N; `displacement`
    (n, c) m of the tire at the points; `gap` (n, c) m; `patch`: the contact points; `limit`: the
    highest frequency up to which the results are valid; `run_in` s: until then the road grows from
    flat under a part of the patch.

    Figures of the road alone begin with a `start` (s) of `run_in`; by default they are of the whole
    record, with what the run-in excites.
    """

    time: Array
    force: Array
    axle_force: Array
    displacement: Array
    gap: Array
    patch: Patch
    limit: Limit
    run_in: float

    @property
    def total_force(self) -> Array:
        """Vertical force of the road (n,), N."""
        return self.force.sum(axis=1)

    @property
    def step(self) -> float:
        """Time step, s: the first instant is one step after the state at rest."""
        return float(self.time[0])

    def spectrum(self, start: float = 0.0) -> tuple[Array, NDArray[np.complex128]]:
        """Frequencies (f,) Hz up to the limit, axle-force amplitudes (f, 3) N (contact.results).

        From `start` s on.
        """
        frequency, amplitude = amplitudes(self._from(start), self.step)
        below = frequency <= self.limit.frequency
        return frequency[below], amplitude[below]

    def third_octaves(self, start: float = 0.0) -> tuple[Array, Array]:
        """Axle force: third-octave centres (b,) Hz to the limit, levels (b, 3) dB re 1 N rms.

        From `start` s on. A run of one step has no band.
        """
        return third_octaves(self._from(start), self.step, self.limit.frequency)

    def _from(self, start: float) -> Array:
        """Axle force (k, 3) N of the instants from `start` s on. InputError if there are none."""
        if not 0.0 <= start <= self.time[-1]:
            raise InputError(f"start = {start:g} s must be from 0 to the end, {self.time[-1]:g} s")
        return self.axle_force[np.searchsorted(self.time, start) :]


@dataclass(frozen=True, kw_only=True)
class _Spec:
    law: TreadLaw
    solver: str = "auto"
    rubs: bool = False
    sheared: bool = False


@typed
def drive(
    tire: RollingTire,
    road: RoadUnderTire,
    *,
    duration: float,
    step: float | None = None,
    tread: TreadLaw | None = None,
    spacing: float | tuple[float, float] | None = None,
    residual: str = "static",
) -> History:
    """Roll the tire over the road for `duration` s.

    `step` s: time step, by default small enough for the fastest mode. `tread`: a law of
    contact.tread.laws, by default a half-space of 10 MPa. `spacing` (m, or m, m along and across) of
    a grid of contact points, by default the nodes of the mesh. Frictionless.

    Raises InputError for arguments of the wrong kind, times that are not positive and finite, a tire
    that is off the road, modes with a free rim or a held road, and a `spacing` with less than two
    points along or across the footprint; ConvergenceError if the road touches the tire outside the patch of contact points.
    Collective.
    """
    check_times(duration, duration if step is None else step)
    law, pitches = _law(tread), _pitches(spacing)
    motions, turning = tire.standing.motions, tire.states.turning
    static = motions.static
    _check_motions(motions)
    if pitches is not None:
        _check_pitches(pitches, static.footprint())
    rolled = Rolled(
        speed=turning.speed * static.rolling_radius(), duration=duration, motion=lambda t: 0.0
    )
    setup = contact_setup(static, motions.lattice, road, rolled, spacing=pitches)
    loads = probe.nodes(setup.patch.index, len(static.points), 2)
    response = tire.respond(loads, loads, residual)
    spec = _Spec(law=law)
    setup, _ = setup.settled(response, static.force, spec)
    fastest = np.abs(response.eigenvalue).max(initial=1.0 / duration)
    largest = min(duration / _LEAST_STEPS, _TURN / fastest) if step is None else step
    chosen = equal_steps(duration, largest)
    instants = _instants(spec, setup, response, chosen, motions.body.comm)
    highest = tire.states.highest / (2 * np.pi)
    bounds = limits(step=chosen.size, highest=highest, pitch=pitch(setup.patch), speed=rolled.speed)
    return _history(setup.patch, instants, lowest(bounds), grown(setup, road.run_in))


def _check_motions(motions: SmallMotions) -> None:
    """InputError for a tire off the road, and for modes that cannot carry the contact."""
    if motions.static.road_height is None:
        raise InputError("drive: the tire is not on a road: press it on one first")
    for key, why in barred_from_contact(motions.rim, motions.road):
        raise InputError(f"drive: modes with {key} {why}")


def _law(tread: TreadLaw | None) -> TreadLaw:
    """The tread law, by default a half-space of 10 MPa."""
    if tread is None:
        return TREADS.make("half-space", youngs_modulus=1e7)
    if isinstance(tread, TreadLaw):
        return tread
    raise InputError(
        f"drive: tread = {tread!r} is no tread law: take an object of contact.tread.laws, such as "
        "HalfSpace(youngs_modulus=1e7)"
    )


def _pitches(spacing: float | tuple[float, float] | None) -> tuple[float, float] | None:
    """Distances (m) of the contact points along and across; one number is both."""
    if spacing is None:
        return None
    try:
        along, across = np.broadcast_to(np.asarray(spacing, dtype=float), 2)
    except (TypeError, ValueError):
        along = across = np.nan
    if not (0 < along < np.inf and 0 < across < np.inf):
        raise InputError(
            f"drive: spacing = {spacing!r} must be one length or two (along, across) above 0 m, such as 0.005"
        )
    return float(along), float(across)


def _check_pitches(pitches: tuple[float, float], found: Footprint) -> None:
    """InputError if fewer than two points fit along or across the footprint at rest."""
    extents = found.length, found.width
    if any(0 < extent < pitch for extent, pitch in zip(extents, pitches, strict=True)):
        raise InputError(
            f"drive: spacing = {pitches[0]:g} m along, {pitches[1]:g} m across leaves less than two points in a "
            f"footprint of {found.length:.3g} m x {found.width:.3g} m: take {min(extents) / 8:.1g} m, for example"
        )


def _instants(
    spec: _Spec, setup: ContactSetup, response: Response, chosen: Steps, comm: MPI.Comm
) -> list[Instant]:
    """Run the time loop with the integration scheme that suits the contact. Collective."""
    kept = response.resolved(chosen.size)
    scheme = choose(oscillation(spec, setup.patch, kept, chosen.size)).scheme
    recursion = Recursion(response=kept, step=chosen.size, scheme=scheme, comm=comm)
    loop = make_loop(spec, setup, recursion, chosen.size)
    given = setup.patch, setup.drive, chosen.size, chosen.count
    return list(roll(loop.tire, loop.solver, *given, memory=loop.memory))


def _history(patch: Patch, instants: list[Instant], limit: Limit, run_in: float) -> History:
    """Stack the instants. Raises ConvergenceError if the road touches the edge of the patch."""
    kept = {
        name: np.stack([getattr(instant, name) for instant in instants])
        for name in ("time", "force", "axle_force", "displacement", "gap")
    }
    if (kept["force"][:, patch.edge] > 0).any():
        raise ConvergenceError(
            "drive: the road touches the edge of the patch of contact points: it rises above the highest "
            "point that it states; take a smoother road or smaller steps"
        )
    return History(**kept, patch=patch, limit=limit, run_in=run_in)
