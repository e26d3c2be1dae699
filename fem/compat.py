"""All differences between dolfinx releases, detected by feature and not by version number.

Debian 12 ships dolfinx 0.5.2, Debian 13 ships 0.9, Ubuntu 26.04 0.10, conda and the PyPI wheel 0.11. No
other file of the program may ask which. Importing it checks that the libraries fit together.
"""

from __future__ import annotations

import functools
import importlib.machinery
import importlib.util
import inspect
import logging
import os
import re
import shlex
import sys
import sysconfig
import types
import warnings
from collections.abc import Callable
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path
from typing import Any, NamedTuple

import basix
import cffi
import dolfinx.fem.petsc  # noqa: F401  (newer releases do not import it by themselves)
import ffcx.codegeneration.jit
import numpy as np
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI
from petsc4py import PETSc

from tireroad.fem import form_cache
from tireroad.fem.compiled import cpu
from tireroad.fem.errors import InputError

_FAMILIES = {
    "MPI": (re.compile(r"/lib(mpi|mpich)(-\w+)?\.so[^/]*$"), "mpi4py, PETSc and dolfinx"),
    "PETSc": (re.compile(r"/libpetsc\w*(-\w+)?\.so[^/]*$"), "petsc4py and dolfinx"),
}
OLDEST = (0, 5)

# Newer FFCx vectorises better by itself. In both cases -O3 and the native instruction set halve the
# assembly time of a hyperelastic tangent on 27-node hexahedra. Nothing of how Python was compiled: its
# flags have -g, which takes a third of the compiler's time.
JIT = {
    "cffi_extra_compile_args": [
        "-O3", "-march=native", "-fno-math-errno", "-shared", "-fPIC", f"-DCPU_{cpu()}",
    ],
}  # fmt: skip
_JIT_KEY = (
    "jit_options" if "jit_options" in inspect.signature(fem.form).parameters else "jit_params"
)
_DECLARED = "tireroad_declarations"  # the C declarations of a plain library, kept inside it

_CELL, _FACET = 0, 1  # integral types of UFCx


def misfit(version: str, scalar: type, maps: str) -> str:
    """Name the libraries of an environment that do not fit together, and a remedy; "" if all fit.

    `version` of dolfinx, `scalar` type of PETSc, `maps` the text of /proc/self/maps.
    """
    if tuple(int(part) for part in re.findall(r"\d+", version)[:2]) < OLDEST:
        return f"dolfinx {version} is too old: 0.5 or newer is needed"
    if np.issubdtype(scalar, np.complexfloating):
        return (
            "PETSc has complex numbers here, and real ones are needed: python3-petsc4py-real on Debian,"
            ' "petsc=*=real*" with conda, dolfinx-solver-real with pip'
        )
    files = {line.split()[-1] for line in maps.splitlines() if "/" in line}
    for family, (pattern, users) in _FAMILIES.items():
        several = sorted(file for file in files if pattern.search(file))
        if len(several) > 1:
            return (
                f"two copies of {family} are loaded, {' and '.join(several)}: {users} must be built on"
                " the same one; take all of them from Debian, all from conda, or all from one wheel"
            )
    return ""


def _check_libraries() -> None:
    """Raise InputError where libraries do not fit together: computing with them would crash or hang."""
    try:
        maps = Path("/proc/self/maps").read_text()
    except OSError:
        maps = ""  # not Linux
    if text := misfit(dolfinx.__version__, PETSc.ScalarType, maps):
        raise InputError(f"{sys.prefix}: {text}; TIREROAD_PYTHON names another python")


_check_libraries()


def _quietly(function: Callable) -> Callable:
    """Wrap a compiling function: no compiler log, no warnings of FFCx's unclosed lock files."""

    @functools.wraps(function)
    def quiet(*arguments: Any) -> Any:
        before = logging.root.manager.disable
        logging.disable(logging.INFO)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", ResourceWarning)
                return function(*arguments)
        finally:
            logging.disable(before)

    return quiet


try:
    import basix.ufl
except ImportError:  # dolfinx 0.5: elements come from legacy UFL
    HAS_BASIX_UFL = False
else:
    HAS_BASIX_UFL = hasattr(basix.ufl, "element")


class _PlainBuilder(cffi.FFI):
    """Builds a form's C code into a plain shared library, where FFCx makes extension modules.

    These need the C headers of Python (python3-dev) and take its flags, and their compiler cannot be
    left at work for later.
    """

    def set_source(self, module_name: str, source: str, **options: Any) -> None:
        self._name, self._code, self._compile_options = module_name, source, options

    def cdef(self, csource: str, **options: Any) -> None:
        super().cdef(csource, **options)
        # FFCx before 0.10 declares pointers to complex numbers, which cffi cannot load from plain
        # libraries; no form of ours reads through them.
        self._declared = re.sub(r"\b(float|double) _Complex\b", "void", csource)

    def compile(self, tmpdir: Path, **_: Any) -> None:
        """Compile with the compiler that cffi would take; cffi.VerificationError where that fails.

        Or, asked for ahead of its use, begin to: form_cache.Begun.
        """
        options = self._compile_options
        text = ",".join(str(byte) for byte in self._declared.encode() + b"\0")
        code = f"#include <ufcx.h>\n{self._code}\nconst char {_DECLARED}[] = {{{text}}};\n"
        command = os.environ.get("CC") or sysconfig.get_config_var("CC") or "cc"
        include = [f"-I{folder}" for folder in options["include_dirs"]]
        libraries = [f"-l{name}" for name in options["libraries"] or []]
        run = [*shlex.split(command), *options["extra_compile_args"], *include]
        failed = form_cache.build(Path(tmpdir), self._name, code, run, libraries)
        if failed is not None:
            raise cffi.VerificationError(f"{command}: {failed.strip()[-500:]}")


