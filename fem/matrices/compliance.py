"""Static flexibility of a held, free or rotating tire, and receptances of its full matrices.

Direct solves are by MUMPS: one factorisation, blocks of right-hand sides, every block checked.

A free tire is solved by inertia relief. A rigid motion R has no stiffness, so K is singular. A load
is balanced by the inertia forces of the rigid acceleration it causes, and the response is made
orthogonal to the rigid motions:

    G = P K^+ P^T,   P = 1 - R R^T M,   R^T M R = 1   (MacNeal, Comput. Struct. 1 (1971) 581)

For K^+ as many unknowns of the rim are held as there are rigid motions; a balanced load causes no
reaction there.

By frame indifference K R of a rotation is the moment of the static forces that do not turn with the
tire. The doppler inertia leaves some where there should be none: Omega^2 S_B u of a shape that is
round but for its elements. A balanced load then causes a small reaction, which is balanced and
solved for again until none is left.

The receptance of the full matrices, frequency by frequency, is the reference for all modal ones:
(K_Omega - w^2 M + i w E) u = b with u = a + i c in real arithmetic:

    [[A, -w E], [w E, A]] [a; c] = [b; 0],   A = K_Omega - w^2 M
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy import linalg, sparse

from tireroad.fem.cavity import Column
from tireroad.fem.collective import summed
from tireroad.fem.errors import ConvergenceError, NearlySingular
from tireroad.fem.matrices.operators import Operators, Rotation, rigid_motions

_CHUNK = 64  # right-hand sides per solve: enough for BLAS 3 in MUMPS, little memory
RESIDUAL_TOLERANCE = 1e-8
_SUMS = 4  # random sums that check a block; checking every column took as long as the solves

# Of the norm of M^-1/2 K M^-1/2: stiffnesses nearer to zero are none, rounding is 1e-16. The modes
# and the static shapes of a tire must agree on it.
RIGID = 1e-12
_PASSES = 8  # each reduces what is out of balance at least a thousandfold where motions are rigid


def solve_all(matrix: PETSc.Mat, loads: sparse.spmatrix) -> np.ndarray:
    """Own rows (n, p) of matrix^-1 loads by one factorisation. Collective."""
    pc = factorise(matrix)
    solution = solve_columns(pc, matrix, loads)
    pc.destroy()
    return solution


def solve_columns(
    pc: PETSc.PC, matrix: PETSc.Mat, columns: np.ndarray | sparse.spmatrix
) -> np.ndarray:
    """Own rows (n, k) of matrix^-1 columns by the given factorisation; checked. Collective."""
    out = np.empty(columns.shape)
    for part, solved in solve_parts(pc, matrix, columns):
        out[:, part] = solved
    return out


def solve_parts(
    pc: PETSc.PC, matrix: PETSc.Mat, columns: np.ndarray | sparse.spmatrix
) -> Iterator[tuple[slice, np.ndarray]]:
    """As `solve_columns`, in blocks, each with its slice, to save memory. Collective."""
    factor = pc.getFactorMatrix()
    if not isinstance(columns, np.ndarray):
        columns = columns.tocsc()
    for start in range(0, columns.shape[1], _CHUNK):
        part = slice(start, min(start + _CHUNK, columns.shape[1]))
        loads = columns[:, part]
        dense = loads if isinstance(loads, np.ndarray) else loads.toarray()
        yield part, _solve(factor, matrix, dense)
    factor.destroy()  # release this reference, which petsc4py would keep forever


def symmetric(matrix: PETSc.Mat) -> bool:
    """Whether the matrix is marked symmetric."""
    known, symmetric = matrix.isSymmetricKnown()
    return bool(known and symmetric)


def factorise(stiffness: PETSc.Mat) -> PETSc.PC:
    """Factorisation by MUMPS: L D L^T if the matrix is marked symmetric, else L U. Collective."""
    pc = PETSc.PC().create(stiffness.comm)
    pc.setOperators(stiffness)
    pc.setType(PETSc.PC.Type.CHOLESKY if symmetric(stiffness) else PETSc.PC.Type.LU)
    pc.setFactorSolverType("mumps")
    pc.setFactorSetUpSolverType()
    factor = pc.getFactorMatrix()
    factor.setMumpsIcntl(14, 100)  # workspace for pivoting beyond MUMPS's estimate
    factor.destroy()
    pc.setUp()
    return pc


def _solve(factor: PETSc.Mat, stiffness: PETSc.Mat, loads: np.ndarray) -> np.ndarray:
    """Own rows of stiffness^-1 loads. Collective.

    Raises NearlySingular for a relative residual above RESIDUAL_TOLERANCE."""
    right = _dense(loads, stiffness.comm)
    solution = right.duplicate()
    factor.matSolve(right, solution)
    out = solution.getDenseArray().copy()
    right.destroy()
    solution.destroy()
    # Sums of the solutions with random signs: the expected square of their residual is that of all
    # columns together.
    signs = np.random.default_rng(0).choice((-1.0, 1.0), (loads.shape[1], _SUMS))
    products = loads @ signs
    comm, defect = stiffness.comm.tompi4py(), multiply(stiffness, out @ signs) - products
    worst, scale = comm.allreduce(np.array([(defect**2).sum(), (products**2).sum()]))
    if not worst <= (RESIDUAL_TOLERANCE**2) * max(scale, np.finfo(float).tiny):
        raise NearlySingular(
            f"greens: a static or harmonic solution has a relative residual of {np.sqrt(worst / scale):.1e}: the "
            "matrix is singular or nearly so. Use elements of more equal size, and loads under which "
            "the tire is stable."
        )
    return out


def multiply(matrix: PETSc.Mat, columns: np.ndarray) -> np.ndarray:
    """Own rows of matrix @ columns. Collective."""
    right = _dense(columns, matrix.comm)
    product = matrix.matMult(right)
    out = product.getDenseArray().copy()
    product.destroy()
    right.destroy()
    return out


def _dense(columns: np.ndarray, comm: PETSc.Comm) -> PETSc.Mat:
    rows, count = columns.shape
    sizes = ((rows, PETSc.DETERMINE), (PETSc.DECIDE, count))
    return PETSc.Mat().createDense(sizes, array=np.asfortranarray(columns), comm=comm)


def rigid_space(operators: Operators) -> np.ndarray:
    """Own rows (n, r) of the M-orthonormal rigid motions without stiffness. Collective.

    They are those of the deformed body's six rigid motions that store no energy R^T K R: none with a
    clamped rim, six with a free rim and no road, but three when centrifugal forces act, which do
    not turn with the tire. The forces K R tell less: they are nonzero already where the stiffness,
    of second order in them, is rounding.
    """
    body, unknowns, mass = operators.body, operators.unknowns, operators.mass[:, None]
    if unknowns.rim is None:
        return np.zeros((len(mass), 0))
    points = body.lattice.points(body.ids) + body.owned(body.u.x.array)
    motions = rigid_motions(points)[unknowns.free]
    if unknowns.rim.mine:
        motions = np.vstack([motions, np.linalg.inv(unknowns.rim.coordinates)])
    comm = body.comm
    inertia = comm.allreduce(motions.T @ (mass * motions))
    motions = motions @ np.linalg.inv(np.linalg.cholesky(inertia)).T
    energy = summed(comm, motions.T @ multiply(operators.stiffness, motions))
    squares, turn = np.linalg.eigh((energy + energy.T) / 2)
    return motions @ turn[:, np.abs(squares) <= RIGID * _norm(operators)]


def _norm(operators: Operators) -> float:
    """Largest row sum of M^-1/2 K M^-1/2, 1/s2. Collective."""
    scaled = operators.stiffness.copy()
    roots = scaled.createVecLeft()
    roots.array[:] = 1 / np.sqrt(operators.mass)
    scaled.diagonalScale(roots, roots)
    norm = float(scaled.norm(PETSc.NormType.NORM_INFINITY))
    scaled.destroy()
    roots.destroy()
    return norm


def statics(operators: Operators, stiffness: PETSc.Mat, loads: sparse.csr_matrix) -> np.ndarray:
    """Own rows (n, p) of the shapes under constant loads. Collective.

    K^-1 loads, or inertia relief with a free rim, for a standing tire only.
    """
    if operators.unknowns.rim is None:
        return solve_all(stiffness, loads)
    return relieved(operators, loads)


def relieved(operators: Operators, loads: sparse.csr_matrix) -> np.ndarray:
    """Own rows (n, p) of G loads; K^-1 loads if there is no rigid motion. Collective.

    Raises ConvergenceError if the balanced loads stay out of balance.
    """
    stiffness, comm = operators.stiffness, operators.body.comm
    rigid = rigid_space(operators)
    if not rigid.shape[1]:
        return solve_all(stiffness, loads)
    weighted = operators.mass[:, None] * rigid
    dense = loads.toarray()
    balanced = defect = dense - weighted @ summed(comm, rigid.T @ dense)
    held, supported = _determinate(operators, rigid)
    factor, answer = factorise(supported), np.zeros_like(dense)
    for _ in range(_PASSES):
        forces = defect.copy()
        forces[held] = 0.0
        answer += solve_columns(factor, supported, forces)
        answer -= rigid @ summed(comm, weighted.T @ answer)
        defect = dense - multiply(stiffness, answer)
        defect -= weighted @ summed(comm, rigid.T @ defect)
        worst, size = comm.allreduce(np.array([(defect**2).sum(), (balanced**2).sum()]))
        if worst <= RESIDUAL_TOLERANCE**2 * size:
            break
    else:
        raise ConvergenceError(_out_of_balance(np.sqrt(worst / size)))
    factor.destroy()
    supported.destroy()
    return answer


def _out_of_balance(relative: float) -> str:
    return (
        f"greens: the balanced loads leave a relative force of {relative:.1e} on the "
        "supports of the free tire: its rigid-body modes are not clearly separated from soft ones. Refine the mesh."
    )


def _determinate(operators: Operators, rigid: np.ndarray) -> tuple[np.ndarray, PETSc.Mat]:
    """Own indices of rim unknowns that restrain the rigid motions statically determinately, and K
    with these held. Collective."""
    rim, stiffness, count = operators.unknowns.rim, operators.stiffness, rigid.shape[1]
    held = np.zeros(0, PETSc.IntType)
    if rim is not None and rim.mine:
        chosen = linalg.qr(rigid[-6:].T, pivoting=True)[2][:count]
        held = (len(rigid) - 6 + np.sort(chosen)).astype(PETSc.IntType)
    supported = stiffness.copy()
    typical = stiffness.getDiagonal().norm() / np.sqrt(stiffness.getSize()[0])
    supported.zeroRowsColumns(held + supported.getOwnershipRange()[0], typical)
    supported.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    return held, supported


def rotating_stiffness(
    operators: Operators,
    rotation: Rotation | None,
    speed: float,
    damping: tuple[float, float],
    inertia: str = "full",
) -> PETSc.Mat:
    """K_Omega = K + Omega^2 S + gamma1 Omega B + gamma2 Omega K M^-1 B; "doppler": S_B for S.
    Collective."""
    stiffness = operators.stiffness.copy()
    if speed == 0:
        stiffness.setOption(PETSc.Mat.Option.SYMMETRIC, True)  # a copy may lose the flag
        return stiffness
    assert rotation is not None, "a speed needs the matrices of the rotating frame"
    add_part(stiffness, speed**2, rotation.carrying(inertia))
    add_part(stiffness, speed * damping[0], rotation.body)
    if damping[1]:
        scaled = rotation.body.copy()
        inverse_mass = scaled.createVecLeft()
        inverse_mass.array[:] = 1 / operators.mass
        scaled.diagonalScale(inverse_mass, None)
        product = operators.stiffness.matMult(scaled)
        stiffness.axpy(speed * damping[1], product, PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
    stiffness.setOption(PETSc.Mat.Option.SYMMETRIC, damping[0] == 0 and damping[1] == 0)
    return stiffness


def rotating_damping(
    operators: Operators,
    rotation: Rotation | None,
    speed: float,
    damping: tuple[float, float],
    inertia: str = "full",
) -> PETSc.Mat:
    """D + 2 Omega G with D = gamma1 M + gamma2 K; "doppler": B for G. Collective."""
    matrix = operators.stiffness.copy()
    matrix.scale(damping[1])
    if speed:
        assert rotation is not None, "a speed needs the matrices of the rotating frame"
        add_part(matrix, 2 * speed, rotation.coriolis(inertia))
    add_diagonal(matrix, damping[0] * operators.mass)
    matrix.setOption(PETSc.Mat.Option.SYMMETRIC, speed == 0)
    return matrix


def add_part(matrix: PETSc.Mat, factor: float, part: PETSc.Mat) -> None:
    """matrix += factor part, whose entries are all among those of `matrix`. Collective."""
    matrix.axpy(factor, part, PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN)


def add_diagonal(matrix: PETSc.Mat, values: np.ndarray) -> None:
    """Add this process's values to the diagonal. Collective."""
    diagonal = matrix.createVecLeft()
    diagonal.array[:] = values
    matrix.setDiagonal(diagonal, PETSc.InsertMode.ADD)
    diagonal.destroy()


