"""Result files: written atomically, reused by hash, read, exported."""
