"""The steps of a deck revolve, inflate, load and roll its tire: they are read as far as a scene has keys for it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from tireroad.fem.decks.abaqus_generation import data_lines
from tireroad.fem.decks.deck import Card, Data, cards, number
from tireroad.fem.errors import InputError

_Table = list[list[str]]
_Values = list[list[float | None]]


@dataclass
class DeckHistory:
    """Figures of a deck's history in its own units; None where it has none.

    `angle` (degrees) and `segments` of *SYMMETRIC MODEL GENERATION, REVOLVE; `pressure`: of the
    last *DSLOAD; `load`: the largest concentrated force; `speed` rad/s: of the last *TRANSPORT
    VELOCITY; `friction`: the largest coefficient; `modes`: of *FREQUENCY.
    """

    angle: float | None = None
    segments: int | None = None
    pressure: float | None = None
    load: float | None = None
    speed: float | None = None
    friction: float | None = None
    modes: int | None = None
    has_mesh: bool = False
    has_steps: bool = False


def history(path: Path) -> DeckHistory:
    """Read the history of a deck from its keywords; unreadable numbers among them are left out. InputError for no deck."""
    history = DeckHistory()
    card: Card | None = None
    lines: list[Data] = []
    for item in cards(path):
        if isinstance(item, Card):
            _take(history, card, lines)
            card, lines = item, []
            history.has_mesh |= item.keyword in ("ELEMENT", "ELGEN")
            history.has_steps |= item.keyword in ("STEP", "SYMMETRIC MODEL GENERATION")
        elif card is not None and card.keyword in _TAKEN:
            lines.append(item)
    _take(history, card, lines)
    return history


def _take(history: DeckHistory, card: Card | None, lines: list[Data]) -> None:
    if card is None or card.keyword not in _TAKEN:
        return
    try:
        table = [parts for _, parts in data_lines(lines)]
        values = [[_number(part, card) for part in parts] for parts in table]
    except InputError:
        return
    _TAKEN[card.keyword](history, card, table, values)


def _number(text: str, card: Card) -> float | None:
    """A number, None for a name."""
    try:
        return number(text, card.place) if text else None
    except InputError:
        return None


def _revolve(history: DeckHistory, card: Card, _: _Table, values: _Values) -> None:
    """Two lines of the axis, then angle and number of elements of each sector, degrees."""
    if "REVOLVE" not in card.options:
        return
    sectors = [(row[0], row[1]) for row in values[2:] if len(row) > 1]
    angle = sum(one for one, many in sectors if one and many)
    count = sum(many for one, many in sectors if one and many)
    if 0 < angle <= 360.001 and count:
        history.angle, history.segments = float(angle), round(count * 360 / angle)


def _pressed(history: DeckHistory, _: Card, table: _Table, values: _Values) -> None:
    for parts, row in zip(table, values, strict=True):
        if len(parts) > 2 and parts[1].upper() == "P" and row[2]:
            history.pressure = abs(row[2])


def _loaded(history: DeckHistory, _: Card, __: _Table, values: _Values) -> None:
    for row in values:
        if len(row) > 2 and row[1] in (1, 2, 3) and row[2]:
            history.load = max(history.load or 0.0, abs(row[2]))


def _rolling(history: DeckHistory, _: Card, __: _Table, values: _Values) -> None:
    speeds = [abs(row[1]) for row in values if len(row) > 1 and row[1]]
    history.speed = max(speeds, default=history.speed)


def _friction(history: DeckHistory, _: Card, __: _Table, values: _Values) -> None:
    if values and values[0] and values[0][0] and 0 < values[0][0] < 3:
        history.friction = max(history.friction or 0.0, values[0][0])


def _modes(history: DeckHistory, _: Card, __: _Table, values: _Values) -> None:
    if values and values[0] and values[0][0] and values[0][0] >= 1:
        history.modes = int(values[0][0])


_TAKEN = {
    "SYMMETRIC MODEL GENERATION": _revolve,
    "DSLOAD": _pressed,
    "CLOAD": _loaded,
    "TRANSPORT VELOCITY": _rolling,
    "FRICTION": _friction,
    "CHANGE FRICTION": _friction,
    "FREQUENCY": _modes,
}
