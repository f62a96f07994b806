"""A stand-in for the server of live streams: what docs/reference/streams.md promises to a client, and no model.

HTTP and WebSockets at one address, as there. The stream is a dancer's; how fast it goes, and what goes wrong with it,
says a `Plan`.
"""

from __future__ import annotations

import hashlib
import json
import socket
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import parse_qs, urlsplit

import numpy as np
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request
from websockets.server import ServerProtocol
from websockets.sync.connection import Connection
from websockets.typing import Subprotocol

from marey.motion.skeleton import HUMANML3D
from marey.streams.frames import Frame, encode_frame
from tests.support.motions import dancer

KEY = "marey_00000000_key"
STREAM = "0198c0de-0000-7000-8000-000000000001"
JOB = "0198c0de-0000-7000-8000-000000000002"
FPS = 20.0
FILES = {"bvh": b"HIERARCHY of the clip", "npz": b"PK of the clip"}
POSES = 400


@dataclass
class Plan:
    """Script of the stream.

    Attributes:
        frames: after which it ends by itself.
        speed: frames a second by the clock on the wall.
        waiting: how many go before it; one does each twentieth of a second.
        waits_for: what it waits for meanwhile.
        drops: the socket breaks, without a word, where it would send these frames.
        gaps: how many frames are not sent, told by a `gap`, by the number of the first.
        silent: the same without a message.
        again: frames that every socket begins before the one that was asked for.
        closes: codes and reasons that the first sockets are closed with.
        fails: the stream fails after so many frames.
        begin: status and problem that `POST` answers; None = 201.
        deaf: it does not stop when it is asked to.
        told: further messages that a socket begins with.
        read: how prompts were read, by their numbers.
    """

    frames: int = 30
    speed: float = 200.0
    waiting: int = 0
    waits_for: str = "slot"
    drops: set[int] = field(default_factory=set)
    gaps: dict[int, int] = field(default_factory=dict)
    silent: dict[int, int] = field(default_factory=dict)
    again: int = 0
    closes: list[tuple[int, str]] = field(default_factory=list)
    fails: int | None = None
    begin: tuple[int, dict[str, Any]] | None = None
    deaf: bool = False
    told: list[Any] = field(default_factory=list)
    read: dict[int, dict[str, str | None]] = field(default_factory=dict)


