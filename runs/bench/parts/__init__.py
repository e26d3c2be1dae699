"""What benchmarks are made of that are too long for one module."""
