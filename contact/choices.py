"""Choices of the method that its estimates of memory and time need, too: without numpy, for the reading of scenes."""

# Of the highest mode: beyond, the truncated modes respond dynamically, not by their static residual
# alone. Against twice the modes, third octaves with their upper edge below it are within 0.5 dB in
# 80 of 84 cases and 1 dB in all; up to 0.9 within 1.6 dB (docs/verification/band.md).
USABLE = 0.8

TURN = 0.3  # rad of the fastest state per automatic step: its phase error is below 1 %
LEAST_STEPS = 200  # of an automatic step

# Up to here the matrix is stored (8 MB); beyond, the tread is a convolution.
DENSE_POINTS = 1000
# Points touching at rest above which conjugate gradients take over. The active set costs the cube
# of the points that come and go: with 580 touching and 180 away from the usual set a fifth of
# conjugate gradients, with 770 and 550 (a road as rough as the points are apart, a whole point per
# step) twice as much.
MOST_TOUCHING = 1000
# The same with friction, of a grid that is no matrix, whose normal and horizontal forces are then found at once
# (contact.solver.grid_newton): a step takes 0.86 of the time with 320 touching (9.9 ms), 0.56 with 610 (25.8 ms), both quickstart.toml;
# 1.1 with 610 of passenger.toml, whose points come and go (65 ms, 5 % of its steps without a solution of both; attachment modes).
# Not where nodes lie far apart for their points (a torus with 65 a node: 1 s a step for 59 ms).
MOST_ALTERNATING, MOST_A_NODE = 300, 16


def by_product(friction: bool, points: int, nodes: int, touching: int) -> bool:
    """Whether "auto" solves a grid of `points` on `nodes`, of which some are `touching` at rest, with products in place of matrices."""
    fine = friction and DENSE_POINTS < points <= MOST_A_NODE * nodes
    return touching > (MOST_ALTERNATING if fine else MOST_TOUCHING)
