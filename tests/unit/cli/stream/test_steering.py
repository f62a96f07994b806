"""Typed and piped input of `marey stream`, and its end."""

from __future__ import annotations

import contextlib
import os
import pty
import signal
import threading
import time
from pathlib import Path
from typing import Any

from marey.motion.keyframes import pose_of
from tests.support.streaming import PROMPT, SLOW, check_frames, environ, frames_of, is_live
from tests.support.walker import walker

# --- what is typed and piped in ---


def test_lines_that_are_piped_in_steer_and_their_end_ends_nothing(serve: Any, start: Any) -> None:
    server = serve(**SLOW)
    running = start(server)
    running.until(is_live)
    running.type("", "a person runs", "/pause", "/nonsense")
    running.until(lambda event: event.get("state") == "paused")
    running.type("/resume")
    assert running.process.stdin is not None
    running.process.stdin.write(b"  a person jumps")  # and no end of line
    running.process.stdin.close()
    steered = running.until(lambda event: event["type"] == "prompt" and event["number"] == 2)
    assert steered["prompt"] == "a person jumps"
    made = len(server.made)
    server.until(lambda: len(server.made) > made + 20)
    assert running.process.poll() is None
    running.process.send_signal(signal.SIGINT)
    assert running.wait() == 130
    assert [message["kind"] for message in server.messages] == ["steer", "pause", "resume", "steer", "stop"]
    assert [prompt["prompt"] for prompt in running.end()["prompts"]] == [PROMPT, "a person runs", "a person jumps"]
    running.until_said("Not sent: '/nonsense'")


def test_a_stop_ends_a_stream_well(serve: Any, start: Any) -> None:
    running = start(serve(**SLOW))
    running.until(is_live)
    running.type("/stop")
    assert running.wait() == 0
    assert (running.end()["state"], running.end()["reason"]) == ("ended", "stopped by the client")


def test_a_stop_ends_a_stream_on_the_pose_of_a_file(serve: Any, start: Any, tmp_path: Path) -> None:
    clip = walker()
    clip.save_npz(tmp_path / "walk.npz")
    server = serve(**SLOW)
    running = start(server, "--end-pose", f"{tmp_path / 'walk.npz'}:5")
    running.until(is_live)
    running.type("/stop")
    assert running.wait() == 0
    (stop,) = server.messages
    assert (stop["kind"], stop["pose"]) == ("stop", pose_of(clip, 5))
    assert running.end()["state"] == "ended"


def test_a_pose_that_is_not_there_begins_no_stream(serve: Any, start: Any, tmp_path: Path) -> None:
    walker().save_npz(tmp_path / "walk.npz")
    server = serve(**SLOW)
    running = start(server, "--end-pose", f"{tmp_path / 'walk.npz'}:500")
    assert running.wait() == 2
    running.until_said("frame 500 is beyond the motion")
    assert server.begun == []


def test_a_stop_that_was_lost_with_its_connection_is_sent_again(serve: Any, start: Any) -> None:
    server = serve(**SLOW, deaf=True)
    running = start(server)
    running.until(is_live)
    running.type("/stop")
    server.until(lambda: server.messages)
    with server.changed:
        server.plan.deaf = False
        server.plan.drops.add(len(server.made) + 5)
    assert running.wait() == 0
    assert [message["kind"] for message in server.messages][:2] == ["stop", "stop"]


def test_a_terminal_shows_a_line_that_counts_and_takes_lines(serve: Any, start: Any, tmp_path: Path) -> None:
    server = serve(**SLOW)
    ours, theirs = pty.openpty()
    seen = bytearray()

    def watch() -> None:
        with contextlib.suppress(OSError):  # the other side is closed
            while block := os.read(ours, 4096):
                seen.extend(block)

    threading.Thread(target=watch, daemon=True).start()
    env = {**environ(server, tmp_path), "TERM": "xterm", "COLUMNS": "150"}
    running = start(server, stdin=theirs, stderr=theirs, env=env)
    os.close(theirs)
    running.until(is_live)
    until_seen(
        seen, b" fps  latency ", b"buffered 0", b"gaps 0", b"prompt 0: a person walks", b"/pause, /resume, /stop"
    )
    os.write(ours, b"a person jumps\n")
    server.until(lambda: server.messages == [{"kind": "steer", "prompt": "a person jumps"}])
    until_seen(seen, "› a person jumps".encode(), b"prompt 1: a person jumps")
    os.write(ours, b"/stop\n")
    assert running.wait() == 0
    assert running.end()["state"] == "ended"


def until_seen(seen: bytearray, *wanted: bytes) -> None:
    deadline = time.monotonic() + 60
    while not all(each in seen for each in wanted):
        assert time.monotonic() < deadline, bytes(seen)
        time.sleep(0.02)


# --- Ctrl-C and worse ---


def test_an_interrupt_stops_the_stream_and_waits_for_its_end(serve: Any, start: Any, tmp_path: Path) -> None:
    server, path = serve(**SLOW), tmp_path / "clip.bvh"
    running = start(server, "-o", path, "--fetch", tmp_path / "clips")
    server.until(lambda: len(server.made) > 20)
    running.until(is_live)
    running.process.send_signal(signal.SIGINT)
    assert running.wait() == 130
    end = running.end()
    assert (end["state"], end["file"]) == ("ended", str(path))
    assert end["frames"] == frames_of(path) == len(server.made)
    assert [message["kind"] for message in server.messages] == ["stop"]
    assert not list((tmp_path / "clips").iterdir())


def test_a_second_interrupt_leaves_at_once(serve: Any, start: Any, tmp_path: Path) -> None:
    server, path = serve(**SLOW, deaf=True), tmp_path / "clip.bvh"
    running = start(server, "-o", path)
    running.until(is_live)
    running.process.send_signal(signal.SIGINT)
    server.until(lambda: server.messages)
    made = len(server.made)
    server.until(lambda: len(server.made) > made + 20)
    assert running.process.poll() is None, "it waits"
    running.process.send_signal(signal.SIGINT)
    assert running.wait() == 130
    assert server.state == "live"
    assert frames_of(path) > made


def test_a_process_that_is_killed_leaves_a_whole_file(serve: Any, start: Any, tmp_path: Path) -> None:
    server, path = serve(**SLOW), tmp_path / "clip.bvh"
    running = start(server, "-o", path)
    server.until(lambda: path.exists() and path.read_bytes().count(b"\n") > 250)
    running.process.kill()
    assert running.wait() == -signal.SIGKILL
    check_frames(path, server, list(range(frames_of(path))))


def test_an_interrupt_while_the_stream_waits_takes_it_back(serve: Any, start: Any) -> None:
    server = serve(**SLOW, waiting=100_000)
    running = start(server)
    server.until(lambda: server.opened)
    running.process.send_signal(signal.SIGINT)
    assert running.wait() == 130
    assert running.end()["frames"] == 0
