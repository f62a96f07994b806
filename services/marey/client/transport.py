"""The HTTP client: requests that are retried, answers as JSON, errors as those of the server."""

from __future__ import annotations

import json
import time
from collections.abc import Generator, Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, cast
from urllib.request import getproxies
from uuid import uuid4

import httpx2

from marey.client.foreign_answers import NoAnswer, connection_failure
from marey.client.lines import Lines
from marey.client.problems import NOT_OURS, error_of, foreign_error
from marey.client.retries import RequestRetries
from marey.client.server_address import Server, ca_file
from marey.core import tracing
from marey.core.errors import InvalidInput, MareyError, Unreachable
from marey.core.tls import context_for

SUBMIT_BUSY_SECONDS = 900.0
"""Seconds to wait in all for a server that is busy with submits: it reads large ones one after the other."""
SUBMIT_TIMEOUT = 300.0
"""100,000 items take a quarter of a minute to write on a busy machine."""
QUIET_SECONDS = 12.0
"""A server pings an event stream every 15 s."""
PATIENCE = 180.0
"""Seconds without a reachable server after which following a job or a stream gives up."""


class Transport:
    """HTTP requests to one server; safe to use from several threads.

    All attempts of one `submit` share an idempotency key, so a retry after a lost answer enqueues nothing twice.
    """

    def __init__(self, server: Server, *, timeout: float = 30.0, attempts: int | None = None) -> None:
        """Connect at the first request.

        Args:
            server: its address and key.
            timeout: seconds of silence after which a request has failed.
            attempts: failures after which a request is given up; None = the default of `RequestRetries`.

        Raises:
            InvalidInput: the address, or a proxy that the environment names, cannot be used.
        """
        self.server = server
        self._attempts = attempts
        try:
            self._http = httpx2.Client(
                base_url=server.url,
                headers={"Authorization": f"Bearer {server.key}"},
                timeout=httpx2.Timeout(timeout, connect=5.0),
                verify=context_for(server.url, ca_file()),
                trust_env=not server.is_here,
            )
        except (httpx2.InvalidURL, ValueError, ImportError) as error:
            raise _no_client(error, server) from error

    def __enter__(self) -> Transport:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the connections."""
        self._http.close()

    def get(self, path: str, **params: Any) -> Any:
        """Return the JSON at `path`."""
        return _json(self._send("GET", path, params=_given(params)))

    def probe(self, path: str, **params: Any) -> httpx2.Response:
        """Ask for the first byte of a file, for its size and ETag; the answer may be a 202: it is being made."""
        return self._send("GET", path, params=_given(params), headers={"Range": "bytes=0-0"})

    def post(self, path: str, body: Any = None, **params: Any) -> Any:
        """POST a JSON body (None = none) and return the answer's JSON; only for requests that may be repeated."""
        return _json(self._send("POST", path, params=_given(params), json=body))

    def post_file(self, path: str, content: bytes, **params: Any) -> Any:
        """POST a file and return the answer's JSON; only for requests that may be repeated."""
        headers = {"Content-Type": "application/octet-stream"}
        timeout = httpx2.Timeout(SUBMIT_TIMEOUT, connect=5.0)
        sent: dict[str, Any] = {"content": content, "headers": headers, "timeout": timeout}
        return _json(self._send("POST", path, params=_given(params), **sent))

    def post_new(self, path: str, body: Any, *, idempotency_key: str | None = None) -> Any:
        """POST with an idempotency key (None = random), which all retries share, so that the object is created once."""
        key = {"Idempotency-Key": idempotency_key or str(uuid4())}
        return _json(self._send("POST", path, patience=SUBMIT_BUSY_SECONDS, json=body, headers=key))

    def post_once(self, path: str, body: Any) -> Any:
        """POST a request that must not be repeated; it is retried only while there is no connection."""
        return _json(self._send("POST", path, repeatable=False, json=body))

    def patch(self, path: str, body: Any, **params: Any) -> Any:
        """PATCH with a JSON body and return the answer's JSON."""
        return _json(self._send("PATCH", path, json=body, params=_given(params)))

    def delete(self, path: str) -> None:
        """DELETE a path."""
        self._send("DELETE", path)

    def submit(
        self,
        items: Lines | Iterable[Mapping[str, Any]],
        *,
        validate_only: bool = False,
        idempotency_key: str | None = None,
        **params: Any,
    ) -> Any:
        """Submit items as NDJSON; return the job, or with `validate_only` the result of the check.

        Args:
            idempotency_key: of all attempts; None = random.

        Raises:
            InvalidItems: with the problems of every line.
        """
        if not isinstance(items, Lines):
            with Lines(items) as lines:
                return self.submit(lines, validate_only=validate_only, idempotency_key=idempotency_key, **params)
        headers = {
            "Content-Type": "application/x-ndjson",
            "Content-Length": str(len(items)),
            "Idempotency-Key": idempotency_key or str(uuid4()),
        }
        query = _given({**params, "validate_only": validate_only or None})
        timeout = httpx2.Timeout(SUBMIT_TIMEOUT, connect=5.0)
        sent: dict[str, Any] = {"params": query, "content": items, "headers": headers, "timeout": timeout}
        return _json(self._send("POST", "/v1/jobs", patience=SUBMIT_BUSY_SECONDS, **sent))

    def pages(self, path: str, **params: Any) -> Iterator[dict[str, Any]]:
        """Iterate over the elements of a listing, page after page."""
        cursor: str | None = None
        while True:
            page = self.get(path, **params, cursor=cursor)
            yield from page["items"]
            cursor = page.get("next")
            if cursor is None:
                return

    @contextmanager
    def stream(
        self, path: str, headers: Mapping[str, str] | None = None, *, json: Any = None, patience: float = 30.0
    ) -> Generator[httpx2.Response]:
        """Open an answer that is read in pieces; redirects (to the object store) are followed without the key.

        Args:
            json: sent by POST; None = GET.
            patience: seconds of silence after which the server counts as unreachable.
        """
        timeout = httpx2.Timeout(patience, connect=5.0)
        options: dict[str, Any] = {"headers": headers, "json": json, "follow_redirects": True, "timeout": timeout}
        method = "GET" if json is None else "POST"
        with _as_unreachable(self.server), self._http.stream(method, path, **options) as response:
            if response.status_code >= 400:
                response.read()
                raise _refused_elsewhere(response) if response.history else error_of(response)
            yield response

    def events(self, job: str, after: int = 0, *, patience: float = 30.0) -> Iterator[dict[str, Any]]:
        """Iterate over the events of a job after number `after` as they happen. Ends with the job, with the connection,
        or after `QUIET_SECONDS` without an event; the caller then asks for the job and calls again."""
        headers = {"Accept": "text/event-stream", "Last-Event-ID": str(after)}
        with self.stream(f"/v1/jobs/{job}/events", headers, patience=patience) as response:
            if response.status_code == 204:
                return
            for event in httpx2.EventSource(cast("httpx2.Response", _UntilQuiet(response))):
                if event.data:
                    yield json.loads(event.data)

    def _send(
        self, method: str, path: str, *, repeatable: bool = True, patience: float | None = None, **request: Any
    ) -> httpx2.Response:
        """Send until there is an answer, and return it if it is no error.

        Args:
            method, path: of the request.
            repeatable, patience: see `RequestRetries`.
            request: parameters, body, headers and timeout, as httpx takes them.

        Raises:
            MareyError: the error of the answer; `Unreachable` without one.
        """
        retries = RequestRetries(self._attempts, repeatable=repeatable, patience=patience)
        while True:
            try:
                response = self._request(method, path, request)
            except httpx2.TransportError as error:
                wait = None if _final(self.server, error) else retries.after_failure(error)
                if wait is None:
                    raise _unreachable(self.server, error) from error
            else:
                if response.status_code < 400:
                    return _expected(response)
                wait = retries.after_refusal(response)
                if wait is None:
                    raise error_of(response)
            time.sleep(wait)

    def _request(self, method: str, path: str, request: Mapping[str, Any]) -> httpx2.Response:
        """Send one attempt, as a span of a trace that the server continues."""
        with tracing.span(f"{method} {path.partition('?')[0]}", kind="client") as span:
            headers: dict[str, str] = dict(request.get("headers") or {})
            if span.traceparent is not None:
                headers[tracing.HEADER] = span.traceparent
            try:
                response = self._http.request(method, path, **cast("dict[str, Any]", {**request, "headers": headers}))
            except httpx2.InvalidURL as error:
                raise InvalidInput(
                    f"cannot be asked for: {error}", where=f"{method} {path}", hint="Correct the name or the address."
                ) from error
            except UnicodeEncodeError as error:  # an argument whose bytes are no UTF-8
                raise InvalidInput(
                    f"{error.object[error.start : error.end]!r} is no UTF-8: the request cannot hold it",
                    where=f"{method} {path}",
                    hint="Write names, comments and reasons in UTF-8.",
                ) from error
            span.set(**{"http.response.status_code": response.status_code})
            return response


