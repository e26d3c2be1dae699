"""`python3 -m runs`: the program, without the launcher."""

import sys

from runs.cli import main

for stream in (sys.stdout, sys.stderr):
    stream.reconfigure(errors="replace")
sys.exit(main(sys.argv[1:]))
