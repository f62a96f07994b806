"""JSON Schema of fields that `shared.items` checks, from the constants of the check; for the reference alone."""

from __future__ import annotations

from typing import Any

from pydantic.config import JsonDict

from shared.characters import LINE_PATTERN
from shared.expected import ACTS, JOIN, MAX_ACTS, SIDED, STRAIGHT
from shared.items import MAX_NAME, MAX_TAG_LENGTH, MODEL, SETTINGS
from shared.text.prompts import MAX_CHARACTERS

MAX_MODEL = 165
"""Characters: a name of 100, `@` and 64 hexadecimal digits."""
PROMPT: JsonDict = {"minLength": 1, "maxLength": MAX_CHARACTERS}
NAME_PATTERN = r"^[^/\\" + LINE_PATTERN.removeprefix("^[^")
"""Of names of motions: one line without separators."""
ITEM_NAME: JsonDict = {"minLength": 1, "maxLength": MAX_NAME, "pattern": NAME_PATTERN}
ITEM_MODEL: JsonDict = {"maxLength": MAX_MODEL, "pattern": f"^{MODEL.pattern}$"}
TAGS: JsonDict = {"items": {"type": "string", "minLength": 1, "maxLength": MAX_TAG_LENGTH, "pattern": LINE_PATTERN}}
_MORE = "|".join(sorted({STRAIGHT, *(side for sides in SIDED.values() for side in sides)}))
_ACT = rf"({'|'.join(ACTS)})( ({_MORE})){{0,2}}"
EXPECTED: JsonDict = {"pattern": rf"^{_ACT}( {JOIN} {_ACT}){{0,{MAX_ACTS - 1}}}$"}


def _setting(low: float, high: float) -> JsonDict:
    return {"type": "integer" if isinstance(low, int) else "number", "minimum": low, "maximum": high}


SAMPLING: dict[str, Any] = {
    "properties": {name: _setting(*bounds) for name, bounds in SETTINGS.items()},
    "additionalProperties": False,
}
"""Which of these a model has, its bundle says."""
