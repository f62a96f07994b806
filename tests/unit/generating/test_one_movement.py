"""Movements of a sequence that are the end of the one before them."""

from __future__ import annotations

from dataclasses import replace

import pytest

from marey.drawing.low_deeds import POUNDS, LowDeed
from marey.generation.bearing import borne_spans
from marey.generation.port import Request
from marey.generation.posture import RowPosture
from marey.generation.shots.one_movement import joined_movements
from marey.generation.timed import TimedText
from marey.text.features import TextFeatures
from marey.vocabulary.entries import load_vocabulary
from tests.unit.generating.test_timelines import text_of


def movement(action: str, said: str) -> TextFeatures:
    """Text of a movement that is read as an action."""
    return replace(text_of(said, 8), rewritten=f"{load_vocabulary().need(action).plain_words}, {said}")


def joined(*rows: tuple[str, str]) -> list[str]:
    return [each.prompt for each in joined_movements([movement(*row) for row in rows], 1)]


@pytest.mark.parametrize("rises", ["stands back up", "straightens up again", "gets to his feet", "rises"])
def test_who_is_upright_already_does_not_get_up_from_the_floor(rises: str) -> None:
    rows = ("pick-up", "picks up a coin"), ("get-up", rises), ("walk", "walks off")
    assert joined(*rows) == [f"picks up a coin and {rises}", "walks off"]


@pytest.mark.parametrize(
    "rows",
    [
        (("kneel", "kneels"), ("pick-up", "picks up a coin"), ("get-up", "stands back up")),
        (("die", "falls"), ("get-up", "gets up")),
        (("walk", "trips over a root"), ("get-up", "gets back up")),
        (("walk", "walks"), ("idle", "stands upright, breathing calmly")),
        (("idle", "dives to the left"), ("idle", "gets up")),
    ],
)
def test_who_is_down_gets_up(rows: tuple[tuple[str, str], ...]) -> None:
    assert joined(*rows) == [said for _, said in rows]


@pytest.mark.parametrize("lowers", ["lowers it", "puts it back down", "drops her left arm to her side"])
def test_a_hand_that_is_raised_comes_down_in_the_same_movement(lowers: str) -> None:
    assert joined(("raise-arm", "raises her hand"), ("pick-up", lowers)) == [f"raises her hand and {lowers}"]


def test_things_are_put_down() -> None:
    assert joined(("pick-up", "picks up a box"), ("pick-up", "puts it down")) == ["picks up a box", "puts it down"]
    assert len(joined(("raise-arm", "raises her hand"), ("pick-up", "puts the box on the floor"))) == 2


def test_hands_that_work_on_the_floor_hold_no_other_pose() -> None:
    kneels = movement("kneel", "kneels down with both hands on her face")
    pounds = movement("idle", "covers her face with both hands")

    def held_at_face(held: RowPosture) -> bool:
        rows = TimedText(0.0, 2.0, kneels), TimedText(2.0, 5.0, pounds, held=held)
        spans = borne_spans(Request(kneels, 1, timeline=rows), 20.0, 100)
        return any(each.bearing.arms for span in spans if span.begin == 40 for each in span.stated)

    assert not held_at_face(RowPosture("knees", "knees", "knees", deed=LowDeed(POUNDS)))
    assert held_at_face(RowPosture("knees", "knees", "knees"))