class _UntilQuiet:
    """A response of server-sent events that ends at the first ping after `QUIET_SECONDS` without an event.

    Pings show that the server is alive, not that events reach it.
    """

    def __init__(self, response: httpx2.Response) -> None:
        self.request, self.headers = response.request, response.headers
        self._response = response

    def iter_text(self) -> Iterator[str]:
        heard = time.monotonic()
        for chunk in self._response.iter_text():
            if any(line and not line.startswith(":") for line in chunk.splitlines()):
                heard = time.monotonic()
            elif time.monotonic() - heard >= QUIET_SECONDS:
                return
            yield chunk


def _refused_elsewhere(response: httpx2.Response) -> Unreachable:
    """Return the error of an object store, without the signature of its URL, which grants access."""
    return Unreachable(
        f"the object store answered {response.status_code} to a URL that was signed for it",
        where=str(response.request.url.copy_with(query=None)),
        hint="Signed URLs work for minutes: is the clock of the server, or of the store, wrong?",
    )


def _json(response: httpx2.Response) -> Any:
    """Return what a successful answer holds.

    Raises:
        InvalidInput: it is not a JSON object or array, so not the API's.
    """
    try:
        found = response.json()
    except NOT_OURS:
        found = None
    if not isinstance(found, dict | list):
        raise foreign_error(response)
    return cast("Any", found)