class LoadedShapes:
    """Shapes K_Omega^-1 b under constant loads b, with coupling to the air in the cavity.

    Loads are own rows (n, p). They are solved in parts, since thousands of shapes on a fine mesh
    would not fit in memory; the factorisation is kept until `destroy`. With a free rim: inertia
    relief, for a standing tire only. All methods are collective.
    """

    def __init__(
        self, operators: Operators, stiffness: PETSc.Mat, air: Column | None = None
    ) -> None:
        self._operators, self._stiffness, self._air = operators, stiffness, None
        self._known: sparse.csc_matrix | None = None
        self._kept: np.ndarray | None = None
        self._factor = factorise(stiffness) if operators.unknowns.rim is None else None
        if air is not None:
            self._pushed = self.whole(air.pushed)
            self._air = air

    def parts(self, loads: np.ndarray | sparse.spmatrix) -> Iterator[tuple[slice, np.ndarray]]:
        """Yields a slice of the loads and own rows (n, q) of their shapes."""
        for part, shapes in self._without_air(loads):
            if self._air is not None:
                shapes = self._air.with_air(np.hstack([shapes, self._pushed]))
            yield part, shapes

    def _without_air(
        self, loads: np.ndarray | sparse.spmatrix
    ) -> Iterator[tuple[slice, np.ndarray]]:
        if self._factor is not None:
            yield from solve_parts(self._factor, self._stiffness, loads)
        else:
            yield slice(None), relieved(self._operators, sparse.csr_matrix(loads))

    def whole(self, loads: np.ndarray | sparse.spmatrix) -> np.ndarray:
        """Own rows (n, p) of all shapes."""
        out = np.empty(loads.shape)
        for part, shapes in self.parts(loads):
            out[:, part] = shapes
        return out

    def remember(self, loads: sparse.spmatrix) -> None:
        """Keep the shapes of these loads (n, p) from the first `readings` on that begin with them."""
        self._known, self._kept = sparse.csc_matrix(loads), None

    def readings(self, rows: sparse.csr_matrix, loads: sparse.spmatrix) -> np.ndarray:
        """rows K_Omega^-1 loads (r, p) on every process, for own columns of `rows` (r, n)."""
        loads = sparse.csc_matrix(loads)
        out, first = np.empty((rows.shape[0], loads.shape[1])), 0
        if self._known is not None and self._begins(loads, self._known):
            first = self._known.shape[1]
            if self._kept is None:
                self._kept = self.whole(self._known)
            out[:, :first] = rows @ self._kept
        rest = out[:, first:]
        for part, shapes in self.parts(loads[:, first:]):
            rest[:, part] = rows @ shapes
        return summed(self._operators.body.comm, out)

    def _begins(self, loads: sparse.csc_matrix, known: sparse.csc_matrix) -> bool:
        """Whether loads begin with the known ones on every process."""
        count = known.shape[1]
        same = count <= loads.shape[1] and not (loads[:, :count] != known).nnz
        return bool(self._operators.body.comm.allreduce(same, op=MPI.LAND))

    def destroy(self) -> None:
        """Free the factor's memory."""
        if self._factor is not None:
            self._factor.destroy()


