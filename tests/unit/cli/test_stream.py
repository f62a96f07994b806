"""`marey stream` as a person and as a script run it, against a stand-in server."""

from __future__ import annotations

import contextlib
import json
import os
import pty
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from services.cli.main import app
from shared.errors import Conflict
from shared.motion.bvh import read_bvh
from shared.motion.kinematics import forward_kinematics
from shared.motion.skeleton import HUMANML3D
from tests.support.marey import COMMAND, REPOSITORY, Ran
from tests.support.stream_server import FILES, JOB, KEY, STREAM, Plan, StreamServer

PROMPT = "a person walks"
SLOW = {"speed": 100.0, "frames": 100_000}
"""A stream that goes on until it is stopped."""


@pytest.fixture
def serve(tmp_path: Path) -> Iterator[Callable[..., StreamServer]]:
    """A server with this plan."""
    with contextlib.ExitStack() as stack:
        yield lambda **plan: stack.enter_context(StreamServer(Plan(**plan)))


def environ(server: StreamServer, home: Path) -> dict[str, str]:
    kept = {name: value for name, value in os.environ.items() if not name.startswith("MAREY_")}
    return {**kept, "MAREY_HOME": str(home), "MAREY_SERVER": server.url, "MAREY_KEY": KEY, "OMP_NUM_THREADS": "1"}


def run(server: StreamServer, *arguments: object, prompt: str = PROMPT, key: str = KEY) -> Ran:
    """The command in this process, without stdin."""
    env = {"MAREY_SERVER": server.url, "MAREY_KEY": key}
    done = CliRunner().invoke(app, ["stream", prompt, *map(str, arguments)], env=env)
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise done.exception
    return Ran(done.exit_code, done.stdout, done.stderr)


@dataclass
class Running:
    """The command as a process of its own."""

    process: subprocess.Popen[bytes]
    events: list[dict[str, Any]] = field(default_factory=list)
    said: list[str] = field(default_factory=list)
    changed: threading.Condition = field(default_factory=threading.Condition)
    threads: list[threading.Thread] = field(default_factory=list)

    @classmethod
    def start(cls, server: StreamServer, home: Path, *arguments: object, **streams: Any) -> Running:
        streams = {
            "env": environ(server, home),
            "stdin": subprocess.PIPE,
            "stdout": subprocess.PIPE,
            "stderr": subprocess.PIPE,
            **streams,
        }
        command = [*COMMAND, "stream", PROMPT, "--json", *map(str, arguments)]
        running = cls(subprocess.Popen(command, cwd=REPOSITORY, **streams))
        running._follow(running.process.stdout, lambda line: running.events.append(json.loads(line)))
        if running.process.stderr is not None:
            running._follow(running.process.stderr, running.said.append)
        return running

    def _follow(self, stream: Any, take: Callable[[str], object]) -> None:
        def read() -> None:
            for line in stream:
                with self.changed:
                    take(line.decode())
                    self.changed.notify_all()

        self.threads.append(threading.Thread(target=read, daemon=True))
        self.threads[-1].start()

    def until(self, wanted: Callable[[dict[str, Any]], Any]) -> dict[str, Any]:
        """The first event that is so."""
        with self.changed:
            assert self.changed.wait_for(lambda: any(map(wanted, self.events)), 60), (self.events, self.said)
        return next(event for event in self.events if wanted(event))

    def until_said(self, text: str) -> None:
        with self.changed:
            assert self.changed.wait_for(lambda: any(text in line for line in self.said), 60), self.said

    def type(self, *lines: str) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write("".join(f"{line}\n" for line in lines).encode())
        self.process.stdin.flush()

    def wait(self) -> int:
        return self.process.wait(60)

    def end(self) -> dict[str, Any]:
        """Its last line; to be asked for when the process is over."""
        return self.until(lambda event: event["type"] == "end")


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[..., Running]]:
    started: list[Running] = []

    def begin(server: StreamServer, *arguments: object, **streams: Any) -> Running:
        started.append(Running.start(server, tmp_path, *arguments, **streams))
        return started[-1]

    yield begin
    for running in started:
        running.process.kill()
        running.process.wait(30)
        for thread in running.threads:
            thread.join(30)
        for pipe in (running.process.stdin, running.process.stdout, running.process.stderr):
            if pipe is not None:
                pipe.close()


def is_live(event: dict[str, Any]) -> bool:
    return event["type"] == "state" and event["state"] == "live"


def frames_of(path: Path) -> int:
    return len(read_bvh(path, rest_frame="keep").root)


def check_frames(path: Path, server: StreamServer, frames: list[int]) -> None:
    """These frames of the file are those of the server, to a millimetre (frames are quantised)."""
    read = read_bvh(path, rest_frame="keep")
    order = [read.skeleton.joint_names.index(name) for name in HUMANML3D.joint_names]
    wanted = forward_kinematics(HUMANML3D, server.rotations, server.root)[frames]
    assert np.abs(read.joints()[frames][:, order] - wanted).max() < 1e-3
    assert read.fps == 20
    assert read.notes == ()


# --- to the end ---


