"""Variants differ in what they are about alone, and each row leaves a bundle that generates."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from marey.bundles import Bundle, find_bundle
from marey.core.errors import InvalidInput
from marey.data.manifest import MANIFEST
from marey.data.prepared import PreparedData
from marey.generation.port import Request
from marey.models.mogo import ablation
from marey.models.mogo.ablation import (
    CODEBOOKS,
    LEVELS,
    SCALES,
    SCALING,
    VARIANTS,
    ablate_data,
    ablate_levels,
    ablate_tokenizer,
    ablate_transformer,
    train_both,
    train_tokenizer,
    train_transformer,
)
from marey.models.mogo.assembly import assemble
from marey.models.mogo.config import PAPER, TINY, MOGOConfig
from marey.models.mogo.generate import Generator
from marey.models.mogo.level_token import LevelToken
from marey.models.mogo.train import train_stage
from marey.training.ablation import AblationRequest
from marey.training.budget import Budget
from marey.training.motions import TOKENS
from marey.training.staging import TrainOptions
from tests.support.ablations import judge_by_two_prompts
from tests.support.prepared import text_features, write_prepared

TOLD_BY_TOKEN = "a lane a level, level token, independent levels"


@pytest.fixture(scope="module")
def options(prepared: PreparedData, tmp_path_factory: pytest.TempPathFactory) -> TrainOptions:
    """A trained run and its bundle."""
    run = tmp_path_factory.mktemp("ablation") / "run"
    options = TrainOptions(prepared.path, run, TINY, Budget(steps=2), device="cpu", bf16=False, quiet=True)
    for stage in ("tokenizer", "transformer"):
        train_stage(stage, options)
    assemble(prepared.path, run, run / "bundle", TINY)
    return options


def test_a_quantizer_without_scales_is_trained_and_measured_alike(options: TrainOptions, tmp_path: Path) -> None:
    found = train_tokenizer("none", replace(options, run=tmp_path))
    assert {"local_mm", "error_mm", "perplexity/0"} <= set(found)
    part = json.loads((tmp_path / "tokenizer" / "part" / "part.json").read_text())
    assert part["config"]["tokenizer"]["scale"] == "none"


def drawn(bundle: Path) -> np.ndarray:
    """Tokens (V, 20) of a motion of a bundle."""
    (made,) = Generator.load(find_bundle(str(bundle)), device="cpu").generate([Request(text_features(0), 1, 20)])
    assert made is not None
    assert np.isfinite(made.features).all()
    return made.tokens


def test_variants_of_the_transformer_share_tokens_and_steers(
    options: TrainOptions, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    judge_by_two_prompts(monkeypatch)
    bundle = str(options.run / "bundle")
    found = []
    for number in range(2):
        (tmp_path / str(number)).mkdir()
        mine = replace(options, run=tmp_path / str(number), threads=1)
        found.append(train_transformer(bundle, VARIANTS[TOLD_BY_TOKEN], mine))
    assert found[0] == found[1]  # the same variant twice: same data, same seed
    assert (tmp_path / "0" / TOKENS).read_bytes() == (tmp_path / "1" / TOKENS).read_bytes()


def test_every_way_of_levels_and_depth_is_judged_and_leaves_a_bundle_that_generates(
    prepared: PreparedData, options: TrainOptions, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    judge_by_two_prompts(monkeypatch)
    request = AblationRequest(prepared.path, str(options.run / "bundle"), tmp_path, steps=1, batch=4, threads=1)
    head, _, *rows = ablate_transformer(request).splitlines()
    assert {"loss/0", "foot skate"} <= {cell.strip() for cell in head.split("|")}
    assert len(rows) == len(VARIANTS)
    assert all(cell.strip() for row in rows for cell in row.strip("|").split("|"))  # no row lacks a number
    made = [tmp_path / f"transformer-{number}-0" / "bundle" for number in range(len(VARIANTS))]
    assert [drawn(bundle).shape for bundle in made] == [(TINY.tokenizer.levels, 20)] * len(VARIANTS)
    networks = [type(Generator.load(find_bundle(str(bundle)), device="cpu").transformer) for bundle in made]
    assert [network is LevelToken for network in networks] == [name == TOLD_BY_TOKEN for name in VARIANTS]


def test_an_ablation_goes_on_where_it_stopped(
    prepared: PreparedData, options: TrainOptions, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    trained: list[str] = []

    def train(scale: str, options: TrainOptions) -> dict[str, float]:
        trained.append(scale)
        if len(trained) == 2:
            raise KeyboardInterrupt
        return {"local_mm": float(len(trained))}

    monkeypatch.setattr(ablation, "train_tokenizer", train)
    request = AblationRequest(prepared.path, str(options.run / "bundle"), tmp_path, steps=1, threads=1)
    with pytest.raises(KeyboardInterrupt):
        ablate_tokenizer(request)
    shown = ablate_tokenizer(request)
    assert trained == [*SCALES.values()][:2] + [*SCALES.values()][1:]
    assert shown.count("|\n") >= len(SCALES)
    assert ablate_tokenizer(request) == shown


def test_the_papers_tables_train_both_networks_and_judge_the_bundle(
    prepared: PreparedData, options: TrainOptions, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    judge_by_two_prompts(monkeypatch)
    monkeypatch.setattr(ablation, "LEVELS", {name: LEVELS[name] for name in ("1 levels", "2 levels")})
    measured: list[str] = []

    def protocol(generator: Generator, settings: object, folder: Path) -> dict[str, float]:
        assert settings == generator.settings({})
        measured.append(folder.name)
        return {"FID": float(generator.config.tokenizer.levels)}

    request = AblationRequest(
        prepared.path, str(options.run / "bundle"), tmp_path, steps=1, batch=4, threads=1, protocol=protocol
    )
    shown = ablate_levels(request)
    assert measured == ["levels-1-levels.0", "levels-2-levels.0"]
    with pytest.raises(InvalidInput, match="trains no generator"):
        ablate_tokenizer(request)
    head, _, *rows = shown.splitlines()
    assert {"local_mm", "error_mm", "validation loss", "foot skate", "FID"} <= {
        cell.strip() for cell in head.split("|")
    }
    assert [row.split(" | ")[0] for row in rows] == ["| 1 levels", "| 2 levels"]
    for number, levels in enumerate((1, 2)):
        made = find_bundle(str(tmp_path / f"levels-{number}-0" / "bundle"))
        wanted = replace(TINY.tokenizer, levels=levels)
        assert MOGOConfig.from_dict(made.manifest.parameters).tokenizer == wanted
        assert drawn(made.path).shape == (levels, 20)
    assert ablate_levels(request) == shown


def test_data_are_mixed_with_shares_of_another_set_and_the_tokenizer_stays(
    prepared: PreparedData, options: TrainOptions, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    judge_by_two_prompts(monkeypatch)
    bundle = options.run / "bundle"
    request = AblationRequest(prepared.path, str(bundle), tmp_path / "report", steps=1, batch=4, threads=1)
    with pytest.raises(InvalidInput) as caught:
        ablate_data(request)
    assert caught.value.where == "--with"
    other = write_prepared(tmp_path / "other", clips=12)
    manifest = json.loads((other / MANIFEST).read_text())
    manifest["sources"][0]["name"] = "others"
    (other / MANIFEST).write_text(json.dumps(manifest))
    shown = ablate_data(replace(request, other=other))
    head, _, *rows = shown.splitlines()
    assert {"validation loss", "foot skate"} <= {cell.strip() for cell in head.split("|")}
    assert [row.split(" | ")[0] for row in rows] == ["| 0 % added", "| 50 % added", "| 100 % added"]
    clips = len(prepared.clips)
    mixed = [len(PreparedData.open(tmp_path / "report" / "data-mixes" / name).clips) for name in ("50", "100")]
    assert mixed == [clips + 4, clips + 8]
    made = [find_bundle(str(tmp_path / "report" / f"data-{number}-0" / "bundle")) for number in range(3)]
    before = find_bundle(str(bundle)).manifest.files["tokenizer.safetensors"].sha256
    assert {each.manifest.files["tokenizer.safetensors"].sha256 for each in made} == {before}
    assert [len(each.manifest.data) for each in made] == [1, 2, 2]
    assert [drawn(each.path).shape for each in made] == [(TINY.tokenizer.levels, 20)] * 3


@pytest.mark.parametrize("name", list(SCALING)[::5])  # the first size scaled, the last not
def test_sizes_and_scales_of_codebooks_leave_bundles_that_generate(
    name: str, options: TrainOptions, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    judge_by_two_prompts(monkeypatch)
    fields = {**SCALING[name], "code_width": 16}  # the published widths take long to train
    train_both(fields, replace(options, run=tmp_path / "run", threads=1))
    assert drawn(tmp_path / "run" / "bundle").shape == (TINY.tokenizer.levels, 20)


def test_the_sizes_of_the_papers_tables() -> None:
    assert [each["levels"] for each in LEVELS.values()] == [1, 2, 3, 4, 5, 6, 7]
    sizes = [(each["codes"], each["code_width"]) for each in CODEBOOKS.values()]
    assert sizes == [(512, 512), (1024, 1024), (2048, 512), (4096, 256), (8192, 128)]
    rows = [(each["codes"], each["code_width"], each["scale"]) for each in SCALING.values()]
    assert rows == [(*size, scale) for scale in ("elementwise", "none") for size in sizes[2:]]
    for each in (*SCALING.values(), *CODEBOOKS.values()):
        replace(PAPER.tokenizer, **each)  # names fields that there are


@pytest.mark.parametrize("name", VARIANTS)
def test_a_variant_changes_lanes_the_level_token_and_depth_alone(name: str) -> None:
    changed = VARIANTS[name].of(TINY)
    plain = replace(changed.transformer, joint=False, level_token=False)
    kept = replace(changed, transformer=plain, depth=TINY.depth)
    assert kept == TINY
    # without a depth head all frames cover all levels: less would save nothing
    assert changed.depth.share == (TINY.depth.share if changed.depth.layers else 1.0)


def test_variants_are_named_by_their_lanes_and_their_depth() -> None:
    named = {name: (variant.joint, variant.depth, variant.level_token) for name, variant in VARIANTS.items()}
    assert named == {
        "a lane a level, PnQ, independent levels": (False, 0, False),
        "a lane a level, level token, independent levels": (False, 0, True),
        "a lane a level, PnQ, depth head": (False, 2, False),
        "one lane, depth head": (True, 2, False),
    }


def test_a_variant_is_bundled_and_judged(
    options: TrainOptions, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    judged: list[tuple[MOGOConfig, int]] = []

    def judge(bundle: Bundle, threads: int) -> dict[str, float]:
        judged.append((MOGOConfig.from_dict(bundle.manifest.parameters), threads))
        assert (tmp_path / "run" / "bundle").samefile(bundle.path)
        return {"all": 0.5}

    monkeypatch.setattr(ablation, "judged", judge)
    variant = VARIANTS["one lane, depth head"]
    mine = replace(options, run=tmp_path / "run", threads=1)
    mine.run.mkdir()
    found = train_transformer(str(options.run / "bundle"), variant, mine)
    assert judged == [(variant.of(TINY), 1)]
    assert set(found) == {"all", "accuracy/0", *(f"loss/{level}" for level in range(TINY.tokenizer.levels))}


def test_each_variant_is_trained_with_each_seed_in_an_empty_folder(
    prepared: PreparedData, options: TrainOptions, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[tuple[object, int]] = []
    bundle = str(options.run / "bundle")

    def train(given: str, variant: object, options: TrainOptions[MOGOConfig]) -> dict[str, float]:
        asked.append((variant, options.seed))
        assert given == bundle
        assert not any(options.run.iterdir())
        (options.run / "left").touch()
        config = options.config
        assert (config.train_tokenizer.batch, config.train_transformer.batch) == (3, 3)
        return {"loss/0": 1.0}

    monkeypatch.setattr(ablation, "train_transformer", train)
    (tmp_path / "transformer-0-0").mkdir()
    (tmp_path / "transformer-0-0" / "half-trained").touch()
    request = AblationRequest(prepared.path, bundle, tmp_path, steps=1, batch=3, seeds=2, threads=1)
    shown = ablate_transformer(request)
    assert asked == [(variant, seed) for seed in range(2) for variant in VARIANTS.values()]
    assert [row.split(" | ")[0].removeprefix("| ") for row in shown.splitlines()[2:]] == list(VARIANTS)
