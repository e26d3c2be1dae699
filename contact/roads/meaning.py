"""Form and meaning of a table of numbers, read from its own text: headings, units, missing values.

Text tables of every kind of road are read through here: the encoding, the separator and the decimal
mark are found by which of them makes rows of numbers; whatever stands before the numbers (headings,
a line of units, comments) is searched for the meaning of each column. What the file says goes before
a default, what contradicts a key is an error that names both, and what is assumed is told.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from tireroad.contact.roads.text_table import NUMBER, Form, Line, first_row, form_of, quoted
from tireroad.fem.errors import InputError

Array = NDArray[np.float64]

UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 0.0254}
"""Metres of the units that a scene can name."""

_LENGTHS = {
    "m": 1.0, "mtr": 1.0, "dm": 0.1, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "μm": 1e-6, "μ": 1e-6, "nm": 1e-9, "km": 1e3,
    "micron": 1e-6, "microns": 1e-6, "mikron": 1e-6,
    "in": 0.0254, "inch": 0.0254, "inches": 0.0254, "zoll": 0.0254, "''": 0.0254, '"': 0.0254, "″": 0.0254,
    "ft": 0.3048, "foot": 0.3048, "feet": 0.3048, "fuß": 0.3048, "'": 0.3048, "′": 0.3048,
    "yd": 0.9144, "yard": 0.9144, "yards": 0.9144, "mil": 2.54e-5, "mils": 2.54e-5, "thou": 2.54e-5,
}  # fmt: skip
# Metres in the languages of Europe, without accents, which a wrong encoding may have spoilt: millimètres, milímetros, Zentimeter.
_METRES = re.compile(
    r"(?:(kilo)|(de[cz]i)|([czs]enti)|(mill?i)|(mi[ck]ro)|(nano))?[- ]?m(?:et|(?<=[oaei]m)[^\W\d]t)(?:er|re|ro|ri|ra|r)(?:s|ar|ow|y|u)?"
)
_PREFIXES = 1e3, 0.1, 1e-2, 1e-3, 1e-6, 1e-9

_TIMES = {
    "s", "sec", "secs", "second", "seconds", "sek", "sekunde", "sekunden", "ms", "us", "μs", "ns", "min", "minutes",
    "h", "hour", "hours",
}  # fmt: skip
_OTHERS = {
    "hz", "khz", "v", "mv", "volt", "volts", "n", "kn", "kg", "pa", "kpa", "mpa", "bar", "%", "deg", "°", "°c", "c", "k",
    "rad", "m/s", "km/h", "m/s2", "m/s^2", "m/s²", "mm/s", "g", "db", "counts", "count", "digits", "lsb", "px", "pixel",
    "m/km", "mm/m", "in/mi", "m2", "m²", "mm2", "mm²", "m3",
}  # fmt: skip
_PER = re.compile(
    r"(?:[*x×·]\s*)?(?:10\s*(?:\^|\*\*)\s*\(?(?P<power>[-+]?\d+)\)?|"
    r"(?P<number>\d+(?:[.,]\d+)?(?:e[-+]?\d+)?)(?:\s*/\s*(?P<by>\d+))?)"
    r"\s*[*x×·]?\s*(?P<word>[^\W\d].*|''|\")",
    re.IGNORECASE,
)
_PARTS = {"tenth": "0.1", "zehntel": "0.1", "hundredth": "0.01", "hundertstel": "0.01", "thousandth": "0.001",
          "tausendstel": "0.001"}  # fmt: skip
_PART = re.compile(rf"({'|'.join(_PARTS)})s?(?:\s+of)?(?:\s+an?)?\s+(?=\w)")
_RAISED = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻⁺", "0123456789-+")
_POWER = re.compile(r"10\s*([⁻⁺]?[⁰¹²³⁴-⁹]+)")
# Headings by what their column holds. The first that fits decides.
_ROLES: tuple[tuple[str, str], ...] = (
    (
        "other",  # how exact heights are, and which of them hold
        r"(?:.*[\W_])?(?:uncert\w*|unsicherheit|incertitude|err|errors?|std|stdev|stddev|sigma|variance|tolerance|accuracy|"
        r"quality|(?:in)?valid\w*|flags?|mask|status|outliers?|dropouts?)(?:[\W_].*)?",
    ),
    (
        "count",
        r"|#|index|idx|no|nr|n|num|number|nummer|samples?|sample[ _-]?(?:no|nr|number|index|id)|points?|point[ _-]?(?:no|nr|"
        r"number|id)|pts?|punkt|id|fid|oid|rows?|lines?|zeile|count(?:er)?|i|j|k|lfd|lfd\.? ?nr|record|scan|frame|unnamed: \d+"
        r"|messpunkt|pkt|\w+(?: \w+)?[ _.-]+(?:#|no|nr|n°|number|nummer)"
        r"|(?:sample|point|record|row|scan|line|punkt|zeilen|seq)(?:#|no|nr|n°|number|nummer)"
        r"|n°|num[ée]ro|seq(?:uence)?|observation|entry|data ?points?|messung|z[äa]hler|pulses?|ticks?|trigger|encoder|row ?names",
    ),
    (
        "time",
        r"t|time.*|zeit.*|temps|tiempo|tijd|tempo|timestamp.*|date.*|datum|uhrzeit|elapsed.*|seconds?|sec",
    ),
    ("x", r"x|x[ _-].*|.*[ _-]x|x(?:pos|coord|koord|value|wert|axis|achse|dist).*"),
    ("y", r"y|y[ _-].*|.*[ _-]y|y(?:pos|coord|koord|value|wert|axis|achse|dist).*"),
    ("z", r"z|z[ _-].*|.*[ _-]z|z(?:pos|coord|koord|value|wert|axis|achse|dist).*"),
    (
        "x",
        r"(?:dist|pos|abstand|weg|station|chain|stre[ck]|l[aä]ng|laeng|length|longitud|absci|absz|along|travel|afstand|"
        r"avst|long\b|longpos|lange\b|fahrtr|posi|u$|s$|d$|l$|progressiv|rolling|absc|pk$|kilometr|coord|entf|running|arc).*|x\d+"
        r"|.*[ _](?:distance|position|length|entfernung)",
    ),
    ("y", r"(?:lateral|width|across|transv|quer|breit|breed|larg|anch|v$).*"),
    (
        "z",
        r"(?:h$|height|h(?:ö|o|oe|�)he|hoehe|depth|prof|elev|alt|tief|tie?fe|ordin|value|wert|messwert|haut|hoog|h(?:ö|o)jd|"
        r"textur|relief|surface|rough|amplit|cota|quota|heigth|hgt|dz$|level).*",
    ),
    (
        "other",
        r".*(?:force|kraft|speed|veloc|geschw|temper|accel|angle|winkel|mpd|iri\b|lat$|lon$|latit|gps|press|druck|qualit|"
        r"intens|valid|flag|status|snr|weight|error|std|sigma|comment|remark|easting|northing|\brms\b|\b[esm]m?td\b|slope|"
        r"gradient|curvature|cross ?fall).*",
    ),
)
# Words that lead to another role than the noun behind them.
_PLACED = re.compile(
    r"(?:(lateral|transvers\w*|cross[ _-]?\w*|across|quer)|(vertical)|(longitudinal|along))[ _-]?(?:pos(?:ition)?|dist(?:ance)?|"
    r"offset|coord(?:inate)?|location|axis|abstand|achse|koordinate)s?"
)
_MATCHES = tuple((role, re.compile(pattern, re.IGNORECASE)) for role, pattern in _ROLES)
_HARMLESS = re.compile(
    r"[-+]?\d*|left|right|links|rechts|centre|center|mid(?:dle)?|raw|filtered|measured|laser|calc(?:ulated)?|mean|average|"
    r"forward|lateral|vertical|longitudinal|transversal|up|upward|iso|relative|abs(?:olute)?|wheel ?path",
    re.IGNORECASE,
)
_BRACKETED = re.compile(r"[\[({<«]([^\])}>»]*)[\])}>»]")
_PARTED = re.compile(r"\s+in\s+|\s*(?:[,/:;|-]|_+)\s*|\s+")
_JOINED = re.compile(r"^(x|y|z|height|depth|dist|distance|elevation|h)(\w{2,})$|^(x|y|z)(m)$", re.I)
_CAMEL = re.compile(r"^(.*[a-z])(MM|Mm|CM|Cm|DM|Dm|UM|Um|μm)$")
# What in a heading multiplies its numbers; a heading of which the last word is half a unit: z_e-3 m.
_TIMES_IN = re.compile(
    r"(?<=\w)\s*[×*·]\s*\d|\s+x\s*10+\b|^[x×*]\s*(?:\d\.|10)|\d\s*[×*]|10\s*(?:\^|\*\*)|[*/]\s*10+\b"
)
_HALF = re.compile(
    r"(?:[-+^]\s*\d+|(?:\b|_)e[-+]?\d+|(?:\b|_)(?:milli|micro|centi|deci|nano|kilo)|(?:\b|_)(?:tenth|hundredth|thousandth)s?(?:\s+of)?(?:\s+an?)?"
    r"|(?:\b|_)(?:per|times)|[*×])$"
)
# Heights counted downwards, or distances from a sensor above.
_DOWN = re.compile(
    r"\b(?:positiv\w*|point(?:s|ing)|axis|measured|count(?:s|ed)|increas\w*|direction)\b.{0,24}\b(?:down(?:wards?)?|nach unten)\b"
    r"|\b(?:down(?:wards?)?|nach unten)\b.{0,16}\bpositiv|\b(?:z|heights?|depths?|profile|sign|data|values|y)\b.{0,12}\b"
    r"(?:inverted|upside[ -]?down|reversed|flipped|invertiert|negated)|\b(?:z|heights?|depths?)[ _-]?down\b|[(\[{]down(?:wards?)?[)\]}]"
    r"|\b(?:distance|range|abstand)\s+(?:to|from|between|zu[mr]?|von|vom)\b.*\b(?:surface|road|pavement|sensor|laser|oberfl\w+)"
    r"|\b(?:sensor|laser)[ _-]?(?:distance|range|abstand)\b|\bstand[ -]?off\b|\bclearance\b",
    re.IGNORECASE,
)
_DOWN_FROM = re.compile(r"\b(?:depths?|height|distance)\b.*\bbelow\b", re.IGNORECASE)
_DEEP = re.compile(r"\b(?:depth|tiefe|prof(?:ondeur|undidad|undit))|(?:^|_)depth", re.IGNORECASE)
_WORDS = re.compile(r"[A-ZÀ-Ö]?[a-zß-öø-ÿμ]+|[A-ZÀ-Ö]+")  # of ProfileMM, too
_WITHIN = {"in", "and", "is", "are", "the", "und"}
_NUMBERED = re.compile(
    r"^\W*(?:col(?:umn)?|spalte|colonne|field|channel|kanal)\.?\s*(\d+)\s*[:=.)-]?\s+(.+)$", re.I
)
_UNIT_WORD = re.compile(r"\b(?:units?|einheit(?:en)?|unit[ée]s?|eenheid|unidad(?:es)?)\b", re.I)
_UNIT_TEXT = r"(?:\d[\d.,]*(?:e[-+]?\d+)?(?:\s*/\s*\d+)?\s*|10\s*\^\s*-?\d+\s*)?(?:[a-zμµ]+|''|\")(?:/[a-z\d^²]+)?"
_IN = re.compile(
    rf"(?P<what>[^\W\d]\w*)(?:\s+(?:is|are|given|measured|values?|data|coordinates?|sind|stored|written))*\s+in\s+\[?(?P<unit>{_UNIT_TEXT})(?!\w)",
    re.I,
)
_EACH = re.compile(rf"(?P<what>[^\W\d]\w*)\s*[:=]?\s*[\[(]?(?P<unit>{_UNIT_TEXT})[\])]?$", re.I)
_NUMERIC = r"[-+]?(?:\d+[.,]?\d*|[.,]\d+)(?:e[-+]?\d+)?"
_NODATA = re.compile(
    r"\b(?P<what>no[ _-]?data(?:[ _-]?value)?|(?:missing|fill|null|undefined|invalid|dummy)(?:[ _-]?(?:value|wert|code|data|height))?s?"
    rf"|fehlwerte?)\b\W*?(?:is|are|coded as|as)?\s*[:=]?\s*(?P<value>{_NUMERIC})(?![\w.])",
    re.I,
)
_SCALE = re.compile(
    rf"\b(?P<what>(?:[\w-]+[ _-])?(?:scale|scaling|scale[ _-]?factor|factor|multiplier|gain|faktor|skalierung))(?:\s*[\[(](?P<in>[^\])]*)[\])])?\s*[:=;\t ]\s*(?P<value>{_NUMERIC})",
    re.I,
)
_STEP = re.compile(
    r"\b(?:dx|delta[ _-]?x|x[ _-]?(?:step|spacing|increment|interval|resolution)|pitch|point[ _-]?spacing|spacing|"
    r"(?:sampl\w*|abtast\w*|measur\w*)[ _-]?(?:interval|distance|spacing|step|abstand|pitch|increment)|increment|interval|"
    r"schrittweite|abtastabstand|step(?:[ _-]?size)?)"
    rf"(?:\s*[\[(](?P<before>[^\])]*)[\])])?\s*(?:=|:|;|,|\t|is|every)?\s*(?P<value>{_NUMERIC})\s*[\[(]?(?P<after>[a-zμµ'\"]+(?:/\w+)?)?",
    re.I,
)
_MULTIPLIED = re.compile(
    rf"\b(?:multipl(?:y|ied)|divided?|multipliziert|dividiert)\b(?:\s+\w+){{0,3}}?\s+(?:by|with|mit|durch)\s+(?P<value>{_NUMERIC})"
    rf"|(?P<count>\b(?:1\s+)?(?:lsb|digits?|counts?|bit|ticks?|increment))\s*[:=]\s*{_NUMERIC}\s*(?P<unit>[^\W\d]+)"
    rf"|\b(?:values?|heights?|numbers?|data|raw|counts?|[xyz])\s*[*×]\s*(?P<factor>{_NUMERIC})",
    re.I,
)
_UPRIGHT = {"vertical": "z", "longitudinal": "x", "lateral": "y", "transverse": "y"}
_OF_ALL = re.compile(
    r"\W*(?:(?:all|the|data|measur\w*|si|coordinates?|values?|grid|table|file|column|numbers?|mess\w*|maß|default|base|its|of|in)"
    r"[ _-]*)*",
    re.I,
)
_FLAGS = re.compile(
    r"(?:.*[\W_])?(?:(?:in)?valid\w*|flags?|mask|status|outliers?|dropouts?)(?:[\W_].*)?",
    re.IGNORECASE,
)


def _without_accents(text: str) -> str:
    return "".join(
        letter for letter in unicodedata.normalize("NFD", text) if not unicodedata.combining(letter)
    )


def _metres(word: str) -> float | None:
    """Metres of a unit of length in lower case; None where it is none."""
    if word in _LENGTHS:
        return _LENGTHS[word]
    match = _METRES.fullmatch(_without_accents(word))
    if match is None:
        return None
    return next((size for size, part in zip(_PREFIXES, match.groups(), strict=True) if part), 1.0)


def _plain(text: str) -> str:
    """A text with µ as the Greek letter, 10⁻⁶ as 10^-6, and tenths and the like as numbers; lower case."""
    plain = _POWER.sub(lambda match: f"10^{match[1].translate(_RAISED)}", text).replace("µ", "μ")
    return _PART.sub(lambda match: f"{_PARTS[match[1]]} ", plain.lower())


@dataclass(frozen=True)
class Unit:
    """A unit as it is written; `metres` of a length, None of a time or whatever else."""

    text: str
    metres: float | None
    time: bool = False


def unit_of(text: str) -> Unit | None:
    """The unit that a text is, also with a factor (0.1 mm, 1/10 mm, 10^-3 m, tenths of mm); None where it is none."""
    shown = text.strip().strip(".").strip()
    word = " ".join(_plain(shown).split())
    if metres := _metres(word):
        return Unit(shown, metres)
    if word in _TIMES:
        return Unit(shown, None, time=True)
    if word in _OTHERS:
        return Unit(shown, None)
    match = _PER.fullmatch(word)
    metres = _metres(match["word"].strip()) if match else None
    if match is None or metres is None:
        return None
    if match["power"]:
        times = 10.0 ** int(match["power"])
    else:
        times = float(match["number"].replace(",", ".")) / float(match["by"] or 1)
    # 25 mm is a length, not a unit.
    if not (times > 0 and abs(np.log10(times) - round(np.log10(times))) < 1e-9):
        return None
    return Unit(shown, times * metres)


def counts_down(text: str) -> bool:
    """Whether a text says that heights are counted downwards, or are distances from a sensor above."""
    return bool(_DOWN.search(text) or _DOWN_FROM.search(text))


def downwards_note(title: str) -> list[str]:
    """A note where a heading may mean that heights are counted downwards."""
    return [f'heights under "{title}" are taken upwards: assumed'] if _DEEP.search(title) else []


def role_of(name: str) -> str:
    """Role of a column by its name: x, y, z, count, time or other; "" where the name does not tell."""
    plain = name.replace("µ", "μ").strip().strip("\"'*:.").strip().lower()
    if match := _PLACED.fullmatch(plain):
        return next(role for role, part in zip("yzx", match.groups(), strict=True) if part)
    words = plain.split()
    if len(words) > 1:
        plain = " ".join(
            word for word in words if word[0].isdigit() or not _HARMLESS.fullmatch(word)
        )
    return next((role for role, form in _MATCHES if form.fullmatch(plain)), "")


@dataclass(frozen=True)
class Column:
    """A column: its heading as written ("" where there is none), role, and unit if it is stated.

    `unclear`: a text in the unit's place that is none; `said`: where the unit stands; `name`: the heading without it.
    """

    title: str = ""
    role: str = ""
    unit: Unit | None = None
    unclear: str = ""
    said: str = ""
    headed: bool = False
    name: str = ""


def column_of(title: str, where: str = "") -> Column:
    """The column under a heading: x [mm], Height (um), z, mm, x_mm, Distance / 0.1 mm, ..."""
    shown = " ".join(re.sub(r"^([\"'])(.*)\1$", r"\2", title.strip()).split())
    said = where or f'heading "{shown}"'
    inside = [text.strip(" [({<") for text in _BRACKETED.findall(shown)]
    name = _BRACKETED.sub(" ", shown).strip()
    units = [unit for text in inside if (unit := unit_of(text))]
    odd = [text for text in inside if not unit_of(text) and not _HARMLESS.fullmatch(text)]
    if not units:
        name, units, more = _without_unit(name.replace("µ", "μ"))
        odd += more
    role = role_of(name)
    if len({unit.metres for unit in units}) > 1:
        units, odd = [], [", ".join(unit.text for unit in units)]
    if not units and not odd:
        odd = _unit_words(name) or re.findall(r"(?:\"|''|″|′)$", shown)
    beside = (name, *(text for text in inside if not unit_of(text)))
    if units and any(_TIMES_IN.search(_plain(text)) for text in beside):  # Height x 10 [mm]
        units, odd = [], [shown]
    unit = units[0] if units else None
    if unit is not None and unit.time and role in ("", "x", "y"):
        role = "time"
    unclear = "".join(odd[:1])
    return Column(shown, role, unit, unclear, said, headed=True, name=name)


def _unit_words(name: str) -> list[str]:
    """Words of a heading that are units of length, where none stands in a unit's place: mm Profile, Profile.mm, ProfileMM."""
    words = _WORDS.findall(name)
    lengths = [word for word in words if _lengths_in(word)] or [
        word for word in words[1:] if word == "m"
    ]
    spelled = re.search(
        r"(?:kilo|de[cz]i|[czs]enti|mill?i|mi[ck]ro|nano)[- ]?met\w*|mi[ck]rons?$|\d\s*m\b",
        _without_accents(name),
        re.IGNORECASE,
    )
    spelled = spelled or re.search(r"(?<=[a-zà-ÿ])[mcdnkμ]m\.?$", name)
    first = re.match(r"(?:m|in|ft)\b\.?\s+\w", name, re.IGNORECASE)
    return lengths or [match[0] for match in (spelled, first) if match]


