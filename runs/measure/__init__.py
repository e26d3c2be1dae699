"""Shared by benchmarks and validation: tables, pages, figures, a synthetic tire."""
