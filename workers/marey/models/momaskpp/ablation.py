"""Ablations of MoMask++ on several training seeds: scales and attention of the tokenizer, and conditioning (Tab. 4).

    marey train ablate data/prepared momaskpp-open --what scales --steps 5000 -o report

`scales` and `attention` train tokenizer and masked transformer from scratch, `conditioning` the masked transformer
alone on the bundle's tokens: for the same number of steps in every variant, all else is the bundle's. Tokenizers are
measured by their errors on captured test clips, all variants on the evaluation prompts. Finished variants are kept: a
second call continues.

All scales share one codebook, full-scale variants included.
"""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any

from marey.bundles import find_bundle
from marey.models.momaskpp.assembly import assemble, unpack
from marey.models.momaskpp.config import MoMaskPPConfig
from marey.models.momaskpp.generate import Generator
from marey.models.momaskpp.scales import Scales
from marey.models.momaskpp.train import train_stage
from marey.text.features import TextFeatures
from marey.training.ablation import AblationRequest, compare, evaluation_texts, file_name, judge
from marey.training.motions import TOKENS
from marey.training.optimisation import with_batch
from marey.training.staging import TrainOptions


@dataclass(frozen=True)
class NetworkVariant:
    """A row of an ablation: fields that differ from the bundle's configuration."""

    tokenizer: Mapping[str, Any] = field(default_factory=dict[str, Any])
    masked: Mapping[str, Any] = field(default_factory=dict[str, Any])

    def of(self, config: MoMaskPPConfig) -> MoMaskPPConfig:
        """Return the configuration with this variant."""
        return replace(
            config,
            tokenizer=replace(config.tokenizer, **self.tokenizer),
            masked=replace(config.masked, **self.masked),
        )


SCALES = {
    "multi-scale, 8 4 2 1": NetworkVariant(tokenizer={"scales": (8, 4, 2, 1)}),
    "full-scale, 2 levels": NetworkVariant(tokenizer={"scales": (1, 1)}),
    "full-scale, 4 levels": NetworkVariant(tokenizer={"scales": (1, 1, 1, 1)}),
}
ATTENTION = {
    "with attention": NetworkVariant(tokenizer={"attention": True}),
    "without attention": NetworkVariant(tokenizer={"attention": False}),
}
CONDITIONING = {
    "cross-attention": NetworkVariant(masked={"conditioning": "cross-attention"}),
    "in-context": NetworkVariant(masked={"conditioning": "in-context"}),
}


def ablate_scales(request: AblationRequest) -> str:
    """Compare multi-scale with full-scale tokens; see `ablate`."""
    return ablate("scales", SCALES, ("tokenizer", "masked"), request)


def ablate_attention(request: AblationRequest) -> str:
    """Compare tokenizers with and without attention; see `ablate`."""
    return ablate("attention", ATTENTION, ("tokenizer", "masked"), request)


def ablate_conditioning(request: AblationRequest) -> str:
    """Compare ways to read the words; see `ablate`."""
    return ablate("conditioning", CONDITIONING, ("masked",), request)


def ablate(name: str, variants: Mapping[str, NetworkVariant], stages: tuple[str, ...], request: AblationRequest) -> str:
    """Train the `stages` of each variant, judge it, and return the table; see `marey.training.ablation.compare`.

    Raises:
        InvalidBundle: the bundle declares no text pipeline.
    """
    given = find_bundle(request.bundle)
    config = with_batch(MoMaskPPConfig.from_dict(given.manifest.parameters), ["tokenizer", "masked"], request.batch)

    @cache
    def texts() -> list[TextFeatures]:
        return evaluation_texts(Generator.load(given, threads=request.threads))

    def measured(row: str, seed: int) -> dict[str, float]:
        run = request.output / "networks" / f"{name}-{list(variants).index(row)}.{seed}"
        own = variants[row].of(config)
        found = {"tokens of the longest motion": float(Scales.of(own).total(own.max_tokens))}
        found |= train_variant(request.bundle, stages, request.training(run, own, seed))
        generator = Generator.load(str(run / "bundle"), threads=request.threads)
        settings = generator.settings({})
        protocol = request.measured(generator, settings, f"{name}-{file_name(row)}.{seed}")
        return found | judge(generator, texts(), settings) | dict(protocol)

    return compare(list(variants), measured, request.output, name, seeds=request.seeds)


def train_variant(bundle: str, stages: tuple[str, ...], options: TrainOptions[MoMaskPPConfig]) -> dict[str, float]:
    """Train stages from scratch beside the bundle's other parts, and write the variant's bundle into its run.

    Returns:
        errors of a trained tokenizer on captured test clips, in mm, and the validation loss of the transformer.
    """
    run, shared = options.run, options.run.parent / TOKENS
    shutil.rmtree(run, ignore_errors=True)
    unpack(find_bundle(bundle), run)
    if "tokenizer" not in stages and shared.is_file():  # tokens of the tokenizer that all variants share
        shutil.copy(shared, run)
    metrics = {stage: train_stage(stage, options) for stage in stages}
    if "tokenizer" not in stages:
        shutil.copy(run / TOKENS, shared)
    assemble(options.prepared, run, run / "bundle", options.config)
    errors = metrics.get("tokenizer", {})
    found = {each: errors[f"test/{each}"] for each in ("local_mm", "error_mm") if f"test/{each}" in errors}
    return found | {"validation loss": metrics["masked"]["loss"]}
