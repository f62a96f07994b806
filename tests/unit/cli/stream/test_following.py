"""`marey stream` as a script runs it, against a stand-in server."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from marey.motion.io.bvh import read_bvh
from tests.support.stream_server import FILES, JOB, STREAM
from tests.support.streaming import PROMPT, check_frames, frames_of, run


def test_a_stream_is_followed_to_its_end_and_told_line_by_line(serve: Any, tmp_path: Path) -> None:
    server, path = serve(waiting=2), tmp_path / "clip.bvh"
    options = ("--seconds", 90, "--seed", 5, "--model", "stroller", "--name", "walk")
    ran = run(server, *options, "--slow", "pause", "-o", path, "--json", prompt=f" {PROMPT} ").ok()
    (body,) = server.begun
    assert body == {
        "prompt": PROMPT,
        "seconds": 90,
        "seed": 5,
        "model": "stroller",
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


def test_a_stream_whose_bundle_no_worker_has_loaded_says_so(serve: Any) -> None:
    ran = run(serve(waiting=1, waits_for="worker"), "--json").ok()
    assert "No live worker has loaded stroller-x, so it waits for one (`MAREY_LIVE_MODEL`)." in ran.err
    told = [(line["state"], line["waits_for"]) for line in ran.lines if line["type"] == "state"]
    assert told[0] == ("waiting", "worker")
    assert ("live", None) in told


def test_only_what_is_asked_for_is_sent(serve: Any) -> None:
    server = serve(frames=2)
    run(server).ok()
    assert server.begun == [{"prompt": PROMPT}]


@pytest.mark.parametrize(
    ("read", "words"),
    [
        ({"rewritten": PROMPT, "not_rewritten": None}, ""),
        ({"rewritten": "A person strolls.", "not_rewritten": None}, " (read as: A person strolls.)"),
        ({"rewritten": PROMPT, "not_rewritten": "no answer"}, " (read as it is: no answer)"),
    ],
)
def test_what_a_rewriter_made_of_a_prompt_is_told(serve: Any, read: dict[str, str | None], words: str) -> None:
    ran = run(serve(frames=4, read={0: read}), "--json").ok()
    assert f"From frame 0 on: {PROMPT}{words}" in ran.err.splitlines()
    (event,) = [line for line in ran.lines if line["type"] == "prompt"]
    assert {name: event[name] for name in read} == read


def test_a_warning_of_a_prompt_is_told_under_it(serve: Any) -> None:
    ran = run(serve(frames=4, read={0: {"warnings": ["nothing is known of it"]}}), "--json").ok()
    lines = ran.err.splitlines()
    assert lines[lines.index(f"From frame 0 on: {PROMPT}") + 1] == "Warning: nothing is known of it"
    (event,) = [line for line in ran.lines if line["type"] == "prompt"]
    assert event["warnings"] == ["nothing is known of it"]


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
