"""External servers, for tests against another version: their content is erased.

`MAREY_TEST_POSTGRES=postgresql+psycopg://superuser@127.0.0.1:5432/postgres` and
`MAREY_TEST_REDIS=redis://127.0.0.1:6379` take the place of the embedded ones; run with `-n 0`.
"""

from __future__ import annotations

import os
from dataclasses import dataclass


@dataclass(frozen=True)
class GivenServer:
    """A server that is not started or stopped here."""

    url: str


def given_server(variable: str) -> GivenServer | None:
    """Return the server that an environment variable names, if it does."""
    url = os.environ.get(variable)
    return GivenServer(url) if url else None
