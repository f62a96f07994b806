"""How prompts have a body bear itself: which words are read so, and what is left of a prompt without them."""

from __future__ import annotations

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from marey.vocabulary.bearing_words import BarePrompt, parts_by_gestures, stated_bearings
from marey.vocabulary.bearings import (
    ARMS_BUSY,
    ARMS_FREE,
    ARMS_HELD,
    DRAWN_AS,
    DRAWN_ON,
    SHOWN_BY,
    UPRIGHT,
    StatedBearing,
    bearing_words,
    load_bearings,
)
from marey.vocabulary.entries import load_vocabulary
from marey.vocabulary.scope import ActionLists, every_action, match_scope
from tests.support.marey import REPOSITORY

DRAWN = {**DRAWN_AS, **DRAWN_ON, **SHOWN_BY}


@pytest.mark.parametrize(
    ("prompt", "action", "name"),
    [
        ("a woman waves gloomily", "wave", "sad"),
        ("he claps cheerfully", "clap", "happy"),
        ("she bows timidly", "bow", "scared"),
        ("he kicks furiously", "kick", "angry"),
        ("the champion nods proudly", "nod", "proud"),
    ],
)
def test_moods_show_in_the_trunk_of_who_moves_the_arms(prompt: str, action: str, name: str) -> None:
    (stated,) = stated_bearings(prompt)
    assert stated.name == name
    assert stated.shown_in(action) == "trunk"
    assert not stated.shown_in("roll")


@pytest.mark.parametrize(
    ("prompt", "left", "names"),
    [
        ("As she runs, she waves to the crowd", "she runs", ["waving"]),
        ("While he claps he walks in a circle", "he walks in a circle", ["clapping"]),
        ("A woman drinks from a cup while she is walking.", "A woman walking.", ["drinking"]),
        ("The man nods while walking backwards", "The man walking backwards", ["nodding"]),
        ("He runs as he waves", "He runs", ["waving"]),
        ("The woman is clapping while she walks", "The woman walks", ["clapping"]),
        ("As he backs away, he raises his hands in surrender.", "he backs away.", ["hands-up"]),
        ("While the tired man talks to his friend, he walks", "he walks", ["gesturing", "tired"]),
        ("He talks to his friend while walking", "walking", ["gesturing"]),
        ("As the soldier walks ahead, he aims his rifle", "the soldier walks ahead", ["rifle-aimed"]),
        ("As he marches past, the guard salutes", "he marches past", ["salute"]),
        ("She walks along, nodding and clapping", "She walks along", ["nodding", "clapping"]),
        ("He keeps his guard up as he sidesteps to the left", "sidesteps to the left", ["guard-up"]),
        ("He walks in, then drinks while turning", "He walks in, then turning", ["drinking"]),
        ("He walks in and claps", "He walks in and claps", []),
        ("She sits on a chair, chatting", "She sits on a chair, chatting", []),
        ("As he jumps, he waves", "As he jumps, he waves", []),
        ("She drinks as if she walks on air", "She drinks as if she walks on air", []),
    ],
)
def test_what_is_done_at_the_same_time_as_a_way_is_left_out_with_its_clause(
    prompt: str, left: str, names: list[str]
) -> None:
    bare = BarePrompt.of(prompt)
    assert bare.text == left
    assert [each.name for each in bare.stated] == names
    assert parts_by_gestures(prompt) == ()


def test_a_clause_keeps_the_word_that_joins_it_to_a_bearing_of_the_same_time() -> None:
    bare = BarePrompt.of("he stops, and as he turns, he nods")
    assert bare.text == "he stops, and he turns"
    assert bare.written(bare.text.index("he turns"), len(bare.text)) == "as he turns, he nods"


@pytest.mark.parametrize(
    ("prompt", "left", "name", "times"),
    [
        ("he raps, then knocks on the gate four times", "he raps", "knock", 4),
        ("a man knocks 4x on the window", "", "knock", 4),
        ("a woman gives two loud knocks on the door", "", "knock", 2),
        ("hammers a long nail twice", "", "hammering", 2),
        ("he saws the plank with ten strokes", "", "sawing", 10),
        ("sweeps the yard, six strokes", "", "sweeping", 6),
        ("he stomps twice", "", "stomping", 2),
        ("knocks on the door and jumps twice", "jumps twice", "knock", None),
        ("knocks loudly", "", "knock", None),
    ],
)
def test_numbers_of_strokes_are_read_with_what_they_count(prompt: str, left: str, name: str, times: int | None) -> None:
    bare = BarePrompt.of(prompt)
    assert bare.text == left
    assert [(each.name, each.times) for each in bare.stated] == [(name, times)]


