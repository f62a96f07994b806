"""Settings of sampling: a model that is installed here knows their ranges, of another its bundle tells the names."""

from __future__ import annotations

from pathlib import Path

import pytest

from marey.bundles import Bundle, find_bundle
from marey.bundles.limits import check_settings, sampling_of, settings_of, variety_settings
from marey.core.errors import InvalidInput
from marey.core.settings import Settings
from marey.items.item import Item, read_item
from marey.jobs.generators import capabilities_of, new_items
from marey.registry import get_model
from tests.support.evaluations import write_generator

FOREIGN, KNOWN = "toy-starter", "hgm3-starter"


@pytest.fixture
def config(tmp_path: Path) -> Settings:
    write_generator(tmp_path, FOREIGN)
    write_generator(tmp_path, KNOWN, model="hgm3")
    return Settings(home=tmp_path, models=tmp_path)


def bundle(config: Settings, name: str) -> Bundle:
    return find_bundle(name, config=config)


def test_an_installed_model_gives_ranges_and_its_bundle_the_defaults(config: Settings) -> None:
    found = {each.name: each for each in settings_of(bundle(config, KNOWN))}
    assert (found["steps"].low, found["steps"].high, found["steps"].default) == (1, 100, 10)
    assert found["guidance"].default == 4.0  # the bundle has none
    assert check_settings(bundle(config, KNOWN), {"steps": 8.0, "guidance": 3, "fps": 30.0}) == {
        "steps": 8, "guidance": 3.0, "fps": 30.0,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"guidance": 101.0}, "guidance: 101 is outside 0 to 100"),
        ({"steps": 2.5}, "steps: is 2.5, not a whole number"),
        ({"heat": 1.0}, "unknown setting 'heat' of hgm3-starter; known: steps, motion_steps, action_steps, guidance"),
    ],
)
def test_what_an_installed_model_cannot_be_set_to_is_told(
    config: Settings, values: dict[str, float], message: str
) -> None:
    with pytest.raises(InvalidInput, match=message):
        check_settings(bundle(config, KNOWN), values)


def test_of_a_model_that_is_not_installed_the_names_are_known(config: Settings) -> None:
    assert check_settings(bundle(config, FOREIGN), {"steps": 5000.0}) == {"steps": 5000}
    with pytest.raises(InvalidInput, match="unknown setting 'guidance' of toy-starter; known: steps, fps"):
        check_settings(bundle(config, FOREIGN), {"guidance": 2.0})


def test_a_row_holds_whole_settings_as_integers_however_they_were_written(config: Settings) -> None:
    generator = capabilities_of(bundle(config, FOREIGN), config)
    rows = list(new_items((Item("walk", settings={"steps": steps}), generator) for steps in (8, 8.0)))
    assert [type(row.settings["steps"]) for row in rows] == [int, int]
    assert len({row.batch_key for row in rows}) == 1


def test_variants_of_a_row_count_up_from_its_seed(config: Settings) -> None:
    generator = capabilities_of(bundle(config, FOREIGN), config)
    rows = list(new_items([(Item("walk", seed=7, variants=3), generator), (Item("walk", variants=2), generator)]))
    assert [(row.index, row.variant, row.seed) for row in rows[:3]] == [(0, 0, 7), (0, 1, 8), (0, 2, 9)]
    assert [(row.index, row.variant, row.seed - rows[3].seed) for row in rows[3:]] == [(1, 0, 0), (1, 1, 1)]


def test_candidates_and_redraws_are_settings_of_models_that_can_choose(config: Settings) -> None:
    known = bundle(config, KNOWN)
    assert check_settings(known, {"best_of": 4, "redraws": 1, "steps": 8}) == {"best_of": 4, "redraws": 1, "steps": 8}
    assert check_settings(known, {"best_of": 1, "redraws": 0}) == {}
    for name in ("best_of", "redraws"):
        with pytest.raises(InvalidInput, match=f"{name}: the model 'toy' does not choose among candidates"):
            check_settings(bundle(config, FOREIGN), {name: 2})
    assert check_settings(bundle(config, FOREIGN), {"best_of": 1}) == {}


def test_one_candidate_shares_the_batch_of_items_that_name_none(config: Settings) -> None:
    generator = capabilities_of(bundle(config, KNOWN), config)
    plain, one, two = new_items((Item("walk", settings=s), generator) for s in ({}, {"best_of": 1}, {"best_of": 2}))
    assert plain.batch_key == one.batch_key != two.batch_key
    assert two.settings == {"best_of": 2}


def test_a_variety_is_factors_on_the_defaults_of_the_bundle_within_the_ranges(config: Settings) -> None:
    shipped = find_bundle("hgm3-starter")
    assert variety_settings(shipped, None) == variety_settings(shipped, "normal") == {}
    defaults = {each.name: each.default for each in settings_of(shipped)}
    spec = get_model("hgm3")
    assert spec.variety is not None
    for level, factors in (("low", spec.variety.low), ("high", spec.variety.high)):
        found = variety_settings(shipped, level)
        assert found == {name: pytest.approx(defaults[name] * factor) for name, factor in factors.items()}
        assert check_settings(shipped, found) == found
    low, high = variety_settings(shipped, "low"), variety_settings(shipped, "high")
    assert all(low[name] < defaults[name] < high[name] for name in low)
    with pytest.raises(InvalidInput, match="the model 'toy' has no variety 'high'"):
        variety_settings(bundle(config, FOREIGN), "high")
    assert variety_settings(bundle(config, FOREIGN), "normal") == {}


def test_own_settings_come_before_those_of_the_variety(config: Settings) -> None:
    item = Item("walk", settings={"temperature": 2.0}, variety="high")
    found = sampling_of(bundle(config, KNOWN), item)
    assert (found["temperature"], found["top_k"]) == (2.0, 0.2)
    (row,) = new_items([(item, capabilities_of(bundle(config, KNOWN), config))])
    assert row.settings == found


def test_normal_variety_is_that_of_a_row_without_one(config: Settings) -> None:
    generator = capabilities_of(bundle(config, KNOWN), config)
    plain, normal, low = new_items((Item("walk", variety=level), generator) for level in (None, "normal", "low"))
    assert plain.settings == normal.settings == {}
    assert plain.batch_key == normal.batch_key != low.batch_key


def test_a_variety_is_one_of_three_words() -> None:
    item, problems = read_item({"prompt": "walk", "variety": "high"})
    assert (item and item.variety, problems) == ("high", [])
    for wrong in ("huge", 3, ""):
        _, (problem,) = read_item({"prompt": "walk", "variety": wrong})
        assert problem.field == "variety"


def test_a_row_has_the_length_that_its_prompt_states(config: Settings) -> None:
    generator = capabilities_of(bundle(config, KNOWN), config)
    prompt = "a person walks for three seconds"
    items = [Item(prompt), Item(prompt, seconds=2.0), Item("a person walks"), Item("a person walks for an hour")]
    too_long = Item("a person walks for a minute")
    rows = new_items((item, generator) for item in [*items, too_long])
    assert [row.seconds for row in rows] == [3.0, 2.0, None, None, None]
