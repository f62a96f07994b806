"""The HTTP client: retries with back-off, and problems as errors."""

from __future__ import annotations

import json
import random
import time
from collections.abc import Generator, Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, cast
from urllib.request import getproxies
from uuid import uuid4

import httpx2

from marey.client.foreign_answers import NoAnswer, connection_failure, foreign_answer
from marey.client.lines import Lines
from marey.client.server_address import Server, ca_file
from marey.core import tracing
from marey.core.errors import (
    TYPE_PREFIX,
    Busy,
    Conflict,
    InvalidBundle,
    InvalidFile,
    InvalidInput,
    MareyError,
    NotFound,
    Overloaded,
    QuotaUsedUp,
    Refused,
    TimedOut,
    TooLarge,
    TooSlow,
    Unauthenticated,
    Unreachable,
)
from marey.core.tls import trusting_context
from marey.items.problems import InvalidItems, OutOfScope, Problem

ATTEMPTS = 5
FIRST_PAUSE, LONGEST_PAUSE = 0.25, 8.0
"""Seconds between attempts, doubling with jitter: five attempts give a restarting server about five seconds."""
BUSY_SECONDS = 180.0
"""Seconds to wait in all for a server that is busy; at least `ATTEMPTS` are made."""
SUBMIT_BUSY_SECONDS = 900.0
"""The same for a submit: the server reads large ones one after the other."""
SUBMIT_TIMEOUT = 300.0
"""100,000 items take a quarter of a minute to write on a busy machine."""
QUIET_SECONDS = 12.0
"""A server pings an event stream every 15 s."""
PATIENCE = 180.0
"""Seconds without a reachable server after which following a job or a stream gives up."""
RETRIED = frozenset({429, 502, 503, 504})
QUOTA = QuotaUsedUp.problem_type
NOT_OURS = (ValueError, KeyError, TypeError, AttributeError, RecursionError)
"""Errors of reading an answer that is not the API's; the last one is raised by JSON that is nested too deeply."""

_ERRORS: dict[str, type[MareyError]] = {
    kind.problem_type: kind
    for kind in (
        InvalidInput, TooLarge, InvalidFile, InvalidBundle, Conflict, NotFound, Unreachable, Refused, Unauthenticated,
        TimedOut, TooSlow,
    )
}  # fmt: skip


class Transport:
    """HTTP requests to one server; safe to use from several threads.

    All attempts of one `submit` share an idempotency key, so a retry after a lost answer enqueues nothing twice.
    """

    def __init__(self, server: Server, *, timeout: float = 30.0, attempts: int | None = None) -> None:
        self.server = server
        self._attempts = ATTEMPTS if attempts is None else attempts
        try:
            self._http = httpx2.Client(
                base_url=server.url,
                headers={"Authorization": f"Bearer {server.key}"},
                timeout=httpx2.Timeout(timeout, connect=5.0),
                verify=trusting_context(ca_file()),
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
        self, path: str, headers: Mapping[str, str] | None = None, *, patience: float = 30.0
    ) -> Generator[httpx2.Response]:
        """Open an answer that is read in pieces; redirects (to the object store) are followed without the key.

        Args:
            patience: seconds of silence after which the server counts as unreachable.
        """
        timeout = httpx2.Timeout(patience, connect=5.0)
        options: dict[str, Any] = {"headers": headers, "follow_redirects": True, "timeout": timeout}
        with _as_unreachable(self.server), self._http.stream("GET", path, **options) as response:
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
        """Send until there is an answer.

        Args:
            repeatable: the request may be carried out twice.
            patience: seconds to wait in all while the server is busy; None = `BUSY_SECONDS`.
        """
        pause, failures, refusals, waited = FIRST_PAUSE, 0, 0, 0.0
        if patience is None or self._attempts < ATTEMPTS:
            patience = BUSY_SECONDS if self._attempts >= ATTEMPTS else 0.0
        while True:
            try:
                response = self._request(method, path, request)
            except httpx2.TransportError as error:
                if (final := _final(self.server, error)) is not None:
                    raise final from error
                failures += 1
                never_sent = isinstance(error, httpx2.ConnectError | httpx2.ConnectTimeout)
                if (
                    failures == self._attempts
                    or isinstance(error, httpx2.UnsupportedProtocol)
                    or not (repeatable or never_sent)
                ):
                    raise _unreachable(self.server, error) from error
                wait = pause
            else:
                if response.status_code < 400:
                    return _expected(response)
                wait = max(pause, _retry_after(response))
                if _is_busy(response):  # an answer is not a failure
                    refusals, waited = refusals + 1, waited + wait
                    again = refusals < self._attempts or waited < patience
                else:
                    failures += 1
                    again = failures < self._attempts
                if response.status_code not in RETRIED or not again or not repeatable or _is_quota(response):
                    raise error_of(response)
            time.sleep(wait * random.uniform(0.8, 1.2))  # noqa: S311
            pause = min(pause * 2, LONGEST_PAUSE)

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


