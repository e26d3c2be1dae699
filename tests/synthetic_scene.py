"""The scene of the synthetic results."""

SCENE = """name = "synthetic-torus"
[tire]
section = "torus"
outer_radius = 0.32
minor_radius = 0.1
segments = 60
[tire.material]
model = "neo-hookean"
youngs_modulus = 4.8e7
[static]
inflation = 2.0e5
load = 500.0
[modal]
count = 40
[rotation]
speed = 50.0
[contact]
tread = "half-space"
[road]
kind = "cobblestones"
[time]
duration = 0.25
step = 2.5e-5
"""
