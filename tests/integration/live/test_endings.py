"""The ends of live streams, and their motions: a small real model on real servers."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from uuid import UUID

import numpy as np
import pytest
import sqlalchemy as sa

from marey.core.settings import Settings
from marey.db import transaction
from marey.generation.handler import GeneratorHandler
from marey.generation.shots.editor import EditModel
from marey.jobs import asset_key, get_job, list_items
from marey.jobs.states import ItemState
from marey.jobs.types import MotionRow
from marey.motion import MotionClip, edit
from marey.motion.clip import parse_npz
from marey.registry import get_model, model_names
from marey.storage import FolderStore
from marey.streams import StreamState, stream_prompts
from marey.streams.control import StreamControl
from tests.support.live_loop import Start, Studio, farthest_step, parse, whole
from tests.support.models import load, random_bundle
from tests.support.motions import dancer
from tests.support.runtime import Loop
from tests.support.streaming_models import Streaming


def test_a_stream_shows_frames_obeys_and_becomes_a_motion(
    studio: Studio, start: Start, streaming: Streaming, engine: sa.Engine, folder_store: FolderStore
) -> None:
    generator = load(streaming.bundle)
    stream = studio.begin("a person walks")
    assert (studio.row(stream).state, studio.row(stream).position) == (StreamState.WAITING, 0)
    assert studio.row(stream).waits_for == "worker"
    start()
    studio.until(lambda: studio.row(stream).frames > 0, "a record")
    assert (studio.row(stream).state, studio.row(stream).waits_for) == (StreamState.LIVE, None)
    studio.send(stream, StreamControl("steer", "a person waves"))
    studio.until(lambda: any(f.prompt == 1 for f in whole(studio, stream)), "the second prompt")
    studio.until(lambda: studio.shown(stream) >= generator.limits.min_frames, "frames enough for a clip")
    studio.send(stream, StreamControl("stop"))
    studio.until(lambda: studio.row(stream).state is StreamState.ENDED, "the end")
    frames = whole(studio, stream)
    assert [frame.last for frame in frames] == [False] * (len(frames) - 1) + [True]
    row = studio.row(stream)
    assert (row.frames, row.reason) == (len(frames), "stopped")
    with transaction(engine) as conn:
        prompts = stream_prompts(conn, stream)
    turned = next(frame.number for frame in frames if frame.prompt == 1)
    assert prompts == [(0, "a person walks"), (turned, "a person waves")]
    motion = motion_of(studio, streaming, engine, folder_store, stream)
    assert row.job is not None
    with transaction(engine) as conn:
        assert get_job(conn, studio.key.tenant, row.job).state == "succeeded"
    assert motion.frames == len(frames)
    assert motion.metadata["stream"] == str(stream)
    assert motion.metadata["prompts"] == [[0, "a person walks"], [turned, "a person waves"]]


def pose() -> dict[str, Any]:
    """A pose of a dancer, as the API sends it."""
    return {"joint_rotations": dancer(3, 8)[0][4].tolist(), "root_height": 0.85}


def motion_of(studio: Studio, streaming: Streaming, engine: sa.Engine, store: FolderStore, stream: UUID) -> MotionRow:
    """The record of the motion of an ended stream, once a worker has made it."""
    generator, row = load(streaming.bundle), studio.row(stream)
    assert row.job is not None
    loop = Loop(engine, store, GeneratorHandler(streaming.model, lambda *_, **__: generator, 4, Settings()))
    try:
        loop.run()
    finally:
        loop.close()
    with transaction(engine) as conn:
        (item,) = list_items(conn, studio.key.tenant, row.job).rows
    assert item.state is ItemState.SUCCEEDED, item.problem
    assert item.motion is not None
    return item.motion


def clip_of(studio: Studio, streaming: Streaming, engine: sa.Engine, store: FolderStore, stream: UUID) -> MotionClip:
    """The stored motion of an ended stream."""
    motion = motion_of(studio, streaming, engine, store, stream)
    file = next(each for each in motion.files if each.format == "npz")
    return parse_npz(store.get(asset_key(studio.key.tenant, file.sha256)))


@pytest.mark.parametrize("paused", [False, True])
def test_a_stream_ends_on_a_pose_and_its_motion_goes_on_as_an_edit(
    studio: Studio,
    start: Start,
    streaming: Streaming,
    engine: sa.Engine,
    folder_store: FolderStore,
    tmp_path: Path,
    paused: bool,
) -> None:
    stream = studio.begin("a person walks", max_frames=60)
    start()
    studio.until(lambda: studio.shown(stream) >= 40, "frames")
    if paused:
        studio.send(stream, StreamControl("pause"))
        studio.until(lambda: studio.row(stream).state is StreamState.PAUSED, "the pause")
    studio.send(stream, StreamControl("stop", pose=pose()))
    studio.send(stream, StreamControl("stop", pose={**pose(), "root_height": 2.0}))  # the first one counts
    studio.until(lambda: studio.row(stream).state is StreamState.ENDED, "the end")
    frames = whole(studio, stream)
    assert [frame.last for frame in frames] == [False] * (len(frames) - 1) + [True]
    assert studio.row(stream).reason == "stopped on a pose"
    assert frames[-1].root[1] == pytest.approx(0.85, abs=1e-6)
    wanted = np.array(pose()["joint_rotations"])
    assert np.abs((frames[-1].rotations[1:] * wanted[1:]).sum(axis=-1)).min() > 1 - 1e-6
    assert farthest_step(frames[-21:]) <= 2 * farthest_step(frames[:-20]) + 0.1
    clip = clip_of(studio, streaming, engine, folder_store, stream)
    assert clip.frames == len(frames)
    assert "selection" not in clip.manifest
    (error,) = clip.manifest["quality"]["constraints"]
    assert (error["type"], error["missed"]) == ("pose_keyframe", False)
    (asked,) = clip.manifest["constraints"]
    assert asked["frame"] == clip.frames - 1
    keeping = next(name for name in model_names() if get_model(name).keeps_frames)
    editor = EditModel.of(load(random_bundle(keeping, tmp_path / "random")), {}, parse)
    op = {"op": "extend", "seconds": 1, "prompt": "a person bows", "force": True}
    (longer,) = edit(clip, [op], model=editor)
    assert longer.frames == clip.frames + 20
    np.testing.assert_allclose(longer.joints[: clip.frames], clip.joints, atol=1e-5)
    assert longer.manifest["prompts"] == [[0, "a person walks"], [clip.frames, "a person bows"]]
    assert longer.manifest["edited_from"]["sources"][0]["bundle"] == streaming.bundle.reference


def test_a_second_stop_ends_a_stream_at_once_and_its_motion_has_no_pose(
    studio: Studio, start: Start, streaming: Streaming, engine: sa.Engine, folder_store: FolderStore
) -> None:
    stream = studio.begin("a person walks")
    start()
    studio.until(lambda: studio.shown(stream) >= load(streaming.bundle).limits.min_frames, "frames enough for a clip")
    studio.send(stream, StreamControl("stop", pose=pose()))
    studio.send(stream, StreamControl("stop"))
    studio.until(lambda: studio.row(stream).state is StreamState.ENDED, "the end")
    assert studio.row(stream).reason == "stopped"
    assert whole(studio, stream)[-1].root[1] != pytest.approx(0.85, abs=1e-6)
    assert "constraints" not in clip_of(studio, streaming, engine, folder_store, stream).manifest


def test_a_stream_ends_at_its_limit(studio: Studio, start: Start) -> None:
    stream = studio.begin(max_frames=12)
    start()
    studio.until(lambda: studio.row(stream).state is StreamState.ENDED, "the end")
    frames = whole(studio, stream)
    assert len(frames) == 12
    assert frames[-1].last
    assert studio.row(stream).job is None  # shorter than any clip


def test_a_stream_that_nobody_watches_ends(studio: Studio, start: Start) -> None:
    lonely, watched = studio.begin(), studio.begin(seed=2)
    start(idle_seconds=0.5)

    def is_over() -> bool:
        studio.watch(watched)
        return studio.row(lonely).state is StreamState.ENDED

    studio.until(is_over, "the end")
    assert "no viewer" in str(studio.row(lonely).reason)
    assert studio.row(watched).state is StreamState.LIVE


def test_a_stream_that_is_paused_for_too_long_ends_although_it_is_watched(studio: Studio, start: Start) -> None:
    paused, playing = studio.begin(), studio.begin(seed=2)
    start(paused_seconds=0.5)
    studio.until(lambda: studio.shown(paused) > 0 and studio.shown(playing) > 0, "frames of both")
    studio.send(paused, StreamControl("pause"))

    def is_over() -> bool:
        for stream in (paused, playing):
            studio.watch(stream)
        return studio.row(paused).state is StreamState.ENDED

    studio.until(is_over, "the end")
    assert "paused for 0.5 seconds" in str(studio.row(paused).reason)
    assert studio.row(playing).state is StreamState.LIVE
