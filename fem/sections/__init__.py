"""Cross-sections of tires as curved quadrilaterals, to be revolved into a ring. Without dolfinx."""
