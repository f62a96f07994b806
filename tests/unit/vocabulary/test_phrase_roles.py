"""Words of the vocabulary in other grammatical roles: who does something, with which object, and what says how."""

import pytest

from marey.vocabulary.entries import load_vocabulary
from marey.vocabulary.scope import ActionLists, match_scope

ALL = ActionLists(tuple(load_vocabulary().actions))


def read(prompt: str) -> list[str | None]:
    return [named.action for named in match_scope(prompt, ALL).actions]


Row = tuple[str, list[str | None]]

PARTS: list[Row] = [
    ("a porter walks with his arms hanging", ["walk"]),
    ("stands still, both legs dangling", ["idle"]),
    ("she runs, her hair flying", ["run"]),
    ("the man sits while his hands rest on the knees", ["sit"]),
    ("he kneels, head bowed", ["kneel"]),
    ("she shoots and the gun kicks back", ["shoot"]),
    ("he walks, elbows bent", ["walk"]),
    # the part does the action: by the action's own words, its side or its definition
    ("he walks, his left hand waving", ["walk", "wave"]),
    ("she stands, right leg kicking", ["idle", "kick"]),
    ("both hands clap", ["clap"]),
    ("he walks, his right hand slashing", ["walk", "slash"]),
    ("the right hand swings a sword", ["slash"]),
    ("a man with long arms walks", ["walk"]),
    ("with a raised hand he walks", ["raise-arm", "walk"]),
    ("he knees the guard", ["kick"]),
]
OBJECTS: list[Row] = [
    ("pushes her hair back and waves", ["wave"]),
    ("turns her head and bows", ["idle", "bow"]),
    ("he throws himself aside", ["dodge"]),
    ("she throws back her head and laughs", ["laugh"]),
    ("spins the wheel, then sits", ["sit"]),
    ("he pulls his body up and jumps", ["jump"]),
    ("picks himself up", ["get-up"]),
    ("pulls herself up onto the wall", ["climb-onto"]),
    ("turns the torso to the side", ["twist"]),
    # the object of the action itself
    ("pushes the cart", ["push"]),
    ("throws a hand grenade", ["throw"]),
    ("rolls his shoulders", ["arm-circles"]),
    ("whirls the whole body around", ["spin"]),
    ("spins on one foot", ["spin"]),
]
BLOWS: list[Row] = [
    ("a 360 degree spin kick", ["kick"]),
    ("a spinning back kick", ["kick"]),
    ("performs a spinning roundhouse kick", ["kick"]),
    ("a jumping spin kick", ["kick"]),
    ("throws a backfist", ["punch"]),
    ("throws an overhand right", ["punch"]),
    ("lands a right cross", ["punch"]),
    # movements of their own
    ("spins and kicks", ["spin", "kick"]),
    ("she jumps, then does a kick", ["jump", "kick"]),
    ("throws the ball overhand", ["throw"]),
]
PARTICLES: list[Row] = [
    ("walks down the lane", ["walk"]),
    ("walking up and down", ["walk"]),
    ("a man walks up to the desk", ["walk"]),
    ("runs up to the gate", ["run"]),
    ("a guard stands at the gate", ["idle"]),
    ("the guard sits", ["sit"]),
    ("walks quickly down the street", ["walk"]),
    ("walks slowly down the stairs", ["climb-stairs"]),
    ("he turns very slowly around", ["turn-around"]),
    ("turns around the corner", ["turn"]),
    ("jumps and pushes off", ["jump"]),
    ("throw in some jumping jacks", ["jumping-jacks"]),
    ("climbs the ladder hand over hand", ["climb-ladder"]),
    ("laughs his head off", ["laugh"]),
    ("make her turn around", ["turn-around"]),
    # the particle stays the verb's
    ("walks up the stairs", ["climb-stairs"]),
    ("walks down", ["climb-stairs"]),
    ("turns around the other way", ["turn-around"]),
    ("hands over the keys", ["reach-forward"]),
]
PERFORMED: list[Row] = [
    ("throws a cartwheel", ["cartwheel"]),
    ("he throws a back handspring", ["flip"]),
    ("lands a few quick punches", ["punch"]),
    ("ducks under a kick", ["dodge"]),
    ("hops out of the way of the sword swing", ["hop"]),
    ("bursts out of the blocks and sprints", ["sprint"]),
    ("he dodges the kick", ["dodge"]),
    ("a basketball player waves", ["wave"]),
    ("holds the bow and kneels", ["kneel"]),
    ("he nods while someone explains the plan", ["nod"]),
    ("as an attacker strikes, the guard kneels", ["kneel"]),
    ("shivers as if dancing", ["shiver"]),
    ("slashes in a wide arc", ["slash"]),
    ("runs with long strides", ["run"]),
    ("turns his palms up in turn and claps", ["clap"]),
    # what the person does
    ("throws a ball", ["throw"]),
    ("as he walks, he waves", ["walk", "wave"]),
    ("walks along a wide curve", ["walk", "turn"]),
    ("takes a bow", ["bow"]),
    ("a karate move", ["karate"]),
]
NOUNS: list[Row] = [
    ("gets up from the old leather armchair", ["stand-up"]),
    ("gets up from the muddy ground", ["get-up"]),
    ("lowers himself onto a bench", ["sit-down"]),
    ("sits on the carpet", ["sit-floor"]),
    ("walks up a spiral staircase", ["climb-stairs"]),
    ("hops up and down on her left foot", ["hop"]),
    ("goes up a flight of stairs", ["climb-stairs"]),
    ("a man does a grand jeté", ["leap"]),
    ("she is sitting on a chair", ["sit"]),
    ("he sits on a chair", ["sit-down"]),
    ("lying on his back", ["lie"]),
    # a participle is no noun, an adjective that is an action no adjective, "play football" no "play ball"
    ("stands there, knees slightly bent", ["idle"]),
    ("takes four jogging steps", ["run", "walk"]),
    ("makes a half turn", ["turn-around"]),
    ("make the man bow", ["bow"]),
    ("plays football", ["kick-ball"]),
]
CONTEXT: list[Row] = [
    ("she lies on the floor, then stands up", ["lie", "get-up"]),
    ("he sits on a bench, then gets up", ["sit-down", "stand-up"]),
    ("she kneels, then stands up", ["kneel", "stand-up"]),
    ("he stands up", ["stand-up"]),
    ("she gets up", ["get-up"]),
]


