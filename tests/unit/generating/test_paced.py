"""The pace at which motions are played: that of the words, of the mood, or of a usual way."""

from __future__ import annotations

import pytest

from marey.generation.paced import AskedPace
from marey.motion.features import HUMANML3D_263
from tests.support.bodies import Body, steady


@pytest.mark.parametrize(
    ("prompt", "low", "high"),
    [
        ("a person walks backward", 0.88, 1.12),
        ("a soldier retreats", 0.88, 1.12),
        ("he backs off slowly", 0.55, 0.65),
        ("a man goes backward at a slow walk", 0.55, 0.65),
        ("she quickly walks backwards", 1.45, 1.75),
    ],
)
@pytest.mark.parametrize("made", [1.1, 1.3])
def test_ways_backward_are_at_the_speed_of_the_words(prompt: str, low: float, high: float, made: float) -> None:
    joints = Body(5.0, speed=steady(made)).joints()
    speed = AskedPace.of(prompt, "walk-backward").of_motion(HUMANML3D_263.encode(joints), HUMANML3D_263)
    assert low <= made * speed <= high


@pytest.mark.parametrize(
    ("prompt", "action", "low", "high"),
    [
        ("she waves sadly", "wave", 0.7, 0.85),
        ("a gloomy clerk nods", "nod", 0.7, 0.85),
        ("claps happily", "clap", 1.05, 1.2),
        ("he points angrily", "guide", 1.15, 1.35),
        ("bows slowly and happily", "bow", 0.4, 0.7),
        ("a sad boy jumps", "jump", 1.0, 1.0),
        ("she waves", "wave", 1.0, 1.0),
    ],
)
def test_a_mood_has_a_pace_of_its_own_where_the_words_name_none(
    prompt: str, action: str, low: float, high: float
) -> None:
    assert low <= AskedPace.of(prompt, action).of_drawn(3.0, at_pace=False) <= high


@pytest.mark.parametrize(
    ("prompt", "action", "share"),
    [
        ("pushes a stalled car with great effort", "push", 0.7),
        ("pushes a shopping cart", "push", 1.0),
        ("a tired man pushes a cart", "push", 1.0),
    ],
)
def test_who_pushes_something_heavy_is_slow(prompt: str, action: str, share: float) -> None:
    assert AskedPace.of(prompt, action).share == share
