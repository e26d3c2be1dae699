"""Truncated modes: static and dynamic residual flexibility, and estimates of their error."""