def _without_unit(plain: str) -> tuple[str, list[Unit], list[str]]:
    """A heading without brackets, parted into name and unit, and what stands in the unit's place and is none."""
    for match in (_JOINED.match(plain), _CAMEL.match(plain)):
        name, unit = [part for part in match.groups() if part] if match else ("", "")
        if (length := unit_of(unit)) and length.metres:
            return name, [length], []
    odd: list[str] = []
    for mark in _PARTED.finditer(plain):
        name, tail = plain[: mark.start()], plain[mark.end() :]
        unit, sign = unit_of(tail), mark[0].strip()
        if not name or (tail in ("'", "''", '"') and re.search("[\"']", name)):  # quotation marks
            continue
        # x_s and n h are names, x, s is a time; Profile 10 mm may be the tenth, in 0.1 mm is a unit.
        if unit and (unit.metres or sign in (",", "/", ":", ";", "|")):
            numbered = re.match(r"\d+\s*[a-zμ]", tail) or re.search(
                r"\d[.,/]\d+$|\b10+$|(?:^|\s)\d\S*[^\s\d.,]\S*$", name
            )
            numbered = numbered if not sign else re.match(r"\d", tail) and re.search(r"\d$", name)
            if numbered or _HALF.search(_plain(name)):
                return name, [], [tail if not sign else plain]
            return name, [unit], []
        strange = sign in (",", "/", "|", "in") and not unit and not _HARMLESS.fullmatch(tail)
        if strange and not odd and role_of(name) in ("x", "y", "z"):
            odd = [tail]
    return plain, [], odd


