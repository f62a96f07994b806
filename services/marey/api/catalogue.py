"""Resolution of model names to exact bundles, cached for a few seconds."""

from __future__ import annotations

import threading
import time

from marey.bundles import choose_bundle, list_bundles
from marey.core.errors import NotFound
from marey.core.settings import Settings
from marey.jobs.generators import GeneratorCapabilities, capabilities_of
from marey.registry import streaming_models

FRESH_SECONDS = 5.0
"""Seconds until a replaced bundle is noticed; 100,000 lines of one submit read the disk once."""


class Catalogue:
    """Generator capabilities by requested name, cached for a few seconds. Thread-safe."""

    def __init__(self, config: Settings) -> None:
        self._config = config
        self._cache: dict[str, tuple[float, GeneratorCapabilities]] = {}
        self._lock = threading.Lock()

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

    def live_capabilities(self) -> GeneratorCapabilities:
        """Return the capabilities of the model of live streams that name none.

        Raises:
            NotFound, InvalidBundle, Refused: as `choose_bundle`; or no model here streams, or several do and none is
                chosen.
        """
        return self.capabilities(self._config.live_model or self._only_streaming())

    def _only_streaming(self) -> str:
        """Return the only installed model that streams, or the only one of these that has a bundle."""
        known = streaming_models()
        if len(known) > 1:
            here = {bundle.manifest.model for bundle in list_bundles(config=self._config, kind="generator")}
            known = tuple(name for name in known if name in here) or known
        if len(known) != 1:
            if not known:
                raise NotFound("no installed model streams", hint="A package that registers one adds it.")
            hint = "Name one, or have MAREY_LIVE_MODEL name it."
            raise NotFound(f"several models stream: {', '.join(known)}", hint=hint)
        return known[0]
