"""Actions written in the order of time before a prompt is read."""

from __future__ import annotations

import pytest

from marey.text.time_order import in_time_order


@pytest.mark.parametrize(
    ("prompt", "read"),
    [
        (
            "Before he sits down on the barrel, the sailor yawns loudly.",
            "the sailor yawns loudly, then sits down on the barrel.",
        ),
        ("before bowing, she salutes", "she salutes, then bows"),
        ("after clapping twice, the old man kneels", "the old man claps twice, then kneels"),
        ("Before the match, the fencer salutes.", "Before the match, the fencer salutes."),
        ("after a while, she kneels", "after a while, she kneels"),
        ("before sitting down she waves", "she waves, then sits down"),
        ("having bowed deeply he leaves", "having bowed deeply, he leaves"),
        ("After sitting where he likes the boy sleeps", "After sitting where he likes the boy sleeps"),
    ],
)
def test_what_comes_first_is_told_first(prompt: str, read: str) -> None:
    assert in_time_order(prompt) == read


@pytest.mark.parametrize(
    ("prompt", "read"),
    [
        ("she jogs up, trips over a hose, then gets back up", "she jogs up, falls forward, then gets up"),
        ("he stumbles and scrambles to his feet", "he falls forward and gets up"),
        ("he trips but keeps his balance", "he trips but keeps his balance"),
        ("he stumbles, then walks on", "he stumbles, then walks on"),
    ],
)
def test_a_trip_before_a_getting_up_is_a_fall(prompt: str, read: str) -> None:
    assert in_time_order(prompt) == read


@pytest.mark.parametrize(
    ("prompt", "read"),
    [
        ("creeps up, then sprints off the other way", "creeps up, then turns around and then sprints away"),
        ("turn around, then jog in the opposite direction", "turn around, then jog away"),
        ("she turns and walks in the opposite direction", "she turns around and then walks away"),
        ("points in the opposite direction", "points in the opposite direction"),
    ],
)
def test_who_goes_back_turns_round_first(prompt: str, read: str) -> None:
    assert in_time_order(prompt) == read


@pytest.mark.parametrize(
    ("prompt", "read"),
    [
        ("he waves, then carries on marching", "he waves, then marches"),
        ("she slips, then keeps limping", "she slips, then limps"),
        ("keeps limping", "keeps limping"),
        ("she carries on a tray", "she carries on a tray"),
    ],
)
def test_who_goes_on_does_so_again(prompt: str, read: str) -> None:
    assert in_time_order(prompt) == read


@pytest.mark.parametrize(
    ("prompt", "read"),
    [
        ("1. bow 2. kneel 3. sit down", "bow, then kneel, then sit down"),
        ("1) wave; 2) clap.", "wave, then clap"),
        ("walks 2. then waves", "walks 2. then waves"),
        ("1. bow", "1. bow"),
        ("creeps up, freezes, and listens", "creeps up, stands still, and listens"),
        ("walks through the snow, freezes", "walks through the snow, freezes"),
        ("crosses the arctic plain, freezes", "crosses the arctic plain, freezes"),
        ("turn left, turn right, turn left", "turn left, then turn right, then turn left"),
        ("turn left, walk right", "turn left, walk right"),
        ("Jab, cross, roundhouse kick", "Jab, cross, then roundhouse kick"),
        ("slash right, slash left, stab", "slash right, then slash left, stab"),
        ("walks two steps, turns left and keeps walking", "walks two steps, then turns left, then walks forward"),
        ("walks ahead, turns left and keeps walking", "walks ahead, turns left and keeps walking"),
        ("marches ahead and ends by saluting", "marches ahead, then salutes"),
        ("he runs, jumps, and finally finishes up by waving at us.", "he runs, jumps, then waves at us."),
        ("finishes by the door", "finishes by the door"),
    ],
)
def test_lists_and_what_is_done_last(prompt: str, read: str) -> None:
    assert in_time_order(prompt) == read


@pytest.mark.parametrize(
    ("prompt", "read"),
    [
        ("a sprinter, worn out", "a sprinter sprints, worn out"),
        ("a happy walker", "a happy walker walks"),
        ("a walker, kneeling", "a walker, kneeling"),
        ("the sprinter waves", "the sprinter waves"),
        ("a dog walker", "a dog walker"),
    ],
)
def test_people_named_by_what_they_do_do_it(prompt: str, read: str) -> None:
    assert in_time_order(prompt) == read
