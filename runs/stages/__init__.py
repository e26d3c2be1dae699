"""One module per stage: `inputs` (what it depends on), `compute`, writing and reading its file."""