@pytest.mark.parametrize(
    ("prompt", "side"),
    [
        ("a person limps on the left leg", "left"),
        ("limps over to the sofa on his right leg", "right"),
        ("listens with her left hand to her ear", "left"),
        ("a scout listens, hand to his ear", ""),
        ("walks with an injured right knee", "right"),
        ("a man limps, favoring his left leg", "left"),
        ("walks favouring her good right leg", "left"),
        ("limp forward, wounded left leg", "left"),
        ("hobbles home, right ankle sprained", "right"),
        ("limps off to the left, favouring the right", "right"),
        ("limps up to the ball", ""),
        ("limps away to the left", ""),
        ("salutes with his left hand", "left"),
        ("a soldier salutes", ""),
        ("limping, right leg is hurt", "right"),
        ("walk limp left", "left"),
        ("carries a bucket in her left hand", "left"),
    ],
)
def test_the_side_of_a_bearing(prompt: str, side: str) -> None:
    (stated,) = stated_bearings(prompt)
    assert stated.side == side


@pytest.mark.parametrize(
    ("prompt", "acts"),
    [
        ("rubs his left shoulder", "right"),
        ("brushes off her right sleeve", "left"),
        ("rubs his left knee", "left"),
        ("rubs his shoulder", ""),
    ],
)
def test_a_hand_that_rubs_the_other_arm_is_that_of_the_other_side(prompt: str, acts: str) -> None:
    (stated,) = stated_bearings(prompt)
    assert stated.acts == acts


def test_arms_are_brought_where_a_verb_says_so_and_come_down_where_another_does() -> None:
    (answers,) = stated_bearings("answers a phone call, talks, and hangs up")
    assert answers.is_brought
    assert answers.ends
    (talks,) = stated_bearings("walks while talking on the phone")
    assert not talks.is_brought
    assert not talks.ends


def test_what_is_said_of_the_person_holds_for_all_movements() -> None:
    old, crossed = stated_bearings("an old man walks in with his arms crossed")
    assert old.whole
    assert not crossed.whole


@pytest.mark.parametrize(
    ("prompt", "parts"),
    [
        ("a person walks forward and salutes", ("a person walks forward", "salutes")),
        ("salutes, then turns around", ("salutes", "turns around")),
        ("a man sits down, yawns and lies down", ("a man sits down", "yawns", "lies down")),
        ("a soldier salutes while marching", ()),
        ("a soldier salutes", ()),
        ("walks with arms crossed and turns around", ()),  # held all along
        ("hammers a nail and walks away", ("hammers a nail", "walks away")),
        ("walks in and sweeps the floor", ("walks in", "sweeps the floor")),
        ("runs forward, slides feet first and gets up", ("runs forward", "slides feet first", "gets up")),
        ("a man eats soup seated at a table", ()),
    ],
)
def test_gestures_come_before_or_after_what_else_is_done(prompt: str, parts: tuple[str, ...]) -> None:
    assert parts_by_gestures(prompt) == parts


@given(
    st.lists(
        st.sampled_from(["an old man", "a robot", "walks", "limps", ",", "and", "salutes", "sadly", "as he", "waves"])
    )
)
def test_characters_that_are_left_know_their_place(words: list[str]) -> None:
    prompt = " ".join(words)
    bare = BarePrompt.of(prompt)
    assert len(bare.places) == len(bare.text)
    assert list(bare.places) == sorted(bare.places)
    assert bare.written(0, len(bare.text)) == prompt
    for cut in range(1, len(bare.text)):
        assert bare.written(0, cut) + bare.written(cut, len(bare.text)) == prompt


def test_every_bearing_has_words_and_a_pose_within_what_a_body_can() -> None:
    for name, words in bearing_words():
        assert bool(words) != (name in DRAWN.values()), name
        assert re.fullmatch(r"[a-z-]+", name)
    for bearing in load_bearings().values():
        posed = bearing.arms or bearing.trunk or bearing.gait or bearing.shrug or bearing.keys
        assert bool(posed) != bearing.moves, bearing.id
        assert set(bearing.arms) <= {"left", "right"}
        assert abs(bearing.trunk) <= 45
        assert abs(bearing.head) + abs(bearing.tilt) <= 40
        for pose in bearing.arms.values():
            assert bool(pose.path) + (pose.hand is not None) + (pose.upper is not None or pose.fore is not None) == 1
            assert (pose.hand is None and not pose.path) == (not pose.at), bearing.id
            assert 0 < pose.share <= 1


