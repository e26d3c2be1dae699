"""Result files: written whole, reused by hash, read, exported."""
