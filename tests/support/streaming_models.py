"""Real models that stream, loaded as a live worker does: found by what they can."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from marey.bundles import Bundle
from marey.core.settings import settings
from marey.registry import get_model, resolve
from marey.runtime.live.port import LiveFrame, LiveModel, SessionPool
from tests.support.models import add_text_bundles, random_bundle


@dataclass(frozen=True)
class Streaming:
    """A model with a small bundle of random weights."""

    model: str
    bundle: Bundle
    live: LiveModel


@contextmanager
def loaded(model: str, folder: Path) -> Iterator[Streaming]:
    """Load a model's bundle, which is the only one of `folder`."""
    bundle = random_bundle(model, folder / f"{model}-random")
    add_text_bundles(folder)
    reference = get_model(model).live
    assert reference is not None, f"{model} does not stream"
    with pytest.MonkeyPatch.context() as patch:
        own = {"HOME": str(folder / "home"), "MODELS": str(folder), "DEVICE": "cpu", "THREADS": "1"}
        for name, value in own.items():
            patch.setenv(f"MAREY_{name}", value)
        settings.cache_clear()
        try:
            yield Streaming(model, bundle, resolve(reference)())
        finally:
            settings.cache_clear()


class Around:
    """A session pool that another one does the work of; subclasses change what it shows."""

    def __init__(self, pool: SessionPool) -> None:
        self._pool = pool

    def __getattr__(self, name: str) -> Any:
        return getattr(self._pool, name)

    def step(self) -> dict[int, LiveFrame]:
        """The next frame of every session that is not paused."""
        return self._pool.step()
