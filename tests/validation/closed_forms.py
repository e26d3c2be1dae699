"""Finite elements, modes and recursion against closed forms: (case, unit, computed, exact)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from mpi4py import MPI
from scipy import optimize, sparse
from scipy.sparse.linalg import eigsh

from tireroad.fem.matrices.operators import Operators
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.load_steps import LoadStepper
from tireroad.fem.tire.body import Body
from tireroad.fem.tire.material import Material, compound
from tireroad.fem.tire.mesh import Torus
from tireroad.fem.wheel import Axle, Turning
from tireroad.greens.basis import Basis
from tireroad.greens.recursion import Recursion
from tireroad.greens.response import Response, couple
from tireroad.modal.basis import Projection, project
from tireroad.modal.corner import Corner
from tireroad.modal.rolling import decouple
from tireroad.modal.rotating import matrices, rotating, standing
from tireroad.modal.solver.slicing import Modes
from tireroad.runs.validation.tables import Table
from tireroad.tests.validation import contact_closed_forms as contact

FLAT = 1e6  # m, radius of the section circle: the part of the torus in use is a cylinder
COMM = MPI.COMM_SELF

GOLDEN = 653.0, 63.3, 6.0, 0.15  # k_t, k_s 1/s2, c 1/s, m_u for a body of 1 kg
PUBLISHED = -2.590 + 7.323j, -20.410 + 64.423j  # 1/s
ABOUT = "tube, rings, oscillator, Hertz, punch, friction, creep of rolling, static friction, brush, creeping rubber, pattern and golden car against closed forms"


def tire_rows() -> Iterator[tuple]:
    """All cases."""
    yield from _tube()
    yield from _ring(0.0)
    yield from _ring(50.0)
    yield from _oscillator()


def _cylinder(outer: float, thickness: float, width: float, mesh: tuple, rubber: Material) -> Body:
    segments, across, layers = mesh
    section = Torus(
        outer_radius=outer,
        minor_radius=FLAT,
        thickness=thickness,
        half_angle=width / 2 / FLAT,
        segments=segments,
        elements_arc=across,
        elements_thickness=layers,
        order=2,
        grading="uniform",
    )
    return Body(COMM, section, rubber)


def _tube() -> Iterator[tuple]:
    """Thick Mooney tube in plane strain: the middle of a tube with clamped ends.

    The ends leave an axial strain that falls with one over the length: 1.9, 1.0 % more growth at
    1.6, 3 m. p = 2 (C1 + C2) [ln(a B/(b A)) + (a^2 - A^2)(a^-2 - b^-2)/2].
    """
    A, B = 0.25, 0.30
    rubber = compound("mooney-rivlin", 1000.0, c10=4e5, c01=1e5, bulk_modulus=1e9)
    body = _cylinder(B, B - A, 20.0, (8, 24, 1), rubber)
    loader = LoadStepper(Equilibrium(body), lambda progress: None)
    for a in (0.26, 0.275):
        b = np.sqrt(a * a + B * B - A * A)
        p = 1e6 * (np.log(a * B / (b * A)) + (a * a - A * A) * (a**-2 - b**-2) / 2)
        loader.inflate(p)
        points = body.lattice.points(np.arange(body.lattice.size))
        inner = (np.hypot(points[:, 0], points[:, 2]) < A + 1e-3) & (abs(points[:, 1]) < 1e-3)
        moved = (points + body.displacement())[inner]
        radius = float(np.hypot(moved[:, 0], moved[:, 2]).mean())
        yield f"thick Mooney tube at {p:.0f} Pa, growth of its inner radius", "m", radius - A, a - A


def _ring(speed: float) -> Iterator[tuple]:
    """Thin free ring, inextensional, fixed frame (Endo et al. 1984); n = 2, 3, 4.

    |2 n W/(n^2+1) +- sqrt{n^2 (n^2-1)^2/(n^2+1) [EI/(rho A R^4) + W^2/(n^2+1)]} - n W|.
    """
    R, h, E, density = 0.3, 0.003, 480e6, 1200.0
    body = _cylinder(
        R + h / 2,
        h,
        h,
        (120, 1, 1),
        compound("neo-hookean", density, youngs_modulus=E, poisson_ratio=0.0),
    )
    body.rim = np.array([], dtype=np.int32)
    points = body.lattice.points(np.arange(body.lattice.size))
    # The hoop strain rho R^2 W^2/E of the spin, by a displacement without other strains.
    out = points * [1.0, 0.0, 1.0]
    out *= density * R**3 * speed**2 / E / np.linalg.norm(out, axis=1, keepdims=True)
    body.set_displacement(out)
    operators = Operators(body, 0.0)
    modes = _soft_modes(operators)
    rotation = operators.rotation() if speed else None
    projection = project(modes, rotation, operators.carried, COMM)
    states = rotating(*matrices(projection, speed, (0.0, 0.0), "full"))
    waves = _bending_waves(
        body.lattice.points(body.ids), modes.vectors @ states.right, states.eigenvalue
    )
    bending = E * h**2 / (12 * density * R**4)
    for n in (2, 3, 4):
        root = np.sqrt(n**2 * (n**2 - 1) ** 2 / (n**2 + 1) * (bending + speed**2 / (n**2 + 1)))
        turn = 2 * n * speed / (n**2 + 1) - n * speed
        for sign in (1, -1) if speed else (1,):
            closed = (turn + sign * root) / (2 * np.pi)
            name = f"thin free ring at {speed:g} rad/s, n = {n} (Endo)"
            yield name, "Hz", abs(waves[n][sign]), abs(closed)


def _bending_waves(points: np.ndarray, shape: np.ndarray, eigenvalue: np.ndarray) -> dict:
    """Signed frequency (Hz) by wave number n and branch of in-plane waves exp(i (w t - n a)).

    a: angle from the lowest point against the sense of rotation. Branch 1 is the higher of the two
    frequencies, -1 the lower. States are identified by their shapes (3 s, m), not by their
    frequencies.
    """
    angle = np.arctan2(points[:, 0], -points[:, 2])
    field = shape.reshape(len(points), 3, -1)
    radial = np.sin(angle)[:, None] * field[:, 0] - np.cos(angle)[:, None] * field[:, 2]
    in_plane = np.linalg.norm(field[:, 1], axis=0) < 0.1 * np.linalg.norm(radial, axis=0)
    waves = {}
    for n in (2, 3, 4):
        parts = np.array([np.exp(-1j * k * angle) @ radial for k in (n, -n)]) / len(points)
        whole = np.sqrt((np.abs(radial) ** 2).mean(axis=0))
        ours = in_plane & (eigenvalue.imag > 0) & (np.linalg.norm(parts, axis=0) > 0.9 * whole)
        ways = np.where(np.abs(parts[0]) < np.abs(parts[1]), 1, -1)
        signed = np.sort((ways * eigenvalue.imag)[ours]) / (2 * np.pi)
        waves[n] = {-1: float(signed[0]), 1: float(signed[-1])}
    return waves


def _soft_modes(operators: Operators) -> Modes:
    """60 modes by SciPy: relative to the ring's stiffness across, its softest bending is below what
    modal.solver.undamped can resolve."""
    size = operators.stiffness.getSize()
    stiffness = sparse.csr_matrix(operators.stiffness.getValuesCSR()[::-1], shape=size)
    mass = sparse.diags(operators.mass).tocsc()
    squares, vectors = eigsh(stiffness.tocsc(), 60, mass, sigma=-1e3)
    return Modes(
        squares=squares,
        vectors=vectors,
        residual=np.zeros(60),
        orthonormality=0.0,
        inertia_count=60,
        counted_below=np.inf,
        rigid=6,
        sectors=(size[0],),
        slices=1,
    )


def _oscillator() -> Iterator[tuple]:
    """u'' + u' + u = 1 (appendix D): 1 - e^{-t/2} (cos w t + sin w t/sqrt 3), w = sqrt 3/2."""
    unit = np.ones((1, 1))
    states = standing(Projection(squares=np.ones(1), momentum=np.ones((3, 1))), (1.0, 0.0))
    tire = Recursion(
        response=couple(states, unit, unit, np.ones((3, 1))), step=0.7, scheme="linear", comm=COMM
    )
    tire.start(np.ones(1))
    for k in range(1, 6):
        place = float((tire.predict() + tire.same_step @ np.ones(1))[0])
        tire.advance(np.ones(1))
        t, w = 0.7 * k, np.sqrt(3) / 2
        if k in (1, 5):
            closed = 1 - np.exp(-t / 2) * (np.cos(w * t) + np.sin(w * t) / np.sqrt(3))
            yield f"oscillator of appendix D after {k} steps of 0.7 s", "m", place, float(closed)


