"""TLS contexts of outgoing connections: the machine's certificate authorities, and those of `MAREY_CA_FILE`."""

from __future__ import annotations

import os
import ssl
from functools import cached_property
from pathlib import Path
from typing import Any

from marey.core.errors import InvalidInput

VARIABLE = "MAREY_CA_FILE"
UNTRUSTED_HINT = f"If it belongs to a private certificate authority, set {VARIABLE} to that authority's PEM file."


def trusting_context(ca_file: Path | None = None) -> ssl.SSLContext:
    """Return a client context that verifies certificates and names.

    Trusts the machine's authorities (or `SSL_CERT_FILE`, `SSL_CERT_DIR`), and those of `ca_file` as well.

    Raises:
        InvalidInput: the file, or that of `SSL_CERT_FILE`, cannot be read or holds no certificate.
    """
    import httpx2  # costs 0.1 s of import, which commands without a server avoid

    try:
        context = httpx2.create_ssl_context()
    except OSError as error:  # also SSLError
        named = "SSL_CERT_FILE" if os.environ.get("SSL_CERT_FILE") else "SSL_CERT_DIR"
        message = f"{os.environ.get(named)!r} holds no certificate authorities that can be read: {error.strerror}"
        raise InvalidInput(message, where=named, hint="Correct it, or unset it.") from error
    if ca_file is not None:
        try:
            context.load_verify_locations(cafile=ca_file.expanduser())
        except ssl.SSLError as error:
            message = f"{str(ca_file)!r} holds no certificate in PEM format"
            hint = "It starts with -----BEGIN CERTIFICATE-----."
            raise InvalidInput(message, where=VARIABLE, hint=hint) from error
        except OSError as error:
            message = f"{str(ca_file)!r} cannot be read: {error.strerror}"
            hint = "It names the PEM file of a certificate authority."
            raise InvalidInput(message, where=VARIABLE, hint=hint) from error
    return context


def context_for(url: str, ca_file: Path | None = None) -> ssl.SSLContext:
    """Return `trusting_context` for a client of a server, which may name files of another server.

    Of plain HTTP it reads the machine's authorities at the first connection by TLS, if there is one: they take longer
    than many a command.

    Raises:
        InvalidInput: as `trusting_context`; of plain HTTP for the file of `SSL_CERT_FILE` at that connection.
    """
    is_late = ca_file is None and not url.startswith("https")
    return LateContext(ssl.PROTOCOL_TLS_CLIENT) if is_late else trusting_context(ca_file)


class LateContext(ssl.SSLContext):
    """A `trusting_context` that reads the authorities at its first connection; itself it trusts none."""

    _protocols: tuple[str, ...] = ()

    @cached_property
    def _trusting(self) -> ssl.SSLContext:
        context = trusting_context()
        context.set_alpn_protocols(self._protocols)
        return context

    def set_alpn_protocols(self, alpn_protocols: Any) -> None:
        """Set the protocols that connections offer; clients do so before the first."""
        self._protocols = tuple(alpn_protocols)

    def wrap_socket(self, *args: Any, **options: Any) -> ssl.SSLSocket:
        """Return a connection by TLS on a socket."""
        return self._trusting.wrap_socket(*args, **options)

    def wrap_bio(self, *args: Any, **options: Any) -> ssl.SSLObject:
        """Return a connection by TLS on buffers."""
        return self._trusting.wrap_bio(*args, **options)


def verification_error(error: BaseException) -> str | None:
    """Return the reason why a certificate was rejected, if that caused the error."""
    seen: set[int] = set()
    waiting: list[BaseException | None] = [error]
    while waiting:
        cause = waiting.pop()
        if cause is None or id(cause) in seen:
            continue
        seen.add(id(cause))
        if isinstance(cause, ssl.SSLCertVerificationError):
            return cause.verify_message or str(cause)
        reason = getattr(cause, "reason", None)  # of urllib3
        waiting += [cause.__cause__, cause.__context__, reason if isinstance(reason, BaseException) else None]
        waiting += [each for each in cause.args if isinstance(each, BaseException)]
    return None
