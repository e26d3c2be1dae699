"""Horizontal displacements of half-space and layer: kernels against integrals and equations, in the loop."""

import numpy as np
import pytest
from mpi4py import MPI

from tireroad.contact.loop import ContactProblem, Drive, Loop
from tireroad.contact.solver.active_set import ActiveSet
from tireroad.contact.solver.stick_slip import BrushFriction
from tireroad.contact.tread.brush import Brush, BrushLaw
from tireroad.contact.tread.compliance import half_space_compliance, half_space_influence
from tireroad.contact.tread.kernel import GridPlaces
from tireroad.contact.tread.layer import LayerInfluence, LayerShear, transforms
from tireroad.contact.tread.memory import TreadMemory, WholeGrid
from tireroad.contact.tread.shear import KernelShear, MatrixShear, half_space_shear
from tireroad.greens.recursion import Recursion
from tireroad.tests.validation.cases import RollingStrip, oval_patch

YOUNG = 1e6


def half_space(nu: float):
    return lambda x, y, a, b: half_space_shear(x, y, a, b, YOUNG, nu)


def cells(nx: int, ny: int, dx: float, dy: float):
    """A whole grid: its places, points (c, 2) and half sizes (c, 2)."""
    place = np.arange(nx * ny)
    points = np.stack(np.divmod(place, ny), axis=-1) * [dx, dy]
    return GridPlaces((nx, ny), (dx, dy), place), points, np.tile([dx / 2, dy / 2], (len(place), 1))


@pytest.mark.parametrize("place", [(0.7, -0.4), (3.0, 1.0), (5.9, 0.1), (40.0, -25.0)])
def test_half_space_against_quadrature(place) -> None:
    nu, a, b = 0.3, 0.5, 0.3
    found = half_space(nu)(*(np.array(v) for v in (*place, a, b)))
    nodes, weights = np.polynomial.legendre.leggauss(200)
    x, y = place[0] - a * nodes[:, None], place[1] - b * nodes[None, :]
    r = np.hypot(x, y)
    parts = [
        (1 - nu) / r + nu * x**2 / r**3,
        nu * x * y / r**3,
        (1 - nu) / r + nu * y**2 / r**3,
        (0.5 - nu) * x / r**2,
        (0.5 - nu) * y / r**2,
    ]
    mean = np.array([(weights[:, None] * weights * part).sum() / 4 for part in parts])
    assert found == pytest.approx(mean * (1 + nu) / (np.pi * YOUNG), rel=1e-9)


def solved_layer(nu: float, m: float) -> tuple[float, float, float]:
    """T, S, C of a layer of thickness m: waves cos x, shear modulus 1, its four (two) amplitudes by its boundaries."""

    def shape(a: float, b: float, s: int, z: float):
        """U sin x, W cos x, stresses zz and xz, of the solution U = (a + b z) e^(s z) of the plane equations."""
        e = np.exp(s * z)
        u = (a + b * z) * e
        w = e * (2 * (1 - 2 * nu) * b - s * a - s * b * z + b)
        slope = 2 * s * (1 - 2 * nu) * b * e - u
        return u, w, 2 * slope + 2 * nu / (1 - 2 * nu) * (u + slope), s * u + b * e - w

    def row(part: int, z: float) -> list[float]:
        return [shape(a, b, s, z)[part] for s in (1, -1) for a, b in ((1, 0), (0, 1))]

    matrix = [row(0, m), row(1, m), row(2, 0.0), row(3, 0.0)]
    amplitudes = np.linalg.solve(matrix, [0.0, 0.0, 0.0, -1.0])
    across = np.linalg.solve([[np.exp(m), np.exp(-m)], [1.0, -1.0]], [0.0, -1.0]).sum()
    return row(0, 0.0) @ amplitudes, across, -(row(1, 0.0) @ amplitudes)


@pytest.mark.parametrize("nu", [0.0, 0.3, 0.49])
@pytest.mark.parametrize("m", [0.1, 1.0, 4.0])
def test_layer_transforms_solve_its_equations(nu: float, m: float) -> None:
    found = np.array(transforms(np.array(m), nu))
    assert found == pytest.approx(np.array(solved_layer(nu, m)), rel=1e-10)


