"""Where the tire meets the road and where prescribed forces act: cheap, so made in every run."""

from __future__ import annotations

import math
import zipfile
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import h5py
import numpy as np
from scipy import sparse

from tireroad.contact.patch import spacing
from tireroad.contact.roads.grid_file import UNREADABLE, read_numbers
from tireroad.contact.roads.road import placed
from tireroad.contact.roads.under_tire import make_motion
from tireroad.contact.setup import (
    ContactSetup,
    Rolled,
    contact_setup,
    freely_rolling,
    nodes_within,
)
from tireroad.contact.tread.pattern import Heights, Pattern, pitch_starts
from tireroad.fem.errors import InputError
from tireroad.fem.matrices import probe
from tireroad.fem.static.state import StaticState
from tireroad.modal.corner import HUB_MOMENTS, READINGS, widened
from tireroad.runs.files import store
from tireroad.runs.files.store import put
from tireroad.runs.scene.physics import wheel_slip
from tireroad.runs.scene.road_cache import road_of
from tireroad.runs.scene.schema import Pitch
from tireroad.runs.scene.tables.contact import PatternTable
from tireroad.runs.scene.tables.scene import rolls_freely
from tireroad.runs.stages import corner
from tireroad.runs.stages.matrices import memoize
from tireroad.runs.stages.rolling import run_time
from tireroad.runs.stages.stage import Job, Record, Result, Shared

if TYPE_CHECKING:
    from tireroad.fem.static.footprint import TreadSurface


MOST = 20_000_000  # most depths in a file
_SHOWN = 2e-3  # m: spacing of the depths stored for the report


def make_pattern(table: PatternTable | None, rolling_radius: float) -> Pattern | None:
    """The pattern of a tire with this effective rolling radius (m); None for a slick.

    Raises InputError for an unusable file.
    """
    if table is None:
        return None
    around = 2 * math.pi * rolling_radius
    if table.file is not None:
        return Pattern(around, heights=_heights(table))
    starts = pitch_starts(table.pitches, table.pitch_lengths, table.seed, around)
    return Pattern(around, table.groove, starts)


def inputs(job: Job) -> list | None:
    """The pattern's inputs: its table, and its file by content; None for a slick."""
    pattern = job.scene.pattern
    if pattern is None:
        return None
    return [asdict(pattern), store.file_hash(pattern.file) if pattern.file else None]


def loop_inputs(job: Job, setup: ContactSetup) -> dict:
    """Inputs of a time loop beside the Green's functions: the contact, the road (a file by its content), the time."""
    scene = job.scene
    return {
        "contact": asdict(scene.contact),
        "road": [asdict(scene.road), inputs(job)],
        "files": [store.file_hash(file) for file in scene.road.surface.files],
        "speed": setup.rolled.speed,
        "slip": [rolls_freely(scene), scene.rotation.slip_angle] if scene.rotation else None,
        "wheel": [scene.rotation.wheel, *scene.axle.wheel_inertia] if scene.rotation else None,
        "axle_force": scene.output.axle_force,
        "forces": [asdict(force) for force in scene.force],
        "time": {k: v for k, v in asdict(scene.time).items() if k != "checkpoint"},
    }


def describe(record: Record, setup: ContactSetup) -> None:
    """Record the land ratio of the pattern under the footprint, and the pitch-passing frequency."""
    pattern, patch = setup.pattern, setup.patch
    if pattern is None:
        return
    touching = patch.force > 0
    record.headline["land of the pattern"] = (pattern.land(patch.points[touching, 1]), "-")
    if pattern.pitches:
        tone = setup.rolled.speed * pattern.pitches / pattern.circumference
        record.headline["pitches pass at"] = (tone, "Hz")


def fill(file: h5py.File, setup: ContactSetup) -> None:
    """Write the pattern under the patch at t = 0, and its depth all around the tire."""
    if setup.pattern is None:
        return
    put(file, "pattern/begun", setup.begun, "m")
    _, _, y0, y1 = setup.patch.extent
    s = np.arange(0.0, setup.pattern.circumference, _SHOWN)
    y = np.arange(y0, y1 + _SHOWN, _SHOWN)
    depth = setup.pattern.depth(*np.meshgrid(s, y, indexing="ij"))
    for name, values in (("s", s), ("y", y), ("depth", depth)):
        put(file, f"pattern/{name}", values, "m")


