"""Answers of a language model that were recorded, served as `POST /chat/completions` on this machine."""

from __future__ import annotations

import json
import threading
from collections.abc import Mapping
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from types import TracebackType
from typing import Self

MODEL = "recorded"
"""Name of the model that the answers are said to be of."""
MAX_QUESTION = 2**20


class RecordedAnswers:
    """An endpoint that answers each prompt as recorded, and any other with status 404. Use as a context.

    Attributes:
        url: up to and without `/chat/completions`.
    """

    def __init__(self, answers: Mapping[str, str]) -> None:
        self._http = ThreadingHTTPServer(("127.0.0.1", 0), _handler_of(answers))
        self._http.daemon_threads = True
        self.url = f"http://127.0.0.1:{self._http.server_port}/v1"

    def __enter__(self) -> Self:
        threading.Thread(target=self._http.serve_forever, args=(0.05,), daemon=True).start()
        return self

    def __exit__(self, _kind: type[BaseException] | None, _error: object, _place: TracebackType | None) -> None:
        self._http.shutdown()
        self._http.server_close()


def _handler_of(answers: Mapping[str, str]) -> type[BaseHTTPRequestHandler]:
    class AnswerHandler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            size = min(int(self.headers.get("Content-Length") or 0), MAX_QUESTION)
            prompt = json.loads(self.rfile.read(size))["messages"][-1]["content"]
            answer = answers.get(prompt)
            choice = {"message": {"role": "assistant", "content": answer}}
            body = json.dumps({"choices": [choice]}).encode()
            self.send_response(404 if answer is None else 200)
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, format: str, *args: object) -> None:
            """Log nothing: prompts do not go into logs."""

    return AnswerHandler
