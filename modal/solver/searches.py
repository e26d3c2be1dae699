"""Searches for the eigenpairs of a slice, by their names in `modal.solver` (functions: modal.solver.slicing)."""

from __future__ import annotations

from collections.abc import Mapping

BLOCK = 8
AUTO = "lanczos"
SEARCHES: Mapping[str, str] = {
    "slepc": "SLEPc's Krylov-Schur on (A - sigma I)^-1 of each slice, options -modes_…",
    "lanczos": f"block Lanczos, {BLOCK} vectors a block, on (A - sigma I)^-1 of each slice",
}


def resolved(name: str) -> str:
    """The search of a name that may be "auto"."""
    return AUTO if name == "auto" else name