@dataclass(frozen=True)
class Stated:
    """Statements of the lines before the numbers: units by role ("" for all), `missing` values, the distance `pitch` m between
    heights; `unclear`, `unclear_pitch`: a line that states a unit or factor, or a distance, which is not understood; `down`: a
    line by which heights are counted downwards.
    """

    units: dict[str, tuple[Unit, str]] = field(default_factory=dict)
    missing: tuple[float, ...] = ()
    pitch: tuple[float, str] | None = None
    unclear: str = ""
    unclear_pitch: str = ""
    down: str = ""


@dataclass(frozen=True)
class Layout:
    """How the numbers of a text are written, in which line they begin, and what is said of their columns.

    `before`: lines above the numbers; `width`: fields in a row.
    """

    form: Form
    first: int
    width: int
    columns: tuple[Column, ...]
    stated: Stated
    before: tuple[Line, ...]

    def of(self, *roles: str) -> list[int]:
        """Columns whose headings name one of the roles."""
        return [k for k, column in enumerate(self.columns) if column.role in roles]

    @property
    def headed(self) -> bool:
        """Whether there are headings."""
        return any(column.headed for column in self.columns)


def layout_of(head: Sequence[Line], source: str, fewest: int = 3) -> Layout | None:
    """The layout of the table in the first lines of a text; None where there are no `fewest` rows of numbers.

    InputError for a form that can be read in two ways, and for headings that contradict each other.
    """
    rows = [line for line in head if not line.comment]
    form = form_of(rows, head, source)
    begin = first_row(rows, form, fewest)
    if begin is None:
        return None
    width = len(form.row(rows[begin].text) or ())
    while begin and _lacks_last(rows[begin - 1].text, form, width):
        begin -= 1
    first = rows[begin]
    before = tuple(line for line in head if line.number < first.number)
    columns, used = _headings(before, form, width)
    across = next((line.number for line in reversed(before) if _is_axis(line, form, width)), None)
    rest = [line for line in before if line.number not in {*used, across}]
    titles = max(used, default=0)
    for row in rest if width > 1 else ():
        nearer = not row.comment and row.number > titles
        if (nearer or not any(column.headed for column in columns)) and _names_columns(row):
            raise InputError(
                f"{source}, line {row.number}: {row.text[:60]!r} may name the columns, and cannot be parted into {width} names: "
                "separate them as the numbers are"
            )
    stated = _stated(rest, columns, width, used)
    return Layout(form, first.number, width, columns, stated, before)


