"""Readings of prompts of small acts of head and hands."""

from __future__ import annotations

import pytest

from marey.generation.wish import action_of
from marey.text.held_hand import with_hand_again
from marey.text.pipeline import TextPipeline
from marey.vocabulary.bearing_words import stated_bearings
from tests.support.texts import shared_pipeline


@pytest.fixture(scope="module")
def reading() -> TextPipeline:
    pipeline = shared_pipeline()
    spec = pipeline.spec.model_copy(update={"plain_action": True, "movements": True})
    return TextPipeline(spec, rewriter=pipeline.rewriter, labeller=pipeline.labeller, encoder=pipeline.encoder)


def acts(prompt: str) -> list[tuple[str, str]]:
    return [(each.name, each.acts) for each in stated_bearings(prompt)]


@pytest.mark.parametrize(
    ("prompt", "movements"),
    [
        (
            "rubs his hands together for warmth, stamps his feet, and hugs himself",
            [["hands-rubbed"], ["stomping"], ["self-hug"]],
        ),
        ("nods twice, shakes his head, then shrugs", [[], ["head-shaken"], ["shrug"]]),
        ("points to the left, then to the right, then at himself", [[], [], ["points-self"]]),
        ("folds his arms, taps his foot and sighs", [["arms-crossed"], ["foot-tap"], ["sigh"]]),
        ("a boy walks in, sighs and leans on his staff", [[], ["sigh"], ["stick-lean"]]),
        ("a courier runs up, stops, and catches her breath", [[], ["winded"]]),
        ("a miner swings his pickaxe overhead, then waves", [["chopping"], []]),
        ("draws her blade, slashes twice at the rope and sheathes it", [["sword-drawn"], [], ["sword-sheathed"]]),
        ("the batter drops his bat and jogs off", [["thing-dropped"], []]),
    ],
)
def test_gestures_of_a_list_have_their_turns(reading: TextPipeline, prompt: str, movements: list[list[str]]) -> None:
    (features,) = reading.features([prompt])
    assert [[each.name for each in stated_bearings(one.said)] for one in features.movements] == movements


@pytest.mark.parametrize(
    ("prompt", "action", "names"),
    [
        ("a nervous guard looks over his right shoulder", "idle", ["scared"]),
        ("hugs herself, shivering", "shiver", ["self-hug"]),
        ("shivers in the cold, rubbing her arms", "shiver", ["arms-rubbed"]),
        ("beckons with the left hand for 4 seconds", "idle", ["beckon"]),
        ("lays the baby down gently", "idle", ["thing-laid-down"]),
        ("drops the glass in shock", "idle", ["thing-dropped"]),
        ("lays down her shield", "idle", ["thing-laid-down"]),
        ("leans on his spade to catch his breath", "idle", ["stick-lean"]),
        ("argues, jabbing a finger", "talk", ["finger-jabbed"]),
        ("shakes hands with a guest", "reach-forward", ["handshake"]),
        ("a jogger doubles over, gasping for air", "idle", ["winded"]),
        ("hands on his thighs, panting hard", "idle", ["winded"]),
        ("an out of breath messenger stops and leans forward with his hands on his knees", "idle", ["winded"]),
        ("walks, panting heavily", "walk", ["tired"]),
        ("a lumberjack swings a heavy axe over his head", "idle", ["chopping"]),
        ("slips on the ice, arms windmilling, regains her balance", "idle", ["stumble"]),
    ],
)
def test_small_acts_are_read_as_what_the_body_does(
    reading: TextPipeline, prompt: str, action: str, names: list[str]
) -> None:
    (features,) = reading.features([prompt])
    assert not features.movements
    assert action_of(features) == action
    assert [name for name, _ in acts(prompt)] == names


@pytest.mark.parametrize(
    ("prompt", "again"),
    [
        (
            "picks up the phone with the left hand, listens, and slams it down",
            "picks up the phone with the left hand, listens on the phone with the left hand, and slams it down with the"
            " left hand",
        ),
        (
            "pours tea with his right hand, then hangs up",
            "pours tea with his right hand, then hangs up with the right hand",
        ),
        (
            "takes a cup with the left hand, sets it down and waves with the right hand",
            "takes a cup with the left hand, sets it down and waves with the right hand",
        ),
        ("listens, and slams it down", "listens, and slams it down"),
    ],
)
def test_the_hand_that_took_a_thing_goes_on_with_it(prompt: str, again: str) -> None:
    assert with_hand_again(prompt) == again


@pytest.mark.parametrize(
    ("prompt", "found"),
    [
        ("wipes his lips with the back of his left hand", [("mouth-wiped", "left")]),
        ("knocks for 4 seconds with the left hand", [("knock", "left")]),
        ("pours a cup of tea with the left hand", [("pouring", "left")]),
        ("scratches his nose with her right thumb", [("nose-touched", "right")]),
        ("shoulder rolls out of the way", []),
        ("hears a voice and turns around", []),
        ("lies down", []),
    ],
)
def test_words_of_small_acts(prompt: str, found: list[tuple[str, str]]) -> None:
    assert acts(prompt) == found


def test_who_stops_with_hands_on_the_knees_does_not_stop_holding_them_there(reading: TextPipeline) -> None:
    (features,) = reading.features(["he jogs to the wall and stops with his hands on his knees"])
    assert [[each.name for each in stated_bearings(one.said)] for one in features.movements] == [[], ["winded"]]
    assert acts("she stops rubbing her arms") == []


@pytest.mark.parametrize(
    ("prompt", "hand"),
    [
        ("draws her blade, slashes at the rope, then sheathes it", "right"),
        ("draws a sword with the left hand, slashes at the rope, then sheathes it", "left"),
        ("draws a sword from his right hip, slashes at the rope, then sheathes it", "left"),
    ],
)
def test_the_hand_that_draws_a_sword_strikes_with_it_and_sheathes_it(
    reading: TextPipeline, prompt: str, hand: str
) -> None:
    (features,) = reading.features([prompt])
    _, slash, sheathe = features.movements
    assert slash.said.endswith(f"with the {hand} hand")
    assert sheathe.said.endswith(f"with the {hand} hand")
