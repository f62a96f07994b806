"""Files that the server makes on request."""

from __future__ import annotations

import re
import time
from collections.abc import Mapping
from pathlib import Path
from urllib.parse import urlencode

import httpx2

from marey.client.file_to_fetch import FORMAT, FileToFetch
from marey.client.transport import Transport
from marey.core.errors import InvalidFile, InvalidInput, TimedOut
from marey.exporters import exporters

ETAG = re.compile(r'"([0-9a-f]{64})"')
RANGE = re.compile(r"bytes 0-0/([0-9]{1,15})")
SHORTEST_PAUSE = 0.5


def format_of(path: Path) -> str:
    """Return the format that the ending of a file names; an unknown ending names the format itself.

    Raises:
        InvalidInput: there is no ending.
    """
    ending = path.suffix.removeprefix(".").lower()
    if not FORMAT.fullmatch(ending):
        raise InvalidInput("the ending names no format", where=str(path), hint="Write it as clip.glb or clip.bvh.")
    return next((name for name, exporter in exporters().items() if exporter.extension == ending), ending)


def made_file(
    transport: Transport, url: str, path: Path, options: Mapping[str, str | float | bool | None], *, timeout: float
) -> FileToFetch:
    """Wait until the server has made a file; return it, to be fetched.

    Args:
        url: path of the file on the server.
        options: query parameters; those that are None are left out.
        timeout: seconds.

    Raises:
        TimedOut: the file is not made in time.
        InvalidFile: the server does not say what it sends.
        NotFound, InvalidInput, Refused, Unreachable: from the server.
    """
    query = {name: _text(value) for name, value in options.items() if value is not None}
    until = time.monotonic() + timeout
    while (answer := transport.probe(url, **query, redirect="false")).status_code == 202:
        left = until - time.monotonic()
        if left <= 0:
            hint = "The server goes on; the same request finds the file later."
            raise TimedOut(f"the file was not made within {timeout:g} s", where=url, hint=hint)
        time.sleep(min(max(_pause(answer), SHORTEST_PAUSE), left))
    tag, size = ETAG.fullmatch(answer.headers.get("ETag", "")), RANGE.fullmatch(answer.headers.get("Content-Range", ""))
    if tag is None or size is None:
        raise InvalidFile("the server does not say which file it sends", where=url)
    return FileToFetch(f"{url}?{urlencode(query)}" if query else url, tag[1], int(size[1]), path)


def _text(value: str | float | bool) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


def _pause(answer: httpx2.Response) -> float:
    try:
        return float(answer.headers.get("Retry-After", 0))
    except ValueError:
        return 0.0
