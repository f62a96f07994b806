"""A server that gives prepared answers, one after the other, and remembers what it was asked."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

from marey.client.server_address import Server
from marey.client.transport import Transport


@dataclass
class Script:
    """Answers of the server in order, and the requests it received."""

    answers: list[tuple[int, bytes]]
    asked: list[tuple[str, str | None, bytes]] = field(default_factory=list)


Scripted = Callable[..., tuple[Transport, Script]]


@contextmanager
def scripted_servers() -> Iterator[Scripted]:
    """Start servers that answer as they are told, until the end of the block."""
    servers: list[ThreadingHTTPServer] = []

    def start(*answers: tuple[int, object]) -> tuple[Transport, Script]:
        script = Script([(code, json.dumps(body).encode()) for code, body in answers])

        class Handler(BaseHTTPRequestHandler):
            def answer(self) -> None:
                body = self.rfile.read(int(self.headers.get("Content-Length", 0)))
                script.asked.append((self.command, self.headers.get("Idempotency-Key"), body))
                code, content = script.answers.pop(0)
                if code == 0:  # the answer is lost on the way
                    self.close_connection = True
                    return
                self.send_response(code)
                self.send_header("Content-Length", str(len(content)))
                self.end_headers()
                self.wfile.write(content)

            do_GET = do_POST = do_PATCH = do_DELETE = answer

            def log_message(self, *_: object) -> None:
                pass

        server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        threading.Thread(target=server.serve_forever, daemon=True).start()
        servers.append(server)
        return Transport(Server(f"http://127.0.0.1:{server.server_port}", "key")), script

    try:
        yield start
    finally:
        for server in servers:
            server.shutdown()
            server.server_close()


def problem(kind: str, **more: object) -> dict[str, object]:
    """A problem of the API."""
    return {"type": f"urn:marey:problem:{kind}", "detail": "no", **more}
