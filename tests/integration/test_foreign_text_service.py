"""Answers that are not the text service's are never passed on, and never read to their end."""

from __future__ import annotations

import asyncio
import gzip
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest
from pydantic import SecretStr

from marey.api.text_client import MAX_ANSWER, TextService
from marey.core.errors import Unreachable
from marey.core.settings import Settings
from marey.http.problems import problem_response
from marey.text_service.routes import ParseBody

JSON, PROBLEM = "application/json", "application/problem+json"
BODY = ParseBody(prompts=["a person walks"], model="hgm3")
GOOD = b'{"items": []}'
TOLD = b'{"type": "urn:marey:problem:busy", "title": "Busy", "status": 429, "detail": "too many"}'
FOREIGN: dict[str, tuple[int, dict[str, str], bytes]] = {
    "a page": (200, {"Content-Type": "text/html"}, b"<p>secret-host</p>"),
    "no JSON": (200, {"Content-Type": JSON}, b"{]"),
    "other JSON": (200, {"Content-Type": JSON}, b'{"secret-host": 1}'),
    "a proxy's page": (503, {"Content-Type": "text/html", "Retry-After": "secret-host"}, b"secret-host"),
    "another problem": (404, {"Content-Type": PROBLEM}, b'{"secret-host": 1}'),
    "a redirect": (302, {"Location": "http://secret-host/"}, b""),
    "packed": (200, {"Content-Type": JSON, "Content-Encoding": "gzip"}, gzip.compress(GOOD)),
    "packed wrongly": (200, {"Content-Type": JSON, "Content-Encoding": "gzip"}, GOOD[:-1]),
    "without end": (200, {"Content-Type": JSON}, GOOD + b" " * (2 * MAX_ANSWER)),
}


class Place:
    """An HTTP server that is no text service."""

    def __init__(self) -> None:
        self.answer: tuple[int, dict[str, str], bytes] = (200, {}, b"")
        place = self

        class Handler(BaseHTTPRequestHandler):
            def do_POST(self) -> None:
                self.rfile.read(int(self.headers["Content-Length"]))
                status, headers, body = place.answer
                self.send_response(status)
                for name, value in {**headers, "Content-Length": str(len(body))}.items():
                    self.send_header(name, value)
                self.end_headers()
                try:
                    self.wfile.write(body)
                except OSError:  # the client has seen enough
                    return

            def log_message(self, format: str, *args: object) -> None:
                return

        self._server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        threading.Thread(target=self._server.serve_forever, daemon=True).start()

    def ask(self) -> tuple[int, bytes, str | None]:
        """Status, body and `Retry-After` of what the API answers."""

        async def parse() -> tuple[int, bytes, str | None]:
            url = f"http://127.0.0.1:{self._server.server_port}"
            service = TextService(Settings(text_url=url, text_key=SecretStr("secret")))
            try:
                answer = await service.parse(BODY)
            finally:
                await service.close()
            return answer.status_code, bytes(answer.body), answer.headers.get("Retry-After")

        return asyncio.run(parse())

    def close(self) -> None:
        self._server.shutdown()
        self._server.server_close()


@pytest.fixture
def place() -> Iterator[Place]:
    made = Place()
    yield made
    made.close()


@pytest.mark.parametrize("kind", FOREIGN)
def test_a_foreign_answer_is_503_and_not_shown(place: Place, kind: str) -> None:
    place.answer = FOREIGN[kind]
    with pytest.raises(Unreachable) as raised:
        place.ask()
    told = problem_response(raised.value)
    assert told.status_code == 503
    assert b"the text service does not answer" in told.body
    assert b"secret-host" not in told.body


def test_its_own_answers_are_passed_on(place: Place) -> None:
    place.answer = (200, {"Content-Type": JSON}, GOOD)
    assert place.ask() == (200, GOOD, None)
    place.answer = (429, {"Content-Type": PROBLEM, "Retry-After": "7"}, TOLD)
    assert place.ask() == (429, TOLD, "7")
    place.answer = (429, {"Content-Type": PROBLEM, "Retry-After": "secret"}, TOLD)
    assert place.ask() == (429, TOLD, "2")
