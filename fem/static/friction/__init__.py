"""Coulomb friction in the static state, of a standing and of a steadily rolling tire."""
