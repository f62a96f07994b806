"""The base of all results: reads an object of the API into a frozen dataclass by its annotations."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from datetime import datetime
from functools import cache
from types import NoneType, UnionType
from typing import Any, Self, Union, get_args, get_origin, get_type_hints

from marey.core.errors import InvalidInput

Convert = Callable[[Any], Any]
HINT = "Is this the address of a Marey server? Client and server may be one release apart, not more."


@dataclass(frozen=True, kw_only=True)
class Result:
    """An object of the API.

    Attributes:
        raw: the JSON object as the server sent it, with the fields that this client does not know.
    """

    raw: Mapping[str, Any] = field(default_factory=dict[str, Any], repr=False, compare=False)

    @classmethod
    def of(cls, found: Any) -> Self:
        """Read a JSON object; absent and null fields have their defaults, unknown ones are ignored.

        Raises:
            InvalidInput: it is not such an object.
        """
        try:
            known = {
                name: given if convert is None else convert(given)
                for name, convert in _converters(cls)
                if (given := found.get(name)) is not None
            }
            return cls(raw=found, **known)
        except (AttributeError, TypeError, ValueError, OverflowError) as error:
            message = f"the server's answer is not a {cls.__name__}: {error}"
            raise InvalidInput(message, where="answer", hint=HINT) from error


@cache
def _converters(kind: type[Result]) -> tuple[tuple[str, Convert | None], ...]:
    """Return the fields of a class of results, each with the converter of its JSON value; None = no conversion."""
    hints = get_type_hints(kind)
    return tuple((each.name, _converter(hints[each.name])) for each in fields(kind) if each.name != "raw")


def _converter(hint: Any) -> Convert | None:
    origin, arguments = get_origin(hint), get_args(hint)
    if origin in (Union, UnionType):
        (inner,) = (each for each in arguments if each is not NoneType)
        return _converter(inner)
    if origin is tuple:
        return _elements(_converter(arguments[0]))
    if isinstance(origin, type) and issubclass(origin, Mapping):
        return dict
    if hint is datetime:
        return datetime.fromisoformat
    if hint is float:
        return float
    return hint.of if isinstance(hint, type) and issubclass(hint, Result) else None


def _elements(inner: Convert | None) -> Convert:
    if inner is None:
        return tuple
    return lambda values: tuple(inner(value) for value in values)
