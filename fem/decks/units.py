"""Units of a deck: Abaqus has none, so a length unit stands for a consistent system."""

from __future__ import annotations

from dataclasses import dataclass

from tireroad.fem.errors import InputError
from tireroad.fem.sections.outline import RADII

_SMALLEST, _LARGEST = RADII


@dataclass(frozen=True)
class Units:
    """Factors to SI for lengths, stresses and densities; `words` names the system."""

    length: float
    stress: float
    density: float
    words: str


# Consistent with the second: tonne for mm, slinch (lbf s2/in) for inches.
SYSTEMS = {
    "m": Units(1.0, 1.0, 1.0, "m, kg, s, N, Pa"),
    "mm": Units(1e-3, 1e6, 1e12, "mm, t, s, N, MPa"),
    "in": Units(0.0254, 6894.757293, 1.0686896e7, "in, lbf s²/in, s, lbf, psi"),
}


def check_size(radius: float, unit: str, file: str) -> None:
    """Raise InputError with the unit that fits if the outer radius (deck's unit) is no tire's."""
    if _SMALLEST <= radius * SYSTEMS[unit].length <= _LARGEST:
        return
    fitting = [name for name, of in SYSTEMS.items() if _SMALLEST <= radius * of.length <= _LARGEST]
    fitting = fitting[:1] if radius < _LARGEST else [n for n in fitting if n == "mm"] or fitting
    shown = f"{radius * SYSTEMS[unit].length:.4g} m"
    if not fitting:
        raise InputError(f"{file}: the tire has an outer radius of {shown}; 0.1 to 2.5 m is a tire")
    raise InputError(
        f"{file}: the tire has an outer radius of {shown}: is this deck in {fitting[0]}? Then "
        f'tire.length_unit = "{fitting[0]}" reads it in {SYSTEMS[fitting[0]].words}'
    )
