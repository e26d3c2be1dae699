"""What the report says of each result file: facts, tables and pictures."""
