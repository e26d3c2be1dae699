"""One module a stage: `inputs` (what it depends on), `compute`, and `reuse` of its file."""