def error_of(response: httpx2.Response) -> MareyError:
    """Return the error of an RFC 9457 problem, as it was raised on the server."""
    try:
        return error_of_problem(response.json(), response.status_code, _retry_after(response))
    except NOT_OURS:
        return _foreign(response)


def error_of_problem(problem: Mapping[str, Any], status: int, retry_after: float = 0.0) -> MareyError:
    """Return the error of a problem of the API.

    Args:
        retry_after: seconds.

    Raises:
        ValueError, KeyError, TypeError, AttributeError: it is not a problem of the API.
    """
    kind = str(problem["type"]).removeprefix(TYPE_PREFIX)
    message, where, hint = str(problem["detail"]), problem.get("where"), problem.get("hint")
    if kind == InvalidItems.problem_type:
        found = [_problem(each) for each in problem.get("problems", [])]
        return InvalidItems(found, total=problem.get("total"))
    if kind == OutOfScope.problem_type:
        found = [_problem(each) for each in problem.get("problems", [])]
        return OutOfScope(found, total=problem.get("total"), hint=hint or "")
    if kind == Overloaded.problem_type:
        return Overloaded(message, where=where, hint=hint, seconds=round(retry_after))
    if kind == QUOTA and (quota := problem.get("quota")) is not None:
        sizes = {name: int(quota[name]) for name in ("limit", "used", "asked")}
        seconds = round(retry_after)
        return QuotaUsedUp(message, where=where, hint=hint, seconds=seconds, quota=str(quota["name"]), **sizes)
    if kind in (Busy.problem_type, QUOTA):
        return Busy(message, where=where, hint=hint, seconds=round(retry_after))
    error = _ERRORS.get(kind) or (InvalidInput if status < 500 else MareyError)
    return error(message, where=where, hint=hint)


def _problem(found: Mapping[str, Any]) -> Problem:
    """Read one of the problems of items."""
    line = found.get("line")
    return Problem(None if line is None else int(line), found.get("field"), str(found["message"]))


def _refused_elsewhere(response: httpx2.Response) -> Unreachable:
    """Return the error of an object store, without the signature of its URL, which grants access."""
    return Unreachable(
        f"the object store answered {response.status_code} to a URL that was signed for it",
        where=str(response.request.url.copy_with(query=None)),
        hint="Signed URLs work for minutes: is the clock of the server, or of the store, wrong?",
    )


def _is_busy(response: httpx2.Response) -> bool:
    """Return True if the server is busy: a rate limit, or too many large requests at once."""
    return response.status_code == Busy.status or (
        response.status_code == Overloaded.status and f"{TYPE_PREFIX}{Overloaded.problem_type}" in response.text
    )


def _is_quota(response: httpx2.Response) -> bool:
    """Return True for a quota: unlike a rate it takes minutes, or an operator, so the error is raised at once."""
    return response.status_code == Busy.status and f"{TYPE_PREFIX}{QUOTA}" in response.text


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
        raise _foreign(response)
    return cast("Any", found)


def _expected(response: httpx2.Response) -> httpx2.Response:
    """Return the answer if it may be the API's.

    Raises:
        InvalidInput: a redirect or a page, such as the login page of a proxy; the request had no effect.
    """
    if response.is_redirect or response.headers.get("content-type", "").startswith("text/html"):
        raise _foreign(response)
    return response


def _foreign(response: httpx2.Response) -> MareyError:
    where = str(response.request.url.copy_with(query=None))
    return foreign_answer(response.status_code, response.headers.get, response.text[:2000], where)


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


def _retry_after(response: httpx2.Response) -> float:
    try:
        return min(float(response.headers.get("Retry-After", 0)), 60.0)
    except ValueError:
        return 0.0


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
