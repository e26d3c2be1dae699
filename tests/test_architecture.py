"""The house keeps its order: imports run one way and in no circle, files and folders stay readable."""

from __future__ import annotations

import ast
from collections import Counter
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
ROOMS = ("fem", "modal", "greens", "contact", "runs")  # each may use those before it
LINES = 250  # of a file
FILES = 16  # of a folder
FUNCTION = 30  # lines that 95 % of all functions stay within


def _modules() -> dict[str, Path]:
    files = [file for room in ROOMS for file in sorted((ROOT / room).rglob("*.py"))]
    return {".".join(("tireroad", *f.relative_to(ROOT).with_suffix("").parts)): f for f in files}


MODULES = _modules()


def _for_types_only(node: ast.AST) -> bool:
    return isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)


def _imports(nodes: list[ast.stmt]) -> set[str]:
    """The program's modules imported at the top of a file: what is imported within a function is late."""
    found: set[str] = set()
    for node in nodes:
        if isinstance(node, ast.Import):
            found |= {one.name for one in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found |= {f"{node.module}.{one.name}" for one in node.names} | {node.module}
        elif isinstance(node, ast.If | ast.Try) and not _for_types_only(node):
            found |= _imports(
                [one for one in ast.iter_child_nodes(node) if isinstance(one, ast.stmt)]
            )
    return found & MODULES.keys()


def _every_import(file: Path) -> set[str]:
    """Late ones as well."""
    tree = ast.parse(file.read_text())
    found: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import | ast.ImportFrom):
            found |= _imports([node])
    return found


@pytest.mark.parametrize("room", ROOMS)
def test_imports_run_one_way(room: str) -> None:
    later = ROOMS[ROOMS.index(room) + 1 :]
    for name, file in MODULES.items():
        if name.split(".")[1] == room:
            wrong = {one for one in _every_import(file) if one.split(".")[1] in later}
            assert not wrong, f"{name} imports {sorted(wrong)}"


def test_no_circle_of_imports() -> None:
    graph = {name: _imports(ast.parse(file.read_text()).body) for name, file in MODULES.items()}
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as circle:
        pytest.fail(" -> ".join(circle.args[1]))


def test_files_of_tests_differ_in_name() -> None:
    """Two of one name in different folders are collected one by one, and not together."""
    count = Counter(file.name for file in (ROOT / "tests").rglob("test_*.py"))
    assert {name for name, number in count.items() if number > 1} == set()


def test_files_stay_short() -> None:
    pages = [file for kind in ("*.j2", "*.css", "*.js") for file in (ROOT / "runs").rglob(kind)]
    files = [*MODULES.values(), *(ROOT / "tests").rglob("*.py"), *pages]
    long = {str(file.relative_to(ROOT)): len(file.read_text().splitlines()) for file in files}
    assert {name: lines for name, lines in long.items() if lines > LINES} == {}


def test_folders_stay_small() -> None:
    folders = {file.parent for file in MODULES.values()} | {
        file.parent for file in (ROOT / "tests").rglob("*.py")
    }
    count = {str(one.relative_to(ROOT)): len(list(one.glob("*.py"))) for one in folders}
    assert {name: files for name, files in count.items() if files > FILES} == {}


def test_functions_stay_short() -> None:
    lengths = [
        node.end_lineno - node.body[0].lineno + 1
        for file in MODULES.values()
        for node in ast.walk(ast.parse(file.read_text()))
        if isinstance(node, ast.FunctionDef) and node.end_lineno
    ]
    assert sum(length <= FUNCTION for length in lengths) >= 0.95 * len(lengths)
