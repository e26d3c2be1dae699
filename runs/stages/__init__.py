"""One module per stage: `inputs` (what it depends on), `compute`, and reading and writing its
file."""
