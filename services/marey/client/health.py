"""Health checks of a server, which need no key: `/livez` and `/readyz`."""

from __future__ import annotations

import urllib.error
import urllib.request

from marey.client.foreign_answers import NoAnswer
from marey.core.errors import Unreachable

OK = 200


def health_status(url: str, *, timeout: float) -> int:
    """Return the HTTP status of a health check.

    Args:
        url: of the check, such as `http://127.0.0.1:8000/livez`.
        timeout: seconds.

    Raises:
        NoAnswer: the server accepts the connection and does not answer within `timeout`.
        Unreachable: there is no connection.
    """
    try:
        with urllib.request.urlopen(url, timeout=timeout) as response:  # noqa: S310
            return response.status
    except urllib.error.HTTPError as error:
        return error.code
    except TimeoutError as error:
        raise NoAnswer(f"no answer within {timeout:g} s", where=url) from error
    except OSError as error:
        raise Unreachable(f"no connection: {error}", where=url) from error


def is_healthy(url: str, *, timeout: float) -> bool:
    """Return True if a health check passes.

    Args:
        url: of the check.
        timeout: seconds.
    """
    try:
        return health_status(url, timeout=timeout) == OK
    except Unreachable:
        return False
