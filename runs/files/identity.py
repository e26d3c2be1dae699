"""What a result depends on besides its inputs: the program's sources and the libraries.

Part of every stage's hash, so that no result is reused after the code or a library has changed.
"""

import functools
import hashlib
import re
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

# Imports go one way, so a stage is computed by its own package and those below it. A later stage
# includes all packages of an earlier one: whatever changes an earlier result changes its hash too.
# Damping affects the static state of a rolling tire; with a moving axle, the modes depend on the
# time loop.
_TIRE = ("fem", "runs/stages", "modal")
_ALL = (*_TIRE, "greens", "contact")
PACKAGES: Mapping[str, tuple[str, ...]] = {"static": _TIRE}
"""Source folders that a stage depends on; all five packages if it is not listed here."""

WHEEL = "dolfinx-solver-real"  # dolfinx, PETSc and SLEPc without distributions of their own
LIBRARIES = {
    "dolfinx": ("fenics-dolfinx", WHEEL),
    "basix": ("fenics-basix",),
    "ffcx": ("fenics-ffcx",),
    "ufl": ("fenics-ufl",),
    "PETSc": ("petsc4py", WHEEL),
    "SLEPc": ("slepc4py", WHEEL),
    "numpy": ("numpy",),
    "scipy": ("scipy",),
}
"""Libraries whose version can change a result, with the distributions that may hold them."""


@dataclass(frozen=True)
class Identity:
    """`code`: SHA-256 of the sources; `libraries`: versions by name."""

    code: str
    libraries: Mapping[str, str]

    def differs(self, code: str, libraries: Mapping[str, str]) -> str:
        """What has changed since a result was computed by `code` with `libraries`; "" if none."""
        if code != self.code:
            return "the program's code has changed since"
        changed = [
            f"{name} {libraries.get(name, 'unknown')} -> {version}"
            for name, version in self.libraries.items()
            if libraries.get(name) != version
        ]
        return f"libraries have changed since: {', '.join(changed)}" if changed else ""


def identity(stage: str) -> Identity:
    """The identity of a stage in this process. Reads the sources once per process, about 10 ms."""
    return Identity(_code(PACKAGES.get(stage, _ALL)), libraries())


@functools.cache
def _code(folders: tuple[str, ...]) -> str:
    digest = hashlib.sha256()
    for folder in folders:
        for path in sorted((ROOT / folder).rglob("*.py")):
            digest.update(f"{path.relative_to(ROOT)}\0".encode())
            digest.update(path.read_bytes() + b"\0")
    return digest.hexdigest()


@functools.cache
def libraries() -> dict[str, str]:
    """Versions by name. The first call needs PETSc loaded."""
    versions = {name: _version(holders) for name, holders in LIBRARIES.items()}
    return {**versions, "MUMPS": _mumps()}


def _version(holders: tuple[str, ...]) -> str:
    """The version of the first distribution that is installed, with its name if that is WHEEL."""
    for name in holders:
        try:
            found = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
        return f"in {WHEEL} {found}" if name == WHEEL else found
    return "unknown"


def _mumps() -> str:
    """MUMPS's version, from the name of the loaded library: no interface gives it. Needs PETSc."""
    try:
        maps = Path("/proc/self/maps").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return "unknown"
    found = re.search(r"/libdmumps[^/\n]*?(\d+(?:\.\d+)+)", maps)
    return found.group(1) if found else _version((WHEEL,))