def test_a_stream_is_followed_to_its_end_and_told_line_by_line(serve: Any, tmp_path: Path) -> None:
    server, path = serve(waiting=2), tmp_path / "clip.bvh"
    options = ("--seconds", 90, "--seed", 5, "--model", "mogo", "--name", "walk")
    ran = run(server, *options, "--slow", "pause", "-o", path, "--json", prompt=f" {PROMPT} ").ok()
    (body,) = server.begun
    assert body == {
        "prompt": PROMPT,
        "seconds": 90,
        "seed": 5,
        "model": "mogo",
        "name": "walk",
    }
    assert server.opened[0][1]["slow"] == "pause"
    events = [(line["type"], line.get("state"), line.get("position")) for line in ran.lines]
    assert events[:1] == [("state", "waiting", 2)]
    assert ("state", "live", None) in events
    assert events[-2:] == [("state", "ended", None), ("end", "ended", None)]
    assert all(line["stream"] == STREAM for line in ran.lines)
    assert ran.lines[-1] == {
        "type": "end",
        "stream": STREAM,
        "job": JOB,
        "state": "ended",
        "reason": "as long as it was to be",
        "frames": 30,
        "fps": 20.0,
        "gaps": 0,
        "prompts": [{"number": 0, "frame": 0, "prompt": PROMPT}],
        "file": str(path),
    }
    assert "The stream is waiting, 2 before it." in ran.err
    check_frames(path, server, list(range(30)))


def test_only_what_is_asked_for_is_sent(serve: Any) -> None:
    server = serve(frames=2)
    run(server).ok()
    assert server.begun == [{"prompt": PROMPT}]


def test_without_json_stdout_has_one_line_and_stderr_the_words(serve: Any) -> None:
    ran = run(serve(frames=4, gaps={2: 1})).ok()
    assert ran.out == f"{STREAM}\t{JOB}\tended\t4\t20\t1\t\n"
    assert "Missing: frames 2 to 2." in ran.err
    assert "1 of 4 frames did not come." in ran.err
    assert f"From frame 0 on: {PROMPT}" in ran.err


def test_missing_frames_are_counted_and_their_neighbours_stand_in(serve: Any, tmp_path: Path) -> None:
    server, path = serve(gaps={5: 3}, silent={20: 4}), tmp_path / "clip.bvh"
    ran = run(server, "-o", path, "--json").ok()
    gaps = [(line["first"], line["count"]) for line in ran.lines if line["type"] == "gap"]
    assert gaps == [(5, 3), (20, 4)]
    assert (ran.lines[-1]["gaps"], ran.lines[-1]["frames"], frames_of(path)) == (7, 30, 30)
    check_frames(path, server, [n for n in range(30) if n not in {5, 6, 7, 20, 21, 22, 23}])
    read = read_bvh(path, rest_frame="keep")
    np.testing.assert_allclose(read.root[6], (read.root[4] + read.root[8]) / 2, atol=1e-7)


def test_a_stream_goes_on_where_its_connection_broke(serve: Any, tmp_path: Path) -> None:
    server, path = serve(drops={3, 17}, again=2), tmp_path / "clip.bvh"
    ran = run(server, "-o", path, "--json").ok()
    assert [query["from"] for _, query, _ in server.opened] == ["0", "3", "17"]
    assert (ran.lines[-1]["gaps"], ran.lines[-1]["frames"]) == (0, 30)
    assert ran.err.count("No connection; trying again.") == ran.err.count("Connected again.") == 2
    check_frames(path, server, list(range(30)))


def test_the_files_of_the_clip_are_fetched_when_the_stream_is_over(serve: Any, tmp_path: Path) -> None:
    ran = run(serve(), "--fetch", tmp_path / "clips", "--json").ok()
    *_, end, item = ran.lines
    assert (end["type"], item["job"], item["state"]) == ("end", JOB, "succeeded")
    assert {name: Path(path).read_bytes() for name, path in item["files"].items()} == FILES
    assert Path(item["files"]["bvh"]).parent == tmp_path / "clips"


def test_a_stream_without_a_clip_has_nothing_to_fetch(serve: Any, tmp_path: Path) -> None:
    run(serve(frames=0), "--fetch", tmp_path).refused(3, "no clip to fetch")


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


# --- what goes wrong ---


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
    [(b"GIF89a" + bytes(300), "no frame of version 1"), ({"type": "gap", "first": 1}, "lacks something: KeyError")],
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

    monkeypatch.setattr("shared.motion.bvh_live.LiveBVH.add", add)
    ran = run(server, "-o", path, "--json")
    ran.refused(2, "the disk is full")
    assert ran.lines[-1]["file"] is None
    server.until(lambda: server.messages == [{"kind": "stop"}])


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("-o", "there.bvh"), "is there already"),
        (("-o", "clip.npz"), "only a .bvh"),
        (("-o", "none/clip.bvh"), "cannot be written"),
        (("--fetch", "there.bvh"), "cannot write here"),
        (("--seconds", "nan"), "nan seconds"),
        (("--seconds", "0"), "0 seconds"),
        (("--seed", "-1"), "seed"),
        (("--name", "../x"), "file name"),
        (("--model", "mogo starter"), "model"),
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
    code = "import sys; sys.modules['numpy'] = None; from services.cli.main import run; run()"
    command = [sys.executable, "-c", code, "stream", PROMPT, "--json"]
    options = {"cwd": REPOSITORY, "env": environ(server, tmp_path), "stdin": subprocess.DEVNULL, "timeout": 60}
    done = subprocess.run(command, capture_output=True, check=True, **options)
    assert json.loads(done.stdout.splitlines()[-1])["frames"] == 5
    done = subprocess.run([*command, "-o", "a.bvh"], capture_output=True, check=False, **options)
    assert done.returncode == 2
    assert b"pip install 'marey[motion]'" in done.stderr
