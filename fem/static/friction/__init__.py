"""Coulomb friction of the static state: of the tire that stands, and of the one that rolls steadily."""
