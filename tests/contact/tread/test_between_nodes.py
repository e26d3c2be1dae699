"""What a wall gives way to between the nodes of its mesh: what a half-space seen through a mesh lacks of itself."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy import sparse
from scipy.sparse.linalg import splu

from tireroad.contact.patch import Patch
from tireroad.contact.tread.between_nodes import (
    OuterRubber,
    Raster,
    before_equilibrium,
    in_elements,
    on_nodes,
    over_rectangles,
)
from tireroad.contact.tread.compliance import half_space_influence
from tireroad.contact.tread.kernel import GridPlaces, KernelTread
from tireroad.contact.tread.laws.elastic import ElasticLayer, HalfSpace

PITCH, SIZE = 0.008, 12  # m, points along and across
E, NU, THICK, WIDE = 1e7, 0.49, 0.008, 0.048  # Pa, -, m, half the width of a layer of elements
SQUARE = 0.003  # m: side of a square under pressure


def wall(x, y, a, b):
    return half_space_influence(x, y, a, b, 48e6, 0.45)


def patch(between: int) -> tuple[Patch, np.ndarray]:
    """A grid of points on nodes `between` pitches apart, linear between them, and the nodes' areas."""
    line = np.arange(SIZE) / between
    nodes = int(np.ceil(line[-1])) + 1
    hat = np.maximum(0.0, 1 - np.abs(line[:, None] - np.arange(nodes)))
    x, y = (PITCH * v.ravel() for v in np.meshgrid(np.arange(SIZE), np.arange(SIZE), indexing="ij"))
    count = SIZE**2
    made = Patch(
        index=np.arange(nodes**2),
        points=np.stack([x, y, np.zeros(count)], axis=-1),
        half_sizes=np.full((count, 2), PITCH / 2),
        force=np.zeros(count),
        gap=np.zeros(count),
        edge=np.zeros(count, bool),
        line=np.tile(np.arange(SIZE), SIZE),
        weights=sparse.csr_matrix(np.kron(hat, hat)),
        places=GridPlaces((SIZE, SIZE), (PITCH, PITCH), np.arange(count)),
    )
    return made, np.full(nodes**2, (between * PITCH) ** 2)


def matrix(made: Patch, influence) -> np.ndarray:
    every = np.arange(len(made.points))
    return KernelTread(made.places, influence).block(every, every)


def seen(shape: Callable, pitch: float, half: float) -> Raster:
    """A square of 2 `half` m in cells of `pitch` m, of nodes whose `shape` functions (n, q) are a line's, averaged over cells."""
    line = np.arange(-half + pitch / 2, half, pitch)
    along = (shape(line - pitch / np.sqrt(12)) + shape(line + pitch / np.sqrt(12))) / 2
    return Raster(sparse.csr_matrix(np.kron(along, along)), (len(line),) * 2, (pitch, pitch))


def test_what_nodes_have_is_the_least_energy_of_their_displacements():
    """Galerkin: W N W^T f is the displacement W q that makes q^T W^T C^-1 W q / 2 - q^T W^T f least; and never more than C f."""
    layer = ElasticLayer(youngs_modulus=1e7, poisson_ratio=0.4, thickness=0.004).influence(1.0)
    face = seen(hats(0.012), 0.004, 0.048)
    weights, count = face.weights.toarray(), face.weights.shape[0]
    grid = GridPlaces(face.shape, face.spacing, np.arange(count))
    whole = KernelTread(grid, layer).block(np.arange(count), np.arange(count))
    middle = weights[:, 12:-12]  # at the ends C^-1 of a plane is not that of a square
    known = on_nodes(face, layer)
    force = np.zeros(count)
    force[[12 * 24 + 12, 13 * 24 + 15]] = 3.0, -1.0
    right = weights @ np.linalg.solve(
        weights.T @ np.linalg.solve(whole, weights), weights.T @ force
    )
    found = weights @ (known @ (weights.T @ force))
    assert found == pytest.approx(right, abs=0.01 * np.abs(right).max())
    lacking = np.linalg.eigvalsh(whole - weights @ known @ weights.T)
    assert middle.size and lacking[0] > -0.02 * np.linalg.eigvalsh(whole)[-1]


