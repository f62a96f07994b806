"""Fixtures of the tests of data."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import pytest

from marey.data import gestures


@pytest.fixture(scope="module")
def few_gestures() -> Iterator[None]:
    """Builds make two waves: all that they make on an idle or a walk, dozens of each action, take twenty seconds."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(gestures, "KINDS", {"wave": replace(gestures.KINDS["wave"], count=2)})
        yield
