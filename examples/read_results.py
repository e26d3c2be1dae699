"""Read a result folder: arrays with units, figures, spectra.

Run it with `./tireroad python examples/read_results.py results/quickstart`.
"""

from __future__ import annotations

import sys

import numpy as np

import tireroad as tr


def main(folder: str) -> dict[str, float]:
    """Mean and deviation of the contact force in N, and the loudest third octave of the axle force."""
    run = tr.load(folder)
    assert run.unit("contact/total_force") == "N"
    vertical = run["contact/total_force"][:, 2]
    found = {
        "load at rest": run.attributes("static")["load"],
        "mean": float(vertical.mean()),
        "deviation": float(vertical.std()),
    }
    centre, level = run["spectra/third_octave/centre"], run["spectra/third_octave/level"][:, 2]
    if len(centre):  # a short run has no band with lines enough
        loudest = int(np.argmax(level))
        found |= {"loudest band": float(centre[loudest]), "its level": float(level[loudest])}
    return found


if __name__ == "__main__":
    for name, value in main(sys.argv[1]).items():
        print(f"{name:14s} {value:.4g}")
