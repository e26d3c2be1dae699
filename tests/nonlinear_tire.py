"""A small tire of two rubbers with dynamic moduli on the road, and motions of it, for tests of large motions."""

import numpy as np

from tireroad.fem.matrices.operators import Operators
from tireroad.fem.nonlinear.force import RestoringForce
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.load_steps import LoadStepper
from tireroad.fem.static.state import static_state
from tireroad.fem.tire.body import Body
from tireroad.fem.tire.material import compound
from tireroad.fem.tire.mesh import Region, compounds
from tireroad.tests.validation.cases import thesis_torus

INFLATION = 2e5
SOFT = compound("neo-hookean", 1200.0, youngs_modulus=2e7, poisson_ratio=0.45, dynamic=1.5)
TREAD = compound("yeoh", 1200.0, c10=2e6, c20=-1e5, c30=1e5, bulk_modulus=1e8, dynamic=1.8)


def pressed(comm):
    """A soft torus of two rubbers with dynamic moduli, pressed on the road: its force and state."""
    region = Region(material=TREAD, arc=(0.0, 0.6))
    ring = thesis_torus(segments=12, elements_arc=4, footprint_size=0.3).ring([region.patch(0)])
    body = Body(comm, ring, compounds(SOFT, (region,)))
    loader = LoadStepper(Equilibrium(body), lambda progress: None)
    loader.inflate(INFLATION)
    loader.deflect(0.006)
    state = static_state(loader.equilibrium, loader.touch)
    return RestoringForce(Operators(body, INFLATION), INFLATION), state


def smooth(force, size):
    """Motions (n, 3) m that vary slowly, the same on any number of processes."""
    body = force.body
    x, y, z = body.lattice.points(body.ids).T
    down = np.exp(-40 * ((z + 0.32) ** 2 + x**2))
    fields = [np.stack(parts, axis=-1) for parts in (
        (0.2 * x * down, 0.3 * y * down, down),
        (down, np.sin(9 * y) * down, 0.5 * x * down),
        (0 * x, down * (1 + 3 * x), 4 * y * down),
    )]  # fmt: skip
    return size * np.stack([force.operators.restrict(one) for one in fields], axis=1)