def test_layer_moves_a_wave_as_its_transform_says() -> None:
    """Long waves of forces, summed over the cells of a periodic grid."""
    nu, h, n, d = 0.49, 0.01, 128, 0.002
    i = np.fft.fftfreq(n, 1 / n) * d
    x, y = np.meshgrid(i, i, indexing="ij")
    kernels = np.fft.fft2(
        LayerShear(YOUNG, nu, h)(x, y, np.full(x.shape, d / 2), np.full(x.shape, d / 2))
    )
    for p, q in ((3, 0), (0, 2), (2, 3)):
        kx, ky = 2 * np.pi * np.array([p, q]) / (n * d)
        k = np.hypot(kx, ky)
        along, across, coupling = transforms(np.array(k * h), nu) * np.array(
            np.sinc(p / n) * np.sinc(q / n) / (d**2 * k * YOUNG / 2 / (1 + nu))
        )
        c, s = kx / k, ky / k
        wanted = [along * c**2 + across * s**2, (along - across) * c * s,
                  along * s**2 + across * c**2, -1j * coupling * c, -1j * coupling * s]  # fmt: skip
        assert np.abs(kernels[:, p, q] - wanted).max() < 3e-4 * along


def test_a_thick_layer_is_a_half_space_and_a_thin_one_is_squeezed_out() -> None:
    x, y, a = np.array([0.0, 3.0]), np.array([0.0, 1.0]), np.array(0.5)
    thick = LayerShear(YOUNG, 0.3, 1e4)(x, y, a, a)
    assert thick == pytest.approx(half_space(0.3)(x, y, a, a), rel=1e-3)
    # Incompressible, pressed on a strip: the half-space stays where it is, the layer moves away from the strip.
    assert not half_space(0.5)(x, y, a, a)[3:].any()
    assert -LayerShear(YOUNG, 0.5, 0.5)(x, y, a, a)[3, 1] > 0


@pytest.mark.parametrize("nu", [0.0, 0.25, 0.49])
def test_by_fft_and_by_matrix_are_one_symmetric_positive_definite_compliance(nu: float) -> None:
    grid, points, half_sizes = cells(7, 6, 0.1, 0.2)
    fast, dense = (
        KernelShear(grid, half_space(nu)),
        MatrixShear(points, half_sizes, half_space(nu)),
    )
    rng = np.random.default_rng(1)
    t, f = rng.standard_normal((42, 2)) @ [1, 1j], rng.standard_normal(42)
    for one, other in zip(
        (fast.spread(t), fast.lift(t), fast.drag(f)),
        (dense.spread(t), dense.lift(t), dense.drag(f)),
        strict=True,
    ):
        assert np.abs(one - other).max() <= 1e-12 * np.abs(dense.spread(t)).max()
    index = np.array([3, 4, 17, 40])
    part = np.zeros(42, complex)
    part[index] = t[index]
    for shear in (fast, dense):
        pair = shear.matrix(index) @ np.concatenate([t[index].real, t[index].imag])
        assert pair[:4] + 1j * pair[4:] == pytest.approx(shear.spread(part)[index])
        lifted = shear.lifted(index) @ np.concatenate([t[index].real, t[index].imag])
        assert lifted == pytest.approx(shear.lift(part)[index], abs=1e-20)
        assert shear.bound >= np.linalg.norm(fast.spread(t)) / np.linalg.norm(t)
    parts = [np.stack([column(e) for e in np.eye(42)], axis=1) for column in (
        lambda e: dense.lift(e + 0j), lambda e: dense.lift(1j * e),
        lambda e: dense.spread(e + 0j), lambda e: dense.spread(1j * e))]  # fmt: skip
    lx, ly, sx, sy = parts
    whole = np.block([
        [half_space_compliance(points, half_sizes, YOUNG, nu), lx, ly],
        [lx.T, sx.real, sy.real], [ly.T, sx.imag, sy.imag]])  # fmt: skip
    assert np.abs(whole - whole.T).max() < 1e-14 * np.abs(whole).max()
    assert np.linalg.eigvalsh(whole)[0] > 0


