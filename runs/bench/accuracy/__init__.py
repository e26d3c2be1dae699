"""Benchmarks of run time against error, and of what error bars and searches are worth."""
