"""Addresses that webhooks may reach: public ones, unless `MAREY_WEBHOOK_ALLOW` allows others.

A webhook is a request that a tenant chose and this machine sends: without a policy it could reach internal services.
The policy applies to the address that is connected to, never to how it was written or what a name resolved to
earlier.
"""

from __future__ import annotations

import re
import socket
from collections.abc import Sequence

import httpx2

from marey.core.addresses import Allowed, parse_address
from marey.core.errors import InvalidInput, Refused

MAX_URL = 2000  # characters
MAX_HOST = 253
"""Characters of the name of a host (RFC 1035)."""
LABEL = re.compile(r"[a-z0-9]([a-z0-9_-]{0,61}[a-z0-9])?")
"""One part of the name of a host (RFC 1123); within it also the underscores of names in private networks."""
HINT = "Allow it with MAREY_WEBHOOK_ALLOW."


def choose_address(found: Sequence[str], scheme: str, allowed: Allowed) -> str:
    """Return the address to connect to, from the addresses of a name.

    One forbidden address rejects all: a name with public and private addresses is an attack or a mistake.

    Raises:
        Refused: there is none, one of them is forbidden, or plain http is not allowed for it.
    """
    addresses = [parse_address(each) for each in found]
    if not addresses:
        raise Refused("the webhook host does not resolve")
    if not all(allowed.permits(address) for address in addresses):
        raise Refused("the webhook host resolves to a private address", hint=HINT)
    if scheme != "https" and not all(allowed.named(address) for address in addresses):
        raise Refused("http is allowed only for the networks in MAREY_WEBHOOK_ALLOW", hint=f"Use https. {HINT}")
    return str(addresses[0])


def check_url(text: str, allowed: Allowed) -> str:
    """Validate the URL of a receiver and return its normal form. Names are resolved at delivery.

    Raises:
        InvalidInput: not a URL, or one with a forbidden address.
    """
    try:
        url = httpx2.URL(text)
    except (httpx2.InvalidURL, ValueError) as error:
        raise _wrong(f"is not a URL: {error}") from error
    if url.scheme not in ("https", "http") or not url.host.strip(".") or "%" in url.host:
        raise _wrong("is not an https URL", hint="Write it as https://studio.example/marey.")
    if url.userinfo or url.fragment:
        raise _wrong("holds a user, a password or a fragment", hint="Leave them out: messages are signed.")
    if len(str(url)) > MAX_URL or (url.port is not None and not 0 < url.port < 2**16):
        raise _wrong(f"is over {MAX_URL} characters, or has an invalid port")
    literal = _literal(url.host)
    if literal is not None:
        try:
            choose_address([literal], url.scheme, allowed)
        except Refused as error:
            raise _wrong(error.message, hint=error.hint) from error
    else:
        _check_name(url.raw_host.decode("ascii"))
        if url.scheme == "http" and not allowed.networks:
            raise _wrong("is not https", hint=HINT)
    return str(url)


def _check_name(host: str) -> None:
    """Validate the syntax of a host name; whether it resolves is found out at each delivery.

    Raises:
        InvalidInput: no host can have this name.
    """
    name = host.removesuffix(".")
    labels = name.split(".")
    if len(name) > MAX_HOST or not all(LABEL.fullmatch(label) for label in labels):
        hint = "The parts between its dots are letters, digits and hyphens, 1 to 63, all together at most 253."
        raise _wrong(f"{host[:80]!r} cannot be the name of a host", hint=hint)
    if labels[-1].isdigit():  # the root has no such domain, and browsers read it as an address
        raise _wrong(f"{host[:80]!r} ends in a number, but is no IPv4 address", hint="Write it as 203.0.113.7.")


def _literal(host: str) -> str | None:
    """Return the address in a host, in any notation (`2130706433`, `0x7f.1`); None for a name."""
    host = host.rstrip(".")  # resolves to the same addresses
    if host == "localhost" or host.endswith(".localhost"):
        return "127.0.0.1"
    try:
        found = socket.getaddrinfo(host, None, type=socket.SOCK_STREAM, flags=socket.AI_NUMERICHOST)
    except (OSError, UnicodeError):
        return None
    return str(found[0][4][0])


def _wrong(message: str, hint: str | None = None) -> InvalidInput:
    return InvalidInput(message, where="url", hint=hint)
