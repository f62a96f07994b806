"""What a generator's bundle can be asked for."""

from __future__ import annotations

from collections.abc import Iterable

from shared.bundles.bundle import Bundle
from shared.errors import InvalidInput
from shared.items import OUTPUT_FPS, SETTINGS


def seconds_of(bundle: Bundle) -> tuple[float, float]:
    """The shortest and longest motion a generator makes."""
    manifest = bundle.manifest
    fps = manifest.fps or 20.0
    return float(manifest.parameters["min_frames"]) / fps, float(manifest.parameters["max_frames"]) / fps


def check_seconds(bundle: Bundle, seconds: float | None) -> None:
    """Nothing, if the model can make a motion of that length.

    Raises:
        InvalidInput: it cannot.
    """
    low, high = seconds_of(bundle)
    if seconds is not None and not low <= seconds <= high:
        name = bundle.manifest.name
        raise InvalidInput(f"{seconds:g} is outside {low:g} to {high:g} seconds, the range of {name}")


def check_settings(bundle: Bundle, names: Iterable[str]) -> None:
    """Nothing, if the model has all these settings.

    Raises:
        InvalidInput: it has not.
    """
    own = bundle.manifest.parameters.get("inference", {})
    for name in names:
        if name != OUTPUT_FPS and name not in own:
            model = bundle.manifest.name
            known = [setting for setting in SETTINGS if setting == OUTPUT_FPS or setting in own]
            raise InvalidInput(f"{name!r} is not a setting of {model}; known are {', '.join(known)}")
