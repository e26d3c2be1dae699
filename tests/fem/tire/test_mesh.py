"""The ring of hexahedra: where its nodes are, what its faces are, on any number of processes."""

import numpy as np
import pytest
import ufl
from dolfinx import fem
from mpi4py import MPI

from tireroad.fem import compat
from tireroad.fem.tire.mesh import INNER, RIM, TREAD


@pytest.mark.mpi
@pytest.mark.parametrize("order", [1, 2, 3])
def test_every_node_has_one_place_in_the_lattice(make_body, order):
    body = make_body(order, comm=MPI.COMM_WORLD, footprint_size=0.4)
    ids = np.concatenate(MPI.COMM_WORLD.allgather(body.ids))
    np.testing.assert_array_equal(np.sort(ids), np.arange(body.lattice.size))
    points = body.space.tabulate_dof_coordinates()[: body.nodes]
    # The element's own map and the lattice agree on its geometry nodes; between, by its order.
    off = np.linalg.norm(points - body.lattice.points(body.ids), axis=1).max(initial=0)
    assert off < (1e-12 if order < 3 else 2e-4)


@pytest.mark.mpi
@pytest.mark.parametrize("order", [1, 2, 3])
def test_faces_have_the_areas_of_the_torus(make_body, order):
    body = make_body(order, 24, 12, comm=MPI.COMM_WORLD)
    measure = ufl.Measure("ds", domain=body.mesh, subdomain_data=body.tire.facets)
    one, half = fem.Constant(body.mesh, 1.0), np.radians(120)

    def area(tag):
        return body.comm.allreduce(fem.assemble_scalar(compat.form(one * measure(tag))))

    def torus(radius):
        return 2 * np.pi * radius * (0.22 * 2 * half + 2 * radius * np.sin(half))

    bead = 0.22 + np.array([0.1, 0.088]) * np.cos(half)
    rim = 2 * np.pi * abs(np.diff(bead)[0] / np.cos(half)) * bead.mean() * 2
    tolerance = {1: 2e-2, 2: 1e-4, 3: 1e-5}[order]
    expected = {TREAD: torus(0.1), INNER: torus(0.088), RIM: rim}
    for tag, value in expected.items():
        assert area(tag) == pytest.approx(value, rel=tolerance)
    everything = body.comm.allreduce(fem.assemble_scalar(compat.form(one * ufl.ds(body.mesh))))
    assert everything == pytest.approx(sum(area(tag) for tag in expected), rel=1e-12)


def test_graded_corners_keep_the_mirror_planes_to_the_last_bit(make_body):
    body = make_body(footprint_size=0.25)
    arc, ring = body.ring.arc_corners, body.ring.ring_corners - np.pi
    np.testing.assert_array_equal(arc, -arc[::-1])
    np.testing.assert_allclose(ring, -ring[::-1], atol=1e-15)
    sizes = np.diff(body.ring.ring_corners)
    assert sizes[0] < 0.5 * sizes.max()