@pytest.mark.parametrize(("prompt", "actions"), [*PARTS, *OBJECTS, *BLOWS, *PARTICLES, *PERFORMED, *NOUNS, *CONTEXT])
def test_a_prompt_is_read_as_what_the_person_does(prompt: str, actions: list[str | None]) -> None:
    assert read(prompt) == actions


@pytest.mark.parametrize("part", ["arms", "legs", "both hands", "his fingers", "her long hair"])
@pytest.mark.parametrize("verb", ["hanging", "swinging", "resting", "driving", "flying"])
@pytest.mark.parametrize(
    ("clause", "action"), [("she walks", "walk"), ("he sits", "sit"), ("a man climbs a ladder", "climb-ladder")]
)
def test_a_clause_of_a_part_of_the_body_adds_no_action(clause: str, action: str, verb: str, part: str) -> None:
    for joined in (f"{clause}, {part} {verb}", f"{clause} with {part} {verb}"):
        assert read(joined) == [action]


@pytest.mark.parametrize("adverbial", ["step by step", "again and again", "in turn", "back and forth"])
@pytest.mark.parametrize("clause", ["a person walks", "she kneels", "he swings a sword"])
def test_an_adverbial_adds_no_action(clause: str, adverbial: str) -> None:
    assert read(f"{clause} {adverbial}") == read(clause)


def test_what_stands_alone_is_read_though_it_is_beside_an_action_elsewhere() -> None:
    assert read("arms hanging") == ["hang"]
    assert read("on tiptoe") == ["sneak"]
    assert read("elbow to knee") == ["knee-to-elbow"]


def test_a_phrase_that_is_only_near_counts_beside_no_action() -> None:
    assert match_scope("a woman walks, swinging her arms", ALL).verdict == "known"
    assert match_scope("swings her arms", ALL).verdict == "close"


@pytest.mark.parametrize(
    ("prompt", "negated"),
    [
        ("walks and stops at the door", False),
        ("avoids the blow", False),
        ("she does nothing", False),
        ("stops walking", True),
        ("he forgets to bow", True),
        ("walks and does nothing else, no bows", True),
    ],
)
def test_a_verb_that_ends_something_negates_only_a_verb(prompt: str, negated: bool) -> None:
    assert ("negation" in match_scope(prompt, ALL).flags) is negated
