"""Words of which models read another action than is asked for."""

from __future__ import annotations

import pytest

from marey.text.misleading_words import has_other_sense, lunges_as_exercise, without_misleading


@pytest.mark.parametrize(
    ("prompt", "read"),
    [
        ("A hero walks up to the door", "A hero walks to the door"),
        ("runs right up to her", "runs to her"),
        ("walks up to the second floor", "walks up to the second floor"),
        ("climbs up to the roof", "climbs up to the roof"),
        ("goes up to the roof", "goes up to the roof"),
        ("walks up the hill", "walks up the hill"),
    ],
)
def test_who_walks_up_to_somebody_does_not_rise(prompt: str, read: str) -> None:
    assert without_misleading(prompt) == read


@pytest.mark.parametrize(
    ("prompt", "read"),
    [
        ("pulls himself up a rope hand over hand", "climbs up a rope hand over hand"),
        ("a soldier going down the old rope", "a soldier climbing down the old rope"),
        ("she shimmies slowly up the drainpipe", "she climbs slowly up the drainpipe"),
        ("hand over hand up a rope", "climbing hand over hand up a rope"),
        ("pulls up a rope", "pulls up a rope"),
        ("pulls himself up onto the ledge", "pulls himself up onto the ledge"),
        ("goes down the stairs to the pole", "goes down the stairs to the pole"),
    ],
)
def test_who_hauls_himself_up_a_rope_climbs_it(prompt: str, read: str) -> None:
    assert without_misleading(prompt) == read


@pytest.mark.parametrize(
    ("prompt", "read"),
    [
        ("he jogs back to his car", "he jogs to his car"),
        ("a man walks back home", "a man walks home"),
        ("she turns around and walks back", "she turns around and walks forward"),
        ("A guard walks forward, turns and runs back.", "A guard walks forward, turns and runs forward."),
        ("turns, then walks backwards", "turns, then walks backwards"),
        ("he steps back", "he steps back"),
        ("a man walks back three steps", "a man walks back three steps"),
        ("walks back slowly, watching the door", "walks back slowly, watching the door"),
        ("he looks back to the house", "he looks back to the house"),
    ],
)
def test_who_returns_walks_ahead(prompt: str, read: str) -> None:
    assert without_misleading(prompt) == read


@pytest.mark.parametrize(
    ("prompt", "read"),
    [
        (
            "a man paces back and forth",
            "a man walks forward, turns around, walks forward, turns around and walks forward",
        ),
        ("pace up and down", "walk forward, turn around, walk forward, turn around and walk forward"),
        (
            "a father pacing to and fro",
            "a father walking forward, turning around and walking forward, turning around and walking forward",
        ),
        (
            "she jogs back and forth for a while",
            "she jogs forward, turns around, jogs forward, turns around and jogs forward",
        ),
        ("walks up and down the hill", "walks up and down the hill"),
        ("rocks back and forth", "rocks back and forth"),
    ],
)
def test_a_way_to_and_fro_has_turns(prompt: str, read: str) -> None:
    assert without_misleading(prompt) == read


@pytest.mark.parametrize(
    ("prompt", "read"),
    [
        ("she is pushed from behind", "she gets hit from behind"),
        ("a man gets kicked in the leg", "a man gets hit"),
        ("a soldier gets shot", "a soldier gets hit"),
        ("he is shot in the arm", "he gets hit"),
        ("shot in the chest, staggers back", "gets hit in the chest hard"),
        ("she is shot down by a sniper", "she is killed by a sniper"),
        ("fires a shot in the air", "fires a shot in the air"),
        ("is shot at from the roof", "is shot at from the roof"),
        ("a knight is brutally slashed", "a knight gets brutally hit"),
        ("a man kicks a ball", "a man kicks a ball"),
        ("a trolley is pushed along the corridor", "a trolley is pushed along the corridor"),
        ("a crate is pushed by a man", "a crate is pushed by a man"),
        ("he is thrown out", "he is thrown out"),
    ],
)
def test_who_is_struck_is_hit(prompt: str, read: str) -> None:
    assert without_misleading(prompt) == read


@pytest.mark.parametrize(
    ("prompt", "read"),
    [
        ("a warrior is stabbed and dies", "a warrior dies"),
        ("he is shot in the chest and falls backward", "he falls backward"),
        ("gets hit in the back, then falls forward", "falls forward"),
        ("a man is shot, drops dead", "a man drops dead"),
        ("is hit and drops his sword", "is hit and drops his sword"),
        ("is hit and walks on", "is hit and walks on"),
    ],
)
def test_a_blow_is_part_of_the_fall(prompt: str, read: str) -> None:
    assert without_misleading(prompt) == read


