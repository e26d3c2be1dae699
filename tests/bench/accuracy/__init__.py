"""Benchmarks of run time against error, and of the quality of error bars and searches."""
