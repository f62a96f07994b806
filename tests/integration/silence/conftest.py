"""A database behind a proxy that can fall silent."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
import sqlalchemy as sa

from tests.servers.stalling_proxy import StallingProxy


@pytest.fixture
def proxy(database_url: str) -> Iterator[StallingProxy]:
    """A proxy in front of this test's database."""
    with StallingProxy(f"{sa.make_url(database_url).query['host']}/.s.PGSQL.5432") as proxy:
        yield proxy


@pytest.fixture
def proxied(database_url: str, proxy: StallingProxy) -> str:
    """The address of this test's database through the proxy."""
    url = sa.make_url(database_url).set(host="127.0.0.1", port=proxy.port, query={})
    return url.render_as_string(hide_password=False)
