"""What microphones hear of a finished run: levels, and the sound to listen to.

./tireroad run runs/scenes/quickstart.toml -n 2 && ./tireroad python examples/listen.py
"""

import sys
from pathlib import Path

import numpy as np

import tireroad as tr

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "results/quickstart")
heard = tr.listen(folder, ["cpx", "pass-by", (1.0, 0.5, 0.2)])
levels, errors = heard.total_weighted, heard.total_weighted_error
for name, level, error in zip(heard.names, levels, errors, strict=True):
    known = "unknown" if np.isnan(error) else f"{error:.1f} dB"
    print(f"{name}: {level:.1f} dB(A) re 20 µPa, error {known}, to {heard.frequency[-1]:.0f} Hz")
print(f"sound power: {heard.total_power[1]:.1f} dB(A) re 1 pW")
passed = tr.pass_by(folder)
print(
    f"four tires pass at {3.6 * passed.speed:.0f} km/h: {passed.maximum:.1f} dB(A), time weighting F"
)
