"""Run time against error, scaling and floors: one module a benchmark, found by name."""
