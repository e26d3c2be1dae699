"""Architecture rules: layered imports without circles, constants first, short functions."""

from __future__ import annotations

import ast
import re
from collections import Counter
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

from tireroad.contact.solver.solvers import SOLVERS
from tireroad.greens.residuals import RESIDUALS
from tireroad.greens.schemes import SCHEMES
from tireroad.modal.solver.searches import SEARCHES

ROOT = Path(__file__).parents[1]
ROOMS = ("fem", "modal", "greens", "contact", "runs")  # each may use those before it
FUNCTION = 30  # lines that 95 % of all functions stay within


def _modules() -> dict[str, Path]:
    files = [file for room in ROOMS for file in sorted((ROOT / room).rglob("*.py"))]
    return {".".join(("tireroad", *f.relative_to(ROOT).with_suffix("").parts)): f for f in files}


MODULES = _modules()
TREES = {name: ast.parse(file.read_text()) for name, file in MODULES.items()}


FOLDERS = {name.rpartition(".")[0] for name in MODULES}


def _for_types_only(node: ast.AST) -> bool:
    return isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)


def _imports(nodes: list[ast.stmt], types: bool = True) -> set[str]:
    """The program's modules imported at the top of a file: what is imported within a function is late."""
    found: set[str] = set()
    for node in nodes:
        if isinstance(node, ast.Import):
            found |= {one.name for one in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found |= {f"{node.module}.{one.name}" for one in node.names} | {node.module}
        elif isinstance(node, ast.If | ast.Try) and (types or not _for_types_only(node)):
            found |= _imports(
                [one for one in ast.iter_child_nodes(node) if isinstance(one, ast.stmt)], types
            )
    return found & MODULES.keys()


def _every_import(tree: ast.Module) -> set[str]:
    """Late ones as well."""
    found: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import | ast.ImportFrom):
            found |= _imports([node])
    return found


EVERY_IMPORT = {name: _every_import(tree) for name, tree in TREES.items()}


@pytest.mark.parametrize("room", ROOMS)
def test_imports_run_one_way(room: str) -> None:
    later = ROOMS[ROOMS.index(room) + 1 :]
    for name, imported in EVERY_IMPORT.items():
        if name.split(".")[1] == room:
            wrong = {one for one in imported if one.split(".")[1] in later}
            assert not wrong, f"{name} imports {sorted(wrong)}"


MUST_NEVER = {  # of runs: who must never import whom
    "a scene imports the search": ("scene", "search"),
    "a scene imports the process": ("scene", "process"),
    "a result file imports the reader of scenes": ("files", "scene"),
    "a result file imports the fit": ("files", "fit"),
    "a result file prints": ("files", "process"),
    "the library imports a stage": ("library", "stages"),
    "a page imports the search": ("report", "search"),
    "a stage writes a page": ("stages", "report"),
}


@pytest.mark.parametrize("sentence", MUST_NEVER)
def test_who_must_never_import_whom(sentence: str) -> None:
    """Within `runs`; that physics imports no scene is the one way of the packages above."""
    one, other = (f"tireroad.runs.{part}" for part in MUST_NEVER[sentence])
    wrong = [
        f"{name} imports {imported}"
        for name, imports in EVERY_IMPORT.items()
        if name == one or name.startswith(f"{one}.")
        for imported in imports
        if imported == other or imported.startswith(f"{other}.")
    ]
    assert not wrong, "\n".join(wrong)


def test_constants_stand_before_the_first_definition() -> None:
    """Tables that need a function or class above them apart."""
    late = []
    for name, tree in TREES.items():
        defined: set[str] = set()
        for node in tree.body:
            if isinstance(node, ast.FunctionDef | ast.ClassDef):
                defined.add(node.name)
            elif isinstance(node, ast.Assign | ast.AnnAssign) and defined:
                names = {one.id for one in ast.walk(node) if isinstance(one, ast.Name)}
                if not names & defined:
                    late.append(f"{name}: {ast.unparse(node)[:60]}")
                defined |= names & _targets(node)
    assert not late, "\n".join(late)


def test_docstrings_begin_with_their_subject() -> None:
    """A first sentence has a noun of the field: "Of", "Which", "That" and "What" are none."""
    wrong = [
        f"{name}: {getattr(node, 'name', 'module')}"
        for name, tree in TREES.items()
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef | ast.ClassDef | ast.Module)
        and (ast.get_docstring(node) or "-").split()[0] in ("Of", "Which", "That", "What")
    ]
    assert not wrong, "\n".join(wrong)


