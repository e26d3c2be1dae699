"""The scene file: keys, ranges, rules, what will run and what it takes."""
