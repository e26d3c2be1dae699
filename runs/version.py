"""The version of the program and of its result files; both are written to every output."""

PROGRAM = "tireroad"
VERSION = "0.1.0"
RESULT_FORMAT = 1
