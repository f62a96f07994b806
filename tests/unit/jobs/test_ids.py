"""Identifiers."""

import time
from uuid import RFC_4122

from marey.db.ids import new_id


def test_an_id_is_a_uuid_of_version_7_that_holds_the_time() -> None:
    before = time.time_ns() // 1_000_000
    made = new_id()
    assert (made.version, made.variant) == (7, RFC_4122)
    assert before <= made.int >> 80 <= time.time_ns() // 1_000_000


def test_all_62_bits_after_the_variant_are_random() -> None:
    made = [new_id().int for _ in range(200)]
    for bit in range(62):
        assert len({number >> bit & 1 for number in made}) == 2, bit


def test_ids_are_in_the_order_in_which_they_were_made_and_differ() -> None:
    made = []
    for _ in range(100):
        made.append(new_id())
        time.sleep(1e-6)  # longer than the 244 ns that its fraction of a millisecond tells apart
    assert made == sorted(made)
    assert len(set(made)) == 100
