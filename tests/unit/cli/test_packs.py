"""Many small files in one request, from servers that send what they should and what they should not."""

from __future__ import annotations

import hashlib
import io
import json
import tarfile
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import pytest

from marey.client import packs
from marey.client.downloads import download_all
from marey.client.file_to_fetch import FileToFetch
from marey.client.packs import MOST, SMALL, packs_of
from marey.client.server_address import Server
from marey.client.transport import Transport

Members = Sequence[tuple[str, bytes]]
CONTENTS = {f"m{n}.{ending}": f"{ending} of {n}".encode() * 100 for n in range(5) for ending in ("npz", "bvh")}


def tar_of(members: Members) -> bytes:
    whole = io.BytesIO()
    with tarfile.open(fileobj=whole, mode="w") as tar:
        for name, content in members:
            member = tarfile.TarInfo(name)
            member.size = len(content)
            tar.addfile(member, io.BytesIO(content))
    return whole.getvalue()


class Files(BaseHTTPRequestHandler):
    """Sends files one by one, and packs of them as `answer` says."""

    answer: Callable[[Members], bytes | None] = staticmethod(tar_of)
    """The body of a pack; None = the server knows no packs."""
    asked: list[str]

    def do_GET(self) -> None:
        _, _, _, motion, _, ending = self.path.split("/")
        self.asked.append(f"{motion}.{ending}")
        self._send(200, CONTENTS[f"{motion}.{ending}"])

    def do_POST(self) -> None:
        wanted = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
        names = [f"{motion}.{ending}" for motion in wanted["motions"] for ending in wanted["formats"]]
        self.asked.append("pack")
        body = type(self).answer([(name, CONTENTS[name]) for name in names])
        self._send(405 if body is None else 200, body or b"")

    def _send(self, status: int, body: bytes) -> None:
        self.send_response(status)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *_: object) -> None:
        pass


@contextmanager
def serving(answer: Callable[[Members], bytes | None]) -> Iterator[tuple[Transport, list[str]]]:
    """A client of such a server, and what is asked of it."""
    handler = type("Handler", (Files,), {"answer": staticmethod(answer), "asked": []})
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        with Transport(Server(f"http://127.0.0.1:{server.server_port}", "key")) as client:
            yield client, handler.asked  # type: ignore[attr-defined]
        server.shutdown()


def wanted(folder: Path, **more: Any) -> list[FileToFetch]:
    found: list[FileToFetch] = []
    for name, content in CONTENTS.items():
        motion, ending = name.split(".")
        url = f"/v1/motions/{motion}/files/{ending}"
        found.append(FileToFetch(url, hashlib.sha256(content).hexdigest(), len(content), folder / name, **more))
    return found


def fetched(client: Transport, folder: Path) -> list[str]:
    """Fetch all, and return the names that were told, in order."""
    told: list[str] = []
    download_all(client, wanted(folder), overwrite=False, done=lambda file: told.append(file.path.name))
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == CONTENTS
    return sorted(told)


def test_many_small_files_come_by_one_request(tmp_path: Path) -> None:
    with serving(tar_of) as (client, asked):
        assert fetched(client, tmp_path) == sorted(CONTENTS)
        assert asked == ["pack"]
        assert fetched(client, tmp_path) == sorted(CONTENTS)
    assert asked == ["pack"], "those that are there are not asked for"


ANSWERS: dict[str, Callable[[Members], bytes | None]] = {
    "a server without packs": lambda _: None,
    "no tar": lambda _: b"<html>a page</html>" * 100,
    "nothing": lambda _: b"",
    "a tar that ends early": lambda members: tar_of(members)[:3000],
    "others beside them": lambda members: tar_of([("../../evil", b"x"), *members]),
    "files that lead out": lambda members: tar_of([(f"../{name}", content) for name, content in members]),
    "another content": lambda members: tar_of([(name, content[::-1]) for name, content in members]),
    "another size": lambda members: tar_of([(name, content + b"x") for name, content in members]),
    "one of them twice": lambda members: tar_of([members[0], members[0], *members[1:]]),
    "more than was asked for": lambda members: tar_of(members) + bytes(2**20),
}


@pytest.mark.parametrize("answer", ANSWERS)
def test_what_no_pack_brings_is_fetched_file_by_file(tmp_path: Path, answer: str) -> None:
    folder = tmp_path / "in" / "here"
    folder.mkdir(parents=True)
    with serving(ANSWERS[answer]) as (client, asked):
        assert fetched(client, folder) == sorted(CONTENTS)
    assert asked[0] == "pack"
    singly = asked[1:]
    assert len(set(singly)) == len(singly)
    if answer not in ("one of them twice", "more than was asked for", "a tar that ends early"):
        assert sorted(singly) == sorted(CONTENTS)
    assert [path.name for path in tmp_path.rglob("*") if path.is_dir()] == ["in", "here"]
    assert not list(tmp_path.glob("evil*"))


def test_a_pack_is_read_no_further_than_what_was_asked_for() -> None:
    chunks = iter([bytes(100)] * 50)
    reader = packs._Reader(chunks, 1000)  # pyright: ignore[reportPrivateUsage]
    with pytest.raises(packs.InvalidFile, match="more than was asked for"):
        reader.read(10_000)
    assert sum(map(len, chunks)) == 100 * (50 - 11)


def test_files_of_a_motion_are_in_one_pack_and_large_ones_are_alone(tmp_path: Path) -> None:
    def file(motion: int, ending: str, size: int = 100) -> FileToFetch:
        return FileToFetch(f"/v1/motions/{motion}/files/{ending}", "0" * 64, size, tmp_path / f"{motion}.{ending}")

    small = [file(motion, ending) for motion in range(50) for ending in ("npz", "bvh")]
    large = [file(100, "mp4", SMALL + 1), file(101, "npz", SMALL), file(101, "bvh")]
    made = FileToFetch("/v1/motions/7/files/glb", "", 0, tmp_path / "7.glb", asked={"rig": "hero"})
    report = FileToFetch("/v1/evaluations/7/report/html", "0" * 64, 100, tmp_path / "7.html")
    only = [file(motion, "npz") for motion in (200, 201)]
    found = packs_of([*small, *large, made, report, *only])
    assert sorted(file.url for pack in found for file in pack) == sorted(
        each.url for each in [*small, *large, made, report, *only]
    )
    assert [len(pack) for pack in found] == [MOST, 38, 1, 1, 1, 1, 1]
    for pack in found[:2]:
        motions = [each.motion for each in pack]
        assert all(motions.count(motion) == 2 for motion in motions)
    assert [pack[0] for pack in found[2:4]] == only


def test_packs_stay_below_a_size(tmp_path: Path) -> None:
    files = [
        FileToFetch(f"/v1/motions/{motion}/files/npz", "0" * 64, SMALL, tmp_path / f"{motion}.npz")
        for motion in range(40)
    ]
    assert [len(pack) for pack in packs_of(files)] == [16, 16, 8]
