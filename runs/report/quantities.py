"""Formats numbers with units for readers: 4 digits and the usual prefixes."""

from math import isfinite

SYMBOLS = {"-": "", "1": "", "us": "µs", "deg": "°", "m2": "m²", "m3": "m³", "kg^-1/2": "kg^(−1/2)"}
PREFIXES = {
    "m": ((1.0, "m"), (1e-3, "mm"), (1e-6, "µm"), (1e-9, "nm")),
    "s": ((1.0, "s"), (1e-3, "ms"), (1e-6, "µs")),
    "N": ((1e4, "kN", 1e3), (1.0, "N"), (1e-3, "mN")),
    "Pa": ((1e9, "GPa"), (1e6, "MPa"), (1e3, "kPa"), (1.0, "Pa")),
    "Hz": ((1e4, "kHz", 1e3), (1e-2, "Hz", 1.0)),
}


def quantity(value: object, unit: str = "") -> str:
    """`value` with its unit: 0.0123 "m" gives "12.3 mm"; flags in words, texts as they are."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if value is None:
        return "–"
    if isinstance(value, (list, tuple)):
        return ", ".join(quantity(part, unit) for part in value)
    if not isinstance(value, (int, float)):
        return f"{value} {SYMBOLS.get(unit, unit)}".rstrip()
    factor, symbol = _prefix(value, unit)
    return f"{digits(value / factor)} {symbol}".rstrip()


def bounded(value: float, error: float | None, unit: str) -> str:
    """`value` and its `error` to two digits in the value's own unit: "60.37 ± 0.67 N"."""
    if not error:
        return quantity(value, unit)
    factor, symbol = _prefix(value, unit)
    return f"{digits(value / factor)} ± {digits(float(f'{error / factor:.2g}'))} {symbol}".rstrip()


def _prefix(value: float, unit: str) -> tuple[float, str]:
    """The unit with a prefix that suits `value`, and how many of `unit` it has."""
    for threshold, name, *factor in PREFIXES.get(unit, ()):
        if isfinite(value) and abs(value) >= threshold:
            return (factor[0] if factor else threshold), name
    return 1.0, SYMBOLS.get(unit, unit)


def digits(value: float) -> str:
    """4 significant digits; integers in full up to a million; powers of ten as 3.1·10⁻¹²."""
    if float(value).is_integer() and abs(value) < 1e6:
        return f"{int(value):,}".replace(",", "\u202f").replace("-", "−")
    text = f"{value:.4g}"
    mantissa, _, exponent = text.partition("e")
    if exponent:
        raised = str(int(exponent)).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
        text = f"{float(mantissa):.3g}·10{raised}"
    return text.replace("-", "−")
