"""Rules beyond single keys: consistency between tables, usable roads, cords and compounds."""
