"""The reader of the order of time."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from safetensors.numpy import save_file

from marey.core.errors import InvalidFile
from marey.text.encoders import Encoding
from marey.text.order_reader import MOST_CLAUSES, OrderReader, likeliest_order, marked, order_reader
from tests.support.texts import order_of_time, shared_encoder


def test_it_knows_the_shipped_encoder() -> None:
    assert order_reader().encoder_sha256 == shared_encoder().sha256


@pytest.mark.parametrize(
    ("text", "order"),
    [
        ("he walks up,| and bows", (0, 1)),
        ("he walks,| after that he bows", (0, 1)),
        ("he walks,| after a few seconds he bows", (0, 1)),
        ("after climbing the stairs| he bows", (0, 1)),
        ("he kneels| before he draws his sword", (0, 1)),
        ("she won't stop clapping| until she sits down", (0, 1)),
        ("he bows| after sitting on the floor", (1, 0)),
        ("he walks off| once he has bowed", (1, 0)),
        ("before leaving the room| he bows", (1, 0)),
        ("prior to kneeling,| the knight swings his sword twice", (1, 0)),
        ("only after bowing deeply| does he leave", (0, 1)),
        ("he kneels,| but only after he has run up to the gate", (1, 0)),
        ("she sits down,| having waved to the crowd", (1, 0)),
    ],
)
def test_clauses_come_in_the_order_of_time(text: str, order: tuple[int, ...]) -> None:
    clauses = text.split("|")
    assert order_of_time(clauses, [True] * len(clauses)) == order


def test_what_asks_for_no_movement_is_left_out() -> None:
    clauses = ["The crowd is loud.", " He bows", " after having run up to the stage"]
    assert order_of_time(clauses, [False, True, True]) == (2, 1)
    assert order_of_time(clauses, [False, True, False]) == (1,)


def test_more_clauses_than_are_compared_stay_as_they_are_written() -> None:
    def encode(text: str) -> Encoding:
        raise AssertionError(text)

    many = ["he bows,"] + ["having clapped,"] * MOST_CLAUSES
    assert order_reader().order(many, [True] * len(many), encode) == tuple(range(len(many)))


def test_clauses_past_the_limit_of_the_encoder_stay_as_they_are_written() -> None:
    assert order_of_time(["he bows,", "slowly " * 300, "having clapped before"], [True, False, True]) == (0, 2)


@given(st.lists(st.text(" abc", min_size=1).filter(str.strip), min_size=1, max_size=6))
def test_the_marks_stand_between_clauses(clauses: list[str]) -> None:
    text, spans = marked(clauses)
    assert [text[start:end] for start, end in spans] == [clause.strip() for clause in clauses]


def test_all_pairs_together_decide() -> None:
    assert likeliest_order([0, 1, 2], {(0, 1): 3.0, (0, 2): 3.0, (1, 2): -3.0}) == (1, 2, 0)
    assert likeliest_order([0, 1, 2], {(0, 1): 9.0, (0, 2): -1.0, (1, 2): 2.0}) == (1, 0, 2)
    assert likeliest_order([4, 7], {(4, 7): 0.5}) == (4, 7)  # in doubt as they are written


def test_a_file_of_another_reader_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "reader.safetensors"
    save_file({}, path, {"classes": "[]", "encoder_sha256": ""})
    with pytest.raises(InvalidFile, match="not a reader of the order of time"):
        OrderReader.load(path)
