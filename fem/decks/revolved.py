"""Bodies of revolution reduced to their section."""

from __future__ import annotations

from tireroad.fem.decks.deck import Deck


def reduced(deck: Deck):
    return deck, None
