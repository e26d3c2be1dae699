"""A scene with a target for its accuracy."""

SCENE = """
name = "wanted"
[tire.material]
youngs_modulus = 48e6
[static]
load = 400.0
[rotation]
speed = 40.0
[contact]
youngs_modulus = 1e7
reach = 0.006
[road]
kind = "sine"
amplitude = 2e-4
wavelength = 0.1
run_in = 0.05
[time]
duration = 0.1
[accuracy]
target = 0.05
up_to = 100.0
"""
