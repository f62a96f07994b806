"""Punches that a prompt lists."""

from __future__ import annotations

import pytest

from marey.vocabulary.blows import stated_blows
from marey.vocabulary.counts import stated_count


@pytest.mark.parametrize(
    ("prompt", "blows"),
    [
        ("boxing: jab, jab, cross", "jab jab cross"),
        ("boxing combo: left jab, right cross, left hook", "left-jab right-cross left-hook"),
        ("one-two combo", "jab cross"),
        ("throws two jabs and a cross", "jab jab cross"),
        ("double jab, then a quick right hand cross", "jab jab right-cross"),
        ("jab twice then a hook", "jab jab hook"),
        ("jab, cross, three times", "jab cross jab cross jab cross"),
        ("jab-cross-hook x2", "jab cross hook jab cross hook"),
        ("left, right, left hook", "left right left-hook"),
        ("punches left, right, left", "left right left"),
        ("throws three jabs", "jab jab jab"),
        ("hooks", "hook"),
        ("uppercut right", "right-uppercut"),
        ("uppercut, right, heavy", "right-uppercut"),
        ("three quick jabs with the left, then one big right hook", "left-jab left-jab left-jab right-hook"),
        ("one left jab, then two right hooks", "left-jab right-hook right-hook"),
        ("left jab, right", "left-jab right"),
        ("jab left, cross right", "left-jab right-cross"),
        ("throws an overhand right", "right-overhand"),
        ("jab, cross, overhand", "jab cross overhand"),
        ("two backfists and a left hook", "backfist backfist left-hook"),
        ("back fist", "backfist"),
        ("a backhanded strike", "backfist"),
        ("brings down a hammer-fist", "hammer fist"),
        ("palm heel strike", "palm strike"),
        ("a straight left to the body", "left-straight"),
        ("throws a punch to the left", ""),
        ("punches straight ahead", ""),
        ("throws the ball overhand to him", ""),
        ("sits cross-legged", ""),
    ],
)
def test_punches_are_read_in_their_order(prompt: str, blows: str) -> None:
    assert " ".join(f"{each.side}-{each.kind}".strip("-") for each in stated_blows(prompt)) == blows


def test_a_list_of_punches_is_their_number() -> None:
    assert stated_count("boxing: jab, jab, cross", "punch") == 3
    assert stated_count("one-two combo", "punch") == 2
    assert stated_count("throws a jab three times", "punch") == 3
    assert stated_count("throws a hook", "punch") is None


def test_punches_have_the_weight_of_their_own_words() -> None:
    assert [each.weight for each in stated_blows("two light jabs and a heavy hook")] == ["light", "light", "heavy"]
    assert [each.weight for each in stated_blows("uppercut, right, heavy")] == ["heavy"]
    assert [each.weight for each in stated_blows("right hook")] == [""]