@pytest.mark.mpi
def test_a_loop_goes_on_with_the_same_bits_on_a_shearing_tread() -> None:
    """Half-space alone, no bristles, pressure and friction coupled; in the middle of it new objects take over."""
    patch, step, nu = oval_patch((9, 7), (0.015, 0.02), 500.0), 1e-4, 0.3
    count, steps = len(patch.points), 60
    response = RollingStrip(speed=20.0).horizontal_response(patch.points, 3, 2, 1e3)
    normal = half_space_compliance(patch.points[:, :2], patch.half_sizes, 5e6, nu)

    def influence(x, y, a, b):
        return half_space_shear(x, y, a, b, 5e6, nu)

    def height(x, y):
        return 1e-3 * np.sin(30 * x + 10 * y) * np.clip(x / 0.3, 0, 1) ** 3

    def loop() -> Loop:
        tire = Recursion(response=response, step=step, scheme="linear", comm=MPI.COMM_WORLD)
        shear = MatrixShear(patch.points[:, :2], patch.half_sizes, influence)
        brush = Brush(
            BrushLaw(np.inf, 0.5, (2e-3, 1e-3)), patch.points[:, 0], patch.line, 20.0, step
        )
        brush.begin(patch.force > 0)
        friction = BrushFriction(brush, tire.same_step, None, shear)
        solver = ActiveSet(tire.same_step[:count, :count] + normal)
        return Loop(tire, ContactProblem(patch, tire.same_step, solver, friction))

    def go(one: Loop, until: int, done: int = 0) -> list:
        blocks = one.roll(Drive(height, lambda t: 0.0, 20.0), step, until, done=done)
        return [instant for block in blocks for instant in block.instants()]

    unbroken, first, second = go(loop(), steps), loop(), loop()
    go(first, 30)
    second.restore({name: np.array(value) for name, value in first.snapshot().items()})
    for one, other in zip(unbroken[30:], go(second, steps, 30), strict=True):
        assert np.array_equal(one.force, other.force)
        assert np.array_equal(one.horizontal, other.horizontal)
    last = unbroken[-1]
    size = np.linalg.norm(last.horizontal, axis=1)
    assert np.all(size <= 0.5 * last.force * (1 + 1e-9) + 1e-12)
    sticks = (last.force > 0) & (size < 0.49 * last.force)
    assert sticks.any()
    assert (size > 0.499 * last.force)[last.force > 0].any()


def test_sideways_too_a_tread_creeps_to_its_relaxed_modulus() -> None:
    grid, points, half_sizes = cells(6, 5, 0.01, 0.01)
    creep = np.array([0.5]), np.array([0.01])
    tread = half_space(0.3)
    past = WholeGrid(grid, lambda *at: half_space_influence(*at, YOUNG, 0.3), tread)
    memory = TreadMemory(creep, past, 0.01, 0.0, 1e-3)
    force = np.random.default_rng(3).standard_normal((3, 30))
    for _ in range(150):
        past = memory.predict()
        memory.advance(force.ravel())
    shear, sideways = MatrixShear(points, half_sizes, tread), force[1] + 1j * force[2]
    moved = shear.spread(sideways) + shear.drag(force[0])
    once = half_space_compliance(points, half_sizes, YOUNG, 0.3) @ force[0] + shear.lift(sideways)
    elastic = np.stack([once, moved.real, moved.imag])
    assert past + memory.at_once * elastic == pytest.approx(
        1.5 * elastic, rel=1e-5, abs=1e-9 * np.abs(elastic).max()
    )


def test_layer_of_both_directions_is_positive_definite() -> None:
    grid, points, half_sizes = cells(6, 6, 0.006, 0.006)
    x, y = (points[:, None, k] - points[None, :, k] for k in (0, 1))
    given = x, y, half_sizes[None, :, 0], half_sizes[None, :, 1]
    normal = LayerInfluence(1e7, 0.49, 0.01)(*given)
    xx, xy, yy, zx, zy = LayerShear(1e7, 0.49, 0.01)(*given)
    whole = np.block([[normal, zx, zy], [zx.T, xx, xy], [zy.T, xy.T, yy]])
    assert np.abs(whole - whole.T).max() < 1e-12 * np.abs(whole).max()
    assert np.linalg.eigvalsh(whole)[0] > 0