class _PlainLoader(importlib.machinery.ExtensionFileLoader):
    """Loads what `_PlainBuilder` built, as the module that FFCx expects: `ffi` and `lib`."""

    def create_module(self, spec: Any) -> types.ModuleType:
        return types.ModuleType(spec.name)

    def exec_module(self, module: Any) -> None:
        module.ffi, module.lib = _loaded(self.path)


@functools.cache
def _loaded(path: str) -> tuple[cffi.FFI, Any]:
    """The library of a form, loaded once: for good, since forms point into it, and named by a hash of its code."""
    reader, ffi = cffi.FFI(), cffi.FFI()
    reader.cdef(f"extern const char {_DECLARED}[];")
    text = getattr(reader.dlopen(path), _DECLARED)
    ffi.cdef(reader.string(text).decode())
    return ffi, ffi.dlopen(path)


def _build_plain_libraries() -> None:
    """Let FFCx build and load plain libraries. Its module of compilation is changed in this process only."""
    machinery = types.SimpleNamespace(
        FileFinder=importlib.machinery.FileFinder,
        ExtensionFileLoader=_PlainLoader,
        EXTENSION_SUFFIXES=EXTENSION_SUFFIXES,
    )
    jit: Any = ffcx.codegeneration.jit
    jit.cffi = types.SimpleNamespace(FFI=_PlainBuilder)
    jit.importlib = types.SimpleNamespace(machinery=machinery, util=importlib.util)


_build_plain_libraries()


def _options(folder: Path) -> dict:
    """Keyword argument with dolfinx's compiler options, `folder` being the cache (form_cache).

    The timeout allows for file systems on which another node sees new files some seconds later."""
    return {_JIT_KEY: {**JIT, "cache_dir": str(folder), "timeout": 120}}


def geometry_nodes(degree: int) -> np.ndarray:
    """Reference coordinates (nodes, 3) of a hexahedral geometry element, in its node order."""
    # With legacy UFL geometry nodes are equispaced; basix.ufl warps them from order 3 on.
    variants = basix.LagrangeVariant
    return _nodes(degree, variants.gll_warped if HAS_BASIX_UFL else variants.equispaced)


def field_nodes(degree: int) -> np.ndarray:
    """Reference coordinates (nodes, 3) of a Lagrange field's nodes: the Gauss-Lobatto points."""
    return _nodes(degree, basix.LagrangeVariant.gll_warped)


def _nodes(degree: int, variant: basix.LagrangeVariant) -> np.ndarray:
    family, cell = basix.ElementFamily.P, basix.CellType.hexahedron
    return basix.create_element(family, cell, degree, variant).points


@_quietly
def create_mesh(comm: MPI.Comm, cells: np.ndarray, points: np.ndarray, degree: int) -> dmesh.Mesh:
    """Distributed mesh of curved hexahedra from each process's cells and points. Collective."""
    if HAS_BASIX_UFL:
        element = basix.ufl.element("Lagrange", "hexahedron", degree, shape=(3,))
        names = inspect.signature(dmesh.create_mesh).parameters
        key = "e" if "e" in names else "domain"
        keywords = {key: ufl.Mesh(element) if key == "domain" else element}
    else:
        # Without an explicit variant FFCx sets it on the mesh only while compiling the first form,
        # not when it loads that form from its cache. Forms would then have another signature in the
        # next run and compile again.
        element = ufl.VectorElement("Lagrange", "hexahedron", degree, variant="equispaced")
        keywords = {"domain": ufl.Mesh(element)}
    return dmesh.create_mesh(comm, cells=cells, x=points, **keywords)


@_quietly
def vector_space(mesh: dmesh.Mesh, degree: int) -> fem.FunctionSpace:
    """Continuous Lagrange space of displacement vectors."""
    if hasattr(fem, "functionspace"):
        return fem.functionspace(mesh, ("Lagrange", degree, (3,)))
    return _space(mesh, ufl.VectorElement("Lagrange", mesh.ufl_cell(), degree))


@_quietly
def cell_space(mesh: dmesh.Mesh) -> fem.FunctionSpace:
    """Space of scalars that are constant in each cell."""
    if hasattr(fem, "functionspace"):
        return fem.functionspace(mesh, ("DG", 0))
    return _space(mesh, ufl.FiniteElement("DG", mesh.ufl_cell(), 0))


