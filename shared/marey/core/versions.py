"""Oldest supported versions of Postgres and Redis, and the check of each. The deployment guide lists them too."""

from __future__ import annotations

import re

from marey.core.errors import Conflict

POSTGRES = 15
REDIS = (7, 0)
"""Valkey counts as the compatible Redis version, which it reports as `redis_version`."""


def check_postgres(number: int) -> None:
    """Check `server_version_num`, such as 150020.

    Raises:
        Conflict: it is older than `POSTGRES`.
    """
    if number < POSTGRES * 10_000:
        found = f"{number // 10_000}.{number % 10_000}"
        raise Conflict(
            f"PostgreSQL {found} is too old: this version of Marey needs {POSTGRES} or newer",
            where="database",
            hint="Upgrade the server, or name another one with MAREY_DATABASE_URL.",
        )


def check_redis(version: str) -> None:
    """Check `redis_version`, such as `7.0.15`. A version that is not a number passes.

    Raises:
        Conflict: it is older than `REDIS`.
    """
    found = re.match(r"(\d+)\.(\d+)", version)
    if found is not None and (int(found[1]), int(found[2])) < REDIS:
        needed = ".".join(map(str, REDIS))
        raise Conflict(
            f"Redis {found[0]} is too old: this version of Marey needs {needed} or newer, or Valkey",
            where="queue",
            hint="Upgrade the server, or name another one with MAREY_QUEUE_URL.",
        )
