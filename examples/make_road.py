"""Write a road of your own as a grid file: here a coarse asphalt, drawn from a texture spectrum.

    ./tireroad python examples/make_road.py [road.npz]

A grid file holds x (nx,), y (ny,) and heights z (nx, ny), all in m; scenes read it by
`[road] kind = "grid", file = "road.npz"`. The spectrum falls with the square of the wave number, is cut
at the stones' size, and the heights are bent so that valleys are deeper than peaks are high, as those
of rolled asphalt are. `runs/scenes/measured_road.npz` is what this script writes by default.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

LENGTH, WIDTH, PITCH = 3.0, 0.24, 0.005  # m
ROUGHNESS = 0.4e-3  # m rms
LONGEST, STONES = 0.5, 0.010  # m, waves


def asphalt(seed: int = 1) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """x (nx,), y (ny,) m and heights (nx, ny) m of a periodic random surface."""
    nx, ny = round(LENGTH / PITCH), round(WIDTH / PITCH)
    kx, ky = np.fft.fftfreq(nx, PITCH)[:, None], np.fft.rfftfreq(ny, PITCH)[None, :]
    wave_number = np.hypot(kx, ky)  # 1/m
    inside = (wave_number >= 1 / LONGEST) & (wave_number <= 1 / STONES)
    # A surface whose profile has a spectrum ~ n^-2 has a spectrum ~ n^-3 in the plane.
    amplitude = np.where(inside, np.maximum(wave_number, 1e-9) ** -1.5, 0.0)
    phase = np.exp(2j * np.pi * np.random.default_rng(seed).random(amplitude.shape))
    height = np.fft.irfft2(amplitude * phase, s=(nx, ny))
    height /= height.std()
    bent = height - 0.15 * height**2  # skewness about -1
    bent -= bent.mean()
    return PITCH * np.arange(nx), PITCH * (np.arange(ny) - ny / 2), ROUGHNESS * bent / bent.std()


def main(target: Path) -> float:
    """Write the file; the heights' rms, mm."""
    x, y, z = asphalt()
    np.savez_compressed(target, x=x, y=y, z=z.astype(np.float32))
    return float(1e3 * z.std())


if __name__ == "__main__":
    place = Path(sys.argv[1] if len(sys.argv) > 1 else "road.npz")
    print(f"{place}: {main(place):.3f} mm rms")
