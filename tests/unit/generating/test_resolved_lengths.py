"""Lengths of motions whose prompts name none."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from marey.generation.lengths import WORK_S, resolved_length
from marey.generation.port import Request
from marey.generation.shots.dispatch import resolve_request
from tests.unit.generating.test_timelines import load, text_of


@pytest.fixture(scope="module")
def generator(tmp_path_factory: pytest.TempPathFactory) -> Any:
    return load("hgm3", Path(tmp_path_factory.mktemp("models")))


def asked(generator: Any, prompt: str, rewritten: str = "a person stands upright") -> Request:
    return Request(replace(text_of(prompt, generator.limits.text_width), rewritten=rewritten), 3)


class _Short:
    """A generator that gives every motion two seconds; bearings are drawn on its motions, or not."""

    def __init__(self, generator: Any, *, draws: bool = True) -> None:
        text = generator.bundle.manifest.text.model_copy(update={"plain_action": draws})
        self.bundle = SimpleNamespace(manifest=generator.bundle.manifest.model_copy(update={"text": text}))
        self.limits = generator.limits

    def resolve_length(self, request: Request) -> Request:
        return replace(request, frames=request.frames or round(2 * self.limits.fps))


def test_work_and_gestures_have_the_time_that_they_take(generator: Any) -> None:
    fps, short = generator.limits.fps, _Short(generator)

    def seconds(prompt: str) -> float:
        return (resolved_length(short, asked(generator, prompt)).frames or 0) / fps  # type: ignore[arg-type]

    assert seconds("a man stands") == 2
    assert seconds("a man sweeps the floor") == WORK_S
    assert seconds("a man answers the phone, talks and hangs up") == WORK_S
    assert seconds("a man swings a golf club") > 5
    assert seconds("a man shrugs") + 2 < seconds("a man shrugs and salutes") < 8
    assert resolve_request(generator, asked(generator, "a man sweeps the floor")).frames >= WORK_S * fps
    assert resolve_request(generator, asked(generator, "a man sweeps the floor")).open


def test_a_model_that_reads_the_words_of_a_gesture_decides_how_long_it_takes(generator: Any) -> None:
    short: Any = _Short(generator, draws=False)
    for prompt in ("a man sweeps the floor", "a man swings a golf club"):
        assert resolved_length(short, asked(generator, prompt)).frames == 2 * generator.limits.fps


def test_a_length_that_is_asked_for_stays(generator: Any) -> None:
    request = replace(asked(generator, "a man sweeps the floor"), frames=40)
    assert resolved_length(generator, request).frames == 40


def test_what_is_not_drawn_takes_no_time(generator: Any) -> None:
    request = asked(generator, "a man sweeps the floor and punches", "a person strikes with the fist")
    assert resolved_length(generator, request) == generator.resolve_length(request)
