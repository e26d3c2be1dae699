"""Validation against full finite elements and closed forms, and stress tests: one module each."""
