"""Servers that are too old are refused with the version that is needed."""

from __future__ import annotations

import pytest

from marey.core.errors import Conflict
from marey.core.versions import check_postgres, check_redis


@pytest.mark.parametrize("number", [150_000, 150_020, 180_004])
def test_a_postgres_of_today_passes(number: int) -> None:
    check_postgres(number)


def test_an_old_postgres_is_refused() -> None:
    with pytest.raises(Conflict, match=r"PostgreSQL 14\.9 is too old: .* 15 or newer") as refused:
        check_postgres(140_009)
    assert refused.value.exit_code == 2
    assert refused.value.hint


@pytest.mark.parametrize("version", ["7.0.0", "7.0.15", "7.2.4", "8.6", "10.0.1", "255.255.255", "unknown"])
def test_a_redis_of_today_passes(version: str) -> None:
    check_redis(version)


@pytest.mark.parametrize("version", ["6.2.14", "5.0", "6.9"])
def test_an_old_redis_is_refused(version: str) -> None:
    with pytest.raises(Conflict, match=r"is too old: .* 7\.0 or newer"):
        check_redis(version)
