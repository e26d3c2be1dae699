"""The house: imports flow one way, no circles, files and folders that can be read."""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
FLOW = ("fem", "modal", "greens", "contact", "runs")
MOST_LINES = 250
MOST_FILES = 18  # "about 15", and an __init__


@cache
def modules() -> dict[str, Path]:
    """Every module of the program by its dotted name below `tireroad`."""
    return {
        ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path
        for package in FLOW
        for path in sorted((ROOT / package).rglob("*.py"))
    }


@cache
def imported(name: str, *, top_only: bool = False) -> frozenset[str]:
    """Modules of the program that a module imports; `top_only`: when it is loaded itself."""
    tree = ast.parse(modules()[name].read_text(encoding="utf-8"))
    tree.body = [node for node in tree.body if not _for_types_only(node)]
    nodes = tree.body if top_only else ast.walk(tree)
    found: set[str] = set()
    for node in nodes:
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("tireroad."):
            module = node.module.removeprefix("tireroad.")
            for alias in node.names:
                inner = f"{module}.{alias.name}"
                found.add(inner if inner in modules() else module)
    return frozenset(found & modules().keys())


def _for_types_only(node: ast.stmt) -> bool:
    return isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"


@pytest.mark.parametrize("package", FLOW)
def test_imports_flow_one_way(package: str) -> None:
    later = FLOW[FLOW.index(package) + 1 :]
    wrong = {
        (name, other)
        for name in modules()
        if name.split(".")[0] == package
        for other in imported(name)
        if other.split(".")[0] in later
    }
    assert not wrong


@pytest.mark.parametrize("package", FLOW[1:])
def test_only_fem_imports_dolfinx(package: str) -> None:
    for path in (ROOT / package).rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = (
                [alias.name for alias in node.names]
                if isinstance(node, ast.Import)
                else [node.module or ""]
                if isinstance(node, ast.ImportFrom)
                else []
            )
            assert not any(name.split(".")[0] in ("dolfinx", "ufl") for name in names), path


def test_no_circular_imports() -> None:
    done: set[str] = set()

    def visit(name: str, path: tuple[str, ...]) -> None:
        assert name not in path, " -> ".join((*path[path.index(name) :], name))
        if name not in done:
            for other in imported(name):
                visit(other, (*path, name))
            done.add(name)

    for name in modules():
        visit(name, ())


def test_files_fit_a_few_screens() -> None:
    long = {
        name: lines
        for name, path in modules().items()
        if (lines := path.read_text(encoding="utf-8").count("\n")) > MOST_LINES
    }
    assert not long


def test_folders_can_be_taken_in_at_a_glance() -> None:
    folders = {path.parent for path in modules().values()}
    crowded = {
        folder: n for folder in folders if (n := len(list(folder.glob("*.py")))) > MOST_FILES
    }
    assert not crowded
