"""Report section parts about the air inside the tire."""

import numpy as np
from numpy.typing import NDArray

from tireroad.runs.files.read import Results, Section
from tireroad.runs.report.quantities import quantity

_MOSTLY = 0.3  # of a state's kinetic energy
_LISTED = 6


def duct(results: Results, section: Section) -> None:
    """Add the modes of the air between rigid walls, if the tire has air (modes.h5)."""
    frequency = results.optional("modes.h5", "cavity/frequency")
    if frequency is None:
        return
    volume = results.dataset("modes.h5", "cavity/pressure").parent.attrs["volume"]
    section.facts.append(("air inside", f"{1e3 * volume:.4g} l"))
    section.facts.append(("modes of the air between rigid walls", _listed(frequency)))
    section.notes.append("The modes listed are the tire's, without the air that couples them.")


def resonances(
    results: Results, section: Section, file: str, name: str, eigenvalue: NDArray
) -> None:
    """Add the states dominated by the air, if the tire has air."""
    share = results.optional(file, name)
    if share is None:
        return
    mostly = np.flatnonzero((share >= _MOSTLY) & (eigenvalue.imag > 0))
    mostly = mostly[np.argsort(eigenvalue.imag[mostly])]
    text = _listed(eigenvalue.imag[mostly] / (2 * np.pi)) if len(mostly) else "none"
    section.facts.append((f"states with {_MOSTLY:.0%} and more of their energy in the air", text))


def _listed(frequency: NDArray) -> str:
    more = ", …" if len(frequency) > _LISTED else ""
    return ", ".join(quantity(float(f), "Hz") for f in frequency[:_LISTED]) + more
