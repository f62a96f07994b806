"""Settings of an item: those of the platform with their ranges, the check of all of them, and their text forms.

The settings of a network are those of its model (`marey.registry`). Standard library only: the small client imports it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import cast

from marey.core.errors import InvalidInput
from marey.items.values import check_number, check_string, check_whole

OUTPUT_FPS, BEST_OF, REDRAWS = "fps", "best_of", "redraws"
"""Settings of an item that are not the network's: the frame rate of its files, the candidates of which the best one
becomes its motion, and the most further rounds of candidates while none is good."""
MIN_OUTPUT_FPS, MAX_OUTPUT_FPS = 1.0, 240.0
MAX_BEST_OF, MAX_REDRAWS = 8, 2
VARIETIES = ("low", "normal", "high")
"""Levels of how much motions of one prompt differ; a model maps them to its settings, `normal` to none."""
PLATFORM_SETTINGS: Mapping[str, tuple[float, float]] = {
    OUTPUT_FPS: (MIN_OUTPUT_FPS, MAX_OUTPUT_FPS),
    BEST_OF: (1, MAX_BEST_OF),
    REDRAWS: (0, MAX_REDRAWS),
}
"""The range of each. All but the frame rate are whole numbers."""
SETTING = re.compile(r"[a-z][a-z0-9_]{0,39}")
"""Names of settings. The spec of a model (`marey.registry`) defines its settings and their ranges: they are checked
where the model is known."""
MAX_SETTINGS = 32
MAX_SETTING = 1e9
"""Limit on the absolute value of any setting."""
SETTINGS_SEPARATOR = ";"


def check_settings(value: object) -> dict[str, float]:
    """Return the settings in an object, by name; only those of the platform have a range here.

    Raises:
        InvalidInput: with the setting in the message.
    """
    if not isinstance(value, Mapping):
        if isinstance(value, str):  # of a table, where it cannot be read
            try:
                read_settings(value)
            except InvalidInput as error:
                raise InvalidInput(f"{error.message}; write guidance=4.5;temperature=0.8") from None
        raise InvalidInput('is not an object: write {"guidance": 4.5}')
    given = cast("Mapping[object, object]", value)
    if len(given) > MAX_SETTINGS:
        raise InvalidInput(f"{len(given)} settings are over the limit of {MAX_SETTINGS}")
    checked: dict[str, float] = {}
    for name, number in given.items():
        if not isinstance(name, str) or not SETTING.fullmatch(name):
            raise InvalidInput(f"{str(name)[:60]!r} is not the name of a setting, such as guidance")
        low, high = PLATFORM_SETTINGS.get(name, (-MAX_SETTING, MAX_SETTING))
        try:
            whole = name in (BEST_OF, REDRAWS)
            checked[name] = check_whole(number, int(low), int(high)) if whole else check_number(number)
        except InvalidInput as error:
            raise InvalidInput(f"{name}: {error.message}") from error
        if not low <= checked[name] <= high:
            raise InvalidInput(f"{name}: {checked[name]:g} is outside {low:g} to {high:g}")
    return checked


def check_variety(value: object) -> str:
    """Return a level of variety."""
    text = check_string(value)
    if text not in VARIETIES:
        raise InvalidInput(f"unknown variety {text[:40]!r}; known: {', '.join(VARIETIES)}")
    return text


def read_setting(text: str) -> tuple[str, float]:
    """Read `NAME=VALUE`, as `guidance=4.5`.

    Raises:
        InvalidInput: it is something else; `where` is the setting whose value is no number.
    """
    name, _, value = (part.strip() for part in text.partition("="))
    if not SETTING.fullmatch(name) or not value:
        raise InvalidInput(f"{text[:60]!r} is not a setting: it is NAME=VALUE, such as guidance=4.5")
    try:
        number = float(value)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise InvalidInput(f"{name}: {value[:40]!r} is not a number", where=name)
    return name, number


def read_settings(text: str) -> dict[str, float]:
    """Read settings in one cell of a table: `temperature=1.2;guidance=4`.

    Raises:
        InvalidInput: it is something else, or names a setting twice.
    """
    found: dict[str, float] = {}
    for part in filter(None, (part.strip() for part in text.split(SETTINGS_SEPARATOR))):
        name, value = read_setting(part)
        if name in found:
            raise InvalidInput(f"{name} stands twice")
        found[name] = value
    return found