def compliance(
    operators: Operators,
    stiffness: PETSc.Mat,
    outputs: sparse.csr_matrix,
    loads: sparse.csr_matrix,
    air: Column | None = None,
    beside: np.ndarray | None = None,
) -> np.ndarray:
    """Displacement (r, k) m/N at the outputs per unit load, on every process. Collective.

    `outputs` (r, 3 s) and `loads` (k, 3 s) are weights of the outer face's nodes, three dofs a
    node. `beside`: own rows (b, n) of further readings, b more rows of the result, e.g. the tire's
    first moment int rho u, kg m/N; `air`: coupling to the cavity. Raises ConvergenceError if a
    solve leaves a relative residual above 1e-8.
    """
    rows, columns = on_own_rows(operators, outputs).T.tocsr(), on_own_rows(operators, loads)
    if beside is not None:
        rows = sparse.vstack([rows, sparse.csr_matrix(beside)], format="csr")
    if air is not None:
        rows = sparse.vstack([rows, air.pushed.T], format="csr")
        columns = sparse.hstack([columns, air.pushed], format="csc")
    shapes = LoadedShapes(operators, stiffness)
    answers = shapes.readings(rows, columns)
    shapes.destroy()
    return answers if air is None else air.mended(answers)


def on_own_rows(operators: Operators, probes: sparse.csr_matrix) -> sparse.csr_matrix:
    """The probes as columns (n, k) over this process's unknowns. Collective.

    `probes` are weights (k, 3 s) of the outer face's nodes, or (k, 3 s + 6) with those of a free
    rim's translation and rotation.
    """
    body = operators.body
    face = body.surface
    own = sparse.csr_matrix(
        (np.ones(len(face.local)), (face.local, face.place)), shape=(body.nodes, len(face.ids))
    )
    weights = probes.T.tocsr()
    on_face, on_rim = weights[: 3 * len(face.ids)], weights[3 * len(face.ids) :]
    nodal = sparse.kron(own, sparse.identity(3), format="csr") @ on_face
    return operators.unknowns.loads(nodal, on_rim.toarray() if on_rim.shape[0] else None)


