"""What a stage is, the run that it belongs to, and what it records."""