def _space(mesh: dmesh.Mesh, element: Any) -> fem.FunctionSpace:
    """A space of dolfinx 0.5, which compiles its elements; newer releases take them from Basix."""
    return form_cache.compiled(
        mesh.comm, lambda folder: fem.FunctionSpace(mesh, element, **_options(folder))
    )


@_quietly
def form(expression: ufl.Form) -> Any:
    """Compile a UFL form with the program's compiler flags. Collective."""
    comm = expression.ufl_domain().ufl_cargo().comm
    return form_cache.compiled(comm, lambda folder: fem.form(expression, **_options(folder)))


@_quietly
def begin_form(expression: ufl.Form) -> None:
    """Begin to compile a form that `form` will be asked for, while other work goes on. Collective."""
    comm = expression.ufl_domain().ufl_cargo().comm
    form_cache.begin(comm, lambda folder: fem.form(expression, **_options(folder)))


@_quietly
def evaluate(
    expression: ufl.core.expr.Expr, points: np.ndarray, mesh: dmesh.Mesh, cells: np.ndarray
) -> np.ndarray:
    """A UFL expression (cells, points, ...) in this process's cells at reference `points` (p, 3), scalar or a vector.
    Collective."""
    made = form_cache.compiled(
        mesh.comm, lambda folder: fem.Expression(expression, points, **_options(folder))
    )
    own = cells.astype(np.int32)
    asks_mesh = "mesh" in inspect.signature(made.eval).parameters
    values = made.eval(mesh, own) if asks_mesh else made.eval(own)
    return np.asarray(values).reshape(len(cells), len(points), *expression.ufl_shape)


def force_vector(form: Any, space: fem.FunctionSpace) -> Any:
    """Ghosted PETSc vector for the assembly of a linear form on `space`. Collective."""
    names = inspect.signature(fem.petsc.create_vector).parameters
    return fem.petsc.create_vector(space if "V" in names else form)  # from 0.10 on of spaces


def cell_facets(mesh: dmesh.Mesh) -> np.ndarray:
    """Facets (cells, 6) of own hexahedra, ghosts included, in the reference element's order."""
    mesh.topology.create_connectivity(3, 2)
    mesh.topology.create_connectivity(2, 3)  # newer releases do not create it when locating dofs
    return mesh.topology.connectivity(3, 2).array.reshape(-1, 6)


def meshtags(mesh: dmesh.Mesh, dim: int, entities: np.ndarray, values: np.ndarray) -> Any:
    """Integer tags of mesh entities, which must be in ascending order."""
    return dmesh.meshtags(mesh, dim, entities.astype(np.int32), values.astype(np.int32))


class Kernels(NamedTuple):
    """Addresses of a form's compiled element kernels, 0 for none, and the form that keeps them."""

    form: Any
    cell: int
    facet: int


def kernels(form: Any) -> Kernels:
    """The kernels of a compiled form with at most one integral over cells and one over facets."""
    ufcx, found = form.ufcx_form, []
    reader = cffi.FFI()
    for kind in (_CELL, _FACET):
        if hasattr(ufcx, "form_integral_offsets"):  # from 0.7 on
            first, last = ufcx.form_integral_offsets[kind], ufcx.form_integral_offsets[kind + 1]
            every = [ufcx.form_integrals[k] for k in range(first, last)]
        else:
            every = [ufcx.integrals(kind)[k] for k in range(ufcx.num_integrals(kind))]
        if len(every) > 1:
            raise NotImplementedError("a form with several integrals of one type")
        pointers = [one.tabulate_tensor_float64 for one in every]
        found += [int(reader.cast("uintptr_t", pointer)) for pointer in pointers] or [0]
    return Kernels(form, *found)


def cell_coefficients(form: Any) -> np.ndarray:
    """Values (cells, w) of a compiled form's coefficients in this process's own cells, as its kernels take
    them."""
    packed = dolfinx.cpp.fem.pack_coefficients(getattr(form, "_cpp_object", form))
    kind = dolfinx.cpp.fem.IntegralType.cell
    return next(np.array(values) for key, values in packed.items() if key[0] == kind)


def constants(form: Any) -> np.ndarray:
    """Values of a compiled form's constants, as its kernels take them."""
    return np.array(dolfinx.cpp.fem.pack_constants(getattr(form, "_cpp_object", form)), float)


def cell_points(mesh: dmesh.Mesh) -> np.ndarray:
    """Coordinates (cells, nodes, 3) m of this process's cells, ghosts included, in their order."""
    dofmap = mesh.geometry.dofmap
    count = mesh.topology.index_map(3).size_local + mesh.topology.index_map(3).num_ghosts
    nodes = np.asarray(getattr(dofmap, "array", dofmap)).reshape(count, -1)
    return mesh.geometry.x[nodes]


def cell_nodes(space: fem.FunctionSpace) -> np.ndarray:
    """Local nodes (cells, nodes) of a field in this process's cells, ghosts included."""
    nodes = space.dofmap.list
    count = (
        space.mesh.topology.index_map(3).size_local + space.mesh.topology.index_map(3).num_ghosts
    )
    return np.asarray(getattr(nodes, "array", nodes)).reshape(count, -1)