def _targets(node: ast.Assign | ast.AnnAssign) -> set[str]:
    targets = node.targets if isinstance(node, ast.Assign) else [node.target]
    return {one.id for target in targets for one in ast.walk(target) if isinstance(one, ast.Name)}


def _circle(types: bool, rooms: tuple[str, ...]) -> str:
    graph = {
        name: _imports(tree.body, types)
        for name, tree in TREES.items()
        if name.split(".")[1] in rooms
    }
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as circle:
        return " -> ".join(circle.args[1])
    return ""


def test_no_circle_of_imports() -> None:
    assert _circle(types=False, rooms=ROOMS) == ""


@pytest.mark.parametrize("room", ROOMS)
def test_no_circle_of_imports_for_types(room: str) -> None:
    assert _circle(types=True, rooms=(room,)) == ""


def test_files_of_tests_differ_in_name() -> None:
    """Two of one name in different folders are collected one by one, and not together."""
    count = Counter(file.name for file in (ROOT / "tests").rglob("test_*.py"))
    assert {name for name, number in count.items() if number > 1} == set()


MENTIONS = {  # modules that name a choice by its word, its declaration among them; validations apart
    "attachment": 2,
    "dirac": 1,
    "damped": 3,
    "convolution": 1,
    "active-set": 3,
    "projected-cg": 5,
    "snes-vi": 2,
    "lanczos": 2,
    "slepc": 2,
}


def test_the_mentioned_choices_are_declared() -> None:
    """Words that mean nothing else, of each kind of choice that is declared in one place."""
    for declared in (RESIDUALS, SCHEMES, SOLVERS, SEARCHES):
        assert MENTIONS.keys() & declared.keys()
    assert MENTIONS.keys() <= {*RESIDUALS, *SCHEMES, *SOLVERS, *SEARCHES}


@pytest.mark.parametrize("word", MENTIONS)
def test_a_choice_is_named_in_few_modules(word: str) -> None:
    """A residual was named in nine: what others ask of it stands where it is declared."""
    where = [
        name
        for name, tree in TREES.items()
        if ".validation." not in name
        and any(isinstance(node, ast.Constant) and node.value == word for node in ast.walk(tree))
    ]
    assert len(where) <= MENTIONS[word], "\n".join(where)


def test_functions_stay_short() -> None:
    lengths = [
        node.end_lineno - node.body[0].lineno + 1
        for tree in TREES.values()
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef) and node.end_lineno
    ]
    assert sum(length <= FUNCTION for length in lengths) >= 0.95 * len(lengths)


def test_modules_that_texts_name_exist() -> None:
    """Docstrings and pages refer to a module by its dotted name, or to its file."""
    places = sorted({".".join(name.split(".")[1:3]) for name in MODULES if name.count(".") > 2})
    names = re.compile(rf"(?<![\w./])(?:{'|'.join(map(re.escape, places))})\.([a-z]\w*)")
    files = re.compile(rf"(?<![\w./])(?:{'|'.join(ROOMS)}|tests)/[\w/]+\.py\b")
    wrong = []
    for file in [*ROOT.glob("docs/**/*.md"), ROOT / "README.md", *MODULES.values()]:
        text = file.read_text()
        known = (f"tireroad.{found[0]}" for found in names.finditer(text))
        wrong += [
            f"{file.name}: {one}" for one in known if one not in MODULES and one not in FOLDERS
        ]
        paths = (found[0] for found in files.finditer(text))
        wrong += [f"{file.name}: {one}" for one in paths if not (ROOT / one).exists()]
    assert not wrong, "\n".join(wrong)


def _journeys() -> list[tuple[str, list[str]]]:
    """Files and functions that docs/architecture.md leads a reader through."""
    text = (ROOT / "docs" / "architecture.md").read_text()
    part = text[text.index("## Four journeys") : text.index("## How to extend it")]
    steps = re.findall(r"`([a-z_/0-9]+\.py)`: ((?:`\w+`(?:, )?)+)", part)
    return [(file, re.findall(r"`(\w+)`", names)) for file, names in steps]


def test_the_journeys_lead_somewhere() -> None:
    journeys = _journeys()
    assert len(journeys) > 25
    for file, names in journeys:
        tree = ast.parse((ROOT / file).read_text())
        kinds = ast.FunctionDef | ast.ClassDef
        there = {node.name for node in ast.walk(tree) if isinstance(node, kinds)}
        assert set(names) <= there, f"{file}: {sorted(set(names) - there)}"
