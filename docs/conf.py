"""The documentation site: Markdown by MyST, built by Sphinx; `.ci/docs` builds it without warnings."""

import re
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
from public_names import page  # noqa: E402

_version = (Path(__file__).resolve().parent.parent / "runs" / "version.py").read_text()

project = "tireroad"
author = "the tireroad authors"
copyright = author
version = release = re.search(r'VERSION = "([^"]+)"', _version).group(1)

extensions = ["myst_parser", "sphinx.ext.mathjax"]
myst_enable_extensions = ["dollarmath", "amsmath", "deflist"]
myst_heading_anchors = 3
exclude_patterns = ["_build"]
html_theme = "furo"
html_title = f"tireroad {version}"
html_static_path = ["_static"]
nitpicky = True

(Path(__file__).resolve().parent / "public-names.md").write_text(page())