def _lacks_last(text: str, form: Form, width: int) -> bool:
    """Whether a line is a row of numbers of which the last is missing: the separator stands at its end."""
    row = form.row(text)
    return (
        row is not None
        and len(row) == width - 1 > 0
        and bool(form.separator)
        and text.endswith(form.separator)
    )


def _is_axis(line: Line, form: Form, width: int) -> bool:
    """Whether a line is the first of a matrix: a corner, also behind an index, and then ascending positions."""
    fields = form.fields(line.text)
    if line.comment or len(fields) != width or width < 3:
        return False
    values = [form.number(text) for text in fields[1 + (form.number(fields[1]) is None) :]]
    numbers = [value for value in values if value is not None]
    return len(numbers) == len(values) > 1 and bool(np.all(np.diff(numbers) > 0))


def _splits(text: str, form: Form, width: int) -> Iterator[list[str]]:
    """The ways to part a line into one title for each column: by the numbers' own form, else by others."""
    own = form.fields(text)
    if len(own) == width > 1 and (form.separator or not _in_pieces(own)):
        yield own
        return
    # The last column has no title.
    if len(own) == width - 1 > 1 and re.search(r"\"\"\s*$|[;,|\t]\s*$", text):
        yield [*own, ""]
        return
    for parts in (
        own,
        quoted(text, ","),
        quoted(text, ";"),
        text.split("\t"),
        re.split(r"\s{2,}|\t", text.strip()),
        re.findall(r"[^\s\[({<]+(?:\s*[\[({<][^\])}>]*[\])}>])?", text),
        text.split(),
        [part.strip('"') for part in re.findall(r'"[^"]*"|\S+', text)],
    ):
        named = [part.strip() for part in parts]
        if len(named) == width + 1 and not named[-1]:
            named.pop()
        if len(named) == width and not _in_pieces(named):
            yield named
        # x, mm, z, mm: names and units in turn
        elif len(named) == 2 * width > 2 and all(
            unit_of(part) and re.search(r"[^\W\d]", part) for part in named[1::2]
        ):
            yield [f"{name} [{unit}]" for name, unit in zip(named[::2], named[1::2], strict=True)]
        # R's write.table: no title over the row names
        elif (
            len(named) == width - 1 > 1
            and form.fields(text)[:1] != [""]
            and all(column_of(name).role in ("x", "y", "z") for name in named)
        ):
            yield ["", *named]