def receptance(
    operators: Operators,
    stiffness: PETSc.Mat,
    damping: PETSc.Mat,
    outputs: sparse.csr_matrix,
    loads: sparse.csr_matrix,
    frequency: np.ndarray,
    beside: np.ndarray | None = None,
    air: Column | None = None,
) -> np.ndarray:
    """H (f, r, k) complex, m/N, at the frequencies in Hz, on every process. Collective.

    `stiffness` K_Omega and `damping` E as in fem.matrices.compliance; `beside`: rows (m, n) on own
    unknowns, m further readings, e.g. operators.carried for the tire's first moment int rho u, kg
    m/N; `air`: coupling to the cavity. Each frequency takes one unsymmetric factorisation of twice
    the unknowns. Raises ConvergenceError if a solve leaves a residual above 1e-8.
    """
    comm = operators.body.comm
    rows = on_own_rows(operators, outputs).T.tocsr()
    if beside is not None:
        rows = sparse.vstack([rows, sparse.csr_matrix(beside)], format="csr")
    columns = on_own_rows(operators, loads)
    shape = rows.shape[0], columns.shape[1]
    if air is not None:
        rows = sparse.vstack([rows, air.pushed.T], format="csr")
        columns = sparse.hstack([columns, air.pushed], format="csc")
    n = columns.shape[0]
    both = sparse.vstack([columns, sparse.csc_matrix(columns.shape)], format="csc")
    H = np.empty((len(frequency), *shape), complex)
    for k, omega in enumerate(2 * np.pi * frequency):
        dynamic = _dynamic_stiffness(stiffness, damping, operators.mass, omega)
        solution = solve_all(dynamic, both)
        dynamic.destroy()
        answers = summed(comm, rows @ (solution[:n] + 1j * solution[n:]))
        H[k] = answers if air is None else air.mended(answers, 1j * omega)
    return H


def _dynamic_stiffness(
    stiffness: PETSc.Mat, damping: PETSc.Mat, mass: np.ndarray, omega: float
) -> PETSc.Mat:
    """The real matrix of twice the size; each process holds its rows of both halves. Collective."""
    diagonal, coupling = stiffness.copy(), damping.copy()
    add_diagonal(diagonal, -(omega**2) * mass)
    coupling.scale(omega)
    opposite = coupling.copy()
    opposite.scale(-1)
    nest = PETSc.Mat().createNest([[diagonal, opposite], [coupling, diagonal]], comm=stiffness.comm)
    out = nest.convert("aij", PETSc.Mat())
    for matrix in (nest, diagonal, coupling, opposite):
        matrix.destroy()
    return out
