"""Errors of pydantic in the words of this product. Standard library only: it reads the errors as plain values."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

from marey.core.suggestions import did_you_mean

UNKNOWN_FIELD = "extra_forbidden"
"""Type of pydantic's error for a field that a model does not have."""
LONGEST_VALUE = 80
SHOWN = 40
"""Characters of a text that a message quotes."""
WANTED = {
    **dict.fromkeys(("int_type", "int_parsing", "int_parsing_size", "int_from_float"), "a whole number"),
    **dict.fromkeys(("float_type", "float_parsing"), "a number"),
    **dict.fromkeys(("bool_type", "bool_parsing"), "true or false"),
    "string_type": "a text",
    **dict.fromkeys(("list_type", "tuple_type", "set_type", "frozen_set_type", "iterable_type"), "a list"),
    **dict.fromkeys(("dict_type", "mapping_type", "model_type", "dataclass_type"), "an object"),
    "model_attributes_type": "an object",
    **dict.fromkeys(
        ("datetime_type", "datetime_parsing", "datetime_from_date_parsing", "timezone_aware"),
        "a time such as 2026-11-27T10:00:00Z",
    ),
    **dict.fromkeys(("uuid_type", "uuid_parsing"), "an id such as 01234567-89ab-cdef-0123-456789abcdef"),
}
"""Name of the wanted kind of value, by the type of the error."""
BOUNDS = {
    "greater_than": ("gt", "is not above {}"),
    "greater_than_equal": ("ge", "is below {}, the least that is allowed"),
    "less_than": ("lt", "is not below {}"),
    "less_than_equal": ("le", "is above {}, the most that is allowed"),
}
VALUE_ERROR = "Value error, "
"""How pydantic begins a message that it did not write."""
SUBJECT = re.compile(r"^\w+ should")
_NO_INPUT = object()
_meaning: dict[str, str] = {}


def worded(pattern: str, meaning: str) -> str:
    """Return a pattern for a field; errors about it say what it means in place of the pattern.

    Args:
        pattern: a regular expression.
        meaning: of the texts that match, as `letters and digits, at most 16`.
    """
    _meaning[pattern] = meaning
    return pattern


def meaning_of(pattern: str) -> str | None:
    """Return what a pattern means, None if `worded` was not told."""
    return _meaning.get(pattern)


def place_of(error: Mapping[str, Any]) -> str:
    """Return the path of the field of an error, as `motions.0`; elements of lists are counted from 0."""
    return ".".join(map(str, error["loc"]))


def first_problem(error: Any, *, quoted: bool = True) -> str:
    """Return the first problem of a `pydantic.ValidationError`, with the field that it concerns.

    Args:
        quoted: quote the value.
    """
    first = error.errors(include_url=False, include_input=quoted)[0]
    place = place_of(first)
    return f"{place}: {problem_of(first)}" if place else problem_of(first)


def problem_of(error: Mapping[str, Any], known: Sequence[str] = ()) -> str:
    """Return what is wrong with a value, without its field.

    Args:
        error: one of `pydantic.ValidationError.errors()`, perhaps without its `input`.
        known: names of the fields beside an unknown one.
    """
    kind, value, context = str(error["type"]), error.get("input", _NO_INPUT), error.get("ctx", {})
    if kind == "missing":
        return "is missing"
    if kind == UNKNOWN_FIELD:
        meant = did_you_mean(str(error["loc"][-1]), known)
        return f"is not a known field{meant}" + (f"; known: {', '.join(known)}" if known else "")
    if kind in WANTED:
        if isinstance(value, str | int | float) and not isinstance(value, bool):
            return f"{kind_of(value)} is not {WANTED[kind]}"
        return f"is not {WANTED[kind]}" if value is _NO_INPUT else f"is {kind_of(value)}, not {WANTED[kind]}"
    if kind == "finite_number":
        return "is not a finite number"
    if kind in BOUNDS:
        name, said = BOUNDS[kind]
        shown = value[:SHOWN] if isinstance(value, str) else _shown(value)  # a text that was read as a number
        return f"{shown} {said.format(_number(context[name]))}".strip()
    if kind in ("literal_error", "enum"):
        return _not_among(value, str(context["expected"]))
    if kind in ("too_short", "too_long", "string_too_short", "string_too_long"):
        return _length(kind, value, context)
    if kind == "string_pattern_mismatch":
        meaning = meaning_of(str(context["pattern"]))
        return f"{_shown(value)} cannot be used{': allowed are ' + meaning if meaning else ''}".strip()
    message = str(error["msg"])
    if message.startswith(VALUE_ERROR):  # of our own
        return message.removeprefix(VALUE_ERROR)
    if not isinstance(value, str | int | float) or len(shown := repr(value)) > LONGEST_VALUE:
        return message
    return f"{shown} cannot be used: {SUBJECT.sub('it should', message)}"


def kind_of(value: object) -> str:
    """Name a value of JSON for `is …, not a number`: a text and a number are quoted."""
    if isinstance(value, str):
        return repr(value[:SHOWN])
    if isinstance(value, bool):
        return "true or false"
    if isinstance(value, list | tuple):
        return "a list"
    if value is None:
        return "null"
    if isinstance(value, int) and abs(value) >= 10**SHOWN:
        return f"a number of over {SHOWN} digits"
    return "an object" if isinstance(value, Mapping) else ascii(value)[:SHOWN]


def _shown(value: object) -> str:
    return "" if value is _NO_INPUT else kind_of(value)


def _number(value: object) -> str:
    return f"{value:,}" if isinstance(value, int) else f"{value:g}" if isinstance(value, float) else str(value)


def _not_among(value: object, expected: str) -> str:
    """Describe a value that is none of a few.

    Args:
        expected: `'a', 'b' or 'c'`.
    """
    known = re.findall(r"'((?:[^'\\]|\\.)*)'", expected)
    meant = did_you_mean(value, known) if isinstance(value, str) else ""
    return f"{_shown(value)} is not known{meant}; known: {', '.join(known) or expected}".strip()


def _length(kind: str, value: object, context: Mapping[str, Any]) -> str:
    is_text = kind.startswith("string")
    unit = "character" if is_text else "element"
    if kind.endswith("long"):
        limit, bound = int(context["max_length"]), "at most {} {} allowed"
    else:
        limit, bound = int(context["min_length"]), "at least {} {} needed"
    bound = bound.format(f"{limit:,}", "is" if limit == 1 else "are")
    found = len(value) if isinstance(value, str) else context.get("actual_length")
    if found is None:
        return f"has too {'many' if kind.endswith('long') else 'few'} {unit}s: {bound}"
    if not found:
        return "is empty" if limit == 1 else f"is empty: {bound}"
    return f"has {found:,} {unit}{'' if found == 1 else 's'}: {bound}"
