"""Prompts of live streams, as they are read and recorded: a small real model on real servers."""

from __future__ import annotations

import threading
import time
from dataclasses import replace

import sqlalchemy as sa

from marey.db import transaction
from marey.streams import StreamPrompt, StreamState, prompts_with_rewrites
from marey.streams.control import StreamControl
from marey.streams.redis import LEASE_MS
from marey.streams.rewrites import PromptRewrite
from marey.text.features import TextFeatures
from tests.support.live_loop import Start, Studio, parse, prompts_of, whole


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
