"""What MOGO's own parts are worth: learnable scaling, the level beside the prompt (PnQ), the depth head, one lane.

    python -m marey.models.mogo.ablation tokenizer data/prepared models/mogo-starter --steps 1500 -o report
    python -m marey.models.mogo.ablation transformer data/prepared models/mogo-starter --steps 600 --batch 8 -o report

Each variant is trained from nothing with as many steps as the others, on the same seeds; what it is not about is the
bundle's. `tokenizer` compares the quantizer's scales (MOGO eq. 1-6) by the errors of captured test clips. `transformer`
compares the ways of level and depth by cross-entropy of validation clips, and by the evaluation prompts where the
product can draw from a variant. What is finished is kept: called again, it goes on.
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

import torch
from torch import Tensor, nn

from marey.bundles import find_bundle
from marey.checks.prompts import evaluation_prompts
from marey.core.errors import MareyError
from marey.models.mogo.assembly import RECIPE, assemble, take_apart
from marey.models.mogo.config import MOGOConfig
from marey.models.mogo.generate import Generator
from marey.models.mogo.model import RQHCTransformer
from marey.models.mogo.train import train_stage, transformer_stage
from marey.nn.scaled_quantizer import Scale
from marey.training.ablation import judge, table
from marey.training.adherence import pipeline_of
from marey.training.budget import Budget
from marey.training.staging import TrainOptions, finish, use_threads


class LevelToken(RQHCTransformer):
    """The level as a token of its own behind the prompt, in place of its embedding beside the prompt (eq. 7).

    The token takes the place of the first frame, so frames stand one further away from the prompt, and the first
    one is predicted by it. For comparison alone: streams do not know it.
    """

    def __init__(self, config: MOGOConfig) -> None:
        super().__init__(replace(config, max_frames=config.max_frames + 1))
        self.level_token = nn.Parameter(torch.randn_like(self.prompt.level.weight) * 0.02)
        nn.init.zeros_(self.prompt.level.weight).requires_grad_(False)

    def states(
        self, prompts: Tensor, tokens: Tensor, *, skipped: Tensor | None = None, seam: Tensor | None = None
    ) -> Tensor:
        """As in `RQHCTransformer`."""
        first, frames = self.inputs(prompts, tokens, skipped, seam)
        token = self.level_token[None, :, None].expand(len(tokens), -1, -1, -1)
        x = torch.cat([first, token, frames], 2).flatten(0, 1)
        later = None if seam is None else seam + 1
        states = self.trunk(x, self.reach(tokens.shape[1] + 1, prompts.shape[1], skipped, later))
        behind = states[:, prompts.shape[1] :]
        return behind.view(len(tokens), self.lanes, tokens.shape[1] + 1, -1).transpose(1, 2)


@dataclass(frozen=True)
class Variant:
    """One way of level and depth."""

    joint: bool
    depth: int
    network: type[RQHCTransformer] = RQHCTransformer

    def of(self, config: MOGOConfig) -> MOGOConfig:
        """The configuration with it."""
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
    """Train one tokenizer; its errors on captured test clips, in millimetres, and how many codes it uses."""
    tokenizer = replace(options.config.tokenizer, scale=scale)
    found = train_stage("tokenizer", replace(options, config=replace(options.config, tokenizer=tokenizer)))
    return {name.removeprefix("test/"): value for name, value in found.items() if name.startswith("test/")}


def train_transformer(bundle: str, variant: Variant, options: TrainOptions[MOGOConfig]) -> dict[str, float]:
    """Train one transformer on the bundle's tokens; what validation says, and the evaluation prompts where the
    product can draw from it."""
    config, run = variant.of(options.config), options.run
    options = replace(options, config=config)
    take_apart(find_bundle(bundle), run)
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


def main(arguments: Sequence[str] | None = None) -> int:
    """Train, measure, and write `results.json` and `results.md`."""
    parser = argparse.ArgumentParser(
        prog="python -m marey.models.mogo.ablation", description="Scales; levels and depth."
    )
    parser.add_argument("about", choices=["tokenizer", "transformer"])
    parser.add_argument("data", type=Path, help="a prepared folder, for transformers with its texts")
    parser.add_argument("bundle", help="name or path: gives the configuration, and the tokenizer of all transformers")
    parser.add_argument("--steps", type=int, default=1500)
    parser.add_argument("--batch", type=int, default=0, help="clips a step; 0 = as configured")
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--threads", type=int, default=0)
    parser.add_argument("-o", "--output", type=Path, required=True)
    chosen = parser.parse_args(arguments)
    use_threads(chosen.threads)
    config = MOGOConfig.from_dict(find_bundle(chosen.bundle).manifest.parameters)
    if chosen.batch:
        config = replace(
            config,
            train_tokenizer=replace(config.train_tokenizer, batch=chosen.batch),
            train_transformer=replace(config.train_transformer, batch=chosen.batch),
        )
    results: dict[str, list[dict[str, float]]] = defaultdict(list)
    names = SCALES if chosen.about == "tokenizer" else VARIANTS
    for seed, (number, name) in product(range(chosen.seeds), enumerate(names)):
        run = chosen.output / f"{chosen.about}-{number}-{seed}"
        file = run / "numbers.json"
        if not file.is_file():
            shutil.rmtree(run, ignore_errors=True)
            run.mkdir(parents=True)
            options = TrainOptions(
                chosen.data, run, config, Budget(steps=chosen.steps), seed=seed, threads=chosen.threads
            )
            if name in SCALES:
                numbers = train_tokenizer(SCALES[name], options)
            else:
                numbers = train_transformer(chosen.bundle, VARIANTS[name], options)
            file.write_text(json.dumps(numbers, indent=1), encoding="utf-8")
        results[name].append(json.loads(file.read_text(encoding="utf-8")))
        (chosen.output / f"{chosen.about}.md").write_text(table(results), encoding="utf-8")
    print(table(results))  # noqa: T201
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except MareyError as error:
        sys.exit(f"{error}")
