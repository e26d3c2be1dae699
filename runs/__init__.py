"""Scenes, the staged pipeline, result files, the command line and reports."""