def _heights(table: PatternTable) -> Heights:
    path = Path(table.file)
    heights = _image(path, table) if path.suffix.lower() == ".png" else _arrays(path)
    depth, y = heights.depth, heights.y
    sound = depth.ndim == 2 and y.shape == depth.shape[1:] and len(y) > 1 and len(depth) > 1
    if not sound or not np.isfinite(depth).all() or not (np.diff(y) > 0).all():
        raise InputError(
            f"{path}: a pattern has finite depths (n, m) around and across the tire and ascending y (m), "
            f"not {depth.shape} and {y.shape}"
        )
    if depth.size > MOST:
        raise InputError(
            f"{path}: {depth.size} depths are more than {MOST}: take a coarser pattern"
        )
    if depth.min() < 0:
        raise InputError(f"{path}: depths are under the outer face, so 0 or more (m)")
    return heights


def _arrays(path: Path) -> Heights:
    """From an archive of NumPy, read as plain data (no pickles)."""
    try:
        with zipfile.ZipFile(path) as archive:
            return Heights(*(read_numbers(archive, name, MOST) for name in ("depth", "y")))
    except (ValueError, *UNREADABLE) as problem:
        raise InputError(f"{path}: no pattern: arrays depth and y are needed ({problem})") from None


def _image(path: Path, table: PatternTable) -> Heights:
    """From an image: rows across the tire, from +y down; columns around it."""
    from matplotlib.image import imread

    try:
        picture = np.asarray(imread(path), float)
    except (OSError, ValueError, SyntaxError) as problem:
        raise InputError(f"{path}: no image that can be read ({problem})") from None
    bright = picture if picture.ndim == 2 else picture[..., :3].mean(axis=-1)
    depth = table.depth * (1.0 - bright[::-1].T)
    rows = depth.shape[1]
    return Heights(depth, table.width * ((np.arange(rows) + 0.5) / rows - 0.5))


@dataclass(frozen=True, kw_only=True)
class Setup(Shared[ContactSetup | None]):
    """The patch and the road under it; None without contact in time."""

    name: ClassVar[str] = "setup"
    static: Result[StaticState]

    def make(self) -> ContactSetup | None:
        """The setup from the static state and the scene's road."""
        job = self.job
        if not job.scene.in_contact:
            return None
        state, on_grid = self.static.product, not job.scene.contact.on_nodes
        surface = tread_surface(job, state, self.static.key) if on_grid else None
        return scene_setup(job, state, surface)


def tread_surface(job: Job, state: StaticState, key: str) -> TreadSurface:
    """The deformed tread of the static state with this key."""
    from tireroad.fem.static.footprint import TreadSurface  # not needed for points at nodes

    return memoize("surface", key, lambda: TreadSurface(job.tire.lattice, state.seen))


def scene_setup(job: Job, state: StaticState, surface: TreadSurface | None = None) -> ContactSetup:
    """The patch and the road of the job's scene; `surface`: the tread, if known."""
    scene, motion = job.scene, job.scene.road.motion
    points = points_of(job, state)
    setup = contact_setup(
        state,
        job.tire.lattice,
        placed(road_of(scene.road.surface), scene.road.surface, scene.road),
        Rolled(
            speed=rolling_speed(job, state),
            duration=run_time(scene.time),
            motion=make_motion(motion.kind, motion.amplitude, motion.frequency, motion.duration),
            lift=abs(motion.amplitude) if motion.kind != "none" else 0.0,
        ),
        spacing=(points.dx, points.dy) if isinstance(points, Pitch) else None,
        reach=scene.contact.reach,
        pattern=make_pattern(scene.pattern, rolling_radius(job, state)),
        surface=surface,
    )
    return _slipping(job, state, setup) if scene.contact.has_friction else setup


def points_of(job: Job, state: StaticState) -> str | Pitch:
    """The contact points, "nodes" or the pitch of a grid; for "auto" chosen from this state."""
    contact = job.scene.contact
    if contact.on_nodes:
        return "nodes"
    if contact.points != "auto":
        return contact.points
    # So that the choice is the same with and without an error estimate of the load.
    extent = replace(state, fine_extent=None).footprint()
    speed = rolling_speed(job, state)
    pitch = spacing(extent, nodes_within(state, 0.0), speed, job.scene.accuracy.up_to)
    return "nodes" if pitch is None else Pitch(pitch, pitch)


