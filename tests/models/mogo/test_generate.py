"""Bundles of MOGO, and whole motions drawn from them."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import torch

from marey.bundles import Bundle
from marey.bundles.limits import seconds_of
from marey.core.errors import InvalidBundle, InvalidInput
from marey.generation.port import Request
from marey.models.hgm3.bundle import random_bundle as hgm3_bundle
from marey.models.mogo.assembly import RECIPE, assemble
from marey.models.mogo.bundle import random_bundle
from marey.models.mogo.config import TINY, InferenceConfig
from marey.models.mogo.generate import MAX_SESSIONS, Generator, SamplingSettings
from marey.models.mogo.spec import SPEC
from marey.models.mogo.state import NEVER
from marey.models.mogo.streaming import StreamBatch
from marey.models.mogo.train import train_stage
from marey.motion.skeleton import HUMANML3D
from marey.registry import Setting
from marey.training.budget import Budget
from marey.training.staging import TrainOptions
from tests.support.generating import Dropping
from tests.support.prepared import text_features, write_prepared


@pytest.fixture(scope="session")
def generator(tmp_path_factory: pytest.TempPathFactory) -> Generator:
    return Generator.load(random_bundle(tmp_path_factory.mktemp("mogo") / "random-tiny"), device="cpu")


def test_a_motion_does_not_depend_on_those_beside_it(generator: Generator) -> None:
    requests = [Request(text_features(k), seed=k, frames=16 + k) for k in range(8)]
    together = generator.generate(requests)
    for request, made in zip(requests, together, strict=True):
        (alone,) = generator.generate([request])
        assert made.tokens.shape == (TINY.tokenizer.levels, request.frames)
        assert np.array_equal(alone.tokens, made.tokens)
        assert np.array_equal(alone.features, made.features)


def test_more_requests_than_sessions_are_all_made(generator: Generator, monkeypatch: pytest.MonkeyPatch) -> None:
    requests = [Request(text_features(0), seed=k, frames=16) for k in range(5)]
    wanted = [made.tokens for made in generator.generate(requests)]
    monkeypatch.setattr("marey.models.mogo.generate.MAX_SESSIONS", 2)
    found = [made.tokens for made in generator.generate(requests)]
    assert all(np.array_equal(a, b) for a, b in zip(found, wanted, strict=True))


@pytest.mark.parametrize(("count", "rows"), [(0, 1), (1, 1), (5, 5), (MAX_SESSIONS, MAX_SESSIONS), (900, MAX_SESSIONS)])
def test_on_a_processor_streams_have_a_row_for_each_motion_and_no_more(
    generator: Generator, count: int, rows: int
) -> None:
    """Rows without a session are computed along."""
    assert generator.streams(count, generator.config.inference).capacity == rows


def test_an_open_length_is_the_models_within_its_limits(generator: Generator) -> None:
    lengths = {made.features.shape[0] for made in generator.generate([Request(text_features(1), k) for k in range(40)])}
    assert all(TINY.min_frames <= length <= TINY.max_frames for length in lengths)
    assert len(lengths) > 1


def test_a_bundle_may_make_longer_motions_than_it_was_trained_on(generator: Generator, tmp_path: Path) -> None:
    config = replace(TINY, longest_frames=70)
    bundle = random_bundle(tmp_path / "long", config)
    assert seconds_of(bundle) == (0.8, 3.5)
    long = Generator.load(bundle, device="cpu")
    requests = [Request(text_features(0), seed=1, frames=frames) for frames in (70, TINY.max_frames, 31)]
    made = long.generate(requests)
    assert [each.features.shape[0] for each in made] == [70, TINY.max_frames, 31]
    assert np.isfinite(made[0].features).all()
    # the weights are the same
    (short,) = generator.generate([requests[1]])
    assert np.array_equal(made[1].tokens, short.tokens)
    (alone,) = long.generate(requests[:1])
    assert np.array_equal(made[0].tokens, alone.tokens)
    with pytest.raises(InvalidInput, match=r"71 frames is out of range; this bundle generates 0.8 to 3.5 seconds"):
        long.generate([replace(requests[0], frames=71)])
    with pytest.raises(InvalidInput, match="is under max_frames, 24") as error:
        replace(TINY, longest_frames=20).check()
    assert error.value.where == "longest_frames"


def test_beyond_its_training_length_a_motion_is_that_of_a_stream(tmp_path: Path) -> None:
    """Attention looks back over its window, and the clock stops, whatever the length of the whole."""
    config = replace(TINY, longest_frames=70, split_actions=False)
    generator = Generator.load(random_bundle(tmp_path / "long", config), device="cpu")
    request = Request(text_features(0, 1), seed=5, frames=70)
    (made,) = generator.generate([request])
    streams = generator.streams(1, SamplingSettings().inference(config.inference))
    actions, natural = generator.actions(request.text)
    assert natural[0] <= TINY.max_frames
    session = streams.start(actions, 5, ends_from=NEVER, lasts=natural)
    columns = [streams.step()[session] for _ in range(70)]
    assert np.array_equal(made.tokens.T, torch.stack(columns).numpy())
    assert len({tuple(column.tolist()) for column in columns[TINY.max_frames :]}) > 1


def test_the_clock_stops_as_in_a_stream_beyond_the_training_length_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    generator = Generator.load(random_bundle(tmp_path / "long", replace(TINY, longest_frames=70)), device="cpu")
    told: list[list[int]] = []
    plain = StreamBatch.start

    def start(self: StreamBatch, *args: Any, lasts: list[int], **options: Any) -> int:
        told.append(list(lasts))
        return plain(self, *args, lasts=lasts, **options)

    monkeypatch.setattr(StreamBatch, "start", start)
    text = text_features(0, 1)
    made = generator.generate([Request(text, 1, frames) for frames in (70, TINY.max_frames)])
    assert [len(each.features) for each in made] == [70, TINY.max_frames]
    natural = generator.actions(text)[1]
    assert sum(natural) < 70
    assert told == [natural, [TINY.max_frames]]


def test_prompt_seed_and_settings_make_a_difference(generator: Generator) -> None:
    made = [
        generator.generate([Request(text_features(text), seed, 20)], SamplingSettings(temperature=heat))[0].tokens
        for text, seed, heat in ((0, 0, None), (1, 0, None), (0, 1, None), (0, 0, 0.1))
    ]
    assert all(not np.array_equal(made[0], other) for other in made[1:])


@pytest.mark.parametrize(
    ("request_of", "where"),
    [
        (lambda: Request(text_features(0), 0, 15), "frames"),
        (lambda: Request(text_features(0), 0, 25), "frames"),
        (lambda: Request(text_features(0), -1, 20), "seed"),
        (lambda: Request(text_features(0, width=512), 0, 20), "text"),
    ],
)
def test_a_request_out_of_range_is_refused(generator: Generator, request_of, where: str) -> None:
    with pytest.raises(InvalidInput) as error:
        generator.generate([request_of()])
    assert error.value.where == where


@pytest.mark.parametrize("setting", SPEC.settings, ids=lambda each: each.name)
@pytest.mark.parametrize("value", [-1, 101])
def test_settings_out_of_range_are_refused(generator: Generator, setting: Setting, value: int) -> None:
    with pytest.raises(InvalidInput, match=f"{value} is outside") as refused:
        generator.generate([Request(text_features(0), 0, 20)], SamplingSettings(**{setting.name: value}))
    assert refused.value.where == setting.name


def test_a_run_becomes_a_bundle_that_generates(tmp_path: Path) -> None:
    data = write_prepared(tmp_path / "prepared")
    for stage in ("tokenizer", "transformer"):
        train_stage(stage, TrainOptions(data, tmp_path / "run", TINY, Budget(steps=2), device="cpu", quiet=True))
    bundle = assemble(data, tmp_path / "run", tmp_path / "trained", TINY, card="# card")
    assert not bundle.manifest.random
    made = Generator.load(Bundle.open(tmp_path / "trained"), device="cpu").generate([Request(text_features(0), 1, 20)])
    assert np.isfinite(made[0].features).all()


def test_a_bundle_of_another_model_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidBundle, match="of model hgm3, not mogo"):
        Generator.load(hgm3_bundle(tmp_path / "other"), device="cpu")


def test_a_dropped_request_ends_and_its_neighbours_stay_the_same(
    generator: Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("marey.models.mogo.generate.MAX_SESSIONS", 2)
    requests = [Request(text_features(k), seed=k, frames=20) for k in range(4)]
    whole = generator.generate(requests)
    control = Dropping(1, 2, after=3)
    made = generator.generate(requests, control=control)
    assert made[1] is made[2] is None
    for row in (0, 3):
        assert np.array_equal(made[row].tokens, whole[row].tokens)
    assert control.steps[-1][0] == control.steps[-1][1]


@pytest.mark.parametrize(("values", "where"), [({"steps": 5}, "steps"), ({"upper_top_k": 0.0}, "upper_top_k")])
def test_an_items_settings_are_checked_by_name(generator: Generator, values: dict[str, float], where: str) -> None:
    with pytest.raises(InvalidInput) as error:
        generator.settings(values)
    assert error.value.where == where


def test_streams_of_a_card_are_made_again_only_for_other_settings(monkeypatch: pytest.MonkeyPatch) -> None:
    """Recording a step takes as long as drawing a motion. A stand-in takes the place of the card."""
    generator = object.__new__(Generator)
    generator.device = SimpleNamespace(type="cuda")
    generator._streams = None
    monkeypatch.setattr(Generator, "packed", lambda self: None)
    monkeypatch.setattr("marey.models.mogo.generate.StreamBatch", lambda *_: object())
    usual, other = InferenceConfig(), InferenceConfig(temperature=0.5)
    first = generator.streams(3, usual)
    assert generator.streams(5, usual) is first
    assert generator.streams(5, other) is not first


def test_variety_lowers_and_raises_the_temperature() -> None:
    variety = SPEC.variety
    assert variety is not None
    assert variety.low["temperature"] < 1 < variety.high["temperature"]


@pytest.mark.parametrize(("width", "encoder"), [(384, "minilm"), (768, "clip-vit-l14")])
def test_a_random_bundle_names_the_encoder_of_its_width(tmp_path: Path, width: int, encoder: str) -> None:
    config = replace(TINY, condition=replace(TINY.condition, text_width=width))
    bundle = random_bundle(tmp_path / "random", config)
    assert (bundle.manifest.text.encoder, bundle.manifest.text.width) == (encoder, width)
    assert bundle.manifest.offsets == pytest.approx(HUMANML3D.offsets, abs=1e-6)


def test_the_stages_share_the_minutes_of_a_training() -> None:
    assert sum(RECIPE.shares.values()) == pytest.approx(1)


def test_a_prompt_is_split_into_actions_only_where_the_bundle_says_so(tmp_path: Path) -> None:
    text = text_features(0)
    rows = np.stack([text_features(k).nodes[0] for k in (1, 2)])
    two = replace(text, actions=("a person walks", "a person waves"), action_rows=rows)
    splits = Generator.load(random_bundle(tmp_path / "split"), device="cpu")
    whole = Generator.load(random_bundle(tmp_path / "whole", replace(TINY, split_actions=False)), device="cpu")
    assert splits.bundle.manifest.text.split_actions
    assert len(splits.actions(two)[1]) == 2
    assert not whole.bundle.manifest.text.split_actions
    assert np.allclose(whole.actions(two)[0].numpy(), text.nodes[:1])
    (first,), (second,) = (whole.generate([Request(each, 1, 20)]) for each in (two, text))
    assert np.array_equal(first.tokens, second.tokens)


def test_a_bundle_that_splits_says_nothing_of_it_and_can_be_read_by_earlier_releases(tmp_path: Path) -> None:
    for name, config in (("split", TINY), ("whole", replace(TINY, split_actions=False))):
        random_bundle(tmp_path / name, config)
    said = [json.loads((tmp_path / name / "manifest.json").read_text())["text"] for name in ("split", "whole")]
    assert "split_actions" not in said[0]
    assert said[1]["split_actions"] is False
