"""A small server for a browser (docs/reference/streams.md): a drawn walk in place of a model, and ways to trouble it.

It serves the real page by the real route. Its streams are the walker of tests/support/walker.py; a steer turns it.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import socket
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import uvicorn
from fastapi import FastAPI, Request, WebSocket
from fastapi.responses import JSONResponse, Response
from starlette.websockets import WebSocketDisconnect

from marey.api.catalogue import Catalogue
from marey.api.live.routes import router
from marey.core.disposition import attachment
from marey.core.settings import Settings
from marey.motion.clip import MotionClip
from marey.motion.skeleton import HUMANML3D, Skeleton
from marey.streams.frames import Frame, encode_frame
from tests.support.walker import walker

KEY = "marey_01234567_" + 43 * "k"
READER = "marey_89abcdef_" + 43 * "r"
FPS = 20
SECONDS = 60
PROTOCOL = "marey.stream.v1"


@dataclass
class Walk:
    """One stream."""

    id: str
    prompt: str
    skeleton: Skeleton
    clip: MotionClip
    prompts: list[dict[str, Any]] = field(default_factory=list)
    state: str = "waiting"
    position: int | None = 1
    frames: list[bytes] = field(default_factory=list)
    job: str | None = None

    def view(self) -> dict[str, Any]:
        """As the API shows it."""
        return {
            "id": self.id,
            "prompt": self.prompt,
            "prompts": self.prompts,
            "state": self.state,
            "position": self.position,
            "reason": "stopped" if self.state == "ended" else None,
            "error": None,
            "fps": float(FPS),
            "frames": len(self.frames),
            "max_frames": FPS * SECONDS,
            "job": self.job,
            "skeleton": {
                "names": list(self.skeleton.joint_names),
                "parents": list(self.skeleton.parents),
                "offsets": [[round(float(x), 6) for x in offset] for offset in self.skeleton.offsets],
            },
        }

    def make(self, *, last: bool = False) -> None:
        """One more frame."""
        t = len(self.frames)
        contacts = tuple(bool(c) for c in self.clip.contacts[t])
        number = max((p["number"] for p in self.prompts if p["frame"] <= t), default=0)
        frame = Frame(t, self.clip.root[t], self.clip.rotations[t], contacts, number, last)  # type: ignore[arg-type]
        self.frames.append(encode_frame(frame))


class WalkingServer:
    """Streams walk as long as they have a viewer.

    Attributes:
        opened: the `from` of every socket that was opened.
        bodies: of every stream that was asked for.
        heard: every message of a client.
        full: answer 429 to who wants a stream.
        burst: frames that come at once.
        hold: streams keep waiting.
        skip: frames that are left out, with a gap, before the next one.
        skeleton: that streams to come tell of; they walk as HumanML3D's.
        asked: how often the motions of the clip's job were listed.
        flags: faults in the quality record of the clip.
    """

    def __init__(self) -> None:
        self.opened: list[int] = []
        self.bodies: list[dict[str, Any]] = []
        self.heard: list[dict[str, Any]] = []
        self.full, self.hold, self.burst, self.skip = False, False, 1, 0
        self.skeleton = HUMANML3D
        self.url = ""
        self.asked = 0
        self.flags: list[str] = []
        self._walks: dict[str, Walk] = {}
        self._sockets: set[WebSocket] = set()
        self._loop: asyncio.AbstractEventLoop | None = None

    @property
    def walk(self) -> Walk:
        """The newest stream."""
        return list(self._walks.values())[-1]

    def drop(self, code: int = 1012) -> None:
        """Break off every socket."""
        assert self._loop is not None

        async def close() -> None:
            for each in list(self._sockets):
                await each.close(code)

        asyncio.run_coroutine_threadsafe(close(), self._loop).result(20)

    def app(self) -> FastAPI:
        """The page, the routes and the socket."""
        app = FastAPI(openapi_url=None)
        app.state.catalogue = Catalogue(Settings())
        app.include_router(router)
        app.add_api_route("/v1/jobs/job-of-the-clip/motions", self._motions, methods=["GET"])
        app.add_api_route("/v1/motions/motion-of-the-clip/files/{format}", self._file, methods=["GET"])
        app.add_api_route("/v1/streams", self._begin, methods=["POST"])
        app.add_api_route("/v1/streams/{stream}", self._show, methods=["GET"])
        app.add_api_route("/v1/streams/{stream}/end", self._end, methods=["POST"])
        app.add_api_websocket_route("/v1/streams/{stream}", self._watch)
        return app

    async def _begin(self, request: Request) -> JSONResponse:
        key = request.headers.get("authorization", "").removeprefix("Bearer ")
        if key == READER:
            return _problem(403, "the key 'reader' lacks the scope 'submit'", "Use a key that has it.")
        if key != KEY:
            return _problem(401, "this API key is unknown or revoked", "Make one: `marey admin keys create`.")
        if self.full:
            return _problem(429, "the key has 4 open streams, and may have no more", "Stop one.", retry=30)
        body = await request.json()
        self.bodies.append(body)
        clip = walker(seconds=SECONDS, turn=0.35)
        walk = Walk(f"walk-{len(self._walks)}", body["prompt"], self.skeleton, clip)
        walk.prompts.append({"number": 0, "frame": 0, "prompt": walk.prompt})
        self._walks[walk.id] = walk
        return JSONResponse(walk.view(), 201)

    async def _motions(self, request: Request) -> JSONResponse:
        """The clip's motion; it is not there when it is asked for first."""
        self.asked += 1
        if request.headers.get("authorization") != f"Bearer {KEY}":
            return _problem(401, "this API key is unknown or revoked", "")
        files = [{"format": "npz"}, {"format": "bvh"}]
        quality = {"flags": self.flags, "ok": not self.flags}
        motion = [{"id": "motion-of-the-clip", "files": files, "quality": quality}] if self.asked > 1 else []
        return JSONResponse({"items": motion, "next": None})

    async def _file(self, request: Request, format: str) -> Response:
        if request.headers.get("authorization") != f"Bearer {KEY}":
            return _problem(401, "this API key is unknown or revoked", "")
        header = {"Content-Disposition": attachment(f"歩く.{format}")}
        return Response(f"content of {format}".encode(), headers=header)

    async def _show(self, stream: str) -> JSONResponse:
        walk = self._walks.get(stream)
        return JSONResponse(walk.view()) if walk else _problem(404, "there is no such stream", "")

    async def _end(self, request: Request, stream: str) -> JSONResponse:
        """It ends at once, whatever the pose; it knows one motion."""
        if request.headers.get("authorization") != f"Bearer {KEY}":
            return _problem(401, "this API key is unknown or revoked", "")
        pose = (await request.json())["pose"]
        if pose["motion"]["id"] != "motion-of-the-clip":
            return _problem(422, "there is no such motion", "List motions.")
        self.heard.append({"kind": "end", "pose": pose})
        self._walks[stream].state = "ended"
        return JSONResponse(self._walks[stream].view(), 202)

    async def _watch(self, websocket: WebSocket, stream: str) -> None:
        self._loop = asyncio.get_running_loop()
        offered = websocket.scope["subprotocols"]
        await websocket.accept(PROTOCOL if PROTOCOL in offered else None)
        if f"marey.key.{KEY}" not in offered:
            await websocket.close(4401, "this API key is unknown or revoked")
            return
        walk = self._walks.get(stream)
        if walk is None:
            await websocket.close(4404, "there is no such stream")
            return
        self._sockets.add(websocket)
        self.opened.append(int(websocket.query_params["from"]))
        listening = asyncio.create_task(self._listen(websocket, walk))
        try:
            await self._play(websocket, walk, self.opened[-1])
        except (WebSocketDisconnect, RuntimeError):
            pass
        finally:
            listening.cancel()
            self._sockets.discard(websocket)

    async def _listen(self, websocket: WebSocket, walk: Walk) -> None:
        with contextlib.suppress(WebSocketDisconnect):
            while True:
                message = json.loads(await websocket.receive_text())
                self.heard.append(message)
                if message["kind"] == "steer" and "\u2603" in message["prompt"]:
                    problem = {"status": 422, "detail": "the prompt cannot be used", "hint": "Use words."}
                    await websocket.send_json({"type": "error", "problem": problem})
                elif message["kind"] == "steer":
                    row = {"number": len(walk.prompts), "frame": len(walk.frames) + 5, "prompt": message["prompt"]}
                    walk.prompts.append(row)
                else:
                    walk.state = {"pause": "paused", "resume": "live", "stop": "ended"}[message["kind"]]

    async def _play(self, websocket: WebSocket, walk: Walk, at: int) -> None:
        told: object = None
        due = time.monotonic() + 0.5  # it waits a moment before a worker has it
        while True:
            if walk.state == "waiting" and not self.hold and time.monotonic() > due:
                walk.state, walk.position = "live", None
            news = (walk.state, walk.position, len(walk.prompts))
            if news != told and walk.state != "ended":
                await websocket.send_json({"type": "stream", "stream": walk.view()})
                told = news
            if self.skip:
                for _ in range(self.skip):
                    walk.make()
                await websocket.send_json({"type": "gap", "first": at, "count": self.skip})
                at, self.skip = len(walk.frames), 0
            if walk.state == "live":
                for _ in range(self.burst):
                    walk.make()
            if walk.state == "ended":
                walk.make(last=True)
                walk.job = "job-of-the-clip"
            for frame in walk.frames[at:]:
                await websocket.send_bytes(frame)
            at = max(at, len(walk.frames))
            if walk.state == "ended":
                await websocket.send_json({"type": "end", "stream": walk.view()})
                await websocket.close(1000)
                return
            await asyncio.sleep(self.burst / FPS)


def _problem(status: int, detail: str, hint: str, *, retry: int | None = None) -> JSONResponse:
    headers = {"Retry-After": str(retry)} if retry else None
    return JSONResponse({"status": status, "detail": detail, "hint": hint}, status, headers)


@contextlib.contextmanager
def walking_server() -> Iterator[WalkingServer]:
    """Serve until the end of the block."""
    server = WalkingServer()
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    config = uvicorn.Config(server.app(), port=port, log_level="warning", timeout_graceful_shutdown=1)
    running = uvicorn.Server(config)
    thread = threading.Thread(target=running.run, daemon=True)
    thread.start()
    deadline = time.monotonic() + 30
    while not running.started:
        assert time.monotonic() < deadline, "the server does not start"
        assert thread.is_alive(), "the server ended"
        time.sleep(0.02)
    server.url = f"http://127.0.0.1:{port}"
    try:
        yield server
    finally:
        running.should_exit = True
        thread.join(20)
