"""The version of the program and of its result files; everything that is written carries both."""

PROGRAM = "tireroad"
VERSION = "0.1.0"
RESULT_FORMAT = 1
