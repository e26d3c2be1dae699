"""Processes, signals, memory, terminal output, and the test runner."""
