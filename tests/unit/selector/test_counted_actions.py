"""Actions that a prompt can count."""

from __future__ import annotations

from marey.selector.repetitions import REPETITIONS
from marey.vocabulary.entries import load_vocabulary
from marey.vocabulary.scope import every_action, match_scope


def test_the_vocabulary_calls_those_counted_whose_repetitions_are_found() -> None:
    counted = {action.id for action in load_vocabulary().actions.values() if action.counted}
    assert counted == set(REPETITIONS)


def test_numbers_of_counted_actions_are_kept() -> None:
    assert "counts" not in match_scope("a man bows three times", every_action()).flags
    assert "counts" not in match_scope("a man takes three steps forward", every_action()).flags
    assert "counts" in match_scope("a man walks three times around the table", every_action()).flags
    assert "counts" in match_scope("a man drinks three times", every_action()).flags
    assert "counts" in match_scope("a man drinks three times and bows twice", every_action()).flags
