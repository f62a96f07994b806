"""The version of the installed package."""

from __future__ import annotations

import importlib.metadata
from collections.abc import Iterator

import pytest

from marey.core.package import own_version


@pytest.fixture(autouse=True)
def unread() -> Iterator[None]:
    own_version.cache_clear()
    yield
    own_version.cache_clear()


def test_the_version_is_that_of_the_metadata() -> None:
    assert own_version() == importlib.metadata.version("marey")


def test_the_metadata_is_read_once(monkeypatch: pytest.MonkeyPatch) -> None:
    found = own_version()
    monkeypatch.setattr(importlib.metadata, "version", lambda name: pytest.fail(f"read {name} again"))
    assert own_version() == found