@pytest.mark.parametrize("name", sorted(each.id for each in load_bearings().values() if each.keys))
def test_keys_have_a_time_each_and_work_ends_where_it_begins(name: str) -> None:
    bearing = load_bearings()[name]
    keys = bearing.keys
    assert keys is not None
    assert keys.times[0] == 0
    assert list(keys.times) == sorted(set(keys.times))
    ways = [
        keys.trunk,
        keys.twist,
        keys.head,
        keys.tilt,
        keys.shrug,
        keys.sink,
        *(pose.path for pose in bearing.arms.values()),
    ]
    assert any(ways)
    for way in filter(None, ways):
        assert len(way) == len(keys.times)
        assert bearing.gesture or way[0] == way[-1]
    assert bearing.gesture or bearing.work


def test_bearings_fit_what_leaves_the_body_free() -> None:
    groups = UPRIGHT, ARMS_FREE, ARMS_HELD, ARMS_BUSY
    assert set(load_vocabulary().actions) >= frozenset[str]().union(*groups)
    assert len(frozenset[str]().union(*groups)) == sum(map(len, groups))
    assert StatedBearing("hands-up").shown_in("jump") == StatedBearing("arms-crossed").shown_in("squat") == "upper"
    assert StatedBearing("salute").shown_in("jump") == StatedBearing("old", whole=True).shown_in("jump") == ""
    zombie, person = StatedBearing("zombie"), StatedBearing("old", whole=True)
    assert [zombie.shown_in(action) for action in ("walk", "sit", "wave", "punch")] == ["body", "upper", "", ""]
    assert [person.shown_in(action) for action in ("walk", "sit", "wave", "punch")] == ["body", "upper", "trunk", ""]
    assert StatedBearing("salute").shown_in("sit") == "upper"
    assert StatedBearing("salute", whole=True).shown_in("wave") == ""


def test_a_gesture_is_in_the_scope_of_a_bundle_on_whose_motions_it_is_drawn() -> None:
    lists = ActionLists(("walk",), drawn=True)
    assert match_scope("a soldier salutes", lists).verdict == "known"
    assert match_scope("a zombie walks and shrugs", lists).verdict == "known"
    assert match_scope("a soldier salutes", ActionLists(("walk",))).verdict == "unknown"
    assert match_scope("an old man", lists).verdict == "unknown"  # says who, but not what
    assert match_scope("an old man yodels", lists).verdict == "unknown"
    assert match_scope("a lumberjack chops wood in the forest", lists).verdict == "known"
    scope = match_scope("a man reads a newspaper", every_action())
    assert scope.verdict == "known"
    assert scope.actions[0].text == "reads a newspaper"
    assert "objects" in scope.flags


def test_the_documentation_lists_every_bearing() -> None:
    page = (REPOSITORY / "docs" / "how-to" / "bearings.md").read_text()
    table = page.partition("| bearing |")[2].partition("\n\n")[0]
    rows = [row for row in table.splitlines() if row.startswith("| `")]
    assert sorted(name for row in rows for name in re.findall(r"`([a-z-]+)`", row)) == sorted(
        set(load_bearings()) - set(DRAWN.values())
    )
    for row in rows:
        names = set(re.findall(r"`([a-z-]+)`", row))
        for example in re.findall(r'"([^"]+)"', row):
            texts = (example, f"{example} walks", f"a man walks {example}")
            assert any(names & {each.name for each in stated_bearings(text)} for text in texts), example


def test_a_movement_of_the_whole_body_is_made_by_who_stands_alone() -> None:
    assert StatedBearing("burpee").shown_in("idle") == "body"
    assert not any(StatedBearing("burpee").shown_in(action) for action in ("walk", "sit", "jump", "wave"))


def test_who_sneaks_on_tiptoe_is_drawn_so_whole() -> None:
    assert StatedBearing("tiptoe").shown_in("sneak") == "body"
    assert not StatedBearing("sneaking").shown_in("sneak")


@pytest.mark.parametrize(
    ("prompt", "side"),
    [
        ("beckons with his left hand", "left"),
        ("blows a kiss with the right hand", "right"),
        ("beckons", ""),
        ("shaving with the left hand", "left"),
        ("wash the window with your left hand", "left"),
        ("walks off, waving with her left hand", "left"),
    ],
)
def test_a_gesture_is_done_by_the_hand_that_stands_behind_it(prompt: str, side: str) -> None:
    (stated,) = stated_bearings(prompt)
    assert stated.side == side


def test_a_call_that_is_ended_apart_from_its_beginning_ends() -> None:
    (call,) = stated_bearings("answers the phone with the left hand, nods twice and hangs up")
    assert call.ends
    assert call.side == "left"
    assert not stated_bearings("answers the phone and nods twice")[0].ends