def _expected(response: httpx2.Response) -> httpx2.Response:
    """Return the answer if it may be the API's.

    Raises:
        InvalidInput: a redirect or a page, such as the login page of a proxy; the request had no effect.
    """
    if response.is_redirect or response.headers.get("content-type", "").startswith("text/html"):
        raise foreign_error(response)
    return response


@contextmanager
def _as_unreachable(server: Server) -> Generator[None]:
    try:
        yield
    except httpx2.TransportError as error:
        raise _unreachable(server, error) from error


def _final(server: Server, error: httpx2.TransportError) -> MareyError | None:
    """Return the error for a failure that persists in further attempts, of the server or of the object store."""
    try:
        url = error.request.url.copy_with(path="/", query=None)
    except RuntimeError:  # there was no request yet
        return connection_failure(error, server.url)
    return connection_failure(error, str(url).rstrip("/"))


def _unreachable(server: Server, error: httpx2.TransportError) -> MareyError:
    kind = NoAnswer if isinstance(error, httpx2.ReadTimeout) else Unreachable
    return _final(server, error) or kind(
        f"the server does not answer ({type(error).__name__}: {error})",
        where=server.url,
        hint="Is it running? `marey serve` starts one here; MAREY_SERVER names another.",
    )


def _no_client(error: Exception, server: Server) -> InvalidInput:
    """Return the error for an address of a server or of a proxy that the HTTP client does not take."""
    if server.is_here or not getproxies():
        return InvalidInput(f"is no address: {error}", where=server.url, hint="Correct MAREY_SERVER.")
    reason = "SOCKS is not supported" if isinstance(error, ImportError) else str(error)
    return InvalidInput(
        f"a proxy that the environment names cannot be used: {reason}",
        where=server.url,
        hint="Unset or correct ALL_PROXY, HTTPS_PROXY and HTTP_PROXY: an http:// proxy can be used.",
    )


def _given(params: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in params.items() if value is not None}
