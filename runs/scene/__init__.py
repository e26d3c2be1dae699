"""The scene file: keys, ranges, rules, the stages it needs and their demand."""
