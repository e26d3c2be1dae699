"""Every page of figures has a command that repeats them and tests that hold a part of them."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
COMMANDS = {"validate": ROOT / "tests" / "validation", "bench": ROOT / "tests" / "bench"}


def _rows() -> dict[str, tuple[str, list[str]]]:
    """Command and tests by page, from the table of docs/verification.md."""
    found = {}
    for line in (
        (DOCS / "verification.md").read_text().split("## What holds each claim")[1].split("\n")
    ):
        if line.startswith("| ["):
            page, command, tests = (cell.strip() for cell in line.strip("|").split("|"))
            link = re.search(r"\((.+)\)", page)
            assert link, page
            found[link[1]] = command.strip("`"), re.findall(r"`([^`]+)`", tests)
    return found


def test_the_table_has_every_page_of_figures():
    pages = {f"verification/{page.name}" for page in (DOCS / "verification").glob("*.md")}
    assert pages <= _rows().keys()
    assert [page for page in _rows() if not (DOCS / page).is_file()] == []


def test_its_commands_and_tests_exist():
    for page, (command, tests) in _rows().items():
        kind, *names = command.split()
        known = {file.stem for file in COMMANDS[kind].rglob("*.py")}
        assert set(names) <= known, (page, command)
        assert tests, page
        for test in tests:
            assert "def test_" in (ROOT / test).read_text(), (page, test)


def test_each_page_names_its_command():
    for page, (command, _) in _rows().items():
        kind, *names = command.split()
        text = (DOCS / page).read_text()
        assert any(f"{kind} {name}" in text for name in names), page