def test_nodes_lose_of_a_tread_no_more_than_they_have() -> None:
    """Between N and A in all directions: neither A nor N less it gives back; N itself where nodes have more."""
    rng = np.random.default_rng(2)
    known, nodes = (one @ one.T for one in rng.standard_normal((2, 12, 12)))
    known[-2:] = known[:, -2:] = 0.0  # nodes of which the raster shows an edge alone
    found = in_elements(known, nodes)
    seen, size = slice(0, 10), np.linalg.norm(known, 2)
    for whole in (known, nodes):
        assert np.linalg.eigvalsh((whole - found)[seen, seen])[0] > -1e-9 * size
    assert not found[-2:].any()
    assert found[seen, seen] == pytest.approx(in_elements(known[seen, seen], nodes[seen, seen]))
    more = known + nodes
    assert in_elements(known, more) == pytest.approx(known, abs=1e-9 * size)


def hats(apart: float) -> Callable:
    """Linear shape functions of nodes `apart` m from each other."""
    nodes = np.arange(-0.048, 0.048 + apart / 2, apart)
    return lambda x: np.maximum(0.0, 1 - np.abs(x[:, None] - nodes) / apart)


@pytest.mark.parametrize("apart", [0.012, 0.008, 0.006])
def test_a_layer_of_elements_is_the_layer_again(apart):
    """A layer of quadratic elements on a rigid base under a square: its own compliance less N, and C. In series it is half as much
    again too soft."""
    law = ElasticLayer(youngs_modulus=E, poisson_ratio=NU, thickness=THICK)
    normal, shear = law.influence(1.0), law.shear(1.0)
    elements, known = (
        layer_of_elements(apart),
        on_nodes(seen(quadratic(apart), 0.0015, WIDE), normal, shear),
    )
    p, side, zero = len(known) // 3, np.full(1, SQUARE / 2), np.zeros(1)
    edge_points = SQUARE / np.sqrt(12) * np.array([-1.0, 1.0])
    one = quadratic(apart)(edge_points).mean(axis=0)
    row = np.kron(one, one)
    for part, own in (
        (0, normal(zero, zero, side, side)[0]),
        (1, shear(zero, zero, side, side)[0, 0]),
    ):
        block = slice(part * p, part * p + p)
        of_elements, resolved = (row @ matrix[block, block] @ row for matrix in (elements, known))
        assert of_elements / own > 0.33
        assert (of_elements - resolved) / own == pytest.approx(0.0, abs=0.16)


