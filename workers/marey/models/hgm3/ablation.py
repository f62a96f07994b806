"""Ablations of HGM³ on several training seeds: masks, conditions (Tab. 3), α (Tab. 4), passes (App. D, Tab. 2).

    marey train ablate data/prepared hgm3-starter --what alphas --steps 1500 -o report

All networks but the masked transformer are the bundle's. The masked transformer is trained from scratch, for the same
number of steps in every variant; a variant that decodes a network of another one does not train it again. Every result
is judged on the evaluation prompts. Finished trainings and measurements are kept: a second call continues.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

from marey.bundles import find_bundle
from marey.models.hgm3.assembly import assemble, unpack
from marey.models.hgm3.config import HGM3Config
from marey.models.hgm3.generate import Generator, SamplingSettings
from marey.models.hgm3.model import SeparateTransformers
from marey.models.hgm3.train import train_stage
from marey.text.features import TextFeatures
from marey.training.ablation import AblationRequest, compare, evaluation_texts, file_name, judge
from marey.training.motions import TOKENS
from marey.training.optimisation import with_batch
from marey.training.staging import TrainOptions

METRICS = "metrics.json"
"""Validation metrics of a finished training; a folder without it is unfinished."""

HIERARCHICAL = SamplingSettings(steps=10, motion_steps=2, action_steps=5)
FLAT = SamplingSettings(steps=10, motion_steps=0, action_steps=0)
DECODINGS = {
    "hierarchical": HIERARCHICAL,
    "flat": FLAT,
    "hierarchical, one token a pass at least": replace(HIERARCHICAL, min_progress=True),
}


@dataclass(frozen=True)
class DecodedVariant:
    """A row of an ablation."""

    networks: tuple[str, ...]  # names in `TRAININGS`; three = one for each level of condition
    settings: SamplingSettings = HIERARCHICAL


SHARED: dict[str, Any] = {"conditions": "all", "mask": "hard"}
"""Fields of `MiningConfig` that every training sets: those of bundles differ, and rows must not."""
TRAININGS: dict[str, dict[str, Any]] = {
    name: SHARED | fields
    for name, fields in {
        "hard": {},
        "random": {"mask": "random"},
        "motion": {"conditions": "motion"},
        "action": {"conditions": "action"},
        "specific": {"conditions": "specific"},
        "alpha-0-0": {"alpha_start": 0.0, "alpha_end": 0.0},
        "alpha-0-0.5": {"alpha_start": 0.0, "alpha_end": 0.5},
        "alpha-0-1": {"alpha_start": 0.0, "alpha_end": 1.0},
        "alpha-1-1": {"alpha_start": 1.0, "alpha_end": 1.0},
    }.items()
}
"""Trained masked transformers, by name: fields of `MiningConfig`; all others are the bundle's."""

MASKS = {
    f"{mask} masks, {name}": DecodedVariant((mask,), settings)
    for mask in ("hard", "random")
    for name, settings in DECODINGS.items()
}

CONDITIONS = {
    # the network of the full condition is also what three networks, decoded flat, come to (second row of Tab. 3)
    "full condition alone": DecodedVariant(("specific",), FLAT),
    "three conditions, three networks": DecodedVariant(("motion", "action", "specific")),
    "three conditions, one network, flat": DecodedVariant(("hard",), FLAT),
    "three conditions, one network": DecodedVariant(("hard",)),
}

ALPHAS = {
    "α 0, random": DecodedVariant(("alpha-0-0",)),
    "α 0 to 0.5": DecodedVariant(("alpha-0-0.5",)),
    "α 0 to 1": DecodedVariant(("alpha-0-1",)),
    "α 1": DecodedVariant(("alpha-1-1",)),
}

SWEEP = ((10, 10, 10), (10, 0, 10), (10, 0, 0), (10, 5, 8), (10, 2, 5), (15, 3, 8), (20, 4, 10))
"""L, L_M and L_A of App. D, Tab. 2."""
PASSES = {
    f"L {steps}, L_M {motion}, L_A {action}": DecodedVariant(
        ("hard",), SamplingSettings(steps=steps, motion_steps=motion, action_steps=action)
    )
    for steps, motion, action in SWEEP
}


def train_variant(
    data: Path, bundle: str, folder: Path, config: HGM3Config, options: TrainOptions[HGM3Config]
) -> dict[str, float]:
    """Train one masked transformer beside the bundle's other parts; write its bundle and return all its numbers."""
    shutil.rmtree(folder, ignore_errors=True)
    unpack(find_bundle(bundle), folder / "run")
    encoded = folder.parent / TOKENS  # tokens of the tokenizer that all variants share
    if encoded.is_file():
        shutil.copy(encoded, folder / "run")
    found = train_stage("masked", replace(options, run=folder / "run", config=config))
    shutil.copy(folder / "run" / TOKENS, encoded)
    assemble(data, folder / "run", folder / "bundle", config)
    (folder / METRICS).write_text(json.dumps(found, indent=1), encoding="utf-8")
    return found


def ablate_masks(request: AblationRequest) -> str:
    """Compare hard and random masks, each decoded in three ways; see `ablate`."""
    return ablate("masks", MASKS, request)


def ablate_conditions(request: AblationRequest) -> str:
    """Compare the full condition alone, a network for each condition, and one for all (Tab. 3); see `ablate`."""
    return ablate("conditions", CONDITIONS, request)


def ablate_alphas(request: AblationRequest) -> str:
    """Compare the four settings of α (Tab. 4); see `ablate`."""
    return ablate("alphas", ALPHAS, request)


def ablate_passes(request: AblationRequest) -> str:
    """Compare numbers of passes under each condition (App. D); see `ablate`."""
    return ablate("passes", PASSES, request)


def ablate(name: str, variants: Mapping[str, DecodedVariant], request: AblationRequest) -> str:
    """Train what variants decode, judge each, and return the table; see `marey.training.ablation.compare`.

    Raises:
        InvalidBundle: the bundle declares no text pipeline.
    """
    given = find_bundle(request.bundle)
    config = with_batch(HGM3Config.from_dict(given.manifest.parameters), ["masked"], request.batch)

    @cache
    def texts() -> list[TextFeatures]:
        return evaluation_texts(Generator.load(given, threads=request.threads))

    def trained(network: str, seed: int) -> Path:
        folder = request.output / "networks" / f"{network}.{seed}"
        if not (folder / METRICS).is_file():
            own = replace(config, mining=replace(config.mining, **TRAININGS[network]))
            train_variant(request.data, request.bundle, folder, own, request.training(folder, own, seed))
        return folder

    def measured(row: str, seed: int) -> dict[str, float]:
        variant = variants[row]
        folders = [trained(network, seed) for network in variant.networks]
        generators = [Generator.load(str(folder / "bundle"), threads=request.threads) for folder in folders]
        generator = generators[-1]
        if len(generators) > 1:
            generator.base = SeparateTransformers([each.networks.masked for each in generators])
        validation = json.loads((folders[-1] / METRICS).read_text(encoding="utf-8"))
        judged = judge(generator, texts(), variant.settings)
        protocol = request.measured(generator, variant.settings, f"{name}-{file_name(row)}.{seed}")
        return {"validation loss": validation["reconstruction/specific"], **judged, **protocol}

    return compare(list(variants), measured, request.output, name, seeds=request.seeds)