def golden_car_rows() -> Iterator[tuple]:
    """Real and imaginary parts of both poles, against the polynomial of the car."""
    for number, (pole, exact) in enumerate(zip(poles(), exact_poles(), strict=True), 1):
        for part, one, other in (
            ("real", pole.real, exact.real),
            ("imaginary", pole.imag, exact.imag),
        ):
            yield f"golden car, pole {number}, {part} part", "1/s", one, other


def golden_car() -> Basis:
    """Wheel and body without a tire, read and loaded at one point under the axle. Collective."""
    _, k_s, c, m_u = GOLDEN
    axle = Axle(
        wheel_mass=m_u,
        wheel_inertia=(1.0, 1.0, 1.0),
        stiffness=np.array([0, 0, k_s, 0, 0, 0]),
        damping=np.array([0, 0, c, 0, 0, 0]),
        body_mass=1.0,
        locked=("x", "y", "rx", "ry", "rz"),
    )
    nothing, own = np.zeros((0, 6)), np.zeros((6, 6))
    corner = Corner(
        axle=axle, places=np.array([[0.0, 0.0, -0.3]]),
        mass=nothing, stiffness=nothing, gyroscopic=nothing, convective=nothing,
        body=nothing, body_convective=nothing,
        own_mass=own, own_stiffness=own, own_gyroscopic=own, own_convective=own,
    )  # fmt: skip
    projection = Projection(squares=np.zeros(0), momentum=np.zeros((3, 0)), corner=corner)
    states = decouple(projection, Turning(damping=(0.0, 0.0)), MPI.COMM_WORLD)
    return Basis(shape=np.zeros((3, 0)), projection=projection, states=states)


