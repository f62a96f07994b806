"""Actions that prompts describe part by part."""

import pytest

from marey.core.errors import InvalidFile
from marey.vocabulary import movements
from marey.vocabulary.entries import load_vocabulary
from marey.vocabulary.movements import load_movements
from marey.vocabulary.scope import ActionLists, match_scope

ALL = ActionLists(tuple(load_vocabulary().actions))


def read(prompt: str) -> list[str | None]:
    return [named.action for named in match_scope(prompt, ALL).actions]


@pytest.mark.parametrize(
    ("prompt", "action"),
    [
        ("lifts the foot off the ground, brings the knee up to the chest and thrusts the foot forward", "kick"),
        ("the fist shoots forward from the hip", "punch"),
        ("raises a hand to head height and rocks it from side to side", "wave"),
        ("the upper body tips forward from the hips and comes back up", "bow"),
        ("bends the knees, pushes off with both feet, rises and lands on the same spot", "jump"),
        ("the knee comes down onto the floor", "kneel"),
        ("cocks the arm back and whips it forward over the shoulder", "throw"),
        ("the forearm snaps up in front of the face", "block"),
    ],
)
def test_movements_of_parts_are_the_action_that_they_make(prompt: str, action: str) -> None:
    scope = match_scope(prompt, ALL)
    assert read(prompt) == [action]
    assert scope.verdict == "known"


@pytest.mark.parametrize(
    ("prompt", "actions"),
    [
        ("he walks, a hand thrown high in the air", ["walk"]),
        ("steps over the cable, the knee lifted", ["walk"]),
        ("sits on a chair and stretches a leg forward", ["sit-down"]),
        ("bends the knees, jumps onto the box and straightens up", ["jump-forward"]),
        ("walks without bringing the knee up and thrusting the foot forward", ["walk"]),
        ("bends down, hands on the thighs, then comes up", ["bend-over"]),
    ],
)
def test_what_parts_do_beside_an_action_is_none(prompt: str, actions: list[str]) -> None:
    assert read(prompt) == actions


def test_a_movement_joins_the_actions_around_it() -> None:
    assert read("he runs up, lifts the knee and thrusts the foot forward, then bows") == ["run", "kick", "bow"]


def test_movements_are_of_actions_and_each_is_needed() -> None:
    assert {movement.action for movement in load_movements()} <= set(load_vocabulary().actions)
    assert all(movement.steps for movement in load_movements())


def test_a_step_without_its_three_slots_is_invalid() -> None:
    with pytest.raises(InvalidFile, match="parts / verbs / where"):
        movements._step("foot / thrust", {})
