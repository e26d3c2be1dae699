"""Processes, signals, memory, printing, and the test runner."""
