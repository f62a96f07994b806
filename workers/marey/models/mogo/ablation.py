"""Ablation of MOGO's own parts: learnable scaling, the level beside the prompt (PnQ), the depth head, one lane.

    marey train ablate data/prepared mogo-starter --what tokenizer --steps 1500 -o report
    marey train ablate data/prepared mogo-starter --what transformer --steps 600 --batch 8 -o report

Each variant is trained from scratch for the same number of steps, on the same seeds; all other parts are the bundle's.
`tokenizer` compares the quantizer's scales (MOGO eq. 1-6) by the errors of captured test clips. `transformer` compares
the ways of level and depth by cross-entropy of validation clips, and by the evaluation prompts where the product can
generate with a variant. Finished variants are kept: a second call continues.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from marey.bundles import find_bundle
from marey.checks.prompts import evaluation_prompts
from marey.models.mogo.assembly import RECIPE, assemble, unpack
from marey.models.mogo.config import MOGOConfig
from marey.models.mogo.generate import Generator
from marey.models.mogo.model import RQHCTransformer
from marey.models.mogo.train import train_stage, transformer_stage
from marey.nn.scaled_quantizer import Scale
from marey.training.ablation import compare, judge
from marey.training.adherence import pipeline_of
from marey.training.budget import Budget
from marey.training.staging import TrainOptions, finish, use_threads


class LevelToken(RQHCTransformer):
    """The level as a token of its own behind the prompt, in place of its embedding beside the prompt (eq. 7).

    The token takes the place of the first frame: frames are one position further from the prompt, and the token's
    output predicts the first frame. For comparison alone: streams do not support it.
    """

    def __init__(self, config: MOGOConfig) -> None:
        super().__init__(replace(config, max_frames=config.max_frames + 1))
        self.level_token = nn.Parameter(torch.randn_like(self.prompt.level.weight) * 0.02)
        nn.init.zeros_(self.prompt.level.weight).requires_grad_(False)

    def states(
        self, prompts: Tensor, tokens: Tensor, *, skipped: Tensor | None = None, seam: Tensor | None = None
    ) -> Tensor:
        """Return the trunk's states; arguments as in `RQHCTransformer`."""
        first, frames = self.inputs(prompts, tokens, skipped, seam)
        token = self.level_token[None, :, None].expand(len(tokens), -1, -1, -1)
        x = torch.cat([first, token, frames], 2).flatten(0, 1)
        later = None if seam is None else seam + 1
        states = self.trunk(x, self.reach(tokens.shape[1] + 1, prompts.shape[1], skipped, later))
        behind = states[:, prompts.shape[1] :]
        return behind.view(len(tokens), self.lanes, tokens.shape[1] + 1, -1).transpose(1, 2)


@dataclass(frozen=True)
class Variant:
    """One way to draw levels and depth."""

    joint: bool
    depth: int
    network: type[RQHCTransformer] = RQHCTransformer

    def of(self, config: MOGOConfig) -> MOGOConfig:
        """Return the configuration with this variant."""
        share = config.depth.share if self.depth else 1.0
        return replace(
            config,
            transformer=replace(config.transformer, joint=self.joint),
            depth=replace(config.depth, layers=self.depth, share=share),
        )


VARIANTS = {
    "a lane a level, PnQ, independent levels": Variant(joint=False, depth=0),
    "a lane a level, level token, independent levels": Variant(joint=False, depth=0, network=LevelToken),
    "a lane a level, PnQ, depth head": Variant(joint=False, depth=2),
    "one lane, depth head": Variant(joint=True, depth=2),
}


SCALES: dict[str, Scale] = {
    "elementwise scales (shipped)": "elementwise",
    "one scale a level": "scalar",
    "no scale": "none",
}


def train_tokenizer(scale: Scale, options: TrainOptions[MOGOConfig]) -> dict[str, float]:
    """Train one tokenizer; return its errors on captured test clips, in mm, and how many codes it uses."""
    tokenizer = replace(options.config.tokenizer, scale=scale)
    found = train_stage("tokenizer", replace(options, config=replace(options.config, tokenizer=tokenizer)))
    return {name.removeprefix("test/"): value for name, value in found.items() if name.startswith("test/")}


def train_transformer(bundle: str, variant: Variant, options: TrainOptions[MOGOConfig]) -> dict[str, float]:
    """Train one transformer on the bundle's tokens; return its validation metrics, and the judged evaluation prompts
    where the product can generate with it."""
    config, run = variant.of(options.config), options.run
    options = replace(options, config=config)
    unpack(find_bundle(bundle), run)
    for made in run.parent.glob("*.safetensors"):  # tokens and steers, the same for all
        shutil.copy(made, run)
    stage, sha256 = transformer_stage(options, variant.network)
    for made in run.glob("*.safetensors"):
        shutil.copy(made, run.parent)
    metrics = RECIPE.train(stage, options)
    found = {name: value for name, value in metrics.items() if name.startswith("loss/") or name == "accuracy/0"}
    if variant.network is not RQHCTransformer:
        return found
    finish(stage.module, options, stage.name, metrics, sha256)
    made = assemble(options.prepared, run, run / "bundle", config)
    generator = Generator.load(made, threads=options.threads)
    texts = pipeline_of(generator).features([p.text for p in evaluation_prompts()])
    return found | judge(generator, texts, generator.settings({}))


def ablate_tokenizer(data: Path, bundle: str, output: Path, **options: Any) -> str:
    """Compare the scales of MoSA; see `_ablate`."""
    return _ablate("tokenizer", SCALES, data, bundle, output, **options)


def ablate_transformer(data: Path, bundle: str, output: Path, **options: Any) -> str:
    """Compare the ways of levels and depth; see `_ablate`."""
    return _ablate("transformer", VARIANTS, data, bundle, output, **options)


def _ablate(
    about: str,
    names: Iterable[str],
    data: Path,
    bundle: str,
    output: Path,
    *,
    steps: int,
    batch: int | None,
    seeds: int,
    threads: int,
) -> str:
    """Train and measure each variant with each seed, and return the table; see `marey.training.ablation.compare`."""
    use_threads(threads)
    config = MOGOConfig.from_dict(find_bundle(bundle).manifest.parameters)
    if batch is not None:
        config = replace(
            config,
            train_tokenizer=replace(config.train_tokenizer, batch=batch),
            train_transformer=replace(config.train_transformer, batch=batch),
        )
    variants = list(names)

    def measured(name: str, seed: int) -> dict[str, float]:
        run = output / f"{about}-{variants.index(name)}-{seed}"
        shutil.rmtree(run, ignore_errors=True)
        run.mkdir(parents=True)
        options = TrainOptions(data, run, config, Budget(steps=steps), seed=seed, threads=threads)
        if name in SCALES:
            return train_tokenizer(SCALES[name], options)
        return train_transformer(bundle, VARIANTS[name], options)

    return compare(variants, measured, output, about, seeds=seeds)
