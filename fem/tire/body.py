"""The tire as a discretised body: mesh, displacement field, clamped rim, integration measures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI
from petsc4py import PETSc
from ufl.core.expr import Expr

from tireroad.fem import compat
from tireroad.fem.collective import collect, watch
from tireroad.fem.sections.mesh2d import Ring
from tireroad.fem.sections.torus import Torus
from tireroad.fem.tire.cords import Cords
from tireroad.fem.tire.material import Material
from tireroad.fem.tire.mesh import INNER, RIM, TREAD, Region, Wall, build, compounds
from tireroad.fem.tire.plies import Plies, laid_on


class Gather:
    """Gathers values at chosen lattice nodes on every process, in the order of `ids`.

    `owned`: ids of this process's owned nodes; `ids`: those to gather, the same on all
    processes.
    """

    def __init__(self, comm: MPI.Comm, owned: np.ndarray, ids: np.ndarray) -> None:
        self.comm = comm
        self.ids = ids
        self.local = np.flatnonzero(np.isin(owned, ids))  # owned blocks that are wanted
        order = np.argsort(ids, kind="stable")
        # Their indices in `ids`.
        self.place = order[np.searchsorted(ids, owned[self.local], sorter=order)]

    def __call__(self, owned: np.ndarray) -> np.ndarray:
        """Values (nodes, ...) on every process from those at the owned nodes (owned, ...).
        Collective."""
        out = np.zeros((len(self.ids), *owned.shape[1:]))
        out[self.place] = owned[self.local]
        self.comm.Allreduce(MPI.IN_PLACE, out)
        return out


class Body:
    """A ring of given materials and cords, with its displacement `u` from the undeformed shape.

    A `Ring` takes materials by name of its section's regions, a `Torus` one for the wall and
    `regions` with others. `cords` lie on the section's plies of their names. Collective to make.
    `ids`: lattice ids of this process's owned nodes; `rim` and `tread`: its blocked dofs there
    (`rim` with ghosts, as boundary conditions need them); `beads`: those of the outer face on the
    rim.
    """

    def __init__(
        self,
        comm: MPI.Comm,
        tire: Ring | Torus,
        material: Material | Mapping[str, Material],
        regions: Sequence[Region] = (),
        cords: Sequence[Cords] = (),
    ) -> None:
        collect(comm)
        self.comm = comm
        if isinstance(tire, Torus):
            tire = tire.ring([region.patch(i) for i, region in enumerate(regions)])
        if isinstance(material, Material):
            material = compounds(material, tuple(regions))
        self.materials = material
        self.tire = build(comm, tire)
        self.ring, order = tire, tire.order
        self.mesh, self.lattice = self.tire.mesh, self.tire.lattice
        watch(comm, self, self.mesh)
        self.space = compat.vector_space(self.mesh, order)
        self.wall = Wall(self.tire, material)
        self.plies = Plies(self.mesh, order, cords, laid_on(self.tire, cords))
        self.u = fem.Function(self.space)
        # One test and one trial function for all forms: UFL does not always treat two of the same
        # space as equal (seen with dolfinx 0.5.2, varying between runs).
        self.test, self.trial = ufl.TestFunction(self.space), ufl.TrialFunction(self.space)
        self.nodes = self.space.dofmap.index_map.size_local
        self.ids = self.lattice.ids(self.space.tabulate_dof_coordinates()[: self.nodes])
        self.rim = self._face_dofs(RIM)
        tread = self._face_dofs(TREAD)
        self.tread = np.setdiff1d(tread[tread < self.nodes], self.rim)
        self.beads = np.intersect1d(tread, self.rim)
        # Degree 2 x order integrates the quadratic form of an affine element exactly: full
        # integration.
        measure = {"metadata": {"quadrature_degree": 2 * order}}
        self.dx = ufl.Measure("dx", domain=self.mesh, **measure)
        # One Gauss point fewer per direction, for the dilatation (static_residual).
        reduced = {"quadrature_degree": 2 * order - 1}
        self.reduced_dx = ufl.Measure("dx", domain=self.mesh, metadata=reduced)
        # Two surface tangents and a test function: exact integration makes the pressure stiffness
        # symmetric. At order 3, degree 2 x order left an asymmetry of 7e-8, more than the
        # stiffness of the lowest modes.
        exact = {"quadrature_degree": 3 * order - 1}
        self.inner_ds = ufl.Measure(
            "ds", domain=self.mesh, subdomain_data=self.tire.facets, metadata=exact
        )(INNER)
        self.everywhere = Gather(comm, self.ids, np.arange(self.lattice.size))
        self.surface = Gather(comm, self.ids, self.lattice.face)

    def _face_dofs(self, tag: int) -> np.ndarray:
        facets = self.tire.facets.indices[self.tire.facets.values == tag]
        return fem.locate_dofs_topological(self.space, 2, facets)

    def clamp(self) -> fem.DirichletBC:
        """Boundary condition: all components zero on the rim."""
        return fem.dirichletbc(np.zeros(3), self.rim, self.space)

    def nodal_mass(self) -> np.ndarray:
        """Lumped mass of the owned dofs (3 nodes,), kg, rim and cords included. Collective.

        int rho phi_i . (1, 1, 1) by the quadrature whose points are the nodes, so positive.
        """
        lobatto = {"quadrature_rule": "GLL", "quadrature_degree": 2 * self.ring.order - 1}
        dx = ufl.Measure("dx", domain=self.mesh, metadata=lobatto)
        ones = ufl.as_vector((1.0, 1.0, 1.0))
        weight = self.wall.density * ufl.inner(self.test, ones) * dx
        weight += self.plies.inertia(ufl.inner(self.test, ones), "nodes")
        vector = fem.petsc.assemble_vector(compat.form(weight))
        vector.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
        return vector.array_r.copy()

    def inertia(self, integrand: Expr) -> ufl.Form:
        """int rho0 integrand over wall and cords by full integration, a UFL form."""
        return self.wall.density * integrand * self.dx + self.plies.inertia(integrand)

    def owned(self, vector: np.ndarray) -> np.ndarray:
        """The owned part of a dof array as (nodes, 3)."""
        return vector[: 3 * self.nodes].reshape(-1, 3)

    def displacement(self) -> np.ndarray:
        """Displacement of all lattice nodes (n, 3), m, on every process. Collective."""
        return self.everywhere(self.owned(self.u.x.array))

    def set_displacement(self, values: np.ndarray) -> None:
        """Set the displacement of all lattice nodes (n, 3), m. Collective."""
        self.owned(self.u.x.array)[:] = values[self.ids]
        self.u.x.scatter_forward()
