"""Capabilities of a generator, read from its bundle alone."""

from __future__ import annotations

import secrets
from dataclasses import replace
from pathlib import Path

import pytest

from marey.bundles import find_bundle
from marey.bundles.limits import settings_of
from marey.core.settings import Settings
from marey.items.item import Item
from marey.items.values import MAX_SEED
from marey.jobs.generators import GeneratorCapabilities, capabilities_of, new_items
from marey.motion.edits.steps import read_steps
from marey.takes.model_edits import EditGenerator
from marey.text.keys import scope_key
from marey.vocabulary.scope import ActionLists, match_scope
from tests.support.live_api import write_bundle

LISTS = ActionLists(("walk", "bow", "wave"), tried=("kick",))
UNDECIDED = "a wave of nausea"
"""Its words alone do not tell a gesture from a thing."""
ROWS = ({"start": 0.0, "end": 2.0, "prompt": UNDECIDED},)


@pytest.fixture
def generator(tmp_path: Path) -> GeneratorCapabilities:
    write_bundle(tmp_path, "own", actions=LISTS)
    config = Settings(models=tmp_path, home=tmp_path)
    return capabilities_of(find_bundle("own", config=config, verify=False), config)


@pytest.mark.parametrize("rows", [None, ROWS])
def test_a_verdict_has_a_key_of_its_own_where_the_prompt_has_rows(
    generator: GeneratorCapabilities, rows: tuple[dict[str, object], ...] | None
) -> None:
    key = generator.scope_key(Item(UNDECIDED, timeline=rows), match_scope(UNDECIDED, LISTS))
    assert key == scope_key(UNDECIDED, generator.bundle.reference, LISTS, in_rows=rows is not None)


def test_what_words_decide_has_no_key(generator: GeneratorCapabilities) -> None:
    prompt = "a person bows"
    assert generator.scope_key(Item(prompt), match_scope(prompt, LISTS)) is None
    assert generator.scope_key(Item(prompt), None) is None


def test_drawn_seeds_of_all_variants_are_seeds(
    generator: GeneratorCapabilities, monkeypatch: pytest.MonkeyPatch
) -> None:
    item = Item("a person bows", variants=8)
    for draw, first in ((lambda _: 0, 0), (lambda below: below - 1, MAX_SEED - 7)):
        monkeypatch.setattr(secrets, "randbelow", draw)
        assert [new.seed for new in new_items([(item, generator)])] == list(range(first, first + 8))
    assert [new.seed for new in new_items([(replace(item, seed=5), generator)])] == list(range(5, 13))


@pytest.mark.parametrize("prompt", [UNDECIDED, "a person bows", "a person kicks a ball"])
def test_the_scope_of_an_edit_waits_for_the_encoder_only_where_words_leave_it_undecided(
    generator: GeneratorCapabilities, prompt: str
) -> None:
    steps = read_steps([{"op": "extend", "seconds": 1, "prompt": prompt}])
    columns = EditGenerator(generator).columns(steps, "warn")
    by_words = match_scope(prompt, LISTS)
    assert columns["scope"] == by_words.as_json()
    key = scope_key(prompt, generator.bundle.reference, LISTS, of_edit=True)
    assert columns.get("scope_key") == (key if prompt == UNDECIDED else None)
    assert (by_words.left is not None) == (prompt == UNDECIDED)
    assert not {"scope", "scope_key"} & EditGenerator(generator).columns(steps, "ignore").keys()


def test_items_of_equal_settings_are_of_one_batch_in_whatever_order_they_name_them(
    generator: GeneratorCapabilities,
) -> None:
    first, second, *_ = settings_of(generator.bundle)
    named = {first.name: first.high, second.name: second.high}
    turned = dict(reversed(named.items()))
    another = {**named, first.name: first.low}
    items = [(Item("a person bows", settings=settings), generator) for settings in (named, turned, another)]
    one, same, other = (new.batch_key for new in new_items(items))
    assert one == same != other
