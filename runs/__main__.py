"""`python3 -m runs`: the program, without the launcher."""

import sys

from runs.cli import main

sys.exit(main(sys.argv[1:]))
