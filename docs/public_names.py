"""The page of the public names of each package, from their source alone: nothing is imported."""

from __future__ import annotations

import ast
import inspect
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("fem", "modal", "greens", "contact")
HEAD = """# Public names

What the packages export, for `from tireroad.fem import Torus` and the like. SI units, angles in rad; where a
docstring says "collective", all MPI processes call together. The chain in ten lines is in
[use it from Python](how-to/library.md).
"""


def page() -> str:
    """The page in Markdown."""
    return HEAD + "".join(_package(name) for name in PACKAGES)


def _package(package: str) -> str:
    tree = ast.parse((ROOT / package / "__init__.py").read_text())
    homes = next(ast.literal_eval(n.value) for n in tree.body if _sets(n, "_HOMES"))
    about = ast.get_docstring(tree)
    parts = [_entry(package, name, home) for name, home in sorted(homes.items())]
    return f"\n## tireroad.{package}\n\n{about}\n" + "".join(parts)


def _sets(node: ast.stmt, name: str) -> bool:
    return isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == name


def _entry(package: str, name: str, home: str) -> str:
    found = _definition(f"{package}.{home}", name)
    if isinstance(found, ast.Assign):  # a registry's decorator
        tree = ast.parse((ROOT / "fem" / "parameters.py").read_text())
        found = next(n for n in ast.walk(tree) if getattr(n, "name", None) == "register")
    text = inspect.cleandoc(ast.get_docstring(found, clean=False) or "")
    return f"\n### {name}\n\n```python\n{_signature(found, name)}\n```\n\n```text\n{text}\n```\n"


def _definition(module: str, name: str) -> ast.stmt:
    """The statement that defines a name of a module, also where the module imports it."""
    tree = ast.parse((ROOT / Path(*module.split(".")).with_suffix(".py")).read_text())
    for node in tree.body:
        if getattr(node, "name", None) == name or _sets(node, name):
            return node
        if isinstance(node, ast.ImportFrom) and name in [one.name for one in node.names]:
            return _definition(str(node.module).removeprefix("tireroad."), name)
    raise LookupError(f"{module} has no {name}")


def _signature(found: ast.AST, name: str) -> str:
    if isinstance(found, ast.FunctionDef):
        result = f" -> {ast.unparse(found.returns)}" if found.returns else ""
        return f"{name}({_arguments(found)}){result}"
    made = [n for n in found.body if isinstance(n, ast.FunctionDef) and n.name == "__init__"]
    if made:
        return f"{name}({_arguments(made[0])})"
    fields = [n for n in found.body if isinstance(n, ast.AnnAssign)]
    return f"{name}({', '.join(_field(n) for n in fields)})"


def _field(node: ast.AnnAssign) -> str:
    default = f" = {ast.unparse(node.value)}" if node.value else ""
    return f"{ast.unparse(node.target)}: {ast.unparse(node.annotation)}{default}"


def _arguments(function: ast.FunctionDef) -> str:
    return ast.unparse(function.args).removeprefix("self, ").removeprefix("self")
