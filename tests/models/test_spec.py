"""Registry entries of all models, held to their code."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Any

import pytest
import torch
from safetensors.torch import load_file

from marey.core.settings import settings as process_settings
from marey.generation.handler import GeneratorHandler
from marey.nn.transformer import sinusoidal_positions
from marey.registry import get_model, model_names, resolve
from tests.support.models import load, random_bundle

MODELS = model_names()


@pytest.fixture(scope="module", params=MODELS)
def generator(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Any:
    """A generator of each model, with random weights."""
    return load(random_bundle(request.param, tmp_path_factory.mktemp("bundle") / "random"))


def spec_of(generator: Any) -> Any:
    return get_model(generator.bundle.manifest.model)


def test_settings_are_those_that_a_batch_can_change(generator: Any) -> None:
    spec = spec_of(generator)
    own = {each.name for each in fields(generator.sampling)}
    assert {each.name for each in spec.settings} <= own
    shown = generator.describe_settings(generator.settings({}))
    assert {each.name for each in spec.settings} <= shown.keys()
    for setting in spec.settings:
        assert setting.low <= setting.default <= setting.high
        assert setting.whole == isinstance(shown[setting.name], int), "as the bundle's value"


def test_a_model_that_keeps_frames_says_so(generator: Any) -> None:
    assert spec_of(generator).keeps_frames == (generator.limits.keeps > 0)


def test_a_model_whose_handler_chooses_among_candidates_says_so(generator: Any) -> None:
    spec = spec_of(generator)
    handler = resolve(spec.handler)()
    assert spec.best_of == isinstance(handler, GeneratorHandler)
    assert handler.queue == spec.name


def test_the_handler_loads_a_bundle_on_the_device_that_is_set(generator: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(process_settings(), "device", "cpu")
    monkeypatch.setattr(process_settings(), "threads", 1)
    handler = resolve(spec_of(generator).handler)()
    handler.load(str(generator.bundle.path))
    assert handler.generator.device == torch.device("cpu")
    assert handler.generator.bundle.reference == generator.bundle.reference
    assert handler.batch_size == handler.generator.batch, "a claim fills a pass"
    monkeypatch.setattr(process_settings(), "device", "nowhere")
    with pytest.raises(Exception, match="unknown device 'nowhere'"):
        resolve(spec_of(generator).handler)().load(str(generator.bundle.path))


def test_lengths_of_a_bundle_are_within_those_of_its_model(generator: Any) -> None:
    limits, own = spec_of(generator).limits, generator.limits
    assert limits.min_seconds <= own.min_frames / own.fps <= own.max_frames / own.fps <= limits.max_seconds


@pytest.mark.parametrize("model", MODELS)
def test_a_variety_draws_motions_nearer_to_each_other_or_farther_apart(model: str) -> None:
    variety = get_model(model).variety
    assert variety is not None
    assert variety.low.keys() == variety.high.keys()
    for setting, factor in variety.low.items():
        assert 0 < factor < 1 < variety.high[setting]
        each = next(each for each in get_model(model).settings if each.name == setting)
        assert each.problem(each.default * factor) is None
        assert each.problem(each.default * variety.high[setting]) is None


@pytest.mark.parametrize("model", [name for name in MODELS if get_model(name).training is not None])
def test_every_stage_has_its_optimisation_and_all_comes_last(model: str, tmp_path: Path) -> None:
    training = get_model(model).training
    assert training is not None
    *stages, last = (stage.name for stage in training.stages)
    assert last == "all"
    config = resolve(training.config)("tiny")
    assert {name for name in vars(config) if name.startswith("train_")} == {f"train_{stage}" for stage in stages}


def test_tables_that_follow_from_sizes_are_not_stored_with_the_weights(generator: Any) -> None:
    """A bundle is read by later versions, whose tables may be longer."""
    stored = {
        f"{file.name}: {name}": tensor.float()
        for file in generator.bundle.path.rglob("*.safetensors")
        for name, tensor in load_file(file).items()
    }
    assert stored
    for name, tensor in stored.items():
        table = tensor.ndim == 2 and len(tensor) > 2 and tensor.shape[1] % 2 == 0
        assert not (table and torch.allclose(tensor, sinusoidal_positions(*tensor.shape), atol=1e-3)), name


def test_the_moving_averages_of_codes_are_as_slow_as_the_configuration_says(generator: Any) -> None:
    config, tokenizer = generator.config.to_dict(), resolve(spec_of(generator).tokenizer)
    trained = spec_of(generator).training is not None
    assert ("decay" in config["tokenizer"]) == trained
    for decay in (0.5, 0.9) if trained else ():
        config["tokenizer"]["decay"] = decay
        assert tokenizer(config).quantizer.decay == decay
