"""Scenes with every table a road needs, and what the reader says of a scene it refuses."""

from pathlib import Path

import pytest

from tireroad.fem.errors import InputError
from tireroad.runs.scene.load import load

FULL = """
[static]
load = 500
[rotation]
speed = 50
[[force]]
amplitude = 2
[contact]
[road]
kind = "cobblestones"
[time]
duration = 0.1
"""


CONTRACT = """
name = "rolling-torus"
[tire]
section = "torus"
outer_radius = 0.32
minor_radius = 0.10
thickness = 0.012
half_angle = 120.0
segments = 100
elements_arc = 16
elements_thickness = 1
order = 2
[tire.material]
model = "neo-hookean"
youngs_modulus = 4.8e8
poisson_ratio = 0.45
density = 1200.0
[static]
inflation = 2.0e5
load = 500.0
steady_rolling = true
[modal]
count = 500
rim = "fixed"
road = "forces"
[damping]
mass = 500.0
stiffness = 0.0
[rotation]
speed = 100.0
inertia = "full"
method = "projected"
count = 40
[greens]
residual = "static"
[[force]]
angle = 0.0
arc = 0.0
spread = [0.0, 0.0]
direction = [0.0, 0.0, 1.0]
amplitude = 1.0
frequency = 5.0
[contact]
tread = "half-space"
youngs_modulus = 3.4e8
poisson_ratio = 0.49
points = "nodes"
brush_stiffness = 199620.0
friction = 0.8
solver = "active-set"
[road]
kind = "flat"
[road.motion]
kind = "sine"
amplitude = 1.0e-3
frequency = 50.0
[time]
duration = 0.1
step = 2.5e-5
scheme = "auto"
checkpoint = 60.0
[output]
spectra = true
axle_force = true
receptance = { to = 500.0, step = 2.0 }
vibration = false
fields = false
"""
"""The scene of the interface's description (README: Scene), with the keys that select written out."""

REAL_TIRE = """
[tire]
section = "radial"
size = "205/60 R15"
segments = 60
[[tire.region]]
dynamic = 1.4
loss_factor = 0.1
[[tire.cords]]
name = "belt 1"
depth = 0.006
arc = [-45.0, 45.0]
angle = 20.0
youngs_modulus = 172.2e9
area = 2.118e-7
spacing = 1.16e-3
density = 0.0
compression = 1.0
[tire.cavity]
temperature = 293.15
[axle]
kind = "corner"
wheel_mass = 15.0
wheel_inertia = [0.4, 0.8, 0.4]
stiffness = [0.0, 0.0, 25e3, 0.0, 0.0, 0.0]
damping = [0.0, 0.0, 2.4e3, 0.0, 0.0, 0.0]
body_mass = 400.0
locked = ["x", "y", "rx", "ry", "rz"]
[accuracy]
estimate = true
target = 0.05
of = "axle_force"
up_to = 400.0
[static]
load = 4000.0
[modal]
up_to = 400.0
[rotation]
speed = 60.0
[contact]
[road]
kind = "cobblestones"
[time]
duration = 0.1
"""
"""The keys of a real tire in the interface's description, and a run on a road to check them in."""


def refused(path: Path, *overrides: str) -> str:
    with pytest.raises(InputError) as caught:
        load(path, overrides)
    return str(caught.value)
