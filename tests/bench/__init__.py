"""Benchmarks of run time against error, scaling and lower bounds, found by name."""
