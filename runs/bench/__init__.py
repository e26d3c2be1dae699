"""Benchmarks of run time against error, scaling and lower bounds: one module each, found by
name."""
