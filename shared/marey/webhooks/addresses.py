"""Addresses that webhooks may reach: public ones, unless `MAREY_WEBHOOK_ALLOW` allows others.

A webhook is a request that a tenant chose and this machine sends: without a policy it could reach internal services.
The policy applies to the address that is connected to, never to how it was written or what a name resolved to
earlier.
"""

from __future__ import annotations

import socket
from collections.abc import Sequence

import httpx2

from marey.core.addresses import Allowed, parse_address
from marey.core.errors import InvalidInput, Refused

MAX_URL = 2000  # characters
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
    elif url.scheme == "http" and not allowed.networks:
        raise _wrong("is not https", hint=HINT)
    return str(url)


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
