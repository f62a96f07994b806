"""Streams that are ended on a pose: requests, what the worker gets, and what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import httpx2
import pytest

from marey.cli.live.end_pose import read_end_pose
from marey.client import Client
from marey.core.errors import Conflict, InvalidInput, NotFound
from marey.motion.keyframes import pose_of
from marey.motion.skeleton import HUMANML3D
from marey.streams.control import StreamControl
from tests.support.editing import clip_of, stored
from tests.support.live_api import LiveApi
from tests.support.live_streams import Hand, watching
from tests.support.streams_api import new_key
from tests.support.walker import walker

IDENTITY = [[1.0, 0.0, 0.0, 0.0]] * 22


def end(http: httpx2.Client, stream: str, pose: object) -> httpx2.Response:
    return http.post(f"/v1/streams/{stream}/end", json={"pose": pose})


def rounded(pose: dict[str, Any]) -> list[list[float]]:
    return [[round(x, 6) for x in turn] for turn in pose["joint_rotations"].values()]


def test_the_pose_of_a_stored_motion_reaches_the_worker(
    api: LiveApi, http: httpx2.Client, stream: str, hand: Hand
) -> None:
    motion = stored(api)
    pose = pose_of(clip_of(api, motion["id"]), 7)
    answer = end(http, stream, {"motion": {"id": motion["id"], "frame": 7}})
    assert (answer.status_code, answer.json()["id"]) == (202, stream)
    (control,) = hand.received()
    assert control.kind == "stop"
    assert control.pose is not None
    assert control.pose["joint_rotations"] == rounded(pose)
    assert control.pose["root_height"] == pytest.approx(pose["root_height"])
    assert control.pose["licence"] == motion["licence"]


def test_rotations_by_joint_or_in_order_and_a_height_are_a_pose(http: httpx2.Client, stream: str, hand: Hand) -> None:
    by_name = dict(zip(HUMANML3D.joint_names, IDENTITY, strict=True))
    assert end(http, stream, {"joint_rotations": by_name, "root_height": 0.8}).status_code == 202
    assert end(http, stream, {"joint_rotations": IDENTITY}).status_code == 202
    assert hand.received() == [
        StreamControl("stop", pose={"joint_rotations": IDENTITY, "root_height": 0.8}),
        StreamControl("stop", pose={"joint_rotations": IDENTITY}),
    ]


@pytest.mark.parametrize(
    ("pose", "where", "words"),
    [
        ({}, "pose", "needs either `motion` or `joint_rotations`"),
        ({"joint_rotations": IDENTITY, "frame": 3}, "pose.frame", "unknown field of a pose"),
        ({"joint_rotations": IDENTITY, "root_position": [0, 1, 0]}, "pose.root_position", "unknown field of a pose"),
        ({"joint_rotations": IDENTITY[:20]}, "pose.joint_rotations", "20 rotations"),
        ({"joint_rotations": {"tail": [1, 0, 0, 0]}}, "pose.joint_rotations", "unknown joint 'tail'"),
        ({"motion": {"file": "bow.npz", "frame": 1}}, "pose.motion.file", "a server reads no files"),
        ({"motion": {"id": "last", "frame": 1}}, "pose.motion.id", "is not the id of a motion"),
        ({"motion": {"id": "0" * 32, "frame": 1}}, "pose.motion.id", "there is no such motion"),
    ],
)
def test_a_pose_that_cannot_be_used_names_its_field(
    http: httpx2.Client, stream: str, pose: dict[str, Any], where: str, words: str
) -> None:
    answer = end(http, stream, pose)
    assert (answer.status_code, answer.json()["where"]) == (422, where)
    assert words in answer.json()["detail"]
    assert http.get(f"/v1/streams/{stream}").json()["state"] == "waiting"


def test_a_frame_beyond_the_motion_is_refused(api: LiveApi, http: httpx2.Client, stream: str) -> None:
    motion = stored(api)
    answer = end(http, stream, {"motion": {"id": motion["id"], "frame": motion["frames"]}})
    assert (answer.status_code, answer.json()["where"]) == (422, "pose.motion.frame")


def test_a_waiting_stream_ends_at_once_and_one_that_has_ended_cannot_end_on_a_pose(
    http: httpx2.Client, stream: str
) -> None:
    assert end(http, stream, {"joint_rotations": IDENTITY}).json()["state"] == "ended"
    assert end(http, stream, {"joint_rotations": IDENTITY}).status_code == 409
    assert end(http, "0" * 32, {"joint_rotations": IDENTITY}).status_code == 404


def test_the_client_and_the_option_read_files_here(
    api: LiveApi, stream: str, hand: Hand, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    clip = walker(prompt="a person walks")
    clip.save_npz("walk.npz")
    motion = stored(api)
    with Client(api.url, key=new_key(api, "read", "submit")) as client:
        assert client.streams.end(stream, pose={"motion": {"file": "walk.npz", "frame": 3}}).id == stream
        (control,) = hand.received()
        assert control.pose is not None
        assert control.pose["joint_rotations"] == rounded(pose_of(clip, 3))
        assert read_end_pose(client, "walk.npz:3") == {**pose_of(clip, 3)}
        asked = {"motion": {"id": motion["id"], "frame": 4}}
        assert read_end_pose(client, f"{motion['id']}:4") == asked
        assert read_end_pose(client, f"{motion['id'][-8:]}:4") == asked
        with client.streams.follow(stream) as live:
            live.stop(asked)
        assert hand.received()[0].pose is not None
        for text, error in (
            ("walk.npz", InvalidInput),
            ("walk.npz:x", InvalidInput),
            (f"walk.npz:{clip.frames}", InvalidInput),
            (f"{motion['id']}:{motion['frames']}", InvalidInput),
            ("nowhere:3", NotFound),
        ):
            with pytest.raises(error):
                read_end_pose(client, text)
        hand.end()
        with pytest.raises(Conflict):
            client.streams.end(stream, pose=asked)


def test_a_message_of_a_socket_has_no_pose(api: LiveApi, stream: str, secret: str, hand: Hand) -> None:
    with watching(api.url, stream, secret) as viewer:
        viewer.connection.send('{"kind": "stop", "pose": {}}')
        problem = viewer.until("error").of("error")[0]["problem"]
        assert (problem["type"], problem["where"]) == ("urn:marey:problem:invalid-input", "pose")
    assert hand.received() == []
