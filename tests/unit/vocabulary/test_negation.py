"""Reading of what prompts say is not done."""

import pytest

from marey.vocabulary.entries import load_vocabulary
from marey.vocabulary.scope import ActionLists, match_scope

ALL = ActionLists(tuple(load_vocabulary().actions))


def read(prompt: str) -> list[str | None]:
    return [named.action for named in match_scope(prompt, ALL).actions]


@pytest.mark.parametrize(
    ("prompt", "actions"),
    [
        ("he walks without running or jumping", ["walk"]),
        ("without jumps the man turns around", ["turn-around"]),
        ("instead of jumping he walks", ["walk"]),
        ("she would rather walk than run", ["walk"]),
        ("neither waves nor bows, he kneels", ["kneel"]),
        ("doesn't wave and bows", ["bow"]),
        ("doesn't wave and bow", [None]),
        ("he refuses to kneel and claps", ["clap"]),
        ("too tired to run, he walks", ["walk"]),
        ("almost falls and runs", ["run"]),
        ("stops running and bows", ["bow"]),
        ("stops running", ["run"]),
        ("except for a bow he does not move", ["bow"]),
        ("everything except a bow; he waves", ["wave"]),
    ],
)
def test_an_action_that_is_not_done_is_not_read(prompt: str, actions: list[str | None]) -> None:
    scope = match_scope(prompt, ALL)
    assert read(prompt) == actions
    assert "negation" in scope.flags


@pytest.mark.parametrize(
    ("prompt", "actions"),
    [
        ("she doesn't stop walking", ["walk"]),
        ("he cannot help laughing", ["laugh"]),
        ("not only walks but waves", ["walk", "wave"]),
        ("nothing but push-ups", ["push-ups"]),
        ("he doesn't sit down until he has bowed", ["sit-down", "bow"]),
        ("stands and does nothing", ["idle"]),
    ],
)
def test_two_negations_make_none(prompt: str, actions: list[str]) -> None:
    assert read(prompt) == actions


@pytest.mark.parametrize("prompt", ["he never sits down", "the guard does not move or wave"])
def test_a_prompt_of_what_is_not_done_alone_asks_for_nothing(prompt: str) -> None:
    scope = match_scope(prompt, ALL)
    assert (scope.verdict, scope.flags, scope.left) == ("unknown", ("negation", "no-action"), None)


def test_more_than_what_is_not_done_is_left_to_the_encoder() -> None:
    assert match_scope("the officer scoots along the wall without running", ALL).left == "verb"