def _in_pieces(titles: Sequence[str]) -> bool:
    """Whether some titles are nothing but a unit in brackets, which belongs to the title before: accel [m/s2] parted."""
    alone = [bool(re.fullmatch(r"[\[({<].*[\])}>]", title)) for title in titles]
    return any(alone) and not all(alone)


def _is_units(fields: Sequence[str]) -> bool:
    """Whether a line holds nothing but units, one or more of them, and blanks."""
    named = [re.sub(r"^[\[({<]|[\])}>]$", "", text.strip()).strip() for text in fields]
    known = [bool(unit_of(text)) for text in named if text not in ("", "-")]
    return bool(known) and all(known)


def _headings(
    before: Sequence[Line], form: Form, width: int
) -> tuple[tuple[Column, ...], set[int]]:
    """The columns by the last line of titles above the numbers, and a line of units beside it; the lines that were used."""
    columns, used = _numbered_titles(before, width) or [Column()] * width, set()
    if columns[0].headed:
        used = {line.number for line in before if _NUMBERED.match(line.text)}
    units: list[tuple[Unit | None, str, str]] = []
    for line in reversed(before) if not columns[0].headed else ():
        for named in _splits(line.text, form, width):
            if width > 1 and all(form.number(text) is not None for text in named if text):
                continue
            if not units and _is_units(named):
                units = [
                    (unit_of(text.strip("[](){}<> ")), text, f"line {line.number}")
                    for text in named
                ]
                used.add(line.number)
                break
            titles = [column_of(text) for text in named]
            if _are_titles(titles, line, width):
                columns = titles
                used.add(line.number)
                break
        else:
            continue
        if columns[0].headed:
            break
    columns = _with_odd_tails(columns)
    for k, (unit, text, where) in enumerate(units):
        if unit is None:
            continue
        column = columns[k]
        if column.unit is not None and column.unit.metres != unit.metres:
            text = f"{column.unit.text} and {text}"
            columns[k] = replace(column, unit=None, unclear=text)
        elif column.unit is None:
            role = "time" if unit.time and column.role in ("", "x", "y") else column.role
            columns[k] = replace(column, unit=unit, said=where, role=role, unclear="")
    return tuple(columns), used


