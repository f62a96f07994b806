"""Which exact bundle a request means, and what that bundle allows."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterable
from dataclasses import dataclass

from shared.bundles import Bundle, TextSpec, choose_bundle, list_bundles
from shared.errors import InvalidBundle, InvalidInput
from shared.items import OUTPUT_FPS, SETTINGS
from shared.settings import Settings
from shared.text.keys import as_served, resolve

FRESH_SECONDS = 5.0
"""A replaced bundle is noticed within this; 100,000 lines of one submit ask the disk once."""
DEFAULT_MODEL = "hgm3"


@dataclass(frozen=True)
class Offer:
    """A bundle that items can be made with."""

    bundle: Bundle
    text: TextSpec
    """With every hash filled in."""
    min_seconds: float
    max_seconds: float

    def check_seconds(self, seconds: float | None) -> None:
        """See `check_seconds`."""
        check_seconds(self.bundle, seconds)

    def check_settings(self, names: Iterable[str]) -> None:
        """See `check_settings`."""
        check_settings(self.bundle, names)


class Catalogue:
    """Offers by the name they were asked for, remembered for a few seconds. Safe in threads."""

    def __init__(self, config: Settings) -> None:
        self._config = config
        self._offers: dict[str, tuple[float, Offer]] = {}
        self._lock = threading.Lock()

    def offer(self, name: str | None) -> Offer:
        """The offer for a model (`hgm3`), a bundle or an exact bundle; None = the default model.

        Raises:
            NotFound, InvalidBundle, Refused: as `choose_bundle`.
        """
        wanted = name or DEFAULT_MODEL
        with self._lock:
            made, offer = self._offers.get(wanted, (0.0, None))
            if offer is None or time.monotonic() - made > FRESH_SECONDS:
                offer = offer_of(choose_bundle(wanted, config=self._config, verify=False), self._config)
                self._offers[wanted] = (time.monotonic(), offer)
        return offer


def offers(config: Settings) -> list[Offer]:
    """Every generator's bundle of this machine, by name."""
    return [offer_of(bundle, config) for bundle in list_bundles(config=config, kind="generator")]


def offer_of(bundle: Bundle, config: Settings) -> Offer:
    """What a generator's bundle allows.

    Raises:
        InvalidBundle: it is no generator.
    """
    manifest = bundle.manifest
    if manifest.kind != "generator" or manifest.text is None or not manifest.fps:
        raise InvalidBundle(
            f"{manifest.name!r} is a {manifest.kind}, not a text-to-motion generator", where=str(bundle.path)
        )
    low, high = seconds_of(bundle)
    return Offer(bundle, resolve(as_served(manifest.text, config=config), config=config), low, high)


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
