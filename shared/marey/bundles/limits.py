"""What a generator's bundle can be asked for."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any, cast

from marey.bundles.bundle import Bundle
from marey.core.errors import InvalidBundle, InvalidInput
from marey.items.item import OUTPUT_FPS, SETTINGS, outside_range

MAX_FRAMES = 2**53
"""The largest integer that a float holds exactly: JSON holds whole numbers that no float can."""


def seconds_of(bundle: Bundle) -> tuple[float, float]:
    """The shortest and longest motion a generator makes.

    Raises:
        InvalidBundle: its manifest does not say.
    """
    manifest = bundle.manifest
    fps = manifest.fps or 20.0
    low, high = (_frames(bundle, name) / fps for name in ("min_frames", "max_frames"))
    if not 0 < low <= high < math.inf:
        raise InvalidBundle(f"makes motions of {low:g} to {high:g} seconds", where=str(bundle.path))
    return low, high


def _frames(bundle: Bundle, name: str) -> float:
    value = bundle.manifest.parameters.get(name)
    if not isinstance(value, int | float) or isinstance(value, bool) or not abs(value) < MAX_FRAMES:
        raise InvalidBundle(f"its parameters give no number as {name!r}", where=str(bundle.path))
    return float(value)


def check_seconds(bundle: Bundle, seconds: float | None) -> None:
    """Nothing, if the model can make a motion of that length.

    Raises:
        InvalidInput: it cannot.
    """
    low, high = seconds_of(bundle)
    if seconds is not None and not low <= seconds <= high:
        raise InvalidInput(outside_range(seconds, low, high, bundle.manifest.name))


def settings_of(bundle: Bundle) -> Mapping[str, Any]:
    """The settings that a model has, with their defaults.

    Raises:
        InvalidBundle: its manifest says something else of them.
    """
    own: Any = bundle.manifest.parameters.get("inference") or {}
    if not isinstance(own, dict):
        raise InvalidBundle("its parameters give no object as 'inference'", where=str(bundle.path))
    return cast("dict[str, Any]", own)


def check_settings(bundle: Bundle, names: Iterable[str]) -> None:
    """Nothing, if the model has all these settings.

    Raises:
        InvalidInput: it has not.
    """
    own = settings_of(bundle)
    for name in names:
        if name != OUTPUT_FPS and name not in own:
            model = bundle.manifest.name
            known = [setting for setting in SETTINGS if setting == OUTPUT_FPS or setting in own]
            raise InvalidInput(f"{name!r} is not a setting of {model}; known are {', '.join(known)}")
