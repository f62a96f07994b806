"""A receiver of webhooks: a real HTTP server, with TLS if asked for, that answers as it is told to."""

from __future__ import annotations

import ssl
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import NameOID

LOOPBACK = ["127.0.0.0/8"]
"""Value of MAREY_WEBHOOK_ALLOW for it."""


@dataclass(frozen=True)
class Received:
    """A request that came in."""

    path: str
    headers: dict[str, str]
    body: bytes

    @property
    def id(self) -> str:
        """Of the message."""
        return self.headers["webhook-id"]


class Receiver:
    """Listens on 127.0.0.1 until the end of the block.

    Attributes:
        answer: what to do with a request once it is noted; 200 unless it is changed.
        received: every request, in order.
        released: set at the end; who hangs waits for it.
        written: bytes of an endless answer.
    """

    def __init__(self, *, tls: ssl.SSLContext | None = None) -> None:
        self.answer: Callable[[Receiver, BaseHTTPRequestHandler, Received], None] = status(200)
        self.received: list[Received] = []
        self.released = threading.Event()
        self.written = 0
        self.scheme = "http" if tls is None else "https"
        self._noted = threading.Condition()
        receiver = self

        class Handler(BaseHTTPRequestHandler):
            def do_POST(self) -> None:
                body = self.rfile.read(int(self.headers["content-length"]))
                headers = {name.lower(): value for name, value in self.headers.items()}
                request = Received(self.path, headers, body)
                receiver._note(request)
                receiver.answer(receiver, self, request)

            def do_GET(self) -> None:
                receiver._note(Received(self.path, {}, b""))
                status(200)(receiver, self, receiver.received[-1])

            def log_message(self, format: str, *_: object) -> None:
                pass

        class Server(ThreadingHTTPServer):
            daemon_threads = True

            def handle_error(self, request: object, client_address: object) -> None:
                pass  # who hangs up on us may

        self._server = Server(("127.0.0.1", 0), Handler)
        self.port = self._server.server_address[1]
        if tls is not None:
            self._server.socket = tls.wrap_socket(self._server.socket, server_side=True, do_handshake_on_connect=False)
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.05,), daemon=True)

    def url(self, host: str = "127.0.0.1", path: str = "/hook") -> str:
        """Where it is."""
        return f"{self.scheme}://{host}:{self.port}{path}"

    def wait(self, count: int, seconds: float = 60.0) -> list[Received]:
        """The requests, once there are so many."""
        with self._noted:
            assert self._noted.wait_for(lambda: len(self.received) >= count, seconds), f"{len(self.received)} came"
            return list(self.received)

    def _note(self, request: Received) -> None:
        with self._noted:
            self.received.append(request)
            self._noted.notify_all()

    def __enter__(self) -> Receiver:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.released.set()
        self._server.shutdown()
        self._server.server_close()
        self._thread.join(10)


# --- answers ---

Answer = Callable[[Receiver, BaseHTTPRequestHandler, Received], None]


def status(code: int, *, body: bytes = b"", **headers: str) -> Answer:
    """An ordinary answer."""

    def answer(_receiver: Receiver, handler: BaseHTTPRequestHandler, _request: Received) -> None:
        handler.send_response(code)
        for name, value in {**headers, "content-length": str(len(body))}.items():
            handler.send_header(name, value)
        handler.end_headers()
        handler.wfile.write(body)

    return answer


def hang(receiver: Receiver, _handler: BaseHTTPRequestHandler, _request: Received) -> None:
    """No answer at all."""
    receiver.released.wait(120)


def drip(receiver: Receiver, handler: BaseHTTPRequestHandler, _request: Received) -> None:
    """A head that never ends: each read of it succeeds."""
    handler.wfile.write(b"HTTP/1.1 200 OK\r\n")
    while not receiver.released.wait(0.05):
        handler.wfile.write(b"x-more: 1\r\n")


def endless(receiver: Receiver, handler: BaseHTTPRequestHandler, _request: Received) -> None:
    """200, and a body that goes on for as long as the client reads; a few gigabytes at most."""
    handler.send_response(200)
    handler.end_headers()
    for _ in range(2**12):
        if receiver.released.is_set():
            return
        handler.wfile.write(bytes(2**20))
        receiver.written += 2**20


def stalling(receiver: Receiver, handler: BaseHTTPRequestHandler, _request: Received) -> None:
    """200, and a body of which the half does not come."""
    handler.send_response(200)
    handler.send_header("content-length", "10")
    handler.end_headers()
    handler.wfile.write(b"12345")
    handler.wfile.flush()
    receiver.released.wait(120)


# --- certificates ---


@dataclass(frozen=True)
class Authority:
    """A certificate authority of the test's own."""

    folder: Path
    _key: ec.EllipticCurvePrivateKey
    _certificate: x509.Certificate

    @classmethod
    def make(cls, folder: Path) -> Authority:
        """A new one."""
        key = ec.generate_private_key(ec.SECP256R1())
        name = _name("authority")
        basics = x509.BasicConstraints(ca=True, path_length=None)
        certificate = _certificate(name, name, key, key.public_key(), basics)
        (folder / "ca.pem").write_bytes(certificate.public_bytes(serialization.Encoding.PEM))
        return cls(folder, key, certificate)

    @property
    def file(self) -> Path:
        """Its certificate, to be trusted."""
        return self.folder / "ca.pem"

    def trusting(self) -> ssl.SSLContext:
        """A client that trusts it alone."""
        return ssl.create_default_context(cafile=self.file)

    def files(self, host: str) -> tuple[Path, Path]:
        """A new certificate for that name and no address, and its key, as PEM files."""
        key = ec.generate_private_key(ec.SECP256R1())
        names = x509.SubjectAlternativeName([x509.DNSName(host)])
        certificate = _certificate(_name(host), self._certificate.subject, self._key, key.public_key(), names)
        path = self.folder / f"{host}-{time.monotonic_ns()}.pem"
        path.write_bytes(certificate.public_bytes(serialization.Encoding.PEM))
        encoding, plain = serialization.Encoding.PEM, serialization.NoEncryption()
        path.with_suffix(".key").write_bytes(key.private_bytes(encoding, serialization.PrivateFormat.PKCS8, plain))
        return path, path.with_suffix(".key")

    def server(self, host: str) -> ssl.SSLContext:
        """A server whose certificate is for that name and no address."""
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.load_cert_chain(*self.files(host))
        return context


def _name(text: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, text)])


def _certificate(
    subject: x509.Name,
    issuer: x509.Name,
    signer: ec.EllipticCurvePrivateKey,
    public: ec.EllipticCurvePublicKey,
    extension: x509.ExtensionType,
) -> x509.Certificate:
    now = datetime.now(UTC)
    builder = x509.CertificateBuilder(issuer, subject, public, x509.random_serial_number())
    builder = builder.not_valid_before(now - timedelta(hours=1)).not_valid_after(now + timedelta(days=1))
    return builder.add_extension(extension, critical=True).sign(signer, hashes.SHA256())
