"""The full tire in time on an axle that moves."""

import numpy as np
import pytest
from mpi4py import MPI
from scipy import sparse
from turning_torus import DAMPING, inflated, pulse

from tireroad.fem.matrices import probe
from tireroad.fem.matrices.operators import rim_motion
from tireroad.fem.static.virtual_work import AT_REST
from tireroad.fem.transient import FullTire
from tireroad.fem.wheel import Axle


def on_axle(comm, axle, speed, step=2e-4, steps=60, load=(0.3, 0.1, 1.0)):
    """Tread's displacement (steps,) m along a load, force on the hub (steps, 3) N and motions of the wheel (steps, 7)."""
    operators, rotation, _ = inflated(comm)
    weights = probe.spot(operators.body.lattice, 0.3, 0.1)
    load = sparse.csr_matrix(probe.directed(weights, load))
    corner = None
    if axle is not None:
        corner = axle, rim_motion(operators.body, 2e5, AT_REST, speed != 0)
    full = FullTire(
        operators=operators,
        rotation=rotation if speed else None,
        speed=speed,
        damping=DAMPING,
        step=step,
        outputs=load,
        loads=load,
        corner=corner,
    )
    moved, hub, wheel = np.zeros(steps), np.zeros((steps, 3)), np.zeros((steps, 7))
    total = np.asarray(load.toarray()).reshape(-1, 3).sum(axis=0)
    for k in range(steps):
        force = np.array([pulse((k + 1) * step)])
        free = full.predict()
        full.advance(force)
        moved[k] = (free + full.same_step @ force)[0]
        hub[k] = total * force - full.inertia_force()
        wheel[k] = full.wheel_motion() if axle else 0.0
    return moved, hub, wheel


def axle(stiffness, **more):
    return Axle(
        wheel_mass=10.0,
        wheel_inertia=(0.3, 0.6, 0.3),
        stiffness=np.full(6, stiffness),
        damping=np.zeros(6),
        **more,
    )


@pytest.mark.slow
@pytest.mark.parametrize("speed", [0.0, 60.0])
def test_stiff_springs_hold_the_wheel(speed) -> None:
    """Displacement and force as on an axle that is held."""
    held, on_hub, _ = on_axle(MPI.COMM_SELF, None, speed)
    moved, hub, wheel = on_axle(MPI.COMM_SELF, axle(1e14), speed)
    assert np.abs(moved - held).max() < 1e-7 * np.abs(held).max()
    assert np.abs(hub - on_hub).max() < 1e-6 * np.abs(on_hub).max()
    assert np.abs(wheel).max() < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("speed", [0.0, 60.0])
def test_springs_carry_what_the_hub_feels(speed) -> None:
    """The force by momentum is that of springs stretched by the wheel's own motion; without springs there is none."""
    _, hub, wheel = on_axle(MPI.COMM_SELF, axle(3e4), speed)
    assert np.abs(wheel[:, :3]).max() > 1e-6
    sprung = 3e4 * wheel[:, :3]
    assert np.abs(hub - sprung).max() < 1e-8 * np.abs(sprung).max()
    _, free, _ = on_axle(MPI.COMM_SELF, axle(0.0), speed)
    assert np.abs(free).max() < 1e-9 * np.abs(hub).max()
