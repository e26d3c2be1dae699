"""Cross-sections of tires as curved quadrilaterals: what is revolved into a ring. No dolfinx here."""
