"""Every model's generator: its progress, and what its settings change."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import pytest

from marey.core.errors import InvalidInput
from marey.generation.port import Request
from marey.registry import Setting, get_model, model_names
from tests.support.generating import Dropping, equal_motions
from tests.support.models import load, random_bundle
from tests.support.prepared import text_features


@pytest.fixture(scope="module", params=model_names())
def generator(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Any:
    """A generator of each model, with random weights."""
    return load(random_bundle(request.param, tmp_path_factory.mktemp("bundle") / "random"))


def requests(generator: Any) -> list[Request]:
    """A short motion, and two of the longest length."""
    least, most = generator.limits.min_frames, generator.limits.max_frames
    return [Request(text_features(i), i, frames) for i, frames in enumerate((least, most, most))]


def check_rising(steps: Sequence[tuple[int, int]]) -> None:
    done, total = [done for done, _ in steps], {total for _, total in steps}
    assert len(total) == 1
    assert done[0] >= 1
    assert all(after > before for before, after in pairwise(done[:-1])), "each step counts"
    assert done[-1] == total.pop(), "all of them are the whole"
    assert done[-1] - done[-2] <= 1, "the last one before the end is not far from it"


def test_the_steps_of_a_batch_add_up_to_what_was_announced(generator: Any) -> None:
    control = Dropping()
    assert all(made is not None for made in generator.generate(requests(generator), control=control))
    check_rising(control.steps)
    other = Dropping()
    generator.generate(requests(generator)[:1], control=other)
    check_rising(other.steps)
    assert other.steps[0][1] < control.steps[0][1]


def test_a_request_that_is_dropped_at_once_leaves_the_others(generator: Any) -> None:
    asked = requests(generator)
    whole, control = generator.generate(asked), Dropping(1)
    made = generator.generate(asked, control=control)
    assert made[1] is None
    assert [(each.tokens == kept.tokens).all() for each, kept in ((made[0], whole[0]), (made[2], whole[2]))] == [1, 1]
    assert control.steps[-1][0] == control.steps[-1][1]
    assert generator.generate(asked[:1], control=Dropping(0)) == [None]


def test_each_setting_changes_what_is_drawn(generator: Any) -> None:
    """A switch between the network and something else is none of these."""
    asked = [Request(text_features(seed), seed, generator.limits.max_frames) for seed in range(2)]
    spec = get_model(generator.bundle.manifest.model)
    described = generator.describe_settings(generator.settings({}))
    own = {each.name: described[each.name] for each in spec.settings}
    usual = generator.generate(asked)
    assert equal_motions(usual, generator.generate(asked, generator.settings(own))), "the bundle's own values"
    for setting in spec.settings:
        if setting.whole and (setting.low, setting.high) == (0, 1):
            continue
        near = own[setting.name] - 1 if setting.whole else own[setting.name] / 2
        others = (drawn(generator, asked, setting, value) for value in (setting.low, near, setting.high))
        assert any(not equal_motions(usual, made) for made in others if made is not None), setting.name


def drawn(generator: Any, asked: Sequence[Request], setting: Setting, value: float) -> Sequence[Any] | None:
    """Motions with another value of a setting; None where the others exclude it, or where it takes many passes."""
    try:
        settings = generator.settings({setting.name: int(value) if setting.whole else value})
    except InvalidInput:
        return None
    if setting.whole and value == setting.high:
        return None
    assert generator.describe_settings(settings)[setting.name] == value
    return generator.generate(asked, settings)