@pytest.mark.parametrize(
    ("prompt", "read"),
    [
        ("he jumps 360 degrees", "he jumps and turns 360 degrees in the air"),
        ("jump up and land facing the other way", "jump and turn 180 degrees in the air"),
        ("she jumps 2 metres", "she jumps 2 metres"),
        ("jumps and lands on both feet", "jumps and lands on both feet"),
    ],
)
def test_a_jump_that_ends_in_another_direction_turns(prompt: str, read: str) -> None:
    assert without_misleading(prompt) == read


@pytest.mark.parametrize(
    ("prompt", "read"),
    [
        ("blocks, then counterattacks", "blocks, then throws a punch"),
        ("parry the sword and counter attack", "parry the sword and slash with the sword"),
        ("ducks before counter-striking with a knife", "ducks before slashing with a knife"),
        ("attacks the counter", "attacks the counter"),
        ("turns around 180 and walks back", "turns around 180 and walks forward"),
        ("turns 180 degrees and walks back", "turns 180 degrees and walks forward"),
    ],
)
def test_counterattacks_are_blows_and_ways_behind_an_angle_lead_ahead(prompt: str, read: str) -> None:
    assert without_misleading(prompt) == read


@pytest.mark.parametrize(
    ("action", "prompt", "other"),
    [
        ("roll", "he rolls up his sleeves", True),
        ("roll", "a woman rolls out dough", True),
        ("roll", "he rolls forward", False),
        ("roll", "rolls down the hill", False),
        ("flip", "she flips her hair", True),
        ("flip", "flips open a notebook", True),
        ("flip", "he does a flip", False),
        ("flip", "flips over the fence", False),
        ("die", "he falls into a chair exhausted", True),
        ("die", "a drunk man almost falls", True),
        ("die", "falls asleep", True),
        ("die", "falls to the ground", False),
        ("lie", "a man lies about his age", True),
        ("lie", "lies on the floor", False),
        ("walk", "walks and rolls his eyes", False),
        (None, "rolls up his sleeves", False),
    ],
)
def test_words_in_another_sense_are_known(action: str | None, prompt: str, other: bool) -> None:
    assert has_other_sense(action, prompt) == other


@pytest.mark.parametrize(
    ("prompt", "read"),
    [
        ("driving a car, both hands on the wheel", "driving a car"),
        ("a man drives a truck with his hands on the steering wheel", "a man drives a truck"),
        ("drives with both hands firmly on the wheel", "drives"),
        ("puts his hands on the wheel", "puts his hands on the wheel"),
    ],
)
def test_the_hands_of_a_driver_are_not_said(prompt: str, read: str) -> None:
    assert without_misleading(prompt) == read


@pytest.mark.parametrize(
    ("prompt", "read"),
    [
        ("guard waits", "a person waits"),
        ("The boxer walks forward", "The person walks forward"),
        ("an archer waits", "a person waits"),
        ("archer idle", "a person idle"),
        ("the security guard paces to the door", "the security person paces to the door"),
        ("guard up", "guard up"),
        ("boxer", "boxer"),
        ("keep your guard up and kick", "keep your guard up and kick"),
        ("a boxer stands with fists raised", "a boxer stands with fists raised"),
        ("a guard walks in, turns and bows", "a guard walks in, turns and bows"),
    ],
)
def test_who_does_something_else_than_the_noun_says_is_a_person(prompt: str, read: str) -> None:
    assert without_misleading(prompt) == read


@pytest.mark.parametrize(
    ("prompt", "read"),
    [
        ("The thief presses his back to the wall", "The thief stands with the back to the wall"),
        ("leaning back against a tree", "standing with the back against a tree"),
        ("she flattens herself against the brick wall", "she stands with the back against the brick wall"),
        ("leans back", "leans back"),
        ("pushes his back foot off the wall", "pushes his back foot off the wall"),
    ],
)
def test_who_presses_the_back_to_a_wall_stands(prompt: str, read: str) -> None:
    assert without_misleading(prompt) == read


@pytest.mark.parametrize(
    ("prompt", "read"),
    [
        ("stumbles back", "stumbles backward"),
        ("staggers slowly back, then falls", "staggers slowly backward, then falls"),
        ("stumbles back to his feet", "stumbles back to his feet"),
        ("gets hit in the shoulder and stumbles back", "gets hit in the shoulder hard"),
        ("is punched in the face, then staggers backwards and falls", "is punched in the face hard and falls"),
    ],
)
def test_who_stumbles_back_goes_backward_and_behind_a_blow_is_part_of_it(prompt: str, read: str) -> None:
    assert without_misleading(prompt) == read


