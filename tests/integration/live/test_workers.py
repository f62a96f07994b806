"""Live streams from the row to the frames, whatever becomes of their workers; a small real model on real servers."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import pytest
import redis
import sqlalchemy as sa

from marey.runtime.live import supervisor
from marey.runtime.live.leased_stream import LeasedStream
from marey.runtime.live.port import LiveFrame, SessionPool
from marey.streams import StreamState
from marey.streams.actions import ActionStart
from marey.streams.control import StreamControl
from marey.streams.notifier import StreamNotifier
from marey.text.features import TextFeatures
from tests.support.live_loop import Start, Studio, actions_of, farthest_step, prompts_of, whole
from tests.support.streaming_models import Around


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
