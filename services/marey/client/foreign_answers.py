"""Errors for answers that do not come from Marey: a proxy's error page, a redirect, another server.

The API answers problems in JSON and no `Server` header; a proxy answers pages of its own and names itself there.
"""

from __future__ import annotations

import re
from collections.abc import Callable

from marey.core.errors import InvalidInput, MareyError, Refused, TooLarge, TooSlow, Unreachable
from marey.core.tls import UNTRUSTED_HINT, verification_error

GUIDE = "docs/how-to/proxy.md"
HTTP_TO_HTTPS = "plain HTTP request was sent to HTTPS port"
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9 ./_-]{0,40}")
_SERVER_HINT = "Is MAREY_SERVER the address of a Marey server?"
_PAGES: dict[int, tuple[type[MareyError], str, str]] = {
    408: (TooSlow, "the request came slower than it waits for one", "Send it again, or raise the proxy's timeouts."),
    413: (
        TooLarge,
        "refuses a request of this size",
        f"Let the proxy pass on 64 MiB (nginx: client_max_body_size 64m; {GUIDE}), or submit fewer lines at once.",
    ),
    429: (Refused, "it limits requests", "Try again later, or raise the limit of the proxy."),
    502: (Unreachable, "it gets no answer from the API", "Is the API running? See the log of the proxy."),
    503: (Unreachable, "it has no API to pass requests on to", "Is the API running? See the log of the proxy."),
    504: (
        Unreachable,
        "the API did not answer within the time it waits",
        f"Try again; if it stays so, raise the read timeout of the proxy (nginx: proxy_read_timeout 300s; {GUIDE}).",
    ),
}
"""By status: the error, the meaning of the proxy's answer, and the hint."""


class NoAnswer(Unreachable):
    """A server that accepted the connection and did not answer in time."""


def foreign_answer(status: int, header: Callable[[str], str | None], text: str, where: str) -> MareyError:
    """Return the error for an answer that is not a problem of the API.

    Args:
        header: looks up a header of the answer.
        text: the beginning of its body.
        where: the address that was asked, without a query.
    """
    name = header("server") or ""
    sender = f"a proxy ({name})" if _NAME.fullmatch(name) else "a proxy or another server"
    if 300 <= status < 400:
        return _redirect(status, header("location") or "", where)
    if status < 300:
        kind = (header("content-type") or "no type").partition(";")[0].strip()
        shown = kind if _NAME.fullmatch(kind) else "something else"
        message = f"{sender} answered {status} with {shown}, where the API answers JSON"
        return InvalidInput(message, where=where, hint=_SERVER_HINT)
    if HTTP_TO_HTTPS in text:
        return InvalidInput("this port speaks https", where=where, hint="Begin MAREY_SERVER with https://.")
    if status in _PAGES:
        kind, meaning, hint = _PAGES[status]
        return kind(f"{sender} answered {status}: {meaning}", where=where, hint=hint)
    if status >= 500:
        return Unreachable(f"{sender} answered {status} without a reason", where=where, hint="See its log.")
    kind = Refused if status in (401, 403) else InvalidInput
    return kind(f"{sender} answered {status}, and not the API", where=where, hint=_SERVER_HINT)


def no_upgrade(status: int, where: str) -> InvalidInput:
    """Return the error for a WebSocket that was answered as an ordinary request."""
    return InvalidInput(
        f"the WebSocket was answered as an ordinary request ({status}): a proxy does not pass on the upgrade",
        where=where,
        hint=f"Let it send HTTP/1.1 with the headers Upgrade and Connection (nginx: {GUIDE}).",
    )


def connection_failure(error: BaseException, where: str) -> MareyError | None:
    """Return the error for a connection that fails again however often it is tried; None for any other failure."""
    why = verification_error(error)
    if why is not None:
        return Unreachable(f"the certificate of the server is not trusted ({why})", where=where, hint=UNTRUSTED_HINT)
    if "WRONG_VERSION_NUMBER" in str(error) or "RECORD_LAYER_FAILURE" in str(error):
        return InvalidInput("this port does not speak https", where=where, hint="Begin MAREY_SERVER with http://.")
    return None


def _redirect(status: int, location: str, where: str) -> InvalidInput:
    target = re.fullmatch(r"(https?://[A-Za-z0-9.:\[\]_-]{1,260})(/[^\s]*)?", location)
    if target is None:
        return InvalidInput(f"answered {status}, a redirect", where=where, hint=_SERVER_HINT)
    return InvalidInput(f"answered {status}, a redirect to {target[1]}", where=where, hint="Set MAREY_SERVER to that.")
