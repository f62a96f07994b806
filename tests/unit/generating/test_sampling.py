"""Sampling settings: the ranges that a model declares hold for its generator and for its configuration files."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import nan
from typing import get_args, get_type_hints

import pytest

from marey.core.errors import InvalidInput
from marey.generation.base import Sampling
from marey.registry import ModelSpec, Setting, find_model, resolve, trainings

TOY = ModelSpec(
    "toy",
    "Toy",
    "A toy.",
    "a:b",
    "a:c",
    (Setting("beats", 1, 8, 2, whole=True), Setting("heat", 0.5, 2.0, 1.0)),
)


@dataclass(frozen=True)
class Inference:
    """A bundle's values: of the settings, and a number that no request changes."""

    beats: int = 2
    heat: float = 1.0
    window: int = 9


@dataclass(frozen=True)
class Toy(Sampling[Inference]):
    """The settings, and a switch that the bundle does not know."""

    spec = TOY

    beats: int | None = None
    heat: float | None = None
    quick: bool = True


def test_settings_change_the_values_of_the_bundle() -> None:
    own = Inference(beats=3, window=4)
    assert Toy().inference(own) == own
    assert Toy(heat=0.5).inference(own) == replace(own, heat=0.5)
    assert Toy(beats=8, heat=2.0).inference(own) == Inference(8, 2.0, 4)


@pytest.mark.parametrize(
    ("settings", "bundle", "message"),
    [
        (Toy(beats=0), Inference(), "beats: 0 is outside 1 to 8"),
        (Toy(beats=9), Inference(), "beats: 9 is outside 1 to 8"),
        (Toy(heat=0.0), Inference(), "heat: 0 is outside 0.5 to 2"),
        (Toy(heat=nan), Inference(), "heat: nan is outside 0.5 to 2"),
        (Toy(beats=2), Inference(heat=3.0), "heat: 3 is outside 0.5 to 2"),
    ],
)
def test_a_value_out_of_the_declared_range_is_refused(settings: Toy, bundle: Inference, message: str) -> None:
    with pytest.raises(InvalidInput) as refused:
        settings.inference(bundle)
    assert str(refused.value) == message
    assert refused.value.where == message.partition(":")[0]


def test_configuration_files_have_the_declared_ranges() -> None:
    compared = 0
    for name, training in trainings().items():
        spec = find_model(name)
        if spec is None:  # the training of something else
            continue
        hints = get_type_hints(type(resolve(training.config)("paper").inference), include_extras=True)
        for setting in spec.settings:
            assert get_args(hints[setting.name]) == (int if setting.whole else float, setting.range)
            compared += 1
    assert compared
