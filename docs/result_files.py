"""Generates the tables of all datasets in docs/results.md.

  ./tireroad python docs/result_files.py docs/results.md

A test compares the page in the repository with the output.
"""

import sys
from pathlib import Path

from tireroad.runs.results.datasets import NOTATION, page

MARK = "## All datasets"


def written(text: str) -> str:
    """The page with its tables as they are declared."""
    head = (
        f"{MARK}\n\nGenerated from `runs/results/datasets.py` by `./tireroad python docs/result_files.py docs/results.md`.\n"
        f"`./tireroad info FILE` shows the same beside the shapes of a file. {NOTATION}\n"
    )
    return text.partition(MARK)[0].rstrip("\n") + "\n\n" + head + "\n".join(page()) + "\n"


if __name__ == "__main__":
    place = Path(sys.argv[1])
    place.write_text(written(place.read_text(encoding="utf-8")), encoding="utf-8")
