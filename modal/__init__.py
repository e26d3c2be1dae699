"""Modes of the tire at its static state, standing and rolling."""

from tireroad.fem.exports import exported

_HOMES = {
    "ModalBasis": "basis",
    "Projection": "basis",
    "Proportional": "damping",
    "RollingModes": "rolling",
    "StateModes": "states",
    "StrainEnergy": "damping",
    "critical_speed": "campbell",
    "onset": "campbell",
    "rolling_modes": "rolling",
    "standing_modes": "standing",
    "with_fields": "standing",
}
__all__ = sorted(_HOMES)
__getattr__, __dir__ = exported(__name__, _HOMES)
