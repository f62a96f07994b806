"""How prompts have a body bear itself: which words are read so, and what is left of a prompt without them."""

from __future__ import annotations

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from marey.vocabulary.bearing_words import BarePrompt, as_written, parts_by_gestures, stated_bearings
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
    ("prompt", "left"),
    [
        ("he is jogging and looks exhausted", "he is jogging"),
        ("the woman is walking and appears to be drunk", "the woman is walking"),
        ("he jogs, looking exhausted", "he jogs"),
        ("the man who seems tired sits down", "the man sits down"),
    ],
)
def test_verbs_of_seeming_go_with_what_they_say(prompt: str, left: str) -> None:
    assert BarePrompt.of(prompt).text == left


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
    ("prompt", "left", "names"),
    [
        ("an old man walks slowly", "a man walks slowly", ["old"]),
        ("a person limps across the room", "a person walks across the room", ["limp"]),
        ("limping", "walking", ["limp"]),
        ("the man hobbled away", "the man walked away", ["limp"]),
        ("a zombie shambles forward", "a person walks forward", ["zombie"]),
        ("walks like a zombie", "walks", ["zombie"]),
        ("do a zombie walk", "do a walk", ["zombie"]),
        ("leans back against the old wall", "", ["wall-lean"]),
        ("IDLE lean wall", "", ["wall-lean"]),
        ("leans against the door to push it open", "leans against the door to push it open", []),
        ("leans on the railing", "", ["rail-lean"]),
        ("walks through deep snow", "walks", ["wading"]),
        ("wades across the river", "walks", ["wading"]),
        ("rubs his neck", "", ["neck-rubbed"]),
        ("rubs his head", "", ["head-scratch"]),
        ("hangs up", "", ["phone-call"]),
        ("hangs up his coat", "hangs up his coat", []),
        ("a drunk man staggers down the street", "a man walks down the street", ["drunk"]),
        ("a swaggering cowboy walks into town", "a cowboy walks into town", ["swagger"]),
        ("the king walks proudly, chest out", "the king walks", ["proud"]),
        ("a person stands with arms crossed", "a person stands", ["arms-crossed"]),
        ("a man crosses his arms and whistles", "a man whistles", ["arms-crossed"]),
        ("a man crosses his arms and taps his foot", "", ["arms-crossed", "foot-tap"]),
        ("a lumberjack chops wood in the forest", "", ["chopping"]),
        ("a girl skips along the path", "a girl walks along the path", ["skipping"]),
        ("a soldier marches with high knees", "a soldier marches", ["high-knees"]),
        ("she knocks three times on the wooden door", "", ["knock"]),
        ("he writes on the whiteboard", "", ["board-writing"]),
        ("a woman covers her face and cries", "", ["face-covered"]),
        ("a soldier salutes", "", ["salute"]),
        ("a violinist plays the violin", "", ["violin"]),
        ("cheer with arms in the air", "cheer", ["hands-up"]),
        ("he shrugs while walking", "walking", ["shrug"]),
        ("a person walks while talking on the phone", "a person walks", ["phone-call"]),
        ("a drunk staggers home", "a person walks home", ["drunk"]),
        ("look at watch", "", ["watch-check"]),
        ("checks his wristwatch and waits", "waits", ["watch-check"]),
        ("sneaks backward", "walks backward", ["sneaking"]),
        ("crouch walk sideways left", "walk sideways left", ["sneaking"]),
        ("walks backwards in a low crouch", "walks backwards", ["low"]),
        ("sneaks back to his room", "sneaks back to his room", []),
        ("a burglar tiptoes through the house", "a burglar tiptoes through the house", ["tiptoe"]),
        ("walks on her toes", "walks", ["tiptoe"]),
        ("tiptoes backward", "walks backward", ["tiptoe"]),
        ("a man eats soup while seated", "a man seated", ["eating"]),
        ("a man eats soup", "a man eats soup", []),
        ("yawns and stretches", "", ["yawn-stretch"]),
        ("points and shouts angrily", "points", ["shout"]),
        ("does three burpees", "", ["burpee"]),
        ("does five lunges", "", ["lunges"]),
        ("walking lunges", "", ["lunges"]),
        ("lunges forward", "", ["lunges"]),
        ("deep forward lunge, left leg in front", "", ["lunges"]),
        ("lunges to the right", "", ["lunges"]),
        ("lunges at him", "lunges at him", []),
        ("the knight lunges forward", "the knight lunges forward", []),
        ("lunges forward and stabs", "lunges forward and stabs", []),
        ("lifts the right knee to the chest", "", ["knee-raise"]),
        ("raises his knee to his elbow", "raises his knee to his elbow", []),
        ("gallops sideways to the left", "", ["side-gallop"]),
        ("rubs the belly in circles", "", ["belly-rubbed"]),
        ("headbangs to the music", "", ["head-banging"]),
        ("fights against a strong wind, leaning in", "walks", ["headwind"]),
        ("stumbles along blind drunk", "walks along", ["drunk"]),
        ("hobbles along on a stick", "walks along", ["limp", "cane"]),
        ("she does a fencing lunge", "", ["fencing-lunge"]),
        ("a fencer lunges at the dummy", "", ["fencing-lunge"]),
        ("lunges at him with a sword", "lunges at him with a sword", []),
        ("a golfer takes a full swing", "", ["golf-swing"]),
        ("a golf pro walks to the tee and drives the ball", "a golf pro walks to the tee", ["golf-swing"]),
        ("a man takes a full swing", "a man takes a full swing", []),
        ("a batter takes a mighty swing", "", ["bat-swing"]),
        ("a tennis player tosses the ball up and serves", "", ["tennis-serve"]),
        ("a waiter serves the guests", "a waiter serves the guests", []),
        ("an athlete runs up and throws the javelin far", "", ["javelin-throw"]),
        ("a discus thrower spins and throws", "", ["discus-throw"]),
        ("she puts the shot with her left hand", "", ["shot-put"]),
        ("puts the shot glass down", "", ["thing-set-down"]),
        ("leans on a shovel", "", ["stick-lean"]),
        ("wipes his mouth with the back of his left hand", "", ["mouth-wiped"]),
        ("hears a noise and turns around", "hears a noise and turns around", []),
        ("lifts a glass to the lips", "lifts a glass to the lips", []),
        ("he dropped his keys and picks them up", "he dropped his keys and picks them up", []),
        ("stretches the left arm out to the side", "stretches the left arm out to the side", []),
        ("a boy flings a frisbee across the park", "", ["frisbee-throw"]),
        ("a woman bowls a strike", "", ["bowling"]),
        ("carries two bowls", "carries two bowls", []),
        ("a basketball player jumps and shoots", "", ["jump-shot"]),
        ("two jump shots", "", ["jump-shot"]),
        ("jumps and shoots a zombie", "jumps and shoots a zombie", []),
        ("bends down, lifts a box from the floor and puts it on a high shelf", "", ["shelf-lift"]),
        ("lifts a crate onto the truck", "", ["shelf-lift"]),
        ("lifts a heavy box", "lifts a heavy box", []),
        ("she curtsies deeply before the queen", "", ["curtsy"]),
        ("a child cowers in the corner", "", ["cower"]),
        ("rows a boat across the lake", "", ["rowing"]),
        ("stands in rows", "stands in rows", []),
        ("a maestro waves his baton", "", ["conducting"]),
        ("a woman waves her arms", "a woman waves her arms", []),
        ("raises both arms overhead in a V of victory", "", ["victory"]),
        ("she throws her arms wide to the audience", "", ["arms-thrown-wide"]),
        ("a magician reveals the card with a flourish", "", ["flourish"]),
        ("rolls white paint onto the wall with a roller", "", ["painting"]),
        ("brushes the dust off his trousers", "", ["legs-dusted"]),
        ("dusts herself off and walks on", "walks on", ["legs-dusted"]),
        ("brushes off her sleeves", "", ["sleeve-dusted"]),
        ("holds her arm out", "holds her arm out", []),
        ("a girl whirls with both arms out", "a girl whirls", ["arms-wide"]),
        ("he spins around with arms outstretched", "he spins around", ["arms-wide"]),
        ("crosses the log, arms out", "crosses the log", ["arms-wide"]),
        ("strolls with his arms held out in front of him", "strolls", ["arms-ahead"]),
        ("comes closer with her arms out for a cuddle", "comes closer for a cuddle", ["arms-ahead"]),
        ("strolls with both hands out", "strolls", ["arms-ahead"]),
        ("a mummy comes with its arms out", "", ["zombie", "arms-ahead"]),
        ("clutches his injured shoulder in pain", "", ["shoulder-held"]),
        ("massages a sore knee", "", ["knee-rubbed"]),
        ("walks with one hand pressed to her ribs", "walks", ["side-held"]),
        ("jogs on while gripping his bruised right side", "jogs on", ["side-held"]),
        ("cradles her broken wrist and elbow", "cradles her broken wrist and elbow", []),
        ("paces about nursing a sore elbow", "paces about", ["arm-held"]),
        ("stands at the side of the road", "stands at the side of the road", []),
        ("holds the side of the boat", "holds the side of the boat", []),
        ("holds the baby's arm up", "holds the baby's arm up", []),
        ("itches the back of her head", "", ["head-back-scratch"]),
        ("the cook scratches his belly", "", ["belly-scratched"]),
        ("scratches an itchy knee", "", ["knee-rubbed"]),
        ("scratches his forearm with his left hand", "", ["shoulder-rubbed"]),
        ("shades her eyes against the glare", "", ["eyes-shaded"]),
        ("shields his face with both arms", "shields his face with both arms", []),
        ("flags down a cab", "", ["hail"]),
        ("signals the start of the race", "signals the start of the race", []),
        ("drops her head in respect", "", ["head-bowed"]),
        ("bows his head to the king", "bows his head to the king", []),
        ("keeps a hand behind his ear", "", ["listen"]),
        ("winds up and fires a fastball", "", ["pitch"]),
        ("pitches a tent", "pitches a tent", []),
        ("pokes her head out from behind the curtain", "", ["peek"]),
        ("peers at a map", "peers at a map", []),
        ("leans forward", "leans forward", []),
        ("catches a frisbee", "", ["catch"]),
        ("catches the last train", "catches the last train", []),
        ("catches a cold", "catches a cold", []),
        ("winds up and throws a hook", "winds up and throws a hook", []),
        ("slips on some gravel but stays upright", "", ["stumble"]),
        ("pats his pockets", "", ["pockets-checked"]),
        ("slips out of her coat", "", ["jacket-off"]),
        ("puts his jacket on", "", ["jacket-on"]),
        ("opens the fridge door", "", ["door-opened"]),
        ("opens his arms", "opens his arms", []),
        ("pours himself a cup of tea", "", ["pouring"]),
        ("she is ironing", "", ["ironing"]),
        ("an iron gate falls", "an iron gate falls", []),
        ("rocks a baby in her arms", "", ["baby-rocked"]),
        ("mops the floor from side to side", "", ["sweeping"]),
        ("a left-handed athlete throws a javelin", "", ["javelin-throw"]),
        ("a batter swings and misses", "", ["bat-swing"]),
        ("kneels down, ties his shoe and stands up", "", ["shoe-tied"]),
        ("cowers in fear, then gets up again", "", ["cower"]),
        ("a maestro waves his baton before the orchestra", "", ["conducting"]),
        ("hugs her mother tightly", "", ["hug"]),
        ("hugs the wall", "hugs the wall", []),
        ("climbs over the fences", "climbs over the fences", []),
        ("jabs a sword like in fencing", "jabs a sword like in fencing", []),
        ("holds the line with open arms", "holds the line with open arms", []),
        ("puts his face in his hands", "", ["face-covered"]),
        ("presses a hand to her lower back", "", ["back-held"]),
        ("knees him in the stomach", "", ["knee-strike"]),
        ("a fighter throws a left knee", "", ["knee-strike"]),
        ("falls to his knees", "falls to his knees", []),
        ("slams both fists on the table", "", ["fists-slammed"]),
        ("bangs his fist on the desk", "", ["fist-slammed"]),
        ("pulls the lever down", "", ["lever-pulled"]),
        ("a bartender shakes a cocktail shaker", "", ["cocktail-shaken"]),
        ("shakes a cocktail", "", ["cocktail-shaken"]),
        ("he moonwalks across the stage", "", ["moonwalk"]),
        ("The goalkeeper dives to his right to save the ball", "", ["side-dive"]),
        ("dives into the pool", "dives into the pool", []),
        ("slides on the ground feet first", "", ["ground-slide"]),
        ("slides on his knees", "slides on his knees", []),
        ("he is drunk and walks home", "walks home", ["drunk"]),
        ("walks with rifle at ready", "walks", ["rifle-ready"]),
        ("a guard stands with a rifle in his hands", "a guard stands", ["rifle-ready"]),
        ("kneels on one knee and aims rifle", "kneels on one knee", ["rifle-aimed"]),
        ("walks forward aiming a rifle", "walks forward", ["rifle-aimed"]),
        ("crouches and points her pistol at the door", "crouches", ["pistol-aimed"]),
        ("holds a pistol with both hands, low ready", "", ["pistol-low"]),
        ("walks carrying a suitcase in right hand", "walks with a load", ["bag-carried"]),
        ("a man carrying a suitcase", "a man walking with a load", ["bag-carried"]),
        ("a man carrying a suitcase walks away", "a man with a load walks away", ["bag-carried"]),
        ("carries two buckets of water", "walks with a load", ["bags-carried"]),
        ("carries a heavy crate in front of him while walking", "walks with a load", ["box-carried"]),
        ("stands holding a box", "stands", ["box-carried"]),
        ("picks up a box and carries it away", "picks up a box and walks with a load", ["box-carried"]),
        ("carries a sack of rice over his shoulder", "walks with a load", ["sack-carried"]),
        ("a maid walks along with a platter held high in her left hand", "a maid walks along", ["tray-raised"]),
        ("a butler carries a tray above his shoulder", "a butler walks with a load", ["tray-raised"]),
        ("a waiter carries a tray of drinks to the table", "a waiter walks with a load to the table", ["tray-carried"]),
        ("she holds a baby in her arms", "", ["baby-held"]),
        ("answers a phone call, talks, and hangs up", "", ["phone-call"]),
        ("his phone rings, he answers, talks for a while and puts it away", "", ["phone-call"]),
        ("limping, right leg is hurt", "walking", ["limp"]),
        ("walks as if his left ankle is sprained", "walks", ["limp"]),
        ("walks, dragging his left leg behind him", "walks", ["limp"]),
        ("a man who broke his leg walks home", "a man walks home", ["limp"]),
        ("walk limp left", "walk", ["limp"]),
        ("he is limping because of a wounded right thigh", "he is walking", ["limp"]),
        ("walk injured leg left", "walk", ["limp"]),
        ("hobbles on crutches", "walks", ["limp", "cane"]),
        ("a girl carries a bucket of water with both hands", "a girl walks with a load", ["box-carried"]),
        ("walks holding a tray with both hands", "walks", ["box-carried"]),
        ("a mother carries her child on her hip", "a mother walks with a load", ["baby-held"]),
        ("idle injured", "idle", ["injured"]),
        ("an angry person stomps forward", "a person walks forward", ["angry", "stomping"]),
        ("dragging his feet", "walking", ["foot-dragging"]),
        ("walks dragging her feet", "walks", ["foot-dragging"]),
        ("a goalkeeper shuffles sideways along the line", "a goalkeeper shuffles sideways along the line", []),
        ("she shuffles quickly to the left", "she shuffles quickly to the left", []),
        ("old woman walks with a cane", "woman walks", ["old", "cane"]),
        ("reload pistol", "", ["reloading"]),
        ("a soldier changes magazines", "", ["reloading"]),
        ("tennis serve", "", ["tennis-serve"]),
        ("she serves a tennis ball", "", ["tennis-serve"]),
        ("skipping rope", "", ["rope-skipping"]),
        ("a girl jumps rope", "", ["rope-skipping"]),
        ("a boxer skips with a rope", "", ["rope-skipping"]),
        ("opens a jar, struggling with the lid", "", ["jar-opened"]),
        ("kneels down and ties his shoe", "", ["shoe-tied"]),
        ("sits on a bench and ties her boots", "sits on a bench", ["lace-tying"]),
        ("sitting at a desk typing on a keyboard", "sitting at a desk", ["typing"]),
        ("laughing hard, slapping the knee", "laughing hard", ["knee-slapped"]),
        ("sits at a table and plays cards", "sits at a table", ["card-playing"]),
    ],
)
def test_what_a_prompt_says_beside_its_bearing(prompt: str, left: str, names: list[str]) -> None:
    bare = BarePrompt.of(prompt)
    assert bare.text == left
    assert [each.name for each in bare.stated] == names


