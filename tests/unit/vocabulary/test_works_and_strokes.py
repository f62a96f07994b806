"""Works whatever stands between verb and object, and strokes of sports as nouns."""

from __future__ import annotations

import pytest

from marey.vocabulary.bearing_words import BarePrompt


@pytest.mark.parametrize(
    ("prompt", "name"),
    [
        ("sweep the tavern floor with a broom", "sweeping"),
        ("rakes dry leaves in the back garden", "sweeping"),
        ("digs a deep hole in the frozen ground with a rusty shovel", "digging"),
        ("shovels wet snow off the driveway", "digging"),
        ("chops thick logs with an axe behind the hut", "chopping"),
        ("hammers a rusty nail into the wooden plank", "hammering"),
        ("saws through a thick oak plank with a hand saw", "sawing"),
        ("paints the old garden fence with a wide brush", "painting"),
        ("stirs a bubbling cauldron of green soup with a ladle", "stirring"),
        ("tennis forehand", "racket-swing"),
        ("two-handed tennis backhand", "backhand"),
        ("badminton smash", "overhead-smash"),
        ("golf drive full swing", "golf-swing"),
        ("golf putt", "putt"),
        ("cricket bat swing", "bat-swing"),
        ("hockey slap shot", "slap-shot"),
    ],
)
def test_a_work_or_stroke_is_read_with_all_its_words(prompt: str, name: str) -> None:
    bare = BarePrompt.of(prompt)
    assert (bare.text, [each.name for each in bare.stated]) == ("", [name])


@pytest.mark.parametrize(
    ("prompt", "left"),
    [
        ("sweeps the old barn, then waves", "waves"),
        ("chops wood in the yard and sits down", "sits down"),
        ("walks upstairs with a hand on the rail", "walks upstairs"),
    ],
)
def test_what_comes_behind_is_left(prompt: str, left: str) -> None:
    assert BarePrompt.of(prompt).text.removeprefix("then ").endswith(left)


@pytest.mark.parametrize(
    "prompt",
    [
        "backhand slap across the face",
        "sweeps the room with his rifle",
        "digs in his pocket",
        "she saw a tree",
        "putting one up on the high shelf",
    ],
)
def test_other_words_are_no_work(prompt: str) -> None:
    assert not {each.name for each in BarePrompt.of(prompt).stated} - {"rifle-ready"}
