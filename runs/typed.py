"""Arguments of the wrong kind, refused by one message that says where the right ones come from."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from functools import cache, wraps
from typing import Any, ParamSpec, TypeVar, get_args, get_type_hints

from tireroad.fem.errors import InputError

P = ParamSpec("P")
T = TypeVar("T")

# What makes each kind of argument, by the name of its class.
_MADE_BY = {
    "TireModel": "tireroad.torus(…) or tireroad.radial(…)",
    "StaticState": "tireroad.press(…)",
    "Standing": "tireroad.modes(…)",
    "RollingTire": "tireroad.roll(…)",
    "RoadUnderTire": 'tireroad.make_road(kind="sine", …)',
    "Turning": "tireroad.Turning(speed=…, damping=(…, …))",
}


def typed(function: Callable[P, T]) -> Callable[P, T]:
    """The function, with InputError for an argument that is not of the class it is annotated with.

    Only for the classes that functions of the library make.
    """
    signature = inspect.signature(function)

    @cache  # when first called: then all classes of the module are defined
    def kinds() -> dict[str, Any]:
        hints = get_type_hints(function)
        return {name: hint for name, hint in hints.items() if name != "return" and _maker(hint)}

    @wraps(function)
    def checked(*args: P.args, **keys: P.kwargs) -> T:
        given = signature.bind(*args, **keys).arguments
        for name, kind in kinds().items():
            if name in given and not isinstance(given[name], kind):
                found = type(given[name]).__name__
                raise InputError(
                    f"{function.__name__}: {name} is of the type {found}: take what {_maker(kind)} returns"
                )
        return function(*args, **keys)

    return checked


def _maker(hint: Any) -> str | None:
    """What makes the class of an annotation, which may also allow None."""
    names = [getattr(one, "__name__", "") for one in (hint, *get_args(hint))]
    return next((_MADE_BY[name] for name in names if name in _MADE_BY), None)