@pytest.mark.parametrize(
    "prompt",
    [
        "a person walks",
        "a man walks through a storm",
        "he swings on the monkey bars",
        "a giant leap forward",
        "an old bridge is crossed by a man",
        "a child waves goodbye to her grandma",
        "a person walks past a zombie",
        "a person dances the robot",
        "a person walks without limping",
        "a man doesn't salute",
        "stops limping and turns",
        "a person stumbles over a rock",
        "a wrestler staggers to his feet",
        "dances until she is tired",
        "a person stomps on a bug",
        "raises both arms",
        "he saw a dog",
        "picks up a hammer and throws it",
        "fishes in her bag for the keys",
        "digs in his pocket",
        "skips the queue",
        "stretches out his hand",
        "draws a gun",
        "draw a picture of a house",
        "reels in pain",
        "walks through smoke",
        "knocks over a vase",
        "holds a golf club",
        "listens to the music",
        "a cook walks in",
        "aims a gun",
        "walks in and aims a gun",
        "holds a rifle",
        "a man stands with a hand on his shoulder",
        "picks up the phone",
        "holds the box above his head",
        "carries a basket on her head",
        "holds a dog on a leash",
        "walks with his arm hurt",
        "does a sweeping kick",
        "a karate chop",
        "looks at a photograph",
        "İstanbul'da bir adam yürür",  # lower case has another length
    ],
)
def test_other_words_are_left_alone(prompt: str) -> None:
    assert BarePrompt.of(prompt) == as_written(prompt)


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
