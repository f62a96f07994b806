"""Resolution of model names to exact bundles, cached for a few seconds."""

from __future__ import annotations

import threading
import time

from marey.bundles import choose_bundle
from marey.core.settings import Settings
from marey.jobs.generators import GeneratorCapabilities, capabilities_of

FRESH_SECONDS = 5.0
"""Seconds until a replaced bundle is noticed; 100,000 lines of one submit read the disk once."""


class Catalogue:
    """Generator capabilities by requested name, cached for a few seconds. Thread-safe."""

    def __init__(self, config: Settings) -> None:
        self._config = config
        self._cache: dict[str, tuple[float, GeneratorCapabilities]] = {}
        self._lock = threading.Lock()

    @property
    def live_model(self) -> str:
        """The model of live streams that name none."""
        return self._config.live_model

    def capabilities(self, name: str | None) -> GeneratorCapabilities:
        """Return the capabilities of a model (`hgm3`), a bundle or an exact bundle; None = the default model.

        Raises:
            NotFound, InvalidBundle, Refused: as `choose_bundle`.
        """
        wanted = name or self._config.default_model
        with self._lock:
            made, generator = self._cache.get(wanted, (0.0, None))
            if generator is None or time.monotonic() - made > FRESH_SECONDS:
                generator = capabilities_of(choose_bundle(wanted, config=self._config, verify=False), self._config)
                self._cache[wanted] = (time.monotonic(), generator)
        return generator
