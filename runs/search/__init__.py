"""Settings that meet an error asked for ([accuracy] target), at least cost."""
