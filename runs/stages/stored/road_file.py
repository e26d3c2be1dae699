"""What is stored and reported of the road: its texture, and the processing of a measured road."""

from __future__ import annotations

import h5py

from tireroad.contact.setup import ContactSetup
from tireroad.runs.files.store import put
from tireroad.runs.process import observe
from tireroad.runs.stages.base.record import Record


def describe(record: Record, setup: ContactSetup) -> None:
    """Record the mean profile depth; report the processing of a measured road in words."""
    for note in setup.road.notes:
        observe.say(f"  road: {note}")
    texture = setup.road.texture
    if texture is not None and texture.depth is not None:
        record.headline["mean profile depth"] = (texture.depth, "m")


def fill(file: h5py.File, setup: ContactSetup) -> None:
    """Write the texture's third octaves; mean profile depth and notes as attributes."""
    road = setup.road
    if road.notes:
        file.attrs["road_notes"] = "; ".join(road.notes)
    if road.texture is None or not len(road.texture.level):
        return
    put(file, "road/wavelength", road.texture.wavelength, "m")
    put(file, "road/texture_level", road.texture.level, "dB re 1 um")
    if road.texture.depth is not None:
        file.attrs["mean_profile_depth"] = road.texture.depth