class StreamServer:
    """Serves one stream until the end of the block.

    Attributes:
        begun: bodies of the `POST`s.
        opened: path, query and headers of each socket.
        messages: what clients sent, in order.
        rotations, root: (T, J, 4) and (T, 3) of the frames.
    """

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        self.begun: list[dict[str, Any]] = []
        self.opened: list[tuple[str, dict[str, str], dict[str, str]]] = []
        self.messages: list[dict[str, Any]] = []
        self.rotations, self.root = dancer(frames=POSES)
        self.changed = threading.Condition()
        self.made: list[bytes] = []
        self.state = "waiting"
        self.position: int | None = plan.waiting
        self.reason: str | None = None
        self.prompts: list[tuple[int, str]] = []
        self._http = ThreadingHTTPServer(("127.0.0.1", 0), _handler(self))
        self._http.daemon_threads = True
        self._over = False

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self._http.server_port}"

    def __enter__(self) -> StreamServer:
        threading.Thread(target=self._http.serve_forever, kwargs={"poll_interval": 0.05}, daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        with self.changed:
            self._over = True
            self.changed.notify_all()
        self._http.shutdown()
        self._http.server_close()

    def until(self, wanted: Callable[[], Any], seconds: float = 60.0) -> None:
        """Wait for something to come true."""
        with self.changed:
            assert self.changed.wait_for(wanted, seconds), "it does not come true"

    def view(self) -> dict[str, Any]:
        """The stream as the server describes it."""
        body, over = self.begun[0], self.state in ("ended", "failed")
        return {
            "id": STREAM,
            "name": body.get("name"),
            "prompt": body["prompt"],
            "model": "stroller",
            "bundle": "stroller-x",
            "licence": "MIT",
            "seed": body.get("seed", 7),
            "state": self.state,
            "position": self.position,
            "waits_for": self.plan.waits_for if self.state == "waiting" else None,
            "reason": self.reason,
            "fps": FPS,
            "error": {"type": "x", "message": "the worker is out of memory", "where": None, "hint": "Try again."}
            if self.state == "failed"
            else None,
            "frames": len(self.made),
            "max_frames": self.plan.frames,
            "job": JOB if over and self.made else None,
            "created": "2026-01-01T00:00:00Z",
            "started": None,
            "ended": None,
            "prompts": [
                {"number": n, "frame": f, "prompt": p, **self.plan.read.get(n, {})}
                for n, (f, p) in enumerate(self.prompts)
            ],
            "skeleton": {
                "names": list(HUMANML3D.joint_names),
                "parents": list(HUMANML3D.parents),
                "offsets": HUMANML3D.offsets.tolist(),
            },
        }

    # --- what the worker does ---

    def begin(self, body: dict[str, Any]) -> dict[str, Any]:
        with self.changed:
            self.begun.append(body)
            threading.Thread(target=self._work, daemon=True).start()
            return self.view()

    def apply(self, message: dict[str, Any]) -> None:
        with self.changed:
            self.messages.append(message)
            if message["kind"] == "steer":
                self.prompts.append((len(self.made), message["prompt"]))
            elif message["kind"] == "stop" and not self.plan.deaf:
                self._end("ended", "stopped by the client")
            elif message["kind"] == "pause":
                self.state = "paused"
            elif message["kind"] == "resume":
                self.state = "live"
            self.changed.notify_all()

    def _work(self) -> None:
        while self.position is not None and not self._over:
            time.sleep(0.05)
            with self.changed:
                self.position = self.position - 1 if self.position else None
                self.changed.notify_all()
        with self.changed:
            if self.state == "waiting":
                self.state, self.prompts = "live", [(0, self.begun[0]["prompt"]), *self.prompts]
        while not self._over and self.state in ("live", "paused"):
            time.sleep(1 / self.plan.speed)
            with self.changed:
                if self.state == "live":
                    self._make()
                    self.changed.notify_all()

    def _make(self) -> None:
        number = len(self.made)
        if number == self.plan.fails:
            self._end("failed", "the worker died")
        elif number == self.plan.frames:
            self._end("ended", "as long as it was to be")
        else:
            last = number + 1 == self.plan.frames
            pose = self.rotations[number % POSES], self.root[number % POSES].astype(np.float32)
            frame = Frame(number, pose[1], pose[0], prompt=len(self.prompts) - 1, last=last)
            self.made.append(encode_frame(frame))

    def _end(self, state: str, reason: str) -> None:
        if self.state not in ("ended", "failed"):
            self.state, self.reason, self.position = state, reason, None

    # --- what a socket does ---

    def show(self, connection: Connection, request: Request) -> None:
        """Serve one socket."""
        parts = urlsplit(request.path)
        query = {name: values[0] for name, values in parse_qs(parts.query).items()}
        with self.changed:
            self.opened.append((parts.path, query, dict(request.headers.raw_items())))
            self.changed.notify_all()
        if self.plan.closes:
            connection.close(*self.plan.closes.pop(0))
            return
        threading.Thread(target=self._listen, args=(connection,), daemon=True).start()
        self._tell(connection, max(0, int(query["from"]) - self.plan.again))

    def _listen(self, connection: Connection) -> None:
        try:
            for message in connection:
                self.apply(json.loads(message))
        except ConnectionClosed:
            pass

    def _tell(self, connection: Connection, at: int) -> None:
        told: object = None
        for message in self.plan.told:
            connection.send(message if isinstance(message, bytes | str) else json.dumps(message))
        while not self._over:
            with self.changed:
                view = self.view()
                standing = (view["state"], view["position"], len(view["prompts"]))
                if standing == told and at >= len(self.made) and self.state in ("waiting", "live", "paused"):
                    self.changed.wait(1.0)
                    continue
                frames = self.made[at:]
            if standing != told:
                connection.send(json.dumps({"type": "stream", "stream": view}))
                told = standing
            while frames:
                if at in self.plan.drops:
                    self.plan.drops.remove(at)
                    connection.socket.shutdown(socket.SHUT_RDWR)
                    return
                skipped = self.plan.gaps.pop(at, 0)
                if skipped:
                    connection.send(json.dumps({"type": "gap", "first": at, "count": skipped}))
                skipped = skipped or self.plan.silent.pop(at, 0)
                if not skipped:
                    connection.send(frames[0])
                at, frames = at + max(1, skipped), frames[max(1, skipped) :]
            if view["state"] in ("ended", "failed") and at >= len(self.made):
                connection.send(json.dumps({"type": "end", "stream": view}))
                connection.close()
                return

    # --- what else is asked for ---

    def answer(self, path: str) -> Any:
        """JSON, bytes, or None where there is nothing."""
        counters = dict.fromkeys(("ready", "leased", "succeeded", "failed", "dead", "cancelled"), 0)
        item = {
            "id": "item",
            "job": JOB,
            "index": 0,
            "name": None,
            "tags": [],
            "prompt": "a person walks",
            "variant": 0,
            "seed": 7,
            "model": "stroller",
            "bundle": "stroller-x",
            "state": "succeeded",
            "error": None,
            "replaces": None,
            "motion": {
                "id": "motion",
                "files": [
                    {"format": name, "sha256": hashlib.sha256(data).hexdigest(), "size": len(data)}
                    for name, data in FILES.items()
                ],
            },
        }
        return {
            f"/v1/jobs/{JOB}": {
                "id": JOB,
                "name": None,
                "state": "succeeded",
                "total": 1,
                "counters": {**counters, "succeeded": 1},
            },
            f"/v1/jobs/{JOB}/items": {"items": [item], "next": None},
            **{f"/v1/motions/motion/files/{name}": data for name, data in FILES.items()},
        }.get(path)


def _handler(server: StreamServer) -> type[_Handler]:
    class Handler(_Handler):
        streams = server

    return Handler


class _Handler(BaseHTTPRequestHandler):
    streams: StreamServer

    def handle(self) -> None:
        head = self._head()
        if b"upgrade: websocket" not in head.lower():
            super().handle()
            return
        protocol = ServerProtocol(subprotocols=[Subprotocol("marey.stream.v1")])
        protocol.receive_data(self.connection.recv(len(head)))
        (request,) = protocol.events_received()
        assert isinstance(request, Request)
        protocol.send_response(protocol.accept(request))
        self.connection.sendall(b"".join(protocol.data_to_send()))
        connection = Connection(self.connection, protocol, close_timeout=2)
        try:
            self.streams.show(connection, request)
        except (ConnectionClosed, OSError):
            pass
        finally:
            connection.close()
            connection.wait_closed(5)

    def _head(self) -> bytes:
        head = b""
        while b"\r\n\r\n" not in head:
            seen = self.connection.recv(65536, socket.MSG_PEEK)
            if len(seen) == len(head):
                time.sleep(0.001)
            if not seen:
                return b""
            head = seen
        return head[: head.index(b"\r\n\r\n") + 4]

    def do_POST(self) -> None:
        body = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
        if self.path == f"/v1/streams/{STREAM}/end" and self.headers["Authorization"] == f"Bearer {KEY}":
            self.streams.apply({"kind": "stop", **body})
            self._send(202, self.streams.view())
        elif self.path != "/v1/streams":
            self._send(404, {"type": "urn:marey:problem:not-found", "detail": "nothing here"})
        elif self.headers["Authorization"] != f"Bearer {KEY}":
            self._send(401, {"type": "urn:marey:problem:unauthenticated", "detail": "no such key"})
        elif self.streams.plan.begin is not None:
            self.streams.begun.append(body)
            self._send(*self.streams.plan.begin)
        else:
            self._send(201, self.streams.begin(body))

    def do_GET(self) -> None:
        found = self.streams.answer(urlsplit(self.path).path)
        if found is None:
            self._send(404, {"type": "urn:marey:problem:not-found", "detail": "nothing here"})
        else:
            self._send(200, found)

    def _send(self, status: int, content: Any) -> None:
        data = content if isinstance(content, bytes) else json.dumps(content).encode()
        self.send_response(status)
        self.send_header("Content-Length", str(len(data)))
        if status == 429:
            self.send_header("Retry-After", "30")
        self.end_headers()
        self.wfile.write(data)

    def log_message(self, *_: object) -> None:
        pass
