"""One webhook request: to the validated address, with limits on time and bytes, without redirects."""

from __future__ import annotations

import asyncio
import contextlib
import os
import socket
import ssl
import time
from collections.abc import Mapping
from datetime import UTC, datetime
from email.utils import parsedate_to_datetime

import httpx2

from marey.core.addresses import Allowed
from marey.core.errors import MareyError, Refused
from marey.webhooks import Attempt
from marey.webhooks.addresses import choose_address

CONNECT_SECONDS = 5.0
ATTEMPT_SECONDS = 15.0
"""Seconds of a whole attempt: name resolution, connection, request, answer."""
DRAIN_SECONDS = 2.0
MAX_ANSWER = 16 * 2**10
"""Bytes of an answer that are read and discarded: only its status matters."""


class Sender:
    """Sends webhook requests. Two requests share nothing: no connection, no cookie."""

    def __init__(
        self, allowed: Allowed, *, tls: ssl.SSLContext | None = None, seconds: float = ATTEMPT_SECONDS
    ) -> None:
        """
        Args:
            tls: trusted authorities; None = the machine's, or those of SSL_CERT_FILE.
            seconds: limit of an attempt.
        """
        self._allowed = allowed
        self._tls = tls or httpx2.create_ssl_context()
        self._seconds = seconds

    async def send(self, url: str, headers: Mapping[str, str], body: bytes) -> Attempt:
        """POST a message; return the result. Never raises for faults of a receiver or the network."""
        began = time.monotonic()
        status: int | None = None
        wait = 0.0
        try:
            status, wait = await self._post(httpx2.URL(url), headers, body)
            error = None if 200 <= status < 300 else _refusal(status)
        except TimeoutError:
            error = f"no answer within {self._seconds:g} s"
        except MareyError as refused:
            error = refused.message
        except (httpx2.HTTPError, httpx2.InvalidURL, ssl.SSLError, OSError) as failure:
            error = _describe(failure)
        return Attempt(status, time.monotonic() - began, error, wait)

    async def _post(self, url: httpx2.URL, headers: Mapping[str, str], body: bytes) -> tuple[int, float]:
        """Return the status of the answer, and the delay in seconds that it asks for."""
        client = httpx2.AsyncClient(
            verify=self._tls,
            trust_env=False,  # a proxy would resolve the name again
            follow_redirects=False,
            timeout=httpx2.Timeout(self._seconds, connect=CONNECT_SECONDS),
        )
        async with client:
            async with asyncio.timeout(self._seconds):  # the client's own limits apply to each read
                response = await self._ask(client, url, headers, body)
            async with contextlib.aclosing(response):
                await _drain(response)
            return response.status_code, asked_to_wait(response.headers.get("retry-after"))

    async def _ask(
        self, client: httpx2.AsyncClient, url: httpx2.URL, headers: Mapping[str, str], body: bytes
    ) -> httpx2.Response:
        """Return the answer, up to its body. The connection goes to the validated address; Host, SNI and certificate
        are those of the name."""
        name = url.raw_host.decode("ascii")
        address = await self._resolve(name, url)
        host = f"[{name}]" if ":" in name else name
        named = {**headers, "host": host if url.port is None else f"{host}:{url.port}"}
        request = client.build_request(
            "POST", url.copy_with(host=address), headers=named, content=body, extensions={"sni_hostname": name}
        )
        return await client.send(request, stream=True)

    async def _resolve(self, name: str, url: httpx2.URL) -> str:
        loop = asyncio.get_running_loop()
        try:
            found = await loop.getaddrinfo(name, url.port, type=socket.SOCK_STREAM)
        except (socket.gaierror, UnicodeError) as error:
            raise Refused("the host is unknown") from error
        return choose_address([str(each[4][0]) for each in found], url.scheme, self._allowed)


def asked_to_wait(header: str | None, now: datetime | None = None) -> float:
    """Return the seconds of a `Retry-After`, a number or a date; 0 for none, and for an invalid one."""
    if header is None:
        return 0.0
    if header.strip().isascii() and header.strip().isdecimal():
        return float(header.strip()[:12])
    try:
        at = parsedate_to_datetime(header)
    except (ValueError, OverflowError):  # a year of twenty digits
        return 0.0
    at = at if at.tzinfo is not None else at.replace(tzinfo=UTC)
    return max((at - (now or datetime.now(UTC))).total_seconds(), 0.0)


async def _drain(response: httpx2.Response) -> None:
    """Read a short answer, so that the receiver sees an orderly end; abandon a long or slow one. Not decompressed."""
    read = 0
    try:
        async with asyncio.timeout(DRAIN_SECONDS):
            async for part in response.aiter_raw():
                read += len(part)
                if read > MAX_ANSWER:
                    return
    except (TimeoutError, httpx2.HTTPError):
        return  # the status is known already


def _refusal(status: int) -> str:
    return f"answered {status}" + (", and redirects are not followed" if 300 <= status < 400 else "")


def _describe(error: Exception) -> str:
    """Describe a failure in a line, without addresses: tenants read this log, and the network is internal."""
    what = type(error).__name__
    cause: BaseException | None = error
    while cause is not None:
        if isinstance(cause, ssl.SSLCertVerificationError):
            return f"its certificate is not valid: {cause.verify_message}"
        if isinstance(cause, OSError) and not isinstance(cause, ssl.SSLError) and cause.errno is not None:
            what = os.strerror(cause.errno)
        cause = cause.__cause__ or cause.__context__
    return f"it cannot be reached: {what}"
