"""Questions of the launcher to a python: which packages it lacks, and an environment made of wheels.

Run by the launcher as a script on whatever python3 there is, before any package is known to be
installed: standard library only, and no syntax later than Python 3.11.

    installation.py missing TESTS PROCESSES     Debian packages that this python lacks, one line
    installation.py make FOLDER TESTS           an environment in FOLDER; its requirements are
                                                the extras `solver` (and `test`) of pyproject.toml
"""

import importlib.util
import os
import shlex
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

OLDEST = (3, 11)
OLDEST_OF_WHEELS = (3, 12)
PACKAGES = {
    "dolfinx": "python3-dolfinx-real", "petsc4py": "python3-petsc4py-real",
    "slepc4py": "python3-slepc4py-real", "mpi4py": "python3-mpi4py", "h5py": "python3-h5py",
    "numpy": "python3-numpy", "scipy": "python3-scipy", "matplotlib": "python3-matplotlib",
    "rich": "python3-rich", "jinja2": "python3-jinja2",
    "threadpoolctl": "python3-threadpoolctl",
}  # fmt: skip
OF_TESTS = {"pytest": "python3-pytest", "xdist": "python3-pytest-xdist"}
MADE = "requirements"  # file that an environment has once it is complete, with what was asked for


def found(module):
    """Whether `module` can be imported; not a folder of its name without a module in it."""
    spec = importlib.util.find_spec(module)
    return spec is not None and spec.origin is not None


def compiler():
    """The C compiler's command, as cffi finds it; None where there is none."""
    command = os.environ.get("CC") or sysconfig.get_config_var("CC") or "cc"
    return command if shutil.which(shlex.split(command)[0]) else None


def beside(program):
    """Path of a program beside this python, else on PATH; None where there is none."""
    return shutil.which(program, path=str(Path(sys.executable).parent)) or shutil.which(program)


def missing(tests, processes):
    """Debian's names of what this python lacks to run the program."""
    packages = dict(PACKAGES, **(OF_TESTS if tests else {}))
    lacking = [name for module, name in packages.items() if not found(module)]
    if compiler() is None and not found("ziglang"):
        lacking.append("gcc")
    if (tests or processes != 1) and beside("mpirun") is None:
        lacking.append("openmpi-bin")
    return lacking


def requirements(tests):
    """pip's requirements of an environment, with a compiler from a wheel where there is none."""
    import tomllib  # of Python 3.11

    with open(Path(__file__).resolve().parents[2] / "pyproject.toml", "rb") as file:
        extras = tomllib.load(file)["project"]["optional-dependencies"]
    names = extras["solver"] + (extras["test"] if tests else [])
    return names + (extras["compiler"] if compiler() is None else [])


def make(folder, tests):
    """Make or complete the environment; raises SystemExit with one line where that fails."""
    if sys.version_info < OLDEST_OF_WHEELS:
        sys.exit("an environment of wheels needs Python 3.12 or newer")
    if not found("ensurepip"):
        sys.exit(f"{sys.executable} has no venv with pip (on Debian: python3-venv)")
    names, mark = requirements(tests), folder / MADE
    before = mark.read_text().splitlines() if mark.exists() else []
    if set(names) <= set(before):
        return
    python = folder / "bin" / "python"
    size = "1.1 GB with a C compiler" if any("ziglang" in name for name in names) else "650 MB"
    print(
        f"tireroad: making an environment in {folder}, once ({size}, about a minute;"
        " TIREROAD_PYTHON=… names a python that has dolfinx)",
        file=sys.stderr,
        flush=True,
    )
    try:
        if not before:
            subprocess.run([sys.executable, "-m", "venv", "--clear", str(folder)], check=True)
        pip = [str(python), "-m", "pip", "install", "-q", "--disable-pip-version-check"]
        subprocess.run([*pip, *names], check=True)
    except (OSError, subprocess.CalledProcessError) as error:
        sys.exit(f"no environment in {folder}: {error}; XDG_CACHE_HOME names another place")
    mark.write_text("\n".join(sorted({*before, *names})) + "\n")


if __name__ == "__main__":
    if sys.argv[1] == "make":
        make(Path(sys.argv[2]), sys.argv[3] == "yes")
    elif sys.version_info < OLDEST:
        sys.exit(1)
    else:
        print(*missing(sys.argv[2] == "yes", int(sys.argv[3])))
