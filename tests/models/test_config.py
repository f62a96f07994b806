"""The configurations of every model by name: each fits its body and itself, and comes back from a manifest."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from importlib import import_module
from typing import Any

import pytest

from marey.core.configs import ModelConfig
from marey.core.errors import InvalidInput
from marey.motion.features import layout
from marey.registry import get_model, model_names
from marey.training.config_checks import check_body, check_heads


def module_of(model: str) -> Any:
    """The module of a model's configurations, beside that of its handler."""
    return import_module(get_model(model).handler.partition(":")[0].rpartition(".")[0] + ".config")


CONFIGS = {
    f"{model} {name}": (config, module_of(model).named_config)
    for model in model_names()
    for name, config in module_of(model).CONFIGS.items()
}
each_config = pytest.mark.parametrize(("config", "named"), CONFIGS.values(), ids=list(CONFIGS))


def tables(config: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    """A configuration and all those inside it, by name."""
    yield name, config
    for each in fields(config):
        if is_dataclass(getattr(config, each.name)):
            yield from tables(getattr(config, each.name), f"{name}{each.name}.")


@each_config
def test_a_configuration_has_the_sizes_of_its_layout(config: Any, named: Any) -> None:
    frames = (config.min_frames, config.max_frames)
    check_body(config.layout, config.features, config.joints, config.fps, frames)
    assert layout(config.layout).name == config.layout
    assert frames[0] >= 1


@each_config
def test_heads_divide_the_width_of_every_network(config: Any, named: Any) -> None:
    found = list(tables(config))
    assert any(hasattr(table, "heads") for _, table in found)
    for name, table in found:
        for heads in ("heads", "attention_heads"):
            if hasattr(table, heads):
                assert getattr(table, heads) > 0
                check_heads(f"{name}{heads}", getattr(table, heads), table.width)


@each_config
def test_a_configuration_is_found_by_its_name_and_comes_back_from_a_manifest(config: ModelConfig, named: Any) -> None:
    config.check()
    assert named(config.name) is config  # pyright: ignore[reportAttributeAccessIssue]
    assert type(config).from_dict(config.to_dict()) == config
    with pytest.raises(InvalidInput, match="unknown configuration 'nowhere'") as refused:
        named("nowhere")
    assert config.name in (refused.value.hint or "")


@each_config
def test_motions_are_whole_tokens_that_the_model_reads(config: Any, named: Any) -> None:
    """A motion of the longest length has no frame that no token covers, and training windows are whole tokens."""
    rate = getattr(config.tokenizer, "frames_per_token", 1)
    assert config.max_frames % rate == config.min_frames % rate == 0
    assert all(window % rate == 0 for window in getattr(config, "windows", ()))


@pytest.mark.parametrize("model", model_names())
def test_the_defaults_that_are_shown_are_those_of_bundles_without_their_own(model: str) -> None:
    """`marey models show` names a default of each setting."""
    spec, inference = get_model(model), module_of(model).InferenceConfig()
    assert {each.name: each.default for each in spec.settings} == {
        each.name: getattr(inference, each.name) for each in spec.settings
    }
    for config in module_of(model).CONFIGS.values():
        assert not [each.name for each in spec.settings if each.problem(getattr(config.inference, each.name))]
