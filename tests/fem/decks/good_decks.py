"""Decks of which nothing is wrong."""

import numpy as np
from torus_decks import BELT, CORDS, Torus, membranes, plain

TORUS = Torus(arcs=6, wall=1)
GOOD = plain(TORUS)
BELTED = GOOD + membranes("BELT", 0.006, np.linspace(-BELT, BELT, 9), 9001, 9001) + CORDS
