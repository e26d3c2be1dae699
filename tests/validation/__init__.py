"""Comparisons with closed forms, the literature, and full finite elements: part of a checkout."""
