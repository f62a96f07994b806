"""Run by `test_full_disk.py`: tries to write more than the limit allows, and prints what came of it as JSON."""

from __future__ import annotations

import hashlib
import json
import resource
import sys
import tempfile
import threading
from collections.abc import Callable
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import numpy as np

from marey.client.downloads import download_all
from marey.client.file_to_fetch import FileToFetch
from marey.client.lines import Lines
from marey.client.manifest import COLUMNS, write_manifest
from marey.client.server_address import Server
from marey.client.transport import Transport
from marey.core.errors import MareyError
from marey.core.hashing import sha256_of
from marey.core.spool import IN_MEMORY
from marey.motion.files import write_atomically
from marey.motion.io.bvh import read_bvh
from marey.motion.io.bvh_live import LiveBVH
from marey.motion.skeleton import HUMANML3D
from marey.storage import FolderStore, NewObject

FOLDER, LIMIT = Path(sys.argv[1]), int(sys.argv[2])
BIG = hashlib.shake_128(b"marey").digest(4 * LIMIT)
KEY = f"t/default/aa/{hashlib.sha256(BIG).hexdigest()}"


def limit(size: int) -> None:
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, resource.getrlimit(resource.RLIMIT_FSIZE)[1]))


def attempt(name: str, act: Callable[[Path], object], size: int = LIMIT) -> dict[str, Any]:
    """Error of an operation on a full disk, and the files it leaves."""
    folder = FOLDER / name
    folder.mkdir(exist_ok=True)
    limit(size)
    try:
        act(folder)
    except MareyError as error:
        said = {"kind": type(error).__name__, "said": str(error)}
    else:
        said = {"kind": None, "said": ""}
    finally:
        limit(resource.RLIM_INFINITY)
    return {**said, "left": left(folder)}


def left(folder: Path) -> list[str]:
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())


class Files(BaseHTTPRequestHandler):
    """Gives `BIG`, from the byte that is asked for."""

    asked: list[str] = []

    def do_GET(self) -> None:
        wanted = self.headers.get("Range", "bytes=0-")
        self.asked.append(wanted)
        start = int(wanted.removeprefix("bytes=").removesuffix("-"))
        self.send_response(206 if start else 200)
        self.send_header("Content-Length", str(len(BIG) - start))
        self.end_headers()
        self.wfile.write(BIG[start:])

    def log_message(self, *_: object) -> None:
        pass


def fetch(folder: Path, port: int) -> None:
    wanted = FileToFetch("/file", hashlib.sha256(BIG).hexdigest(), len(BIG), folder / "clip.npz")
    with Transport(Server(f"http://127.0.0.1:{port}", "key")) as client:
        download_all(client, [wanted], overwrite=False, done=lambda _: None)


def stream(folder: Path, frames: list[int]) -> None:
    turns = np.tile([1.0, 0.0, 0.0, 0.0], (len(HUMANML3D.parents), 1))
    with LiveBVH.open(folder / "live.bvh", HUMANML3D, 20.0) as file:
        for number in range(10_000):
            file.add(turns, (0.001 * number, 1.0, 0.0))
            frames[0] = file.frames


def submit(folder: Path, size: int) -> None:
    tempfile.tempdir = str(folder)
    prompt = {"prompt": "a person walks"}
    with Lines([prompt] * (size // len(json.dumps(prompt)))):
        raise AssertionError("there was room")


def main() -> None:
    told: dict[str, Any] = {}
    store = FolderStore(FOLDER / "put")
    told["put"] = attempt("put", lambda _: store.put(KEY, BIG))
    store = FolderStore(FOLDER / "put_all")
    small = NewObject(f"t/default/bb/{hashlib.sha256(b'x').hexdigest()}", b"x")
    told["put_all"] = attempt("put_all", lambda _: list(store.put_all([small, NewObject(KEY, BIG)])))
    told["page"] = attempt("page", lambda folder: write_atomically(folder / "page.html", BIG))
    told["npz"] = attempt("npz", lambda folder: write_atomically(folder / "clip.npz", BIG))
    rows = [dict.fromkeys(COLUMNS, "walk") for _ in range(1000)]
    told["manifest"] = attempt("manifest", lambda folder: write_manifest(folder, "job", rows))
    (FOLDER / "replaced").mkdir()
    (FOLDER / "replaced" / "old.html").write_text("old")
    told["replaced"] = attempt("replaced", lambda folder: write_atomically(folder / "old.html", BIG))
    told["replaced"]["content"] = (FOLDER / "replaced" / "old.html").read_text()
    server = ThreadingHTTPServer(("127.0.0.1", 0), Files)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    told["fetch"] = attempt("fetch", lambda folder: fetch(folder, server.server_port))
    fetch(FOLDER / "fetch", server.server_port)
    whole = sha256_of(FOLDER / "fetch" / "clip.npz") == hashlib.sha256(BIG).hexdigest()
    told["fetched"] = {"left": left(FOLDER / "fetch"), "whole": whole, "asked": Files.asked}
    frames = [0]
    told["stream"] = attempt("stream", lambda folder: stream(folder, frames))
    clip = read_bvh(FOLDER / "stream" / "live.bvh")
    told["stream"] |= {"written": frames[0], "read": len(clip.root)}
    told["prompts"] = attempt("prompts", lambda folder: submit(folder, 2 * IN_MEMORY))
    room = IN_MEMORY + LIMIT  # the last of them are still buffered when all are written
    told["last prompts"] = attempt("last prompts", lambda folder: submit(folder, room), room)
    print(json.dumps(told))


main()