def quadratic(apart: float) -> Callable:
    """Quadratic shape functions of nodes `apart` m from each other."""
    count = round(WIDE / apart)  # elements

    def of(x: np.ndarray) -> np.ndarray:
        element = np.clip((x + WIDE) // (2 * apart), 0, count - 1).astype(int)
        value, _ = edge((x + WIDE) / apart - 2 * element - 1.0)
        out = np.zeros((len(x), 2 * count + 1))
        for k in range(3):
            out[np.arange(len(x)), 2 * element + k] = value[k]
        return out

    return of


def layer_of_elements(apart: float) -> np.ndarray:
    """Displacements (2p, 2p) m/N, z and x, of the nodes on a layer of elements on a rigid base, each under forces in its direction;
    integrated as in the program: fully for the distortion, one order lower for the volume."""
    shear, bulk = E / (2 * (1 + NU)), E / (3 * (1 - 2 * NU))
    half = np.array([apart, apart, THICK / 2])
    own = np.zeros((81, 81))
    for order in (3, 2):
        for at, weight in zip(*gauss_points(order), strict=True):
            slope = np.stack(
                [
                    np.einsum("a,b,c->abc", *(edge(x)[axis == d] for d, x in enumerate(at))).ravel()
                    for axis in range(3)
                ]
            )
            slope /= half[:, None]
            strain = np.zeros((3, 3, 27, 3))
            for d in range(3):
                strain[d, :, :, d] = slope
            strain = strain.reshape(3, 3, 81)
            even = 0.5 * (strain + strain.transpose(1, 0, 2))
            opened = np.einsum("iik->k", even)
            part = bulk * np.outer(opened, opened)
            if order == 3:
                distorted = even - np.eye(3)[:, :, None] * opened / 3
                part = 2 * shear * np.einsum("ijk,ijl->kl", distorted, distorted)
            own += weight * half.prod() * part
    count = round(WIDE / apart)  # elements of two distances
    lines = 2 * count + 1
    number = np.arange(lines * lines * 3).reshape(lines, lines, 3)
    cells = np.array(
        [
            number[2 * i : 2 * i + 3, 2 * j : 2 * j + 3].ravel()
            for i in range(count)
            for j in range(count)
        ]
    )
    unknowns = (3 * cells[:, :, None] + np.arange(3)).reshape(len(cells), 81)
    rows, columns = np.repeat(unknowns, 81, axis=1), np.tile(unknowns, 81)
    values = np.tile(own.ravel(), (len(cells), 1))
    whole = sparse.csc_matrix((values.ravel(), (rows.ravel(), columns.ravel())))
    free = (3 * number[:, :, 1:].ravel()[:, None] + np.arange(3)).ravel()
    solve, place = splu(whole[free][:, free]).solve, np.full(whole.shape[0], -1)
    place[free] = np.arange(len(free))
    p, out = lines**2, np.zeros((2 * lines**2,) * 2)
    for part, direction in enumerate((2, 0)):
        those = place[3 * number[:, :, 2].ravel() + direction]
        load = np.zeros((len(free), p))
        load[those, np.arange(p)] = 1.0
        block = slice(part * p, part * p + p)
        out[block, block] = solve(load)[those]
    return out


def edge(x: float) -> tuple[np.ndarray, np.ndarray]:
    """Quadratic shape functions from -1 to 1, and their slopes."""
    value = np.array([x * (x - 1) / 2, 1 - x * x, x * (x + 1) / 2])
    return value, np.array([x - 0.5, -2 * x, x + 0.5])


def gauss_points(order: int) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 3) and weights (n,) on a cube."""
    line, weight = np.polynomial.legendre.leggauss(order)
    points = np.stack(np.meshgrid(line, line, line, indexing="ij"), axis=-1).reshape(-1, 3)
    return points, np.einsum("a,b,c->abc", weight, weight, weight).ravel()


def test_a_tread_on_a_wall_is_softer_by_that():
    made, _ = patch(2)
    law = HalfSpace(youngs_modulus=1e7, poisson_ratio=0.49)
    both = matrix(made, OuterRubber(law=law, wall=wall).influence(1.0))
    assert both == pytest.approx(matrix(made, law.influence(1.0)) + matrix(made, wall))


def test_the_mean_over_a_square_beside_its_middle():
    """Johnson, Contact Mechanics (1985), 3.3: 1.122 and 0.946 of p L (1 - nu^2) / E."""
    at = np.zeros(1), np.zeros(1), np.full(1, 1.0), np.full(1, 1.0)
    assert over_rectangles(wall)(*at) / wall(*at) == pytest.approx(0.946 / 1.122, rel=0.03)


def test_the_unloaded_shape_stays():
    """The gap without any force is that of the mesh alone."""
    made, area = patch(2)
    known = 1e-7 * np.eye(len(area))
    force = np.zeros(len(area))
    force[10:13] = 100.0
    own = 1e-6 * np.eye(len(area))  # m/N, of the nodes
    flat = made.gap - made.weights @ (own @ force)
    other = before_equilibrium(made, known, force)
    assert other.gap - other.weights @ ((own - known) @ force) == pytest.approx(flat, abs=1e-15)