def _with_odd_tails(columns: list[Column]) -> list[Column]:
    """The columns; a last word that titles have in common, and that is no name, may be a unit: it is unclear."""
    plain = [column for column in columns if column.role in ("x", "y", "z") and column.unit is None]
    tails = [
        re.split(r"[\s_]+", column.title)[-1]
        for column in plain
        if re.search(r"[\s_]", column.title)
    ]
    if len(tails) < 2 or len(set(tails)) > 1 or role_of(tails[0]) or _HARMLESS.fullmatch(tails[0]):
        return columns
    known = re.compile(
        r"axis|achse|coord\w*|koord\w*|pos\w*|values?|wert|data|direction|\d+|[a-z]?\d+", re.I
    )
    if known.fullmatch(tails[0]):
        return columns
    return [
        replace(column, unclear=tails[0]) if column in plain and not column.unclear else column
        for column in columns
    ]


def _are_titles(columns: Sequence[Column], line: Line, width: int) -> bool:
    """Whether a line above the numbers can be their headings."""
    titles = [column.name or column.title for column in columns if column.role != "count"] or [""]
    if any(
        re.search(r"[:=]\s*[-+]?\d|\b\d+(?:[.,]\d+)?\s*[a-zμ]+$", title, re.I) for title in titles
    ):
        return False  # Length 12 m, Speed: 30
    if any(NUMBER.fullmatch(title) for title in titles) and titles[0]:
        return False  # Position;12.5
    if any(column.title in _WITHIN or column.title.endswith((":", "=")) for column in columns):
        return False  # x in mm and z in um; date: 2021-05-03
    if _UNIT_WORD.search(line.text) and not _BRACKETED.search(line.text):
        return False
    if _STEP.search(line.text) or _SCALE.search(line.text) or _code_in(line.text) is not None:
        return False  # Sampling interval 0.25 mm
    known = [column.role for column in columns if column.role in ("x", "y", "z", "time")]
    if width == 1:
        if re.search(r"\s\d+(?:[.,]\d+)?\s*[a-zμ]+$", columns[0].title, re.I):
            return False  # Start 100 m
        if ":" in columns[0].title and columns[0].unit is None and not columns[0].unclear:
            return False  # Coordinate system: local
        # A sentence is no heading of a single column.
        return len(line.text.split()) <= 4 and (
            bool(known) or columns[0].unit is not None or bool(columns[0].unclear)
        )
    if known:
        return not line.comment or all(len(column.title.split()) <= 5 for column in columns)
    return not line.comment and any(column.title for column in columns) and width <= 20


def _numbered_titles(before: Sequence[Line], width: int) -> list[Column] | None:
    """Titles in lines such as `Column 1: Distance [mm]`."""
    titles = {
        int(match[1]): column_of(match[2])
        for line in before
        if (match := _NUMBERED.match(line.text))
    }
    least = min(titles, default=1)
    if sorted(titles) == list(range(least, least + width)):
        return [titles[least + k] for k in range(width)]
    return None


def _names_columns(line: Line) -> bool:
    """Whether the words of a line that is no headings name two columns or more."""
    if re.search(r"\b(?:rows?|lines?|zeilen?)\b.*\b(?:col|spalte)|\b(?:col|spalte).*\b(?:rows?|lines?|zeilen?)\b|\bacross\b.*\bdown\b|"
                 r"\bdown\b.*\bacross\b", line.text, re.I):  # fmt: skip
        return False  # the order of a matrix
    words = re.findall(r"[^\W\d_]+", line.text)
    roles = [role for word in words if (role := role_of(word)) in ("x", "y", "z")]
    if re.search(r"\d[.,]\d", line.text) or len(set(roles)) < 2 or len(words) > 12:
        return False  # the y of a matrix, or a sentence
    if _IN.search(line.text) or _UNIT_WORD.search(line.text):
        return roles != sorted(roles)  # x in mm, z in um: the order in which columns are taken
    return True


def _stated(
    before: Sequence[Line], columns: Sequence[Column], width: int, used: set[int]
) -> Stated:
    """Statements of the lines that are no headings; `used`: the lines that are."""
    units: dict[str, tuple[Unit, str]] = {}
    missing: list[float] = []
    pitch: tuple[float, str] | None = None
    unclear = unclear_pitch = down = ""
    spoken = any(column.unit or column.unclear for column in columns)
    heard = {column.unit.metres for column in columns if column.unit and column.unit.metres}

    def state(role: str, unit: Unit, line: Line) -> None:
        nonlocal unclear
        where = f"line {line.number}"
        if role in units and units[role][0].metres != unit.metres:
            unclear = f"lines {units[role][1].removeprefix('line ')} and {line.number}: units {units[role][0].text} and {unit.text}"
        units[role] = unit, where

    for line in before:
        text = line.text
        if (code := _code_in(text)) is not None:
            missing.append(code)
            continue
        if match := _STEP.search(text):
            unit_read = unit_of(match["before"] or match["after"] or "")
            value = float(match["value"].replace(",", "."))
            if unit_read is not None and unit_read.metres:
                pitch = value * unit_read.metres, f"line {line.number}"
            elif unit_read is None:
                unclear_pitch = unclear_pitch or f"line {line.number}: {text[:60]!r}"
            continue
        if (factor := _factor_in(text)) is not None:
            if factor != 1.0:
                unclear = unclear or f"line {line.number}: {text[:60]!r}"
            continue
        if counts_down(text):
            down = down or f"line {line.number}: {text[:60]!r}"
        if pairs := _pairs(text):
            for role, unit in pairs:
                state(role, unit, line)
            continue
        if _UNIT_WORD.search(text):
            parsed = _units_in(text, width)
            if not parsed or (
                heard and any(not role and unit.metres not in heard for role, unit in parsed)
            ):
                unclear = unclear or f"line {line.number}: {text[:60]!r}"
            for role, unit in parsed:
                state(role, unit, line)
            continue
        found_in = list(_IN.finditer(text))
        others = _lengths_in(text) - heard
        others -= {
            one.metres for match in found_in if (one := unit_of(match["unit"])) and one.metres
        }
        if others and (found_in or spoken and _mentions_unit(text)):
            unclear = unclear or f"line {line.number}: {text[:60]!r}"
        below = bool(used) and line.number > max(used) and not found_in  # where units stand
        if not spoken and not found_in and (below or _mentions_unit(text)):
            unclear = unclear or f"line {line.number}: {text[:60]!r}"
        for match in found_in:
            one = unit_of(match["unit"])
            role = role_of(match["what"])
            if one is None and role in ("x", "y", "z"):
                unclear = unclear or f"line {line.number}: {text[:60]!r}"
            if one is None or one.metres is None or role in ("count", "time", "other"):
                continue
            role = role if role in ("x", "y", "z") else ""
            if not role and heard and one.metres not in heard:
                unclear = unclear or f"line {line.number}: {text[:60]!r}"
            state(role, one, line)
    return Stated(units, tuple(missing), pitch, unclear, unclear_pitch, down)


