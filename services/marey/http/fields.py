"""JSON Schema of fields that `marey.items` validates, from the constants of its checks; for the reference
alone."""

from __future__ import annotations

from typing import Any

from pydantic.config import JsonDict

from marey.core.characters import LINE_PATTERN
from marey.items.expected import ACTIONS, JOIN, MAX_ACTIONS, SIDED, STRAIGHT
from marey.items.prompts import MAX_CHARACTERS
from marey.items.settings import (
    BEST_OF,
    MAX_BEST_OF,
    MAX_OUTPUT_FPS,
    MAX_REDRAWS,
    MAX_SETTING,
    MAX_SETTINGS,
    MIN_OUTPUT_FPS,
    OUTPUT_FPS,
    REDRAWS,
    SETTING,
)
from marey.items.timeline import MAX_ROWS, MAX_TIMELINE_CHARACTERS
from marey.items.values import MAX_NAME, MAX_TAG_LENGTH, MODEL

MAX_MODEL = 165
"""Characters: a name of 100, `@` and 64 hexadecimal digits."""
PROMPT: JsonDict = {"minLength": 1, "maxLength": MAX_CHARACTERS}
TIMELINE: JsonDict = {"minLength": 1, "maxLength": 2 * MAX_TIMELINE_CHARACTERS, "maxItems": MAX_ROWS}
_HIDDEN = LINE_PATTERN.removeprefix("^[^").removesuffix("]*$")
"""Forbidden characters of free text, as part of a character class."""
_DEVICE = "".join(
    f"[{c.upper()}{c}]" if c.isalpha() else c for c in r"(con((in|out)\$)?|prn|aux|nul|(com|lpt)[0-9¹²³])"
)
NAME_PATTERN = (
    rf"^(?! *{_DEVICE}( *\..*)? *$)(?!.*\.\.) *[^\x00-/:-@\[-`{{-\x7f{_HIDDEN}]"
    rf"([^/\\{_HIDDEN}]*[^/\\. {_HIDDEN}])? *$"
)
"""Pattern of motion names: begins with a letter or digit, no separators and no `..`, no dot at the end, no device of
Windows. As exact as a portable pattern can be: languages have no common class for the letters of all scripts, so it
accepts for ASCII what the check accepts."""
ITEM_NAME: JsonDict = {"minLength": 1, "maxLength": MAX_NAME, "pattern": NAME_PATTERN}
ITEM_MODEL: JsonDict = {"maxLength": MAX_MODEL, "pattern": f"^{MODEL.pattern}$"}
TAG_PATTERN = rf"^(?=.*[^ ]){LINE_PATTERN.removeprefix('^')}"
"""Not blank."""
TAGS: JsonDict = {"items": {"type": "string", "minLength": 1, "maxLength": MAX_TAG_LENGTH, "pattern": TAG_PATTERN}}
_MORE = "|".join(sorted({STRAIGHT, *(side for sides in SIDED.values() for side in sides)}))
_ACTION = rf"({'|'.join(ACTIONS)})( ({_MORE})){{0,2}}"
EXPECTED: JsonDict = {"pattern": rf"^{_ACTION}( {JOIN} {_ACTION}){{0,{MAX_ACTIONS - 1}}}$"}


SAMPLING: dict[str, Any] = {
    "properties": {
        OUTPUT_FPS: {"type": "number", "minimum": MIN_OUTPUT_FPS, "maximum": MAX_OUTPUT_FPS},
        BEST_OF: {"type": "integer", "minimum": 1, "maximum": MAX_BEST_OF},
        REDRAWS: {"type": "integer", "minimum": 0, "maximum": MAX_REDRAWS},
    },
    "additionalProperties": {"type": "number", "minimum": -MAX_SETTING, "maximum": MAX_SETTING},
    "propertyNames": {"pattern": f"^{SETTING.pattern}$"},
    "maxProperties": MAX_SETTINGS,
}
"""A model declares its settings and their ranges: `/v1/models/{name}` lists them."""
