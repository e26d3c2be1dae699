"""Green's functions, receptances and residual flexibility from the modes."""

from tireroad.fem.exports import exported

_HOMES = {
    "Basis": "basis",
    "Convolution": "recursion",
    "Recursion": "recursion",
    "Response": "response",
    "Wheel": "coupling",
    "couple": "response",
    "make_response": "responses",
    "radiate": "sound",
    "wheel_of": "coupling",
}
__all__ = sorted(_HOMES)
__getattr__, __dir__ = exported(__name__, _HOMES)
