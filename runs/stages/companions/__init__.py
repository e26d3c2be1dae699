"""Companion runs, whose differences from a run estimate its errors, and what they may cost."""
