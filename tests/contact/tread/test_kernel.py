"""The tread as a convolution, the bonded layer, and the solvers that need no matrix."""

import numpy as np
import pytest
from scipy import sparse, special
from scipy.interpolate import CubicSpline

from tireroad.contact.solver.active_set import ActiveSet
from tireroad.contact.solver.projected_cg import MatrixCompliance, ProjectedCG, SpreadCompliance
from tireroad.contact.solver.solvers import make_solver
from tireroad.contact.tread.compliance import dense_compliance, half_space_influence
from tireroad.contact.tread.kernel import GridPlaces, KernelTread
from tireroad.contact.tread.layer import LayerInfluence, transform_ratio
from tireroad.fem.errors import ConvergenceError, InputError

SHAPE, SPACING = (13, 10), (0.002, 0.003)


def half_space(x, y, a, b):
    return half_space_influence(x, y, a, b, 5e6, 0.45)


def oval() -> tuple[GridPlaces, np.ndarray]:
    """An oval of points on the grid, their positions (c, 2)."""
    i, j = (a.ravel() for a in np.indices(SHAPE))
    points = np.stack([(i - 6) * SPACING[0], (j - 4.5) * SPACING[1]], axis=-1)
    inside = (points[:, 0] / 0.0125) ** 2 + (points[:, 1] / 0.0145) ** 2 < 1
    return GridPlaces(SHAPE, SPACING, np.flatnonzero(inside)), points[inside]


def patch_compliance(tire_scale: float):
    """The same compliance as a product and as a matrix, and the gap of a sphere above the points."""
    places, points = oval()
    nodes = np.stack(np.meshgrid([-0.012, 0.0, 0.012], [-0.012, 0.0, 0.012]), axis=-1).reshape(
        -1, 2
    )
    distance = np.linalg.norm(points[:, None] - nodes, axis=-1)
    weights = np.exp(-((distance / 0.01) ** 2))
    weights = sparse.csr_matrix(weights / weights.sum(axis=1)[:, None])
    spread = np.linalg.norm(nodes[:, None] - nodes, axis=-1)
    tire = tire_scale * (np.exp(-spread / 0.02) + 0.01 * np.triu(np.ones((9, 9)), 1))
    product = SpreadCompliance(tire, weights, KernelTread(places, half_space))
    halves = np.tile(np.array(SPACING) / 2, (len(points), 1))
    matrix = weights @ (weights @ tire.T).T + dense_compliance(points, halves, half_space)
    return product, matrix, (points**2).sum(axis=1) / 0.1


@pytest.mark.parametrize("thickness", [None, 0.004])
def test_convolution_is_the_matrix(thickness) -> None:
    places, points = oval()
    influence = half_space if thickness is None else LayerInfluence(5e6, 0.45, thickness)
    halves = np.tile(np.array(SPACING) / 2, (len(points), 1))
    matrix = dense_compliance(points, halves, influence)
    kernel = KernelTread(places, influence)
    force = np.random.default_rng(0).standard_normal(len(points))
    assert np.allclose(kernel.apply(force), matrix @ force, rtol=0, atol=1e-12 * matrix.max())
    some = np.array([3, 40, 41, 7])
    assert np.allclose(
        kernel.block(some, some[::2]), matrix[np.ix_(some, some[::2])], rtol=1e-11, atol=0
    )
    rough = kernel.precondition(kernel.apply(force))
    assert np.linalg.norm(rough - force) < 0.5 * np.linalg.norm(force)


def test_product_is_the_matrix() -> None:
    product, matrix, _ = patch_compliance(1e-4)
    force = np.random.default_rng(1).standard_normal(len(matrix))
    some = np.array([2, 30, 11])
    for compliance in (product, MatrixCompliance(matrix)):
        assert np.allclose(compliance.apply(force), matrix @ force, atol=1e-12 * matrix.max())
        assert np.allclose(
            compliance.block(some[::3], some), matrix[np.ix_(some[::3], some)], rtol=1e-11
        )
        assert np.allclose(compliance.diagonal, matrix.diagonal(), rtol=1e-12)


@pytest.mark.parametrize("tire_scale", [1e-6, 1e-4, 1e-2])
@pytest.mark.parametrize("depth", [4e-5, 5e-4, 1e-2])
def test_solvers_agree_from_first_touch_to_full_contact(tire_scale: float, depth: float) -> None:
    product, matrix, gap = patch_compliance(tire_scale)
    expected = ActiveSet(matrix).solve(gap - depth)
    for solver in (
        make_solver("active-set", product),
        ProjectedCG(product),
        ProjectedCG(MatrixCompliance(matrix)),
    ):
        for _ in range(2):
            force = solver.solve(gap - depth)
            assert np.abs(force - expected).max() < 1e-6 * expected.max()
            assert np.array_equal(solver.active, force > 0)
        assert solver.residual <= 1e-9


def test_projected_cg_keeps_the_state_at_rest_and_refuses_nonsense() -> None:
    product, matrix, gap = patch_compliance(1e-4)
    exact = ActiveSet(matrix)
    static = exact.solve(gap - 1e-3)
    q = np.where(static > 0, 0.0, exact.gap)
    solver = ProjectedCG(product)
    for _ in range(3):
        assert np.array_equal(solver.solve(q, static > 0, reference=static), static)
    assert not ProjectedCG(product).solve(gap + 1e-3).any()
    with pytest.raises(ConvergenceError, match="not finite"):
        solver.solve(q * np.nan)
    with pytest.raises(ConvergenceError, match="positive definite"):
        ProjectedCG(MatrixCompliance(-matrix)).solve(gap - 1e-3)


