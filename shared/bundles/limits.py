"""What a generator's bundle can be asked for."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

from shared.bundles.bundle import Bundle
from shared.errors import InvalidBundle, InvalidInput
from shared.items import OUTPUT_FPS, SETTINGS, outside_range


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
    if not isinstance(value, int | float) or isinstance(value, bool):
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


def check_settings(bundle: Bundle, names: Iterable[str]) -> None:
    """Nothing, if the model has all these settings.

    Raises:
        InvalidInput: it has not.
    """
    own: dict[str, Any] = bundle.manifest.parameters.get("inference") or {}
    for name in names:
        if name != OUTPUT_FPS and name not in own:
            model = bundle.manifest.name
            known = [setting for setting in SETTINGS if setting == OUTPUT_FPS or setting in own]
            raise InvalidInput(f"{name!r} is not a setting of {model}; known are {', '.join(known)}")