@pytest.mark.parametrize(
    ("prompt", "read"),
    [
        ("sit down cross-legged", "sit down on the floor cross-legged"),
        ("she sits with her legs crossed", "she sits down on the floor with her legs crossed"),
        ("sits on a chair with legs crossed", "sits on a chair with legs crossed"),
        ("sits cross-legged on the rug", "sits cross-legged on the rug"),
    ],
)
def test_who_sits_cross_legged_sits_on_the_floor(prompt: str, read: str) -> None:
    assert without_misleading(prompt) == read


@pytest.mark.parametrize(
    ("prompt", "read"),
    [
        ("a woman sits down and crosses her legs", "a woman sits down with one leg over the other"),
        ("sits on a bench, crosses one leg over the other", "sits on a bench with one leg over the other"),
        ("takes a seat and then he crosses his legs", "takes a seat with one leg over the other"),
        ("sits on the floor and crosses his legs", "sits on the floor and crosses his legs"),
        ("sits down and crosses his arms", "sits down and crosses his arms"),
    ],
)
def test_a_leg_is_laid_over_the_other_as_the_body_sits(prompt: str, read: str) -> None:
    assert without_misleading(prompt) == read


@pytest.mark.parametrize(
    ("prompt", "read"),
    [
        ("crouch walk left", "crouch walk sideways left"),
        ("sneaks slowly to the right", "sneaks slowly sideways to the right"),
        ("sneaks forward", "sneaks forward"),
    ],
)
def test_who_sneaks_to_a_side_goes_sideways(prompt: str, read: str) -> None:
    assert without_misleading(prompt) == read


@pytest.mark.parametrize(
    ("prompt", "read"),
    [
        ("shifts his weight from one leg to the other", "shifts his weight"),
        ("shifting weight between both feet", "shifting weight"),
        ("shifts the weight onto the left leg", "shifts the weight onto the left leg"),
        ("hurdle jump", "jump forward over a hurdle"),
        ("jumps over a hurdle", "jumps over a hurdle"),
    ],
)
def test_shifted_weight_is_rest_and_a_thing_before_a_jump_is_jumped_over(prompt: str, read: str) -> None:
    assert without_misleading(prompt) == read


@pytest.mark.parametrize(
    ("prompt", "read"),
    [
        ("a person rolls over onto his stomach", "a person lies on his stomach"),
        ("lies in bed and turns onto her left side", "lies in bed and lies on her left side"),
        ("turns to the side", "turns to the side"),
        ("walks on and turns onto his left side", "walks on and turns onto his left side"),
        ("rolls over his shoulder", "rolls over his shoulder"),
        ("lies on his back and rolls over", "lies on his back and lies down on the stomach"),
        ("crawls and rolls onto his back", "crawls and lies down on his back"),
        ("lies down on her back, turns over onto her front", "lies down on her back, lies on her front"),
        ("lying on her stomach, then rolling over", "lying on her stomach, then lying down on the back"),
        ("a soldier rolls over", "a soldier rolls over"),
        ("a barrel roll onto his back", "a barrel roll onto his back"),
    ],
)
def test_who_lies_and_rolls_over_lies(prompt: str, read: str) -> None:
    assert without_misleading(prompt) == read


@pytest.mark.parametrize(
    ("prompt", "read"),
    [
        ("drops to the knees, then falls forward dead", "falls dead over the knees forward"),
        ("sinks to his knees and then falls on his side", "falls dead over the knees sideways"),
        ("falls to his knees and weeps", "kneels down quickly on both knees and weeps"),
        ("drops to his knees and falls asleep", "kneels down quickly on both knees and falls asleep"),
    ],
)
def test_a_fall_over_the_knees_is_one(prompt: str, read: str) -> None:
    assert without_misleading(prompt) == read


@pytest.mark.parametrize(
    ("prompt", "read"),
    [
        ("punch left, punch right, knee right", "punch left, punch right, kick with the right knee"),
        ("jab, cross, then left knee", "jab, cross, then kick with the left knee"),
        ("hand up, knee right", "hand up, knee right"),
    ],
)
def test_a_knee_in_a_list_of_blows_is_one_of_them(prompt: str, read: str) -> None:
    assert without_misleading(prompt) == read


