"""Fetched files that the server does not have: made of the npz."""

from __future__ import annotations

import hashlib
import threading
from collections.abc import Iterator
from dataclasses import replace
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import pytest

from marey.client.downloads import download_all
from marey.client.fetching import plan
from marey.client.server_address import Server
from marey.client.transport import Transport
from marey.core.errors import Conflict
from marey.exporters import Coordinates, exporter_of
from marey.motion.export_options import PLAIN, ExportOptions
from tests.support.walker import walker
from tests.unit.cli.test_fetching import ITEM

CLIP = walker(turn=0.3)
FILES = {name: exporter_of(name).encode(CLIP, Coordinates()) for name in ("npz", "bvh")}


class Stored(BaseHTTPRequestHandler):
    """Serves the npz and the BVH of one motion."""

    served: list[str] = []

    def do_GET(self) -> None:
        name = self.path.rpartition("/")[2]
        type(self).served.append(name)
        self.send_response(200)
        self.send_header("Content-Length", str(len(FILES[name])))
        self.end_headers()
        self.wfile.write(FILES[name])

    def log_message(self, *_: object) -> None:
        pass


@pytest.fixture
def client() -> Iterator[Transport]:
    Stored.served = []
    with ThreadingHTTPServer(("127.0.0.1", 0), Stored) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        with Transport(Server(f"http://127.0.0.1:{server.server_port}", "key")) as client:
            yield client
        server.shutdown()


def item() -> dict[str, Any]:
    files = [
        {"format": name, "sha256": hashlib.sha256(data).hexdigest(), "size": len(data)} for name, data in FILES.items()
    ]
    return {**ITEM, "motion": {"id": "m", "files": files}}


def fetch(
    client: Transport, folder: Path, formats: list[str] | None, root: ExportOptions = PLAIN, *, overwrite: bool = False
) -> dict[str, bytes]:
    ((_, downloads),) = plan([item()], folder, formats, "a", export=root)
    download_all(client, downloads, overwrite=overwrite, done=lambda _: None)
    assert sorted(path.name for path in folder.iterdir()) == sorted(file.path.name for file in downloads)
    return {file.format: file.path.read_bytes() for file in downloads}


def test_a_format_that_the_server_does_not_have_is_made(client: Transport, tmp_path: Path) -> None:
    assert fetch(client, tmp_path, ["glb", "bvh"]) == {
        "glb": exporter_of("glb").encode(CLIP, Coordinates()),
        "bvh": FILES["bvh"],
    }
    assert sorted(Stored.served) == ["bvh", "npz"]


def test_files_that_have_the_option_are_made_and_others_fetched(client: Transport, tmp_path: Path) -> None:
    made = fetch(client, tmp_path, None, ExportOptions(root_bone=True))
    assert made == {"npz": FILES["npz"], "bvh": exporter_of("bvh").encode(CLIP, Coordinates(root_bone=True))}
    assert Stored.served == ["npz", "npz"]
    assert fetch(client, tmp_path, None, ExportOptions(root_bone=True)) == made


def test_a_made_file_replaces_another_only_on_request(client: Transport, tmp_path: Path) -> None:
    plain = fetch(client, tmp_path, ["bvh"])
    with pytest.raises(Conflict, match="holds something else"):
        fetch(client, tmp_path, ["bvh"], ExportOptions(tpose_frame=True))
    assert [path.read_bytes() for path in tmp_path.iterdir()] == [plain["bvh"]]
    assert fetch(client, tmp_path, ["bvh"], ExportOptions(tpose_frame=True), overwrite=True) != plain


def test_a_format_that_is_known_nowhere_is_refused(tmp_path: Path) -> None:
    with pytest.raises(Conflict, match="was not made as abc"):
        plan([item()], tmp_path, ["abc"])


def test_without_an_npz_no_file_can_be_made(tmp_path: Path) -> None:
    alone = replace_files(item(), "bvh")
    with pytest.raises(Conflict, match="was not made as glb"):
        plan([alone], tmp_path, ["glb"])


def replace_files(given: dict[str, Any], kept: str) -> dict[str, Any]:
    files = [file for file in given["motion"]["files"] if file["format"] == kept]
    return {**given, "motion": {**given["motion"], "files": files}}


def test_a_clip_keeps_its_placement_on_request(client: Transport, tmp_path: Path, monkeypatch) -> None:
    moved = replace(CLIP, manifest={"placement": {"x": 1.0, "z": 2.0, "heading": 0.0}})
    monkeypatch.setitem(FILES, "npz", moved.to_npz())
    kept = ExportOptions(placement="keep")
    assert fetch(client, tmp_path, ["bvh"], kept)["bvh"] == exporter_of("bvh").encode(moved, Coordinates.of(kept))
