"""The tread pattern of a scene."""

from __future__ import annotations

import math
import zipfile
from dataclasses import asdict
from pathlib import Path

import h5py
import numpy as np

from tireroad.contact.roads.grid_file import UNREADABLE, read_numbers
from tireroad.contact.setup import ContactSetup
from tireroad.contact.tread.pattern import Heights, Pattern, pitch_starts
from tireroad.fem.errors import InputError
from tireroad.runs.files import store
from tireroad.runs.files.store import put
from tireroad.runs.scene.tables.contact import PatternTable
from tireroad.runs.stages.base.job import Job
from tireroad.runs.stages.base.record import Record

MOST = 20_000_000  # most depths in a file
_SHOWN = 2e-3  # m: spacing of the depths stored for the report


def make_pattern(wanted: PatternTable | None, rolling_radius: float) -> Pattern | None:
    """The pattern of a tire with this effective rolling radius (m); None for a slick.

    Raises InputError for an unusable file.
    """
    if wanted is None:
        return None
    around = 2 * math.pi * rolling_radius
    if wanted.file is not None:
        return Pattern(around, heights=_heights(wanted))
    starts = pitch_starts(wanted.pitches, wanted.pitch_lengths, wanted.seed, around)
    return Pattern(around, wanted.groove, starts)


def inputs(job: Job) -> list | None:
    """The pattern's inputs: its table, and its file by content; None for a slick."""
    wanted = job.scene.pattern
    if wanted is None:
        return None
    return [asdict(wanted), store.file_hash(wanted.file) if wanted.file else None]


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


def _heights(wanted: PatternTable) -> Heights:
    path = Path(wanted.file)
    heights = _image(path, wanted) if path.suffix.lower() == ".png" else _arrays(path)
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


def _image(path: Path, wanted: PatternTable) -> Heights:
    """From an image: rows across the tire, from +y down; columns around it."""
    from matplotlib.image import imread

    try:
        picture = np.asarray(imread(path), float)
    except (OSError, ValueError, SyntaxError) as problem:
        raise InputError(f"{path}: no image that can be read ({problem})") from None
    bright = picture if picture.ndim == 2 else picture[..., :3].mean(axis=-1)
    depth = wanted.depth * (1.0 - bright[::-1].T)
    rows = depth.shape[1]
    return Heights(depth, wanted.width * ((np.arange(rows) + 0.5) / rows - 0.5))
