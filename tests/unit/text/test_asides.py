"""Words around the movements of a prompt are left out before it is read."""

from __future__ import annotations

import pytest

from marey.text.asides import without_asides


@pytest.mark.parametrize(
    ("prompt", "said"),
    [
        ("Gag reel: he waves, trips and falls", "he waves, trips and falls"),
        ("warm-up: star jumps, then toe touches", "star jumps, then toe touches"),
        ("I need a loop for the wizard: she nods and bows", "she nods and bows"),
        ("volleyball: clap twice, serve with the left hand", "clap twice, volleyball serve with the left hand"),
        ("an old man: sits down, coughs", "an old man: sits down, coughs"),
        ("a karate form: block, punch, kick", "a karate form: block, punch, kick"),
        ("death, shot in the chest, falls backward", "shot in the chest, falls backward"),
        ("guard patrol, walks ahead, turns around", "walks ahead, turns around"),
        ("death, clutching the chest", "death, clutching the chest"),
        ("death, arrow, drops to the floor", "death, arrow, drops to the floor"),
        ("patrol, then stops", "patrol, then stops"),
        ("the boy waves: arm up, arm down", "the boy waves: arm up, arm down"),
    ],
)
def test_titles_are_left_out(prompt: str, said: str) -> None:
    assert without_asides(prompt) == said


@pytest.mark.parametrize(
    ("prompt", "said"),
    [
        ("A nurse in a hallway. She walks ahead.", "A nurse walks ahead."),
        ("There is a chair by the door. He sits down.", "He sits down."),
        ("We need a fall for the knight. He staggers.", "He staggers."),
        ("I want a man who waves. He bows.", "I want a man who waves. He bows."),
        ("EXT. ROOFTOP - NIGHT. Rosa runs and jumps.", "Rosa runs and jumps."),
        ("A man walks. He waves.", "A man walks. He waves."),
        ("Kneel. Stand up.", "Kneel. Stand up."),
        ("The woman is tired. She sits down.", "The woman is tired. She sits down."),
    ],
)
def test_scenes_are_left_out(prompt: str, said: str) -> None:
    assert without_asides(prompt) == said


@pytest.mark.parametrize(
    ("prompt", "said"),
    [
        ("kneel -> wave => bow", "kneel, then wave, then bow"),
        ("kneel / wave / bow", "kneel, then wave, then bow"),
        ("• kneel • wave", "kneel, then wave"),
        ("kneel + wave... bow", "kneel, then wave, then bow"),
        ("- kneel - wave - bow", "kneel, then wave, then bow"),
        ("a side-to-side sway", "a side-to-side sway"),
        ("run w/o stopping", "run w/o stopping"),
    ],
)
def test_signs_between_clauses_are_no_movements(prompt: str, said: str) -> None:
    assert without_asides(prompt) == said


@pytest.mark.parametrize(
    ("prompt", "said"),
    [
        ("creep ahead, hunched over, about 3 m, then wave", "creep ahead hunched over about 3 m, then wave"),
        ("walk, two steps left, clap", "walk, two steps left, clap"),
        ("walk, crouch, crawl", "walk, crouch, crawl"),
        ("wave for a while - make it 4 s", "wave for a while"),
        ("she bows, length: 3 s", "she bows"),
        ("he makes it to the door in 4 seconds", "he makes it to the door in 4 seconds"),
    ],
)
def test_how_and_how_far_belong_to_the_clause_before(prompt: str, said: str) -> None:
    assert without_asides(prompt) == said


@pytest.mark.parametrize(
    ("prompt", "said"),
    [
        ("SHOT B: he walks in", "he walks in"),
        ("Scene 4, shot 2: she sits down, then stands up", "she sits down, then stands up"),
        ("Take 3 - he walks forward", "he walks forward"),
        ("He takes a shot", "He takes a shot"),
        ("walk > stop > sit", "walk, then stop, then sit"),
        ("Step up, clap: a simple party dance", "Step up, clap"),
    ],
)
def test_labels_of_shots_and_names_behind_a_list_are_left_out(prompt: str, said: str) -> None:
    assert without_asides(prompt) == said


@pytest.mark.parametrize(
    ("prompt", "said"),
    [
        ("She walks in and sits down slowly so that nobody hears her", "She walks in and sits down slowly"),
        ("He waves so as not to be overlooked, then runs", "He waves, then runs"),
        ("He crouches so he cannot be seen.", "He crouches."),
        ("He bends so that he can jump", "He bends so that he can jump"),
        ("He jumps so high that he flies", "He jumps so high that he flies"),
    ],
)
def test_what_a_movement_is_done_for_is_left_out(prompt: str, said: str) -> None:
    assert without_asides(prompt) == said
