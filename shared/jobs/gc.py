"""Garbage collection of assets, under lock."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

import sqlalchemy as sa

from shared.jobs.policy import Policy
from shared.jobs.types import GarbageReport


class ObjectStore(Protocol):
    """What garbage collection needs of an asset store (`shared.storage.AssetStore` fits)."""

    def delete(self, key: str) -> None: ...
    def keys(self, prefix: str = "") -> Iterator[str]: ...
    def exists(self, key: str) -> bool: ...


def asset_key(tenant: str, sha256: str) -> str:
    """Key of an asset in the store: `t/{tenant}/{sha[:2]}/{sha}`."""
    return f"t/{tenant}/{sha256[:2]}/{sha256}"


def collect_garbage(engine: sa.Engine, store: ObjectStore, *, rules: Policy | None = None) -> GarbageReport:
    """Remove assets that nothing refers to (and whose writer's lease is gone), and objects without a row.

    Each removal holds the lock of its asset row, so that a worker about to write the same content waits and writes it
    anew.

    Raises:
        Unreachable: the store or the database does not answer; what was removed until then stays removed.
    """
    raise NotImplementedError


def remove_stale_assets(engine: sa.Engine, store: ObjectStore, *, rules: Policy | None = None) -> int:
    """The sweeper's part of it: assets still `writing` an hour after their lease went."""
    raise NotImplementedError
