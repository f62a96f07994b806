"""Live streams from the row to the frames, and back to a motion: real Postgres, real Valkey, a small real model."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any
from uuid import UUID

import numpy as np
import pytest
import redis
import sqlalchemy as sa

from marey.core.settings import Settings
from marey.db import transaction
from marey.generation.handler import GeneratorHandler
from marey.generation.shots.editor import EditModel
from marey.jobs import asset_key, get_job, list_items
from marey.jobs.states import ItemState
from marey.motion import MotionClip, edit
from marey.motion.clip import parse_npz
from marey.registry import get_model, model_names, streaming_models
from marey.runtime.live import supervisor
from marey.runtime.live.leased_stream import LeasedStream
from marey.runtime.live.port import LiveFrame, SessionPool
from marey.storage import FolderStore
from marey.streams import StreamPrompt, StreamState, prompts_with_rewrites, stream_actions, stream_prompts
from marey.streams.actions import ActionStart
from marey.streams.control import StreamControl
from marey.streams.frames import Frame
from marey.streams.notifier import StreamNotifier
from marey.streams.redis import LEASE_MS
from marey.streams.rewrites import PromptRewrite
from marey.text.features import TextFeatures
from tests.support.live_loop import LiveWorker, Studio, parse
from tests.support.models import load, random_bundle
from tests.support.motions import dancer
from tests.support.runtime import Loop
from tests.support.streaming_models import Around, Streaming, loaded

Start = Callable[..., LiveWorker]


@pytest.fixture(scope="module", params=streaming_models())
def streaming(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Streaming]:
    with loaded(request.param, tmp_path_factory.mktemp(request.param)) as streaming:
        yield streaming


@pytest.fixture
def studio(engine: sa.Engine, client: redis.Redis, streaming: Streaming) -> Studio:
    return Studio(engine, client, streaming.model, streaming.bundle.reference)


@pytest.fixture
def start(engine: sa.Engine, client: redis.Redis, streaming: Streaming) -> Iterator[Start]:
    workers: list[LiveWorker] = []

    def begin(slots: int = 2, pool: Callable[[SessionPool], Any] = Around, **options: Any) -> LiveWorker:
        workers.append(LiveWorker(engine, client, lambda: pool(streaming.live.open_pool(slots)), **options))
        return workers[-1]

    yield begin
    for worker in workers:
        worker.stop()


def test_a_worker_hears_that_a_stream_has_begun(
    studio: Studio, start: Start, client: redis.Redis, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(supervisor, "TAKE_SECONDS", 3600.0)  # after its first look at the rows it hears, or never knows
    start()
    first = studio.begin("a person walks")
    StreamNotifier(client).notify()
    studio.until(lambda: studio.row(first).state is StreamState.LIVE, "the first stream")
    second = studio.begin("a person waves")
    StreamNotifier(client).notify()
    studio.until(lambda: studio.row(second).state is StreamState.LIVE, "the second stream")


def whole(studio: Studio, stream: UUID) -> list[Frame]:
    """Its frames, none missing."""
    frames = [frame for frame in studio.frames(stream) if isinstance(frame, Frame)]
    assert [frame.number for frame in frames] == list(range(len(frames)))
    return frames


def farthest_step(frames: list[Frame]) -> float:
    roots = np.stack([frame.root for frame in frames])
    return float(np.linalg.norm(np.diff(roots, axis=0), axis=1).max())


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
    assert row.job is not None
    handler = GeneratorHandler(streaming.model, lambda *_, **__: generator, 4, Settings())
    loop = Loop(engine, folder_store, handler)
    try:
        loop.run()
    finally:
        loop.close()
    with transaction(engine) as conn:
        (item,) = list_items(conn, studio.key.tenant, row.job).rows
        assert get_job(conn, studio.key.tenant, row.job).state == "succeeded"
    assert item.state is ItemState.SUCCEEDED
    assert item.motion is not None
    assert item.motion.frames == len(frames)
    assert item.motion.metadata["stream"] == str(stream)
    assert item.motion.metadata["prompts"] == [[0, "a person walks"], [turned, "a person waves"]]


def pose() -> dict[str, Any]:
    """A pose of a dancer, as the API sends it."""
    return {"joint_rotations": dancer(3, 8)[0][4].tolist(), "root_height": 0.85}


def clip_of(studio: Studio, streaming: Streaming, engine: sa.Engine, store: FolderStore, stream: UUID) -> MotionClip:
    """The stored motion of an ended stream."""
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
    file = next(each for each in item.motion.files if each.format == "npz")
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


def test_how_prompts_were_read_is_on_record_also_after_a_kill(studio: Studio, start: Start, engine: sa.Engine) -> None:
    def rewriting(prompt: str) -> TextFeatures:
        return replace(parse(prompt), rewritten=f"{prompt} ahead", not_rewritten=None)

    def refusing(prompt: str) -> TextFeatures:
        return replace(parse(prompt), rewritten=prompt, not_rewritten="it changes the verbs")

    def stream_prompts() -> list[StreamPrompt]:
        with transaction(engine) as conn:
            return prompts_with_rewrites(conn, stream)

    stream = studio.begin("a person walks")
    first = start(parse=rewriting)
    studio.until(lambda: studio.row(stream).frames > 0, "a record")
    studio.send(stream, StreamControl("steer", "a person runs"))
    studio.until(lambda: len(stream_prompts()) == 2, "the second prompt's record")
    first.kill()
    start(parse=refusing)
    studio.send(stream, StreamControl("steer", "a person bows"))
    studio.until(lambda: len(stream_prompts()) == 3, "the third prompt's record")
    assert [each.read for each in stream_prompts()] == [
        PromptRewrite("a person walks ahead"),
        PromptRewrite("a person runs ahead"),
        PromptRewrite("a person bows", "it changes the verbs"),
    ]


def test_a_paused_stream_stands_still_and_goes_on_where_it_was(studio: Studio, start: Start) -> None:
    stream = studio.begin()
    start()
    studio.until(lambda: studio.shown(stream) > 5, "frames")
    studio.send(stream, StreamControl("pause"))
    studio.until(lambda: studio.row(stream).state is StreamState.PAUSED, "the pause")
    shown = studio.shown(stream)
    studio.send(stream, StreamControl("steer", "a person bows"))
    studio.send(stream, StreamControl("resume"))
    studio.until(lambda: studio.shown(stream) > shown + 5, "more frames")
    frames = whole(studio, stream)
    assert [frame.prompt for frame in frames] == [0] * shown + [1] * (len(frames) - shown)
    assert np.linalg.norm(frames[shown].root - frames[shown - 1].root) <= 2 * farthest_step(frames[:shown])


def test_another_worker_goes_on_behind_the_last_frame_after_a_kill(studio: Studio, start: Start) -> None:
    stream = studio.begin("a person walks")
    first = start()
    studio.until(lambda: studio.row(stream).frames > 0, "a record")
    studio.send(stream, StreamControl("steer", "a person runs"))
    studio.until(lambda: studio.shown(stream) > 0 and whole(studio, stream)[-1].prompt == 1, "the second prompt")
    studio.until(lambda: len(prompts_of(studio, stream)) == 2, "its record")
    first.kill()
    shown, fence = studio.shown(stream), studio.row(stream).fence
    assert studio.row(stream).state is StreamState.LIVE
    start()
    studio.until(lambda: studio.shown(stream) >= shown + 20, "frames of the other worker")
    frames = whole(studio, stream)
    assert {frame.prompt for frame in frames[shown:]} == {1}
    assert studio.row(stream).fence > fence
    assert np.linalg.norm(frames[shown].root - frames[shown - 1].root) <= 3 * farthest_step(frames[:shown]) + 0.05


def test_after_a_kill_the_act_that_plays_goes_on_and_none_begins_again(studio: Studio, start: Start) -> None:
    stream = studio.begin("walk forward, then wave with the right hand")
    first = start()
    studio.until(lambda: len(actions_of(studio, stream)) == 2, "the second act's record")
    first.kill()
    actions, recorded = actions_of(studio, stream), studio.row(stream).frames
    assert [start.action for start in actions] == [0, 1]
    assert actions[0].frame == 0 < actions[1].frame < recorded
    second = start()
    studio.until(lambda: studio.row(stream).frames > recorded + 20, "records of the other worker")
    assert actions_of(studio, stream) == actions
    second.kill()
    studio.send(stream, StreamControl("steer", "bow, then sit down"))
    start()
    studio.until(lambda: len(prompts_of(studio, stream)) == 2, "the record of a steer that came during the outage")
    turned = prompts_of(studio, stream)[1][0]
    studio.until(lambda: len(actions_of(studio, stream)) == 4, "the second act of that prompt")
    found = actions_of(studio, stream)
    assert found[:3] == [*actions, ActionStart(turned, 0)]
    assert found[3].action == 1
    shown = whole(studio, stream)
    assert turned == next(frame.number for frame in shown if frame.prompt == 1)


def test_a_stream_of_a_worker_that_did_not_record_acts_goes_on_with_its_first(
    studio: Studio, start: Start, engine: sa.Engine
) -> None:
    stream = studio.begin("walk forward, then wave with the right hand")
    first = start()
    studio.until(lambda: studio.row(stream).frames > 0, "a record")
    first.kill()
    with engine.begin() as conn:
        conn.execute(sa.text("UPDATE stream_chunk SET acts = NULL WHERE stream_id = :id"), {"id": stream})
    recorded = studio.row(stream).frames
    start()
    studio.until(lambda: studio.row(stream).frames > recorded, "records of the other worker")
    assert actions_of(studio, stream)[0] == ActionStart(recorded, 0)


def test_a_worker_that_stops_in_good_order_gives_its_streams_away_at_once(studio: Studio, start: Start) -> None:
    stream = studio.begin()
    first = start()
    studio.until(lambda: studio.shown(stream) > 5, "frames")
    first.stop()
    shown = studio.shown(stream)
    assert studio.row(stream).frames == shown
    start()
    studio.until(lambda: studio.shown(stream) > shown + 3, "frames of the other worker")
    whole(studio, stream)


def test_a_frame_shown_while_the_worker_stops_is_written_down(
    studio: Studio, start: Start, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Slow(Around):
        def step(self) -> dict[int, LiveFrame]:
            made = super().step()
            time.sleep(0.3)  # the supervisor hears that it is over meanwhile
            return made

    released = supervisor._released

    def late(held: LeasedStream) -> None:
        time.sleep(0.6)  # the frame is shown under a lease that still holds
        released(held)

    monkeypatch.setattr(supervisor, "_released", late)
    stream = studio.begin()
    first = start(pool=Slow)
    studio.until(lambda: studio.shown(stream) > 1, "frames")
    first.stop()
    assert studio.row(stream).frames == studio.shown(stream)


def test_streams_wait_while_every_slot_is_taken(studio: Studio, start: Start) -> None:
    streams = [studio.begin(seed=seed) for seed in range(3)]
    start(slots=2)
    studio.until(lambda: all(studio.shown(stream) > 0 for stream in streams[:2]), "frames of two")
    waiting = studio.row(streams[2])
    assert (waiting.state, waiting.position, waiting.waits_for) == (StreamState.WAITING, 0, "slot")
    studio.send(streams[0], StreamControl("stop"))
    studio.until(lambda: studio.shown(streams[2]) > 0, "frames of the third")
    assert studio.row(streams[0]).state is StreamState.ENDED


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


def test_a_queue_that_forgets_everything_costs_no_stream(studio: Studio, start: Start, client: redis.Redis) -> None:
    stream = studio.begin()
    start()
    studio.until(lambda: studio.row(stream).frames > 0, "a record")
    recorded = studio.row(stream).frames
    client.flushall()
    studio.until(lambda: studio.row(stream).frames > recorded + 20, "more records")
    assert studio.row(stream).state is StreamState.LIVE


class Fragile(Around):
    """Breaks, with all that is in it, at frame 5 of the stream with seed 13."""

    def __init__(self, pool: SessionPool) -> None:
        super().__init__(pool)
        self._seeds: dict[int, int] = {}

    def start(self, text: TextFeatures, seed: int, **options: Any) -> int:
        session = self._pool.start(text, seed, **options)
        self._seeds[session] = seed
        return session

    def catch_up(self, session: int, frames: int) -> list[LiveFrame]:
        return [self._held(session, made) for made in self._pool.catch_up(session, frames)]

    def step(self) -> dict[int, LiveFrame]:
        return {session: self._held(session, made) for session, made in super().step().items()}

    def _held(self, session: int, made: LiveFrame) -> LiveFrame:
        if self._seeds[session] == 13 and made.frame.number == 5:
            raise RuntimeError("a bug in the model")
        return made


def test_a_stream_that_breaks_the_room_fails_alone(studio: Studio, start: Start) -> None:
    good, bad = studio.begin(seed=1), studio.begin(seed=13)
    start(pool=Fragile)
    studio.until(lambda: studio.row(bad).state is StreamState.FAILED, "the failure")
    problem = studio.row(bad).problem
    assert problem is not None
    assert problem.type == "handler-error"
    shown = studio.shown(good)
    studio.until(lambda: studio.shown(good) > shown + 10, "frames of the other")
    whole(studio, good)


def test_a_prompt_that_cannot_be_read_fails_its_stream(studio: Studio, start: Start) -> None:
    bad, good = studio.begin("refused"), studio.begin()
    start()
    studio.until(lambda: studio.row(bad).state is StreamState.FAILED, "the failure")
    studio.until(lambda: studio.shown(good) > 0, "frames of the other")
    studio.send(good, StreamControl("steer", "refused"))
    studio.send(good, StreamControl("steer", "a person waves"))
    studio.until(lambda: whole(studio, good)[-1].prompt == 1, "the next prompt")


class Rewriter:
    """Reads prompts that say so when it is told to, the others at once."""

    def __init__(self) -> None:
        self.go = threading.Event()
        self.asked: list[str] = []

    def parse(self, prompt: str) -> TextFeatures:
        self.asked.append(prompt)
        if prompt.endswith("slowly"):
            assert self.go.wait(60)
        return parse(prompt)


def test_a_prompt_that_is_read_for_longer_than_a_lease_lasts_is_read_once(
    studio: Studio, start: Start, engine: sa.Engine
) -> None:
    rewriter = Rewriter()
    stream = studio.begin("a person walks slowly")
    start(slots=1, parse=rewriter.parse)
    studio.until(lambda: bool(rewriter.asked), "the reading")
    start(slots=1, parse=rewriter.parse)  # it would take what has no lease
    time.sleep(2 * LEASE_MS / 1000)
    rewriter.go.set()
    studio.until(lambda: studio.shown(stream) > 3, "frames")
    assert rewriter.asked == ["a person walks slowly"]
    assert studio.row(stream).fence == 1


def test_a_prompt_that_is_read_for_long_holds_up_its_own_stream_alone(studio: Studio, start: Start) -> None:
    rewriter = Rewriter()
    one, other = studio.begin(seed=1), studio.begin(seed=2)
    start(parse=rewriter.parse)
    studio.until(lambda: min(studio.shown(one), studio.shown(other)) > 0, "frames of both")
    studio.send(one, StreamControl("steer", "a person waves slowly"))
    studio.send(one, StreamControl("steer", "a person bows"))
    studio.until(lambda: "a person waves slowly" in rewriter.asked, "the reading")
    recorded = studio.row(one).frames
    studio.send(other, StreamControl("steer", "a person jumps"))
    studio.until(lambda: whole(studio, other)[-1].prompt == 1, "the other stream's prompt")
    studio.until(lambda: studio.row(one).frames > recorded, "records meanwhile")
    assert {frame.prompt for frame in whole(studio, one)} == {0}
    rewriter.go.set()
    studio.until(lambda: len(prompts_of(studio, one)) == 3, "both prompts, in order")
    assert [text for _, text in prompts_of(studio, one)][1:] == ["a person waves slowly", "a person bows"]


def test_a_stop_does_not_wait_for_a_prompt_that_is_being_read(studio: Studio, start: Start) -> None:
    rewriter = Rewriter()
    stream = studio.begin()
    start(parse=rewriter.parse)
    studio.until(lambda: studio.shown(stream) > 0, "frames")
    studio.send(stream, StreamControl("steer", "a person waves slowly"))
    studio.send(stream, StreamControl("stop"))
    studio.until(lambda: studio.row(stream).state is StreamState.ENDED, "the end")
    rewriter.go.set()


def actions_of(studio: Studio, stream: UUID) -> list[ActionStart]:
    with transaction(studio.engine) as conn:
        return stream_actions(conn, stream)


def prompts_of(studio: Studio, stream: UUID) -> list[tuple[int, str]]:
    with transaction(studio.engine) as conn:
        return stream_prompts(conn, stream)
