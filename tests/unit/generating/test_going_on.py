"""Walks and runs that go on into each other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from marey.generation.shots.going_on import (
    LEAST_S,
    MOST_S,
    WAITS_S,
    as_long_as_stated,
    aside_of,
    is_way,
    keeps_course,
    passes_over,
    rolls_landing,
    without_halt,
    without_wait,
)
from marey.generation.shots.windows import no_text
from marey.motion.features import HUMANML3D_263
from marey.text.features import TextFeatures
from marey.vocabulary.entries import load_vocabulary
from tests.support.bodies import Body, steady

LAYOUT = HUMANML3D_263


def way(begins: float, ends: float, seconds: float = 5.0) -> np.ndarray:
    """Features of a walk at 1.2 m/s between two moments."""
    body = Body(seconds, speed=lambda t: 1.2 * np.clip((t - begins) / 0.3, 0, 1) * np.clip((ends - t) / 0.3, 0, 1))
    return LAYOUT.encode(body.joints())


def test_the_halt_between_two_walks_is_left_out() -> None:
    before, after = without_halt(way(-1.0, 4.0), way(0.8, 9.0), LAYOUT)
    assert len(before) / LAYOUT.fps == pytest.approx(4.0, abs=0.45)
    assert len(after) / LAYOUT.fps == pytest.approx(5.0 - 0.8, abs=0.45)


def test_walks_that_go_on_stay_whole() -> None:
    walk = LAYOUT.encode(Body(4.0, speed=steady(1.2)).joints())
    before, after = without_halt(walk, walk, LAYOUT)
    assert len(before) == len(after) == len(walk)


def test_no_more_is_left_out_than_may_be() -> None:
    before, _ = without_halt(way(-1.0, 3.0), way(-1.0, 9.0), LAYOUT)
    assert len(before) / LAYOUT.fps == pytest.approx(5.0 - MOST_S, abs=0.1)
    short = LAYOUT.encode(Body(1.5, speed=lambda t: np.where(t < 0.8, 1.2, 0.0)).joints())
    assert len(without_halt(short, short, LAYOUT)[0]) / LAYOUT.fps >= LEAST_S - 0.05


@pytest.mark.parametrize(
    ("words", "is_one"),
    [
        ("a person walks forward", True),
        ("a person runs", True),
        ("a person leaps", True),
        ("a person bows", False),
        ("a person walks and turns", False),
    ],
)
def test_a_way_is_a_walk_a_run_or_a_leap_alone(words: str, is_one: bool) -> None:
    assert is_way(replace(no_text(4), prompt=words, rewritten=words)) is is_one


def test_a_way_begins_at_once() -> None:
    late = without_wait(way(1.5, 9.0), LAYOUT)
    assert len(late) / LAYOUT.fps == pytest.approx(5.0 - 1.5 + WAITS_S, abs=0.3)
    at_once = way(-1.0, 9.0)
    assert len(without_wait(at_once, LAYOUT)) == len(at_once)


def test_a_way_keeps_the_seconds_that_are_stated() -> None:
    walk = LAYOUT.encode(Body(4.0, speed=steady(1.2)).joints())
    made_up = as_long_as_stated(walk[:50], LAYOUT, 70)
    assert len(made_up) == 70
    place = LAYOUT.decode(made_up)[:, 0, 2]
    assert place[-1] - place[50] == pytest.approx(1.2, abs=0.3)
    assert as_long_as_stated(walk, LAYOUT, 60) is walk


def test_ways_behind_other_movements_keep_their_course() -> None:
    def text(said: str, words: str) -> TextFeatures:
        return replace(no_text(4), prompt=said, rewritten=words)

    duck, walk = text("ducks", "a person dodges left"), "a person walks forward"
    assert aside_of(text("walks to the left", walk)) == 90
    assert aside_of(text("walks to the right", walk)) == -90
    assert aside_of(text("walks away", walk)) == 0
    assert keeps_course(duck, text("walks away", walk))
    assert not keeps_course(duck, text("walks in a circle", walk))
    assert not keeps_course(text("walks", walk), text("walks away", walk)), "they are joined as one way"


def said(words: str, prompt: str = "") -> TextFeatures:
    return replace(no_text(4), rewritten=words, prompt=prompt or words)


def test_vaults_and_steps_over_things_go_on() -> None:
    assert passes_over(said("a person clambers over, vaults over the wall"))
    assert passes_over(said("a person stands upright, breathing calmly, arms hanging at the sides", "steps over a log"))
    assert not passes_over(said("a person bows"))


def test_who_lands_rolls_and_does_not_fall_or_kick() -> None:
    flip = said(load_vocabulary().need("flip").plain_words)
    assert rolls_landing(flip, said(load_vocabulary().need("roll").plain_words))
    assert not rolls_landing(flip, said("a person kicks"))
    assert not rolls_landing(said("a person bows"), said(load_vocabulary().need("roll").plain_words))
