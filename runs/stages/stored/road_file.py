"""What is stored and reported of the road: its texture, and the processing of a measured road."""

from __future__ import annotations

import h5py

from tireroad.contact.results.relief import Relief, nothing_met, relief_seen
from tireroad.contact.setup import ContactSetup
from tireroad.runs.files.store import put
from tireroad.runs.process import observe
from tireroad.runs.scene.road_rules import foot, never_met, within_run_in, without_relief
from tireroad.runs.scene.tables.scene import Road
from tireroad.runs.stages.base.record import Record

# Share of the road's standard deviation that the points have to see.
_SEEN = 0.5
# Share of its height from which on an obstacle counts as whole.
_WHOLE = 0.98


def describe(record: Record, setup: ContactSetup, road: Road) -> None:
    """Record the mean profile depth; report the processing of a measured road in words.

    Warns if the `road` of the scene is flat where the run passes, or flat to its points.
    """
    for note in setup.road.notes:
        observe.say(f"  road: {note}")
    texture = setup.road.texture
    if texture is not None and texture.depth is not None:
        record.headline["mean profile depth"] = (texture.depth, "m")
    first, last = setup.road.passed
    if last <= first:
        record.warnings.extend(never_met(road))
    elif road.kind != "flat" and nothing_met(setup):
        record.warnings.append(without_relief(road, first, last))
    elif (place := foot(road)) is not None and (share := setup.road.share(place)) < _WHOLE:
        record.warnings.append(within_run_in(road, place, share))
    elif (relief := relief_seen(setup)) is not None:
        _describe_smoothing(record, setup, relief)


def _describe_smoothing(record: Record, setup: ContactSetup, relief: Relief) -> None:
    """Record the road's relief and what the points see of it; warn if that is less than half."""
    record.indicators["standard deviation of the road"] = (relief.road, "m")
    record.indicators["of the road as the points see it"] = (relief.points, "m")
    if relief.points < _SEEN * relief.road:
        along, across = 1e3 * setup.patch.spacing
        record.warnings.append(
            f"contact points {along:.3g} × {across:.3g} mm apart see {1e3 * relief.points:.2g} of the road's "
            f"{1e3 * relief.road:.2g} mm (standard deviation): waves shorter than two spacings are averaged over each "
            "point's rectangle, so most of this road has no effect; take points a quarter of its waves apart or less "
            "(contact.points), or a road of longer waves"
        )


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