def _factor_in(text: str) -> float | None:
    """The factor that a line states; nan for the size of a count (LSB = 0.1 um), None where it states none."""
    if match := _SCALE.search(text):
        return float(match["value"].replace(",", "."))
    match = _MULTIPLIED.search(text)
    if match is None:
        return None
    if match["count"]:  # Count: 200 is none
        unit = unit_of(match["unit"])
        return np.nan if unit and unit.metres else None
    return float((match["value"] or match["factor"]).replace(",", "."))


def _pairs(text: str) -> list[tuple[str, Unit]]:
    """(role, unit) of a line that is nothing but these: z: um; x [mm], z [um]; vertical / um."""
    pairs = []
    for part in re.split(r"[,;\t]\s*|\s+(?=[xyz]\b)", text.strip()):
        column = column_of(
            re.sub(r"[:=]", " ", re.sub(r"^\W*(?:col(?:umn)?s?\s*\d*\s*[:=.])?", "", part))
        )
        if (
            column.unit is None
            or not column.unit.metres
            or re.search(r"\d|unit", column.name + column.unit.text)
        ):
            return []  # Length: 1 m
        pairs.append((_UPRIGHT.get(column.name.lower(), column.role), column.unit))
    return pairs if all(role in ("x", "y", "z") for role, _ in pairs) else []


def mentions_unit(text: str) -> bool:
    """Whether a text about heights mentions a unit of length: height in mm, z [mm]."""
    units = [unit_of(match["unit"]) for match in _IN.finditer(text)]
    return _mentions_unit(text) or any(unit and unit.metres for unit in units)


def _mentions_unit(text: str) -> bool:
    """Whether a line has a unit of length in it that could be a column's: in brackets, or a word such as mm."""
    words = re.findall(r"[^\W\d_]+", text.replace("µ", "μ"))
    roles = {role_of(word) for word in words} & {"x", "y", "z"}
    if words and all((unit := unit_of(word)) and unit.metres for word in words):
        return True
    if len(roles) > 1:
        return _has_unit(text)
    if re.search(r"[:=]\s*[-+]?\d[\d.,e+-]*\s*[^\s\d]{0,4}\s*$", text, re.I):
        return False  # Lane width: 3.5 m
    spot = r"\d[\d.,]*(?:e[-+]?\d+)?\s*(?:[mcdkn]m|[uμµ]m|m|ft|inch)\b"  # of 0.2 mm
    inside = [
        part for part in _BRACKETED.findall(text) if not re.fullmatch(spot, part.strip(), re.I)
    ]
    named = [
        unit
        for part in inside
        for word in re.split(r"[\s=:,\[({<]+", part)
        if (unit := unit_of(word)) and unit.metres
    ]
    return bool(named) or _has_unit(re.sub(spot, " ", _BRACKETED.sub(" ", text), flags=re.I))


def _has_unit(text: str) -> bool:
    return bool(_lengths_in(text))


def _lengths_in(text: str) -> set[float]:
    """Metres of the units of length that stand in a line: in brackets, or a word such as mm."""
    text = re.sub(r"[^\W\d_]+\s*/\s*(?:h|hr|s|min)\b", " ", text)  # Speed 80 km/h
    words = [word.lower() for word in _WORDS.findall(text.replace("µ", "μ"))]
    inside = [unit.metres for part in _BRACKETED.findall(text) if (unit := unit_of(part))]
    plain = [_metres(word) for word in words if len(word) > 1 and word != "in"]
    return {metres for metres in (*inside, *plain) if metres}


def _code_in(text: str) -> float | None:
    """The value that a line names as no height. `Missing values: 12` counts them."""
    match = _NODATA.search(text)
    if match is None:
        return None
    value = float(match["value"].replace(",", "."))
    counted = match["what"].lower().endswith("s") or match["what"].lower() in (
        "missing",
        "invalid",
        "null",
    )
    return None if counted and value >= 0 and value == round(value) and value < 99 else value


