"""Dynamic modulus and loss factor from a Prony series."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

PRONY_FREQUENCY = 100.0  # Hz at which a series is evaluated


def prony(parts: dict, options: Mapping[str, str], notes: list[str]) -> tuple[float, float, float]:
    """(long-term fraction of the given moduli, dynamic over long-term modulus, loss factor)."""
    if "VISCOELASTIC" not in parts:
        return 1.0, 1.0, 0.0
    given, table, place = parts["VISCOELASTIC"]
    if given.get("TIME", "").upper() != "PRONY":
        notes.append(f"*VISCOELASTIC other than TIME=PRONY: not used ({place})")
        return 1.0, 1.0, 0.0
    terms = np.array([(*row, 0.0, 0.0, 0.0)[:3] for row in table]).reshape(-1, 3)
    share, times = terms[:, 0], terms[:, 2]
    if (share < 0).any() or share.sum() >= 1 or (times <= 0).any():
        raise place.error("a Prony series needs g ≥ 0 with a sum below 1, and times > 0")
    long_term = 1 - share.sum()
    turn = 2 * np.pi * PRONY_FREQUENCY * times
    storage = long_term + (share * turn**2 / (1 + turn**2)).sum()
    loss = (share * turn / (1 + turn**2)).sum()
    notes.append(
        f"Prony series read at {PRONY_FREQUENCY:g} Hz: dynamic modulus {storage / long_term:.3g} times the "
        f"long-term one, loss factor {loss / storage:.3g} ({place})"
    )
    instant = options.get("MODULI", "LONG TERM").upper() == "INSTANTANEOUS"
    return (long_term if instant else 1.0), storage / long_term, loss / storage