@pytest.mark.parametrize(
    ("prompt", "exercise"),
    [
        ("does five lunges", True),
        ("a person lunges", True),
        ("lunges with a sword", False),
        ("lunges at him", False),
        ("the knight lunges", False),
        ("a person squats", False),
    ],
)
def test_who_lunges_without_a_weapon_exercises(prompt: str, exercise: bool) -> None:
    assert lunges_as_exercise(prompt) is exercise


@pytest.mark.parametrize(
    ("prompt", "read"),
    [
        ("the dancer leaps with her arms out", "the dancer performs a leap"),
        ("a dancer leaps up", "a person leaps up"),
        ("a man leaps", "a man leaps"),
    ],
)
def test_a_dancer_leaps_from_one_foot_to_the_other(prompt: str, read: str) -> None:
    assert without_misleading(prompt) == read


@pytest.mark.parametrize(
    ("prompt", "read"),
    [
        ("walks up the stairs and then back down", "walks up the stairs, turns around and walks down the stairs"),
        ("climb the stairs, then go down again", "climb the stairs, turn around and go down the stairs"),
        ("goes upstairs and comes back down", "goes upstairs, turns around and comes down the stairs"),
        (
            "walks up two steps, turns around, and walks back down",
            "walks up two steps, turns around, and walks down the stairs",
        ),
        ("running up and down the stairs", "running up the stairs, turning around and running down the stairs"),
        ("walks up the stairs and lies down", "walks up the stairs and lies down"),
        ("walks up the steps and looks down", "walks up the steps and looks down"),
        ("goes down the stairs", "goes down the stairs"),
        ("walks up the stairs, then sits down", "walks up the stairs, then sits down"),
    ],
)
def test_who_goes_up_the_stairs_and_down_again_turns_between(prompt: str, read: str) -> None:
    assert without_misleading(prompt) == read


@pytest.mark.parametrize(
    ("prompt", "read"),
    [
        ("crouches and covers his head with both arms", "crouches"),
        ("crouches and covers the hole", "crouches and covers the hole"),
    ],
)
def test_hands_over_the_head_are_the_form_of_a_crouch(prompt: str, read: str) -> None:
    assert without_misleading(prompt) == read


@pytest.mark.parametrize(
    ("prompt", "read"),
    [
        ("mops the floor from side to side", "mops the floor"),
        ("scrubs the deck back and forth and sings", "scrubs the deck and sings"),
        ("polishes the bar left and right", "polishes the bar"),
        ("walks from side to side", "walks from side to side"),
    ],
)
def test_strokes_of_work_are_no_steps(prompt: str, read: str) -> None:
    assert without_misleading(prompt) == read


@pytest.mark.parametrize(
    ("prompt", "read"),
    [
        ("spins around twice and bows", "spins twice and bows"),
        ("twirling round three times", "twirling three times"),
        ("spins around and bows", "spins around and bows"),
    ],
)
def test_a_number_of_spins_is_no_turn_to_face_back(prompt: str, read: str) -> None:
    assert without_misleading(prompt) == read


@pytest.mark.parametrize("prompt", ["sneak walk left", "sneak left", "crouch walk to the left"])
def test_a_crouched_way_to_a_side_is_named_as_one(prompt: str) -> None:
    assert " sideways " in without_misleading(prompt)


@pytest.mark.parametrize(
    ("prompt", "read"),
    [
        ("a woman falls to her knees", "a woman kneels down quickly on both knees"),
        ("he slowly sinks down to his knees and prays", "he slowly kneels down on both knees and prays"),
        ("the king collapsing onto his knees", "the king kneeling down quickly on both knees"),
        ("she drops heavily to her knees, then looks up", "she kneels down heavily on both knees, then looks up"),
        ("go down on both knees", "kneel down on both knees"),
    ],
)
def test_who_falls_to_the_knees_kneels(prompt: str, read: str) -> None:
    assert without_misleading(prompt) == read


@pytest.mark.parametrize(
    "prompt", ["he drops to his knees and elbows", "she falls to one knee", "he goes onto his hands and knees"]
)
def test_other_ways_to_the_floor_stay(prompt: str) -> None:
    assert without_misleading(prompt) == prompt


@pytest.mark.parametrize(
    ("prompt", "read"),
    [
        ("a singer exits stage left", "a singer walks off to the left"),
        ("the host leaves to the right", "the host walks off to the right"),
        ("he leaves his left shoe", "he leaves his left shoe"),
    ],
)
def test_who_leaves_to_a_side_walks(prompt: str, read: str) -> None:
    assert without_misleading(prompt) == read
