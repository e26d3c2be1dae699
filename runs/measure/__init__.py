"""What benches and validation share: tables, pages, pictures, a synthetic tire."""
