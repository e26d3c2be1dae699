"""The report of a folder, as written."""

from pathlib import Path

from tireroad.runs.report.page import write_report


def page(directory: Path) -> str:
    return write_report(directory).read_text(encoding="utf-8")
