"""Roads, tread laws, and the unilateral contact problem of a rolling tire."""

from tireroad.fem.exports import exported

_HOMES = {
    "ContactSetup": "setup",
    "EndlessRoad": "roads.road",
    "Patch": "patch",
    "RoadKind": "roads.road",
    "RoadUnderTire": "roads.under_tire",
    "Rolled": "setup",
    "TreadLaw": "tread.law",
    "amplitudes": "results.spectra",
    "contact_setup": "setup",
    "equal_steps": "loop",
    "make_patch": "patch",
    "make_road": "roads.road",
    "road_kind": "roads.road",
    "roll": "loop",
    "step_solver": "model",
    "third_octaves": "results.spectra",
    "tread_law": "tread.law",
}
__all__ = sorted(_HOMES)
__getattr__, __dir__ = exported(__name__, _HOMES)