@pytest.mark.parametrize("nu", [0.0, 0.3, 0.45])
def test_layer_between_column_and_half_space(nu: float) -> None:
    """Long waves feel the confined column, h (1 + nu)(1 - 2 nu)/(E (1 - nu)); short ones the half-space."""
    m = np.array([1e-4])
    column = (1 - 2 * nu) / (1 - nu) ** 2 / 2
    assert transform_ratio(m, nu)[0] / m[0] == pytest.approx(column, rel=1e-6)
    assert transform_ratio(np.array([30.0]), nu)[0] == pytest.approx(1.0, rel=1e-12)


def test_layer_under_even_pressure_and_deep_layer() -> None:
    young, nu, h = 5e6, 0.3, 0.01
    n, d = 81, 0.004
    x, y = np.meshgrid((np.arange(n) - n // 2) * d, (np.arange(n) - n // 2) * d)
    half = np.full(x.shape, d / 2)
    sink = LayerInfluence(young, nu, h)(x, y, half, half).sum() * d * d
    assert sink == pytest.approx(h * (1 + nu) * (1 - 2 * nu) / (young * (1 - nu)), rel=1e-3)
    deep = LayerInfluence(5e6, 0.45, 100.0)(x, y, half, half)
    assert np.allclose(deep, half_space(x, y, half, half), rtol=0, atol=2e-3 * deep.max())
    with pytest.raises(InputError, match="thickness"):
        LayerInfluence(young, nu, 0.0)


@pytest.mark.slow
@pytest.mark.parametrize("nu", [0.0, 0.3, 0.49])
@pytest.mark.parametrize("thickness", [1e-4, 1e-3, 5e-3, 1.0])
def test_layer_is_positive_definite(nu: float, thickness: float) -> None:
    """Rectangles of any shape, a hundredth to 500 times as wide as the layer is thick: it never pulls."""
    layer = LayerInfluence(5e6, nu, thickness)
    for spacing in ((1e-3, 1e-3), (0.02, 0.02), (0.05, 0.05), (5e-3, 0.05), (0.03, 1e-3)):
        places = np.stack(np.indices((4, 4)), axis=-1).reshape(-1, 2) * spacing
        halves = np.tile(np.array(spacing) / 2, (len(places), 1))
        matrix = dense_compliance(places, halves, layer)
        values = np.linalg.eigvalsh(matrix)
        assert values[0] > 0.03 * values[-1], spacing
        half = dense_compliance(places, halves, lambda *w: half_space_influence(*w, 5e6, nu))
        assert np.all(matrix.diagonal() < half.diagonal()), spacing


@pytest.mark.slow
@pytest.mark.parametrize("sides", [(0.01, 0.01), (0.05, 0.08), (0.004, 0.12)])
@pytest.mark.parametrize("place", [(0.0, 0.0), (0.006, 0.003), (0.03, -0.1)])
def test_layer_under_a_rectangle(sides, place) -> None:
    """Against the correction of a point force, summed over small squares of the rectangle."""
    young, nu, h = 5e6, 0.4, 0.01
    m = (np.arange(4000) + 0.5) * 0.01
    ratio = 0.01 * (transform_ratio(m, nu) - 1.0) * (1 - nu**2) / (np.pi * young * h)
    r = np.linspace(0.0, 0.2, 800)
    point = CubicSpline(r, [special.j0(m * s / h) @ ratio for s in r])
    a, b = np.array(sides) / 2
    s, t = np.meshgrid(*((np.arange(400) + 0.5) / 400 * 2 * side - side for side in (a, b)))
    summed = point(np.hypot(place[0] - s, place[1] - t)).mean()
    where = [np.array([value]) for value in (*place, a, b)]
    found = LayerInfluence(young, nu, h)(*where) - half_space_influence(*where, young, nu)
    assert found[0] == pytest.approx(summed, abs=1e-4 * abs(point(0.0)))


def test_an_incompressible_layer_much_thinner_than_its_points_is_refused() -> None:
    with pytest.raises(InputError, match="closer contact.points, or a smaller contact.poisson"):
        LayerInfluence(5e6, 0.5, 1e-4)(*(np.array([v]) for v in (0.0, 0.0, 0.01, 0.01)))


def test_the_box_of_projected_cg_grows_with_the_contact() -> None:
    """It begins around a few points, then meets a stone far from them; and is the same after a restart."""
    product, matrix, gap = patch_compliance(1e-4)
    exact, solver = ActiveSet(matrix), ProjectedCG(product)
    static = exact.solve(gap - 5e-5)
    q = np.where(static > 0, 0.0, exact.gap)
    solver.solve(q, static > 0, reference=static)
    begun = len(solver._index)
    assert 0 < np.count_nonzero(static) <= begun < len(gap)
    stone = q - 3e-3 * (np.arange(len(gap)) < 3)
    force = solver.solve(stone, reference=static)
    expected = ActiveSet(matrix).solve(stone, reference=static)
    assert np.abs(force - expected).max() < 1e-6 * expected.max()
    assert force[:3].all() and begun < len(solver._index)
    assert np.array_equal(solver.gap == 0, force > 0)
    again = ProjectedCG(product)
    again.set_state(solver.state())
    assert np.array_equal(again.solve(q, reference=static), solver.solve(q, reference=static))
