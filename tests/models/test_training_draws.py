"""Random draws of training, which make networks robust: they change no motion that is generated."""

from __future__ import annotations

from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import pytest

from marey.generation.port import Request
from marey.registry import get_model, model_names, resolve
from tests.support.generating import equal_motions
from tests.support.models import load, random_bundle
from tests.support.prepared import text_features

DRAWN = frozenset(
    {
        "attention_dropout", "clockless", "corruption", "drop", "dropout", "gumbel", "level_dropout", "noise",
        "perturb", "replace_mask", "replace_random", "residual_drop",
    }
)  # fmt: skip
"""Fields of configurations that are shares or strengths of such draws."""


def with_draws(config: Any, value: float) -> Any:
    """A configuration with one value in all of these fields, at any depth."""
    changed: dict[str, Any] = {}
    for each in fields(config):
        own = getattr(config, each.name)
        if is_dataclass(own):
            changed[each.name] = with_draws(own, value)
        elif each.name in DRAWN:
            changed[each.name] = value
    return replace(config, **changed)


@pytest.mark.parametrize("model", [name for name in model_names() if get_model(name).training is not None])
def test_shares_of_training_change_no_motion(model: str, tmp_path: Path) -> None:
    training = get_model(model).training
    assert training is not None
    asked = [Request(text_features(seed), seed, frames) for seed, frames in ((1, 24), (2, 24), (3, None))]
    made = []
    for value in (0.0, 0.5):
        config = with_draws(resolve(training.config)("tiny"), value)
        bundle = random_bundle(model, tmp_path / str(value), config=config)
        generator = load(bundle)
        assert generator.config == config
        made += [generator.generate(asked), generator.generate(asked)]
    for other in made[1:]:
        assert equal_motions(made[0], other)
