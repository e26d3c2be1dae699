"""Report sections, by result file: facts, tables and figures."""
