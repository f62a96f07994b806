"""The ablations train what they name and leave the rest alone, and decode as their rows say."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from marey.bundles import Bundle, find_bundle
from marey.data.prepared import PreparedData
from marey.generation.port import Request
from marey.models.hgm3 import ablation
from marey.models.hgm3.ablation import DECODINGS, FLAT, HIERARCHICAL, TRAININGS, train_variant
from marey.models.hgm3.assembly import assemble
from marey.models.hgm3.conditions import LEVELS
from marey.models.hgm3.config import OPEN, STARTER, TINY, HGM3Config
from marey.models.hgm3.generate import Generator, SamplingSettings
from marey.models.hgm3.model import MaskedTransformer, SeparateTransformers
from marey.models.hgm3.spec import SPEC
from marey.models.hgm3.train import train_stage
from marey.registry import resolve
from marey.training.ablation import AblationRequest
from marey.training.budget import Budget
from marey.training.motions import TokenData
from marey.training.staging import TrainOptions
from tests.support.ablations import judge_by_two_prompts
from tests.support.prepared import text_features


def options_of(prepared: PreparedData, run: Path) -> TrainOptions:
    return TrainOptions(prepared.path, run, TINY, Budget(steps=2), device="cpu", bf16=False, quiet=True)


@pytest.fixture(scope="module")
def bundle(prepared: PreparedData, tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    run = tmp_path_factory.mktemp("ablation") / "run"
    for stage in ("tokenizer", "masked", "residual", "length"):
        train_stage(stage, options_of(prepared, run))
    return assemble(prepared.path, run, run.parent / "bundle", TINY)


def test_a_variant_differs_from_its_bundle_in_the_masked_transformer_alone(
    prepared: PreparedData, bundle: Bundle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    options = options_of(prepared, tmp_path)
    random_masks = replace(TINY, mining=replace(TINY.mining, mask="random"))
    numbers = train_variant(prepared.path, str(bundle.path), tmp_path / "variant", random_masks, options)
    assert numbers["reconstruction/specific"] > 0
    made = find_bundle(str(tmp_path / "variant" / "bundle"))
    assert made.manifest.parameters["mining"]["mask"] == "random"
    for part in ("tokenizer", "residual", "length"):
        theirs, ours = bundle.tensors(part), made.tensors(part)
        assert all(np.array_equal(theirs[name], ours[name]) for name in theirs)
    theirs, ours = bundle.tensors("masked"), made.tensors("masked")
    assert not all(np.array_equal(theirs[name], ours[name]) for name in theirs)

    def encode_again(*_: object) -> None:
        raise AssertionError("the tokens of the first variant serve the second")

    monkeypatch.setattr(TokenData, "encode", encode_again)
    train_variant(prepared.path, str(bundle.path), tmp_path / "second", TINY, options)


def test_each_ablation_trains_its_networks_once_and_judges_every_row(
    prepared: PreparedData, bundle: Bundle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    judge_by_two_prompts(monkeypatch)
    # Rows of one kind differ in their settings alone, which the test of the papers' tables reads.
    monkeypatch.setattr(ablation, "ALPHAS", {"α 0 to 0.5": ablation.ALPHAS["α 0 to 0.5"]})
    monkeypatch.setattr(ablation, "PASSES", dict(list(ablation.PASSES.items())[:2]))
    measured: dict[str, tuple[type, SamplingSettings]] = {}

    def protocol(generator: Generator, settings: SamplingSettings, folder: Path) -> dict[str, float]:
        assert folder.parent == tmp_path / "protocol"
        measured[folder.name] = (type(generator.base), settings)
        return {"FID": 1.5}

    request = AblationRequest(prepared.path, str(bundle.path), tmp_path, steps=1, batch=4, threads=1, protocol=protocol)
    trained: list[str] = []

    def train(*arguments: object) -> dict[str, float]:
        trained.append(arguments[2].name)
        return train_variant(*arguments)

    monkeypatch.setattr(ablation, "train_variant", train)
    expected = {
        "conditions": ["specific.0", "motion.0", "action.0", "hard.0"],
        "alphas": ["alpha-0-0.5.0"],
        "passes": [],  # of `hard.0`
    }
    rows = {"conditions": 4, "alphas": 1, "passes": 2}
    for each in SPEC.ablations:
        if each.name not in expected:
            continue
        run = resolve(each.run)
        shown = run(request)
        assert trained == expected[each.name]
        assert len(shown.splitlines()) == 2 + rows[each.name]
        assert shown.count(" 1.500 |") >= rows[each.name]
        assert (tmp_path / f"{each.name}.md").read_text() == shown
        trained.clear()
        assert run(request) == shown
        assert not trained
    assert (tmp_path / "networks" / "alpha-0-0.5.0" / "bundle" / "manifest.json").is_file()
    assert measured["conditions-full-condition-alone.0"] == (MaskedTransformer, FLAT)
    assert measured["conditions-three-conditions-three-networks.0"] == (SeparateTransformers, HIERARCHICAL)
    assert len(measured) == sum(rows.values()), "each row once"


@pytest.mark.parametrize("given", [STARTER, OPEN], ids=lambda config: config.name)
def test_the_settings_of_the_papers_tables(given: HGM3Config) -> None:
    trained = {name: replace(given.mining, **fields) for name, fields in TRAININGS.items()}
    alone = ("motion", "action", "specific")
    assert {name: each.conditions for name, each in trained.items()} == {
        name: name if name in alone else "all" for name in trained
    }
    assert {name: each.mask for name, each in trained.items()} == {
        name: "random" if name == "random" else "hard" for name in trained
    }
    alphas = [trained[each.networks[0]] for each in ablation.ALPHAS.values()]
    assert [(each.alpha_start, each.alpha_end) for each in alphas] == [(0, 0), (0, 0.5), (0, 1), (1, 1)]
    passes = [each.settings for each in ablation.PASSES.values()]
    stages = [(s.steps, s.motion_steps, s.action_steps - s.motion_steps, s.steps - s.action_steps) for s in passes]
    assert stages == [
        (10, 10, 0, 0), (10, 0, 10, 0), (10, 0, 0, 10), (10, 5, 3, 2), (10, 2, 3, 5), (15, 3, 5, 7), (20, 4, 6, 10),
    ]  # fmt: skip
    assert [(each.networks, each.settings) for each in ablation.CONDITIONS.values()] == [
        (("specific",), FLAT),
        (("motion", "action", "specific"), HIERARCHICAL),
        (("hard",), FLAT),
        (("hard",), HIERARCHICAL),
    ]


def test_separate_networks_decode_their_own_level_alone(bundle: Bundle) -> None:
    generator = Generator.load(bundle, device="cpu", threads=1, dtype=torch.float32)
    requests = [Request(text_features(seed), seed, 196) for seed in range(2)]
    wanted, flat = (generator.generate(requests, settings)[0] for settings in (HIERARCHICAL, FLAT))
    assert wanted.decided[0] > 0, "the motion node decides some tokens"
    alike = [Generator.load(bundle, device="cpu", threads=1, dtype=torch.float32) for _ in range(LEVELS)]
    copies = [each.networks.masked for each in alike]
    generator.base = SeparateTransformers(copies)
    assert np.array_equal(generator.generate(requests, HIERARCHICAL)[0].tokens, wanted.tokens)
    copies[0].head.bias.data.copy_(5 * torch.randn_like(copies[0].head.bias))
    assert np.array_equal(generator.generate(requests, FLAT)[0].tokens, flat.tokens)
    assert not np.array_equal(generator.generate(requests, HIERARCHICAL)[0].tokens, wanted.tokens)


def test_flat_decoding_has_all_its_passes_at_the_level_of_specifics() -> None:
    inference = DECODINGS["flat"].inference(TINY.inference)
    assert inference.motion_steps == inference.action_steps == 0
    assert inference.steps > 0
