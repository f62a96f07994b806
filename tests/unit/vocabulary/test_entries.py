"""The vocabulary's file and its loader."""

import re

import pytest

from marey.core.errors import InvalidFile, NotFound
from marey.vocabulary.entries import Action, load_vocabulary, parse_vocabulary

ACTIONS = list(load_vocabulary().actions.values())


def test_at_least_sixty_actions() -> None:
    assert len(ACTIONS) >= 60


@pytest.mark.parametrize("action", ACTIONS, ids=lambda action: action.id)
def test_each_entry_is_whole(action: Action) -> None:
    assert re.fullmatch(r"[a-z]+(-[a-z]+)*", action.id)
    assert action.definition.endswith(".")
    assert len(action.definition) > 80
    assert action.nouns
    assert action.id not in action.implies
    assert 0 < action.flight_s < 1
    for phrase in (*action.verbs, *action.nouns, *action.near):
        assert phrase == phrase.lower().strip()


def test_no_phrase_belongs_to_an_action_twice() -> None:
    for action in ACTIONS:
        assert not set(action.near) & {*action.verbs, *action.nouns}, action.id


def test_implication_reaches_through_others() -> None:
    entry = '[{}]\ndefinition = "x"\nverbs = ["{}"]\nimplies = {}\n'
    chain = [
        entry.format(name, name, implies) for name, implies in (("a", ["b"]), ("b", ["c", "d"]), ("c", []), ("d", []))
    ]
    vocabulary = parse_vocabulary("".join(chain).replace("'", '"').encode(), "v.toml")
    assert vocabulary.implied("a") == {"b", "c", "d"}
    assert vocabulary.implied("c") == frozenset()


def test_an_unknown_id_lists_the_known_ones() -> None:
    with pytest.raises(NotFound, match="unknown action 'juggle'\n  Known: idle, walk"):
        load_vocabulary().need("juggle")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[walk", "not a TOML file"),
        ("walk = 3", "walk: is not a table"),
        ('[walk]\nverbs = ["walk"]', "definition is missing"),
        ('[walk]\ndefinition = "x"', "verbs is missing"),
        ('[walk]\ndefinition = "x"\nverbs = ["walk"]\nsides = 1', "unknown field 'sides'"),
        ('[walk]\ndefinition = "x"\nverbs = ["walk"]\nsupport = "wings"', "unknown support 'wings'; known: feet"),
        ('[walk]\ndefinition = "x"\nverbs = ["walk", "walk"]', "'walk' twice"),
        ('[walk]\ndefinition = "x"\nverbs = ["walk"]\nimplies = ["go"]', "implies names no action: go"),
        ('[walk]\ndefinition = "x"\nverbs = ["walk"]\nkind_of = "go"', "kind_of names no action: go"),
        ('[walk]\ndefinition = "x"\nverbs = "walk"', "verbs is not a list"),
    ],
)
def test_a_broken_file_names_its_fault(text: str, message: str) -> None:
    with pytest.raises(InvalidFile, match=re.escape(message)):
        parse_vocabulary(text.encode(), "v.toml")
