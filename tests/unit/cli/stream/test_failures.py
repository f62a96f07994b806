"""Failures of `marey stream`: message, exit code, files kept."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from marey.core.errors import Conflict
from tests.support.marey import REPOSITORY
from tests.support.streaming import PROMPT, SLOW, environ, frames_of, run


def test_a_stream_that_fails_is_6_with_its_reason_and_keeps_its_frames(serve: Any, tmp_path: Path) -> None:
    path = tmp_path / "clip.bvh"
    ran = run(serve(fails=12), "-o", path, "--json")
    ran.refused(6, "the worker is out of memory", "Try again.")
    assert (ran.lines[-1]["state"], ran.lines[-1]["reason"]) == ("failed", "the worker died")
    assert frames_of(path) == 12


def test_a_key_with_too_many_streams_is_5_and_asks_once(serve: Any) -> None:
    problem = {"type": "urn:marey:problem:busy", "detail": "4 streams are open", "hint": "Stop one."}
    server = serve(begin=(429, problem))
    run(server).refused(5, "4 streams are open", "Stop one.")
    assert len(server.begun) == 1


def test_a_wrong_key_is_5(serve: Any) -> None:
    run(serve(), key="marey_00000000_wrong").refused(5, "no such key")


@pytest.mark.parametrize(("close", "code"), [(4401, 5), (4403, 5), (4404, 3), (4422, 2)])
def test_a_socket_that_is_refused_is_told_as_the_error_it_is(close: int, code: int, serve: Any) -> None:
    ran = run(serve(closes=[(close, "because of you")]), "--json")
    ran.refused(code, "because of you")
    assert ran.lines[-1]["type"] == "end"


def test_a_message_that_cannot_be_used_is_told_and_the_stream_goes_on(serve: Any) -> None:
    problem = {"type": "urn:marey:problem:invalid-input", "detail": "the prompt is empty"}
    told = [{"type": "error", "problem": problem}, {"type": "news of a later release"}]
    ran = run(serve(told=told), "--json").ok()
    assert "The server says: the prompt is empty" in ran.err
    assert [line["problem"] for line in ran.lines if line["type"] == "error"] == [problem]


@pytest.mark.parametrize(
    ("told", "said"),
    [
        (b"GIF89a" + bytes(300), "not a frame of a Marey"),
        ({"type": "gap", "first": 1}, "lacks something: KeyError"),
    ],
)
def test_a_server_that_speaks_otherwise_is_2_and_the_stream_is_stopped(told: Any, said: str, serve: Any) -> None:
    server = serve(**SLOW, told=[told])
    run(server).refused(2, said)
    server.until(lambda: server.messages == [{"kind": "stop"}])


def test_a_file_that_cannot_be_written_any_more_is_2_and_the_stream_is_stopped(
    serve: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    server, path = serve(**SLOW), tmp_path / "clip.bvh"

    def add(*_: object, **__: object) -> None:
        raise Conflict("the disk is full", where=str(path))

    monkeypatch.setattr("marey.motion.io.bvh_live.LiveBVH.add", add)
    ran = run(server, "-o", path, "--json")
    ran.refused(2, "the disk is full")
    assert ran.lines[-1]["file"] is None
    server.until(lambda: server.messages == [{"kind": "stop"}])


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("-o", "there.bvh"), "already exists"),
        (("-o", "clip.npz"), "only a .bvh"),
        (("-o", "none/clip.bvh"), "cannot be written"),
        (("--fetch", "there.bvh"), "cannot write here"),
        (("--seconds", "nan"), "nan seconds"),
        (("--seconds", "0"), "0 seconds"),
        (("--seed", "-1"), "seed"),
        (("--name", "../x"), "file name"),
        (("--model", "stroller starter"), "model"),
    ],
)
def test_what_cannot_be_is_2_before_anything_begins(
    arguments: tuple[str, ...], said: str, serve: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("there.bvh").write_text("old")
    server = serve()
    run(server, *arguments).refused(2, said)
    assert server.begun == []
    assert Path("there.bvh").read_text() == "old"


def test_a_prompt_without_words_is_2(serve: Any) -> None:
    server = serve()
    run(server, prompt="  ").refused(2, "empty")
    assert server.begun == []


def test_an_existing_file_is_replaced_when_asked(serve: Any, tmp_path: Path) -> None:
    path = tmp_path / "clip.bvh"
    path.write_text("old")
    run(serve(), "-o", path, "--overwrite").ok()
    assert frames_of(path) == 30


def test_a_client_without_numpy_watches_but_writes_no_file(serve: Any, tmp_path: Path) -> None:
    server = serve(frames=5)
    code = "import sys; sys.modules['numpy'] = None; from marey.cli.main import run; run()"
    command = [sys.executable, "-c", code, "stream", PROMPT, "--json"]
    options = {"cwd": REPOSITORY, "env": environ(server, tmp_path), "stdin": subprocess.DEVNULL, "timeout": 60}
    done = subprocess.run(command, capture_output=True, check=True, **options)
    assert json.loads(done.stdout.splitlines()[-1])["frames"] == 5
    done = subprocess.run([*command, "-o", "a.bvh"], capture_output=True, check=False, **options)
    assert done.returncode == 2
    assert b"pip install 'marey[motion]'" in done.stderr
