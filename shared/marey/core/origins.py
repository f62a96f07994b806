"""Origins of web pages, as browsers write them: scheme, host and, unless it is the scheme's own, port."""

from __future__ import annotations

import re

from marey.core.errors import InvalidInput

ORIGIN = re.compile(r"(https?)://(\[[0-9A-Fa-f:.]+\]|[A-Za-z0-9._-]+)(?::([0-9]{1,5}))?")
PORTS = {"http": 80, "https": 443}


def origin_of(text: str) -> str | None:
    """Return an origin in its canonical form; None for text that is not an origin, such as `null` and `*`."""
    match = ORIGIN.fullmatch(text.lower())
    if match is None or (match[3] and not 1 <= int(match[3]) <= 65535):
        return None
    scheme, host, port = match.groups()
    return f"{scheme}://{host}" + (f":{int(port)}" if port and int(port) != PORTS[scheme] else "")


def check_origins(values: list[str]) -> list[str]:
    """Return the origins of a setting, without duplicates.

    Raises:
        InvalidInput: one of them is not an exact origin.
    """
    checked = [(value, origin_of(value)) for value in values]
    wrong = [value for value, origin in checked if origin is None]
    if wrong:
        what = "any origin cannot be allowed" if wrong[0] == "*" else f"{wrong[0][:100]!r} is not an origin"
        raise InvalidInput(what, hint='Name each exactly, as ["https://app.example.com"], without a path.')
    return list(dict.fromkeys(origin for _, origin in checked if origin is not None))
