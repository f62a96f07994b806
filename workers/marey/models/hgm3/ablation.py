"""Ablation of hard token mining and of the hierarchy of conditions, on several training seeds.

    marey train ablate data/prepared hgm3-starter --steps 1500 --seeds 3 -o report

All networks but the masked transformer are the bundle's. The masked transformer is trained from scratch, once with hard
and once with random masks per seed, for the same number of steps. Every result is then decoded hierarchically, flat,
and with at least one token per pass, and judged on the evaluation prompts. Finished variants are kept: a second call
continues.
"""

from __future__ import annotations

import json
import shutil
from collections import defaultdict
from dataclasses import replace
from itertools import product
from pathlib import Path

from marey.bundles import find_bundle
from marey.checks.prompts import evaluation_prompts
from marey.core.errors import InvalidBundle
from marey.models.hgm3.assembly import assemble, unpack
from marey.models.hgm3.config import HGM3Config
from marey.models.hgm3.generate import Generator, SamplingSettings
from marey.models.hgm3.train import train_stage
from marey.text.pipeline import TextPipeline
from marey.training.ablation import judge, table
from marey.training.budget import Budget
from marey.training.motions import TOKENS
from marey.training.staging import TrainOptions

DECODINGS = {
    "hierarchical": SamplingSettings(motion_steps=2, action_steps=5),
    "flat": SamplingSettings(motion_steps=0, action_steps=0),
    "hierarchical, one token a pass at least": SamplingSettings(motion_steps=2, action_steps=5, min_progress=True),
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
    return found


def ablate(data: Path, bundle: str, output: Path, *, steps: int, batch: int | None, seeds: int, threads: int) -> str:
    """Train and judge all variants; write `results.json` and `results.md`, and return the table.

    Raises:
        InvalidBundle: the bundle declares no text pipeline.
    """
    given = find_bundle(bundle).manifest
    config = HGM3Config.from_dict(given.parameters)
    if batch is not None:
        config = replace(config, train_masked=replace(config.train_masked, batch=batch))
    if given.text is None:
        raise InvalidBundle("the bundle declares no text pipeline", where=bundle)
    texts = TextPipeline.load(given.text).features([p.text for p in evaluation_prompts()])
    results: dict[str, list[dict[str, float]]] = defaultdict(list)
    for seed, mask in product(range(seeds), ("hard", "random")):
        folder = output / f"{mask}-{seed}"
        file = folder / "numbers.json"
        if not file.is_file():
            own = replace(config, mining=replace(config.mining, mask=mask))
            options = TrainOptions(data, folder, own, Budget(steps=steps), seed=seed, threads=threads)
            validation = train_variant(data, bundle, folder, own, options)
            generator = Generator.load(str(folder / "bundle"), threads=threads)
            numbers = {
                name: {"validation loss": validation["reconstruction/specific"]} | judge(generator, texts, settings)
                for name, settings in DECODINGS.items()
            }
            file.write_text(json.dumps(numbers, indent=1), encoding="utf-8")
        for name, numbers in json.loads(file.read_text(encoding="utf-8")).items():
            results[f"{mask} masks, {name}"].append(numbers)
        (output / "results.md").write_text(table(results), encoding="utf-8")
    (output / "results.json").write_text(json.dumps(results, indent=1), encoding="utf-8")
    return table(results)
