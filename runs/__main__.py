"""`python3 -m runs` in a checkout, `python3 -m tireroad.runs` where it is installed."""

from tireroad.runs.start import program

program()
