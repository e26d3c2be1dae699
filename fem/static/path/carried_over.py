"""Transfer of a static state to another mesh of the same tire, as a close start."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tireroad.fem.matrices import probe
from tireroad.fem.sections.locate import interpolation, locate
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.state import StaticState, static_state
from tireroad.fem.tire.mesh import Lattice

if TYPE_CHECKING:
    from tireroad.fem.model import TireModel


def carried_over(
    state: StaticState, tire: TireModel, other: TireModel, load: float | None
) -> StaticState | None:
    """Static state of the `other` mesh, by Newton's method from the `state` of this one.

    Inflation, rolling and road height are kept; with a `load` (N) the road carries that instead.
    The height of first touch is taken from the state. None if no equilibrium is found.
    Collective.
    """
    body = other.body
    body.set_displacement(sampled(tire.lattice, state.displacement, body.lattice))
    equilibrium = Equilibrium(body, state.rolling, state.road)
    equilibrium.pressure.value = state.inflation
    carried = None if load is None else load * state.road.upright
    step = equilibrium.solve(state.road_height, load=carried)
    return static_state(equilibrium, state.touch_height) if step.converged else None


def sampled(lattice: Lattice, values: np.ndarray, target: Lattice) -> np.ndarray:
    """Values (n, 3) of a lattice interpolated to another lattice of the same tire."""
    section = lattice.tire.section
    place = locate(section.nodes, section.cells, section.order, target.section)
    across = interpolation(lattice.cells_2d, lattice.edge, lattice.shape[1], place)
    first, shape = probe.line_shape(lattice.ring_corners, lattice.edge, target.ring)
    index = (first[:, None] + np.arange(len(lattice.edge))) % lattice.shape[0]
    around = np.einsum("ka,kanx->knx", shape, values.reshape(*lattice.shape, 3)[index])
    return np.stack([across @ ring for ring in around]).reshape(-1, 3)