def _units_in(text: str, width: int) -> list[tuple[str, Unit]]:
    """(role, unit) of a line that has the word unit in it; empty where it is not understood."""
    match = _UNIT_WORD.search(text)
    assert match is not None
    who = re.sub(r"[^\w]+$", "", text[: match.start()].strip())
    rest = re.sub(
        r"^\s*(?:are|is|in|of(?= \w+ (?:is|are)))?\s*[:=;,\t]?\s*", "", text[match.end() :]
    )
    rest = re.sub(r"^([\"'])(.*)\1$", r"\2", rest.strip(" ;,\t"))
    who = re.sub(r"[_\s-]+$", "", who)
    whose = _UPRIGHT.get(who.lower(), role_of(who)) if who else ""
    if re.fullmatch(r"(?:.*[ _-])?lengths?|horizontal|x/?y|xy", who, re.I) and (
        unit := unit_of(rest)
    ):
        return [("x", unit), ("y", unit)]
    if whose not in ("x", "y", "z"):
        if who and not _OF_ALL.fullmatch(who):
            return []  # Intensity unit: mm
        whose = ""
    bare = re.sub(r"^[\[({<]|[\])}>]$", "", rest).strip()
    if unit := unit_of(bare):
        return [(whose, unit)]
    if of := re.match(r"^(?:of\s+)?(\w+)\s*(?:is|are|=|:)?\s*(.+)$", rest, re.I):
        role, unit = role_of(of[1]), unit_of(re.sub(r"[\[\](){}]", "", of[2]))
        if role in ("x", "y", "z") and unit:
            return [(role, unit)]
    parts = [part.strip() for part in re.split(r"[;,\t]|\band\b|\bund\b", rest) if part.strip()]
    units: list[tuple[str, Unit]] = []
    plain = [unit_of(re.sub(r"[\[\](){}]", "", part)) for part in parts]
    if all(plain):
        same = {unit.metres for unit in plain if unit}
        if len(same) == 1 and plain[0]:
            return [("", plain[0])]
        roles = {2: ("x", "z"), 3: ("x", "y", "z")}.get(len(parts), ())
        return [
            (role, unit)
            for role, unit in zip(roles, plain, strict=False)
            if unit and len(parts) == width
        ]
    for part in parts:
        match = _EACH.match(part)
        role, unit = (role_of(match["what"]), unit_of(match["unit"])) if match else ("", None)
        if unit is None or role not in ("x", "y", "z"):
            return []
        units.append((role, unit))
    return units


def late_statement(line: Line) -> bool:
    """Whether a comment among or below the numbers states a unit, a factor, a direction or a missing value."""
    text = line.text
    if _code_in(text) is not None or _UNIT_WORD.search(text):
        return True
    if any((unit := unit_of(match["unit"])) and unit.metres for match in _IN.finditer(text)):
        return True
    if _factor_in(text) not in (None, 1.0) or counts_down(text):
        return True
    return any((unit := unit_of(inside)) and unit.metres for inside in _BRACKETED.findall(text))


def check_late(lines: Iterable[Line], source: str, *, alone: bool = False) -> Iterator[Line]:
    """The lines that are no comments. InputError for a comment that states a unit below the numbers' beginning.

    `alone`: each line is one height, and an empty one among them may be a height that is missing: an error, too.
    """
    last, empty = 0, 0
    usual: int | None = (
        None  # empty lines between two heights: some programs write every line end twice
    )
    begun = False
    for line in lines:
        empty += line.number - last - 1 if last else 0
        last = line.number
        if alone and not line.comment:
            if begun and usual not in (None, empty):
                raise InputError(
                    f"{source}, line {line.number - 1}: is empty: if it stands for a height that is missing, write nan"
                )
            usual, begun, empty = (empty if begun else None), True, 0
        if not line.comment:
            yield line
        elif late_statement(line):
            raise InputError(
                f"{source}, line {line.number}: {line.text[:60]!r} among the numbers: what it says of them must stand "
                "above the first"
            )


@dataclass(frozen=True)
class Scale:
    """Metres of a column's numbers, as text for the user, and whether it was assumed."""

    metres: float
    text: str
    assumed: bool = False
    stated: bool = False


def scale_of(
    role: str, column: Column, stated: Stated, given: tuple[str, str | None], source: str
) -> Scale | None:
    """The unit of a column: of the file, or of the key (its name and value) `given`; None where neither says.

    InputError where both say and differ, for a unit that is not known, and for one that is no length.
    """
    key, value = given
    what = {"x": "x", "y": "y", "z": "heights"}[role]
    name = f"road.{key}"
    if value is None and stated.unclear:
        raise InputError(
            f"{source}, {stated.unclear} is not understood, and may state units or a factor: say {name} in [road], "
            "apply the factor, or remove the line"
        )
    if value is None and " and " in column.unclear:
        raise InputError(
            f"{source}: {what} are in {column.unclear} by the lines above the numbers: say {name}"
        )
    if role == "z" and (down := column.title if counts_down(column.title) else stated.down):
        raise InputError(
            f"{source}, {down}: heights that are counted downwards, or distances from a sensor; a road has heights upwards: "
            "write them so, with that changed"
        )
    unit, said = column.unit, column.said
    for other in (role, ""):
        if other not in stated.units:
            continue
        theirs, where = stated.units[other]
        if unit is None:
            unit, said = theirs, where
        elif unit.metres != theirs.metres and (other == role or not column.unit):
            raise InputError(
                f"{source}: {what} are in {unit.text} by the {said}, and in {theirs.text} by {where}: which is right? "
                "Correct the file"
            )
    if unit is not None and unit.metres is None:
        other = "a time" if unit.time else "no length"
        raise InputError(
            f"{source}: {what} are in {unit.text} ({said}), which is {other}: a road has lengths there"
        )
    if unit is None:
        if column.unclear and value is None:
            odd = "may be their unit" if _lengths_in(column.unclear) else "is no unit that is known"
            raise InputError(
                f'{source}: "{column.unclear}" in the {column.said} {odd}: say what {what} are in, '
                f'{name} = "mm" for example'
            )
        return None if value is None else Scale(UNITS[value], f"{value} (road.{key})")
    assert unit.metres is not None
    if value is not None and abs(UNITS[value] / unit.metres - 1) > 1e-6:
        raise InputError(
            f'{source}: the file says that {what} are in {unit.text} ({said}), and {name} = "{value}": take the key out, '
            "or correct the file"
        )
    return Scale(unit.metres, f"{unit.text} ({said})", stated=True)


def check_flags(column: Column, values: Array, source: str) -> None:
    """InputError where a column may say which heights hold: it is called so, and its values are not all the same."""
    if _FLAGS.fullmatch(column.title) and len(np.unique(values[np.isfinite(values)])) > 1:
        raise InputError(
            f'{source}: the column "{column.title}" may say which heights are missing: write nan for these, and leave the column out'
        )


@dataclass(frozen=True)
class ReadAs:
    """A quantity read from a file, for the user: its name, the place it was in, its unit, and its gaps."""

    quantity: str
    place: str
    unit: str
    remark: str = ""
