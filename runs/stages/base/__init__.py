"""Base classes of stages, the job they belong to, and their records."""
