"""Checks of the single values of an item, apart from the item, and their limits.

Each check takes a value of JSON or of a table, and returns it in its own type or raises `InvalidInput`. Standard
library only: the small client imports it.
"""

from __future__ import annotations

import math
import re
import unicodedata
from collections.abc import Sequence
from typing import cast

from marey.core.characters import check_text, is_printable
from marey.core.errors import InvalidInput
from marey.core.validation import kind_of, worded

MAX_SEED = 2**31 - 1
MAX_VARIANTS = 100
MIN_SECONDS, MAX_SECONDS = 0.5, 60.0
"""Range over all models; a bundle's own range, which is narrower, is checked once the bundle is known."""
MAX_TAGS, MAX_TAG_LENGTH = 20, 64

MAX_NAME = 100
NAME = re.compile(rf"[^\W_][^/\\]{{0,{MAX_NAME - 1}}}")
"""A name begins with a letter or digit of any script and holds no separators and no invisible characters. The client
derives the file name from it (`marey.client.names`)."""
RESERVED = re.compile(r"(con|prn|aux|nul|conin\$|conout\$|com[\d¹²³]|lpt[\d¹²³])( *\..*)?", re.IGNORECASE)
"""Reserved device names of Windows."""
MODEL = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,99}(@[0-9a-f]{6,64})?")
MODEL_PATTERN = worded(f"^{MODEL.pattern}$", "names of models and bundles: `marey models list` shows them")


def check_name(value: object) -> str:
    """Return the name of a motion, normalized (NFC) and without spaces at its ends."""
    text = check_text(check_string(value))
    if not text.isascii():
        text = re.sub(r"[^\S ]", " ", unicodedata.normalize("NFC", text))
    text = text.strip()
    if len(text) > MAX_NAME:
        raise InvalidInput(f"has {len(text)} characters; file names take up to {MAX_NAME} of it")
    if RESERVED.fullmatch(text):
        raise InvalidInput(f"{text!r} cannot be a file name: it is a device name on Windows")
    if not NAME.fullmatch(text) or text.endswith(".") or ".." in text or not is_printable(text):
        raise InvalidInput(
            f"{text[:60]!r} cannot be a file name: begin with a letter or digit, use no / \\ .. and no dot at the end"
        )
    return text


def check_seconds(value: object) -> float:
    """Return a length in seconds, in the range over all models."""
    number = check_number(value)
    if not MIN_SECONDS <= number <= MAX_SECONDS:
        raise InvalidInput(f"{number:g} is outside {MIN_SECONDS:g} to {MAX_SECONDS:g} seconds")
    return number


def outside_range(seconds: float, low: float, high: float, bundle: str) -> str:
    """Return the message about a length that a bundle cannot generate."""
    return f"{seconds:g} is outside {low:g} to {high:g} seconds, the range of {bundle}"


def check_seed(value: object) -> int:
    """Return the seed of variant 0."""
    return check_whole(value, 0, MAX_SEED)


def check_variants(value: object) -> int:
    """Return the number of variants."""
    return check_whole(value, 1, MAX_VARIANTS)


def check_model(value: object) -> str:
    """Return the name of a model or bundle."""
    text = check_string(value)
    if not MODEL.fullmatch(text):
        raise InvalidInput(f"{text[:60]!r} is not the name of a model or bundle: `marey models list` shows them")
    return text


def check_tags(value: object) -> tuple[str, ...]:
    """Return the tags in a list."""
    if not isinstance(value, list | tuple):
        raise InvalidInput('is not a list of words: write ["walk", "take 2"]')
    given = cast("Sequence[object]", value)
    if len(given) > MAX_TAGS:
        raise InvalidInput(f"{len(given)} tags are over the limit of {MAX_TAGS}")
    return tuple(_tag(tag) for tag in given)


def _tag(value: object) -> str:
    tag = check_string(value)
    if not tag.isprintable():
        check_text(tag, subject=f"{tag[:80]!r} is not a tag: it")
    if not tag.strip() or len(tag) > MAX_TAG_LENGTH or not is_printable(tag):
        raise InvalidInput(f"{tag[:80]!r} is not a tag: 1 to {MAX_TAG_LENGTH} printable characters")
    return tag


def check_string(value: object) -> str:
    """Return a text."""
    if not isinstance(value, str):
        raise InvalidInput(f"is {kind_of(value)}, not a text")
    return value


def check_number(value: object) -> float:
    """Return a finite number as float."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InvalidInput(f"is {kind_of(value)}, not a number")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise InvalidInput("is not a finite number")
    return number


def check_whole(value: object, low: int, high: int) -> int:
    """Return a whole number in a range, both ends included; 3.0 is one."""
    if isinstance(value, float) and value.is_integer():
        value = int(value)
    if isinstance(value, bool) or not isinstance(value, int):
        raise InvalidInput(f"is {kind_of(value)}, not a whole number")
    if not low <= value <= high:
        raise InvalidInput(f"{value if abs(value) < 10**20 else 'it'} is outside {low} to {high}")
    return value
