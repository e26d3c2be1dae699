"""What no single key can say: contradictions between tables, roads that cannot be driven on, cords and compounds."""