def response() -> Response:
    """The vertical response at that point. Collective."""
    point = sparse.csr_matrix([[0.0, 0.0, 1.0]])
    return golden_car().couple(point, point)


def poles() -> list[complex]:
    """Poles 1/s as in PUBLISHED: H(s) + 1/k_t = 0 with a massless tire spring. Collective."""
    wheel = response()

    def closed(
        s: complex,
    ) -> complex:  # `receptance` adds the mirror poles, so it is H(s) off the imaginary axis too
        return wheel.receptance(np.array([s / (2j * np.pi)]))[0, 0, 0] + 1 / GOLDEN[0]

    return [
        complex(optimize.newton(closed, near, x1=near * 1.0001, tol=1e-13)) for near in PUBLISHED
    ]


def exact_poles() -> list[complex]:
    """Poles 1/s, in the same order: (m_u s2 + c s + k_s + k_t)(s2 + c s + k_s) = (c s + k_s)^2."""
    k_t, k_s, c, m_u = GOLDEN
    spring = np.array([c, k_s])
    both = np.polymul([m_u, c, k_s + k_t], [1.0, c, k_s])
    roots = np.roots(np.polysub(both, np.polymul(spring, spring)))
    return [complex(roots[np.abs(roots - near).argmin()]) for near in PUBLISHED]


def run() -> list[Table]:
    """One table of all cases."""
    rows = [
        [case, found, exact, unit, 100 * abs(found / exact - 1)]
        for rows in (
            tire_rows,
            golden_car_rows,
            contact.normal_rows,
            contact.shear_rows,
            contact.creep_rows,
            contact.grooved_rows,
            contact.static_friction_rows,
        )
        for case, unit, found, exact in rows()
    ]
    columns = [("case", ""), ("computed", "-"), ("exact", "-"), ("unit", ""), ("error", "%")]
    notes = [
        "Errors are those of the discretisation: they fall with the mesh or the number of points."
    ]
    return [Table("Closed forms", columns, rows, notes)]