def _slipping(job: Job, state: StaticState, setup: ContactSetup) -> ContactSetup:
    """The setup with slip and slip angle; at free rolling also the slip of the static shape."""
    setup = replace(setup, slip=wheel_slip(job.scene))
    if not rolls_freely(job.scene):
        return setup
    return freely_rolling(setup, state, job.tire.lattice.ring, rolling_radius(job, state))


def rolling_speed(job: Job, state: StaticState) -> float:
    """Speed of the road under the tire, m/s: wheel speed times effective rolling radius."""
    return job.speed * rolling_radius(job, state)


def rolling_radius(job: Job, state: StaticState) -> float:
    """Effective rolling radius, m: from the scene, or else from the static state."""
    radius = job.scene.rotation.rolling_radius if job.scene.rotation else None
    return radius or state.rolling_radius()


def components(job: Job) -> tuple[int, ...]:
    """Directions in which the motion of the contact points is followed: normal to the road; with a
    brush, or on a road that is not level, also along and across."""
    return (2, 0, 1) if job.scene.horizontal_forces else (2,)


def _on_nodes(state: StaticState, setup: ContactSetup, part: int) -> sparse.csr_matrix:
    """A direction of the road at each node of the patch, (p, 3 s)."""
    count, index, frames = len(state.points), setup.patch.index, state.frames
    if frames is None:
        return probe.nodes(index, count, part)
    return probe.along(index, count, frames[index, part])


@dataclass(frozen=True)
class Probes:
    """The driven and read points on the outer face.

    `name` "contact" or "force"; `outputs` (r, 3 s) and `loads` (k, 3 s), wider if the wheel is read
    too; `counted`: the part of both that is displacements at loads.
    """

    name: str
    outputs: sparse.csr_matrix
    loads: sparse.csr_matrix
    counted: slice = field(default_factory=lambda: slice(None))

    @property
    def on_face(self) -> Probes:
        """The counted part, restricted to the outer face."""
        if self.counted == slice(None):
            return self
        face = slice(self.outputs.shape[1] - READINGS)
        outputs = self.outputs[self.counted][:, face].tocsr()
        if self.loads is self.outputs:  # saves half of the solutions
            return Probes(self.name, outputs, outputs)
        return Probes(self.name, outputs, self.loads[:, face].tocsr())


def probes(job: Job, state: StaticState, setup: ContactSetup | None) -> Probes:
    """Probes of the contact patch and prescribed forces, or of prescribed forces alone."""
    loads, readings = driven_points(job) if job.scene.force else (None, None)
    more = corner.readings(job)
    if setup is None:
        return _driven_alone(loads, readings, min(more, HUB_MOMENTS))
    parts = [_on_nodes(state, setup, part) for part in components(job)]
    if job.scene.force:
        parts += [loads, readings]
    points = sparse.vstack(parts, format="csr")
    if not more:
        return Probes("contact", points, points)
    points, last = widened(points, more), points.shape[0]
    return Probes("contact", points, points, slice(last))


def _driven_alone(loads: sparse.csr_matrix, readings: sparse.csr_matrix, more: int) -> Probes:
    """Probes of prescribed forces, and `more` readings of the wheel."""
    if not more:
        return Probes("force", readings, loads)
    wide, last = widened(readings, more), readings.shape[0]
    loads = sparse.csr_matrix(
        (loads.data, loads.indices, loads.indptr), (len(loads.indptr) - 1, wide.shape[1])
    )
    return Probes("force", wide, loads, slice(last))


def driven_points(job: Job) -> tuple[sparse.csr_matrix, sparse.csr_matrix]:
    """The prescribed forces (k, 3 s), and readings (3 k, 3 s) of x, y and z at their centres."""
    lattice, loads, readings = job.tire.lattice, [], []
    for force in job.scene.force:
        angle, arc = np.radians([force.angle, force.arc])
        spread = np.radians(force.spread[0]), np.radians(force.spread[1])
        direction = np.array(force.direction)
        loads.append(probe.directed(probe.spot(lattice, angle, arc, spread), direction))
        here = probe.spot(lattice, angle, arc)
        readings += [probe.directed(here, axis) for axis in np.eye(3)]
    return sparse.csr_matrix(np.stack(loads)), sparse.csr_matrix(np.stack(readings))
