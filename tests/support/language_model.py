"""An endpoint that speaks OpenAI's chat completions, on a thread; what it answers, each test says."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any


@dataclass
class CompletionReply:
    """One response; `content` makes a proper completion of it, `body` anything else."""

    content: str | None = None
    body: bytes | None = None
    status: int = 200
    headers: dict[str, str] = field(default_factory=dict[str, str])
    delay: float = 0.0
    """Seconds before each byte."""

    def bytes(self) -> bytes:
        if self.body is not None:
            return self.body
        return json.dumps({"choices": [{"message": {"role": "assistant", "content": self.content}}]}).encode()


@dataclass
class ChatRequest:
    """One request."""

    path: str
    authorization: str | None
    question: dict[str, Any]

    @property
    def prompt(self) -> str:
        return self.question["messages"][-1]["content"]


class LanguageModel:
    """Use as a context; `answer` may be replaced at any time."""

    def __init__(self, answer: Callable[[ChatRequest, int], CompletionReply]) -> None:
        """`answer` gets the request and how many came before it."""
        self.answer = answer
        self.asked: list[ChatRequest] = []
        self._lock = threading.Lock()
        self._closing = threading.Event()
        self._http = ThreadingHTTPServer(("127.0.0.1", 0), _handler(self))
        self._http.daemon_threads = True
        self.url = f"http://127.0.0.1:{self._http.server_port}/v1"

    def __enter__(self) -> LanguageModel:
        threading.Thread(target=self._http.serve_forever, args=(0.01,), daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        self._closing.set()
        self._http.shutdown()
        self._http.server_close()

    def take(self, asked: ChatRequest) -> CompletionReply:
        with self._lock:
            self.asked.append(asked)
            return self.answer(asked, len(self.asked) - 1)

    def wait(self, seconds: float) -> None:
        self._closing.wait(seconds)


def _handler(model: LanguageModel) -> type[BaseHTTPRequestHandler]:
    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            question = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
            answer = model.take(ChatRequest(self.path, self.headers.get("Authorization"), question))
            body = answer.bytes()
            try:
                self.send_response(answer.status)
                for name, value in {"Content-Length": str(len(body)), **answer.headers}.items():
                    self.send_header(name, value)
                self.end_headers()
                for byte in body if answer.delay else ():
                    model.wait(answer.delay)
                    self.wfile.write(bytes([byte]))
                if not answer.delay:
                    self.wfile.write(body)
            except OSError:  # the client has had enough
                time.sleep(0)

        def log_message(self, format: str, *args: object) -> None:
            pass

    return Handler