@pytest.mark.parametrize(
    ("prompt", "name"),
    [
        ("stumbles forward and catches his balance", "stumble"),
        ("a man stumbles", "stumble"),
        ("trips over a stone but catches herself", "stumble"),
        ("nearly trips", "stumble"),
        ("stumbles home", "drunk"),
        ("draws a sword", "sword-drawn"),
        ("the knight unsheathes his blade", "sword-drawn"),
        ("sheathes the katana", "sword-sheathed"),
        ("puts the sword back in its scabbard", "sword-sheathed"),
        ("a child throws a huge temper tantrum", "tantrum"),
        ("bored idle", "bored"),
        ("idle, shifting weight", "weight-shift"),
    ],
)
def test_stumbles_swords_and_restless_bodies_are_read(prompt: str, name: str) -> None:
    assert [each.name for each in stated_bearings(prompt)] == [name]


@pytest.mark.parametrize(
    "prompt", ["draws a bow", "draws a circle with a sword", "stumbles and falls", "throws a fitted ball"]
)
def test_other_drawing_falling_and_throwing_is_none_of_them(prompt: str) -> None:
    assert not stated_bearings(prompt)


@pytest.mark.parametrize(
    ("prompt", "names"),
    [
        ("a woman walks against a strong wind", {"headwind"}),
        ("he leans into the gale and walks on", {"headwind"}),
        ("the flag flies in the wind", set()),
        ("he walks through the wind farm", set()),
    ],
)
def test_who_walks_against_the_wind_leans_into_it(prompt: str, names: set[str]) -> None:
    assert {each.name for each in stated_bearings(prompt)} == names


@pytest.mark.parametrize(
    ("prompt", "name", "times", "side"),
    [
        ("does six hammer curls", "curling", 6, ""),
        ("performs fifteen barbell curls", "curling", 15, ""),
        ("dumbbell curls with both arms, 7 reps", "curling", 7, ""),
        ("arm curls, alternating arms, nine times", "curling", 9, ""),
        ("does two sets of 10 arm curls", "curling", 10, ""),
        ("curls a weight with her left arm four times", "curling", 4, "left"),
        ("does some bicep curls", "curling", None, ""),
        ("conducts the choir with both hands", "conducting", None, ""),
        ("hammers a nail with both hands", "hammering", None, ""),
    ],
)
def test_numbers_of_work_and_both_arms_belong_to_it(prompt: str, name: str, times: int | None, side: str) -> None:
    (stated,) = stated_bearings(prompt)
    assert (stated.name, stated.times, stated.side) == (name, times, side)


@pytest.mark.parametrize(
    ("prompt", "names"),
    [
        ("hobbles along hunched over a cane", {"limp", "stooped", "cane"}),
        ("the old wizard hobbles along leaning on his staff", {"old", "limp", "cane"}),
        ("walks propped on a crutch", {"cane"}),
        ("spins his staff", set()),
        ("Drunk sailor staggers forward", {"drunk", "stagger"}),
        ("a wasted bridesmaid walks home", {"drunk"}),
        ("swagger walk, cocky gangster attitude", {"swagger"}),
        ("walk tired: dragging feet, shoulders slumped", {"tired", "foot-dragging", "sad"}),
        ("strafe left five steps in a combat crouch", {"low"}),
        ("strafes right, staying low", {"low"}),
        ("strafe right, knees bent, six steps", {"low"}),
        ("walks forward in a low crouch", set()),
        ("a zombie lurches forward dragging its right leg", {"zombie", "limp"}),
        ("walks bent over her walking stick", {"stooped", "cane"}),
        ("walks hunched over", {"stooped"}),
        ("bends over the table", set()),
        ("walks along a narrow wooden beam", {"beam-walk"}),
        ("walks, arms out to the sides for balance", {"arms-balance"}),
        ("teeters, holding her arms out to keep her balance", {"arms-balance", "drunk"}),
        ("walks with arms out to both sides", {"arms-wide"}),
        ("carries a wooden beam", set()),
        ("staggers back four steps", {"stagger"}),
        ("staggers back to his feet", set()),
    ],
)
def test_canes_beams_and_staggers_are_read(prompt: str, names: set[str]) -> None:
    assert {each.name for each in stated_bearings(prompt)} == names


def test_a_doer_alone_does_nothing_else() -> None:
    assert BarePrompt.of("maestro directing a choir, both arms").text == ""


@pytest.mark.parametrize(
    ("prompt", "seconds"),
    [
        ("salutes and holds it for 4 seconds", 4.0),
        ("salutes for five seconds", 5.0),
        ("shrugs, holds the pose for 3 s", 3.0),
        ("salutes and walks for three seconds", None),
    ],
)
def test_a_gesture_is_held_as_long_as_the_words_behind_it_say(prompt: str, seconds: float | None) -> None:
    (stated,) = stated_bearings(prompt)
    assert stated.hold_s == seconds
