"""The ablations train what they name, leave the rest alone, and judge every row."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from marey.bundles import Bundle, find_bundle
from marey.data.prepared import PreparedData
from marey.models.momaskpp import ablation
from marey.models.momaskpp.ablation import ATTENTION, CONDITIONING, SCALES, NetworkVariant, train_variant
from marey.models.momaskpp.assembly import assemble
from marey.models.momaskpp.config import TINY, MoMaskPPConfig
from marey.models.momaskpp.scales import Scales
from marey.models.momaskpp.spec import SPEC
from marey.models.momaskpp.tokenizer import Tokenizer
from marey.models.momaskpp.train import train_stage
from marey.registry import resolve
from marey.training.ablation import AblationRequest
from marey.training.budget import Budget
from marey.training.motions import TOKENS
from marey.training.staging import TrainOptions
from tests.support.ablations import judge_by_two_prompts

PARTS = ("tokenizer", "masked", "refiner", "length")


def options_of(prepared: PreparedData, run: Path, config: MoMaskPPConfig = TINY) -> TrainOptions[MoMaskPPConfig]:
    return TrainOptions(prepared.path, run, config, Budget(steps=1), device="cpu", bf16=False, quiet=True)


@pytest.fixture(scope="module")
def bundle(prepared: PreparedData, tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    run = tmp_path_factory.mktemp("ablation") / "run"
    for stage in PARTS:
        train_stage(stage, options_of(prepared, run))
    return assemble(prepared.path, run, run.parent / "bundle", TINY)


@pytest.mark.parametrize(
    ("variant", "stages"),
    [
        (CONDITIONING["in-context"], ("masked",)),
        (ATTENTION["without attention"], ("tokenizer", "masked")),
        (SCALES["full-scale, 2 levels"], ("tokenizer", "masked")),
    ],
)
def test_a_variant_trains_its_stages_alone(
    variant: NetworkVariant, stages: tuple[str, ...], prepared: PreparedData, bundle: Bundle, tmp_path: Path
) -> None:
    run = tmp_path / "networks" / "one"
    found = train_variant(str(bundle.path), stages, options_of(prepared, run, variant.of(TINY)))
    assert ("local_mm" in found, "error_mm" in found) == ("tokenizer" in stages,) * 2
    assert found["validation loss"] > 0
    assert (run.parent / TOKENS).is_file() == ("tokenizer" not in stages), "the next variant needs them"
    made = find_bundle(str(run / "bundle"))
    assert MoMaskPPConfig.from_dict(made.manifest.parameters) == variant.of(TINY)
    for part in PARTS:
        theirs, ours = bundle.tensors(part), made.tensors(part)
        same = theirs.keys() == ours.keys() and all(np.array_equal(theirs[name], ours[name]) for name in theirs)
        assert same == (part not in stages), part


def test_every_row_is_judged_and_kept(
    prepared: PreparedData, bundle: Bundle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    judge_by_two_prompts(monkeypatch)
    request = AblationRequest(prepared.path, str(bundle.path), tmp_path, steps=1, batch=4, threads=1)
    trained: list[Path] = []

    def train(bundle: str, stages: tuple[str, ...], options: TrainOptions[MoMaskPPConfig]) -> dict[str, float]:
        trained.append(options.run)
        return train_variant(bundle, stages, options)

    monkeypatch.setattr(ablation, "train_variant", train)
    assert [each.name for each in SPEC.ablations] == ["scales", "attention", "conditioning"]
    (run,) = (resolve(each.run) for each in SPEC.ablations if each.name == "conditioning")
    shown = run(request)
    assert [path.name for path in trained] == ["conditioning-0.0", "conditioning-1.0"]
    assert len(shown.splitlines()) == 2 + len(CONDITIONING)
    assert "foot skate" in shown
    trained.clear()
    assert run(request) == shown
    assert not trained


def test_variants_of_the_papers_table() -> None:
    config = replace(TINY, max_frames=196)
    tokens = {name: Scales.of(variant.of(config)).total(49) for name, variant in SCALES.items()}
    assert list(tokens.values()) == [91, 98, 196]
    without = Tokenizer(ATTENTION["without attention"].of(TINY))
    assert not any("attention" in name for name in without.state_dict())
    assert any("attention" in name for name in Tokenizer(ATTENTION["with attention"].of(TINY)).state_dict())
    features = torch.randn(1, 32, 263)
    assert without.eval()(features)[0].shape == features.shape
    assert "attention" not in TINY.to_dict()["tokenizer"], "earlier releases read bundles that have it"
