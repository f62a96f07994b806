"""Ablation of MOGO's own parts: learnable scaling, the level beside the prompt (PnQ), the depth head, one lane; and
the paper's tables of the quantizer.

    marey train ablate data/prepared mogo-starter --what tokenizer --steps 1500 -o report
    marey train ablate data/prepared mogo-starter --what transformer --steps 600 --batch 8 -o report
    marey train ablate data/prepared mogo-starter --what levels --steps 3000 -o report

Each variant is trained from scratch for the same number of steps, on the same seeds; all other parts are the bundle's.
`tokenizer` compares the quantizer's scales (MOGO eq. 1-6) by the errors of captured test clips. `transformer` compares
the ways of level and depth (Tab. 7) by cross-entropy of validation clips and by the evaluation prompts. `scaling`,
`levels` and `codebooks` (Tab. 3 to 5) train both networks, and compare by the errors and by the evaluation prompts.
`data` (Tab. 6) trains the transformer on the data and on mixes with another set. The bundles of all but `tokenizer`
stay beside the numbers, for an evaluator. Finished variants are kept: a second call continues.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

from marey.bundles import Bundle, find_bundle
from marey.core.errors import InvalidInput
from marey.models.mogo.assembly import RECIPE, assemble, unpack
from marey.models.mogo.config import MOGOConfig
from marey.models.mogo.generate import Generator
from marey.models.mogo.train import train_stage, transformer_stage
from marey.nn.scaled_quantizer import Scale
from marey.training.ablation import AblationRequest, compare, evaluation_texts, file_name, judge
from marey.training.mixing import mix_with_texts
from marey.training.optimisation import with_batch
from marey.training.staging import TrainOptions, finish, use_threads

V = TypeVar("V")


@dataclass(frozen=True)
class Variant:
    """One way to draw levels and depth."""

    joint: bool
    depth: int
    level_token: bool = False

    def of(self, config: MOGOConfig) -> MOGOConfig:
        """Return the configuration with this variant."""
        share = config.depth.share if self.depth else 1.0
        return replace(
            config,
            transformer=replace(config.transformer, joint=self.joint, level_token=self.level_token),
            depth=replace(config.depth, layers=self.depth, share=share),
        )


VARIANTS = {
    "a lane a level, PnQ, independent levels": Variant(joint=False, depth=0),
    "a lane a level, level token, independent levels": Variant(joint=False, depth=0, level_token=True),
    "a lane a level, PnQ, depth head": Variant(joint=False, depth=2),
    "one lane, depth head": Variant(joint=True, depth=2),
}


SCALES: dict[str, Scale] = {
    "elementwise scales (shipped)": "elementwise",
    "one scale a level": "scalar",
    "no scale": "none",
}


SIZES = ((512, 512), (1024, 1024), (2048, 512), (4096, 256), (8192, 128))
"""Codes of a codebook and numbers of a code, of Tab. 5; the last three are those of Tab. 3."""

SCALING: dict[str, Mapping[str, Any]] = {
    f"{codes} × {width}, {shown}": {"codes": codes, "code_width": width, "scale": scale}
    for shown, scale in (("scaled", "elementwise"), ("not scaled", "none"))
    for codes, width in SIZES[2:]
}
"""Fields of the tokenizer's configuration, by row of Tab. 3."""
LEVELS: dict[str, Mapping[str, Any]] = {f"{count} levels": {"levels": count} for count in range(1, 8)}
"""The same of Tab. 4."""
CODEBOOKS: dict[str, Mapping[str, Any]] = {
    f"{codes} × {width}": {"codes": codes, "code_width": width} for codes, width in SIZES
}
"""The same of Tab. 5."""


SHARES = {"0 % added": 0.0, "50 % added": 0.5, "100 % added": 1.0}
"""Shares of the training clips of another set, by row of Tab. 6."""
MIXES = "data-mixes"


def train_tokenizer(scale: Scale, options: TrainOptions[MOGOConfig]) -> dict[str, float]:
    """Train one tokenizer; return its errors on captured test clips, in mm, and how many codes it uses."""
    tokenizer = replace(options.config.tokenizer, scale=scale)
    found = train_stage("tokenizer", replace(options, config=replace(options.config, tokenizer=tokenizer)))
    return {name.removeprefix("test/"): value for name, value in found.items() if name.startswith("test/")}


def train_transformer(bundle: str, variant: Variant, options: TrainOptions[MOGOConfig]) -> dict[str, float]:
    """Train one transformer on the bundle's tokens; return its validation metrics and the judged evaluation prompts."""
    config, run = variant.of(options.config), options.run
    options = replace(options, config=config)
    unpack(find_bundle(bundle), run)
    for made in run.parent.glob("*.safetensors"):  # tokens and steers, the same for all
        shutil.copy(made, run)
    stage, sha256 = transformer_stage(options)
    for made in run.glob("*.safetensors"):
        shutil.copy(made, run.parent)
    metrics = RECIPE.train(stage, options)
    found = {name: value for name, value in metrics.items() if name.startswith("loss/") or name == "accuracy/0"}
    finish(stage.module, options, stage.name, metrics, sha256)
    return found | judged(assemble(options.prepared, run, run / "bundle", config), options.threads)


def train_both(fields: Mapping[str, Any], options: TrainOptions[MOGOConfig]) -> dict[str, float]:
    """Train a tokenizer of other sizes and a transformer on its tokens; return the tokenizer's errors on captured test
    clips, in mm, the transformer's validation loss, and the judged evaluation prompts."""
    config = replace(options.config, tokenizer=replace(options.config.tokenizer, **fields))
    options = replace(options, config=config)
    errors = train_stage("tokenizer", options)
    found = {name: errors[f"test/{name}"] for name in ("local_mm", "error_mm")}
    found["validation loss"] = train_stage("transformer", options)["loss"]
    return found | judged(assemble(options.prepared, options.run, options.run / "bundle", config), options.threads)


def train_on_mix(bundle: str, other: Path, share: float, options: TrainOptions[MOGOConfig]) -> dict[str, float]:
    """Train a transformer on the data and a share of another set's training clips, with the bundle's tokenizer; return
    its validation loss, on clips of the first set alone, and the judged evaluation prompts."""
    run, prepared = options.run, options.prepared
    if share:
        prepared = run.parent / MIXES / f"{100 * share:.0f}"
        if not prepared.exists():  # an unfinished one has another name
            mix_with_texts(options.prepared, other, share, prepared)
    unpack(find_bundle(bundle), run)
    metrics = train_stage("transformer", replace(options, prepared=prepared))
    made = assemble(prepared, run, run / "bundle", options.config)
    return {"validation loss": metrics["loss"]} | judged(made, options.threads)


def judged(bundle: Bundle, threads: int) -> dict[str, float]:
    """Judge a bundle on the evaluation prompts."""
    generator = Generator.load(bundle, threads=threads)
    return judge(generator, evaluation_texts(generator), generator.settings({}))


def ablate_tokenizer(request: AblationRequest) -> str:
    """Compare the scales of MoSA; see `_ablate`.

    Raises:
        InvalidInput: an evaluator is named: no motions are generated.
    """
    if request.protocol is not None:
        hint = "Compare by `scaling`, or leave it out."
        raise InvalidInput("the ablation 'tokenizer' trains no generator", where="--evaluator", hint=hint)
    return _ablate("tokenizer", SCALES, train_tokenizer, request)


def ablate_transformer(request: AblationRequest) -> str:
    """Compare the ways of levels and depth; see `_ablate`."""

    def train(variant: Variant, run: TrainOptions[MOGOConfig]) -> dict[str, float]:
        return train_transformer(request.bundle, variant, run)

    return _ablate("transformer", VARIANTS, train, request)


def ablate_scaling(request: AblationRequest) -> str:
    """Compare learnable scaling with none at three sizes of codebooks (Tab. 3); see `_ablate`."""
    return _ablate("scaling", SCALING, train_both, request)


def ablate_levels(request: AblationRequest) -> str:
    """Compare numbers of levels (Tab. 4); see `_ablate`."""
    return _ablate("levels", LEVELS, train_both, request)


def ablate_codebooks(request: AblationRequest) -> str:
    """Compare sizes of codebooks (Tab. 5); see `_ablate`."""
    return _ablate("codebooks", CODEBOOKS, train_both, request)


def ablate_data(request: AblationRequest) -> str:
    """Compare shares of another set that are added to the data (Tab. 6); see `_ablate`.

    Raises:
        InvalidInput: no other set is named.
    """
    other = request.other
    if other is None:
        raise InvalidInput("names no data to add", where="--with", hint="Name a prepared folder, such as that of CMP.")

    def train(share: float, run: TrainOptions[MOGOConfig]) -> dict[str, float]:
        return train_on_mix(request.bundle, other, share, run)

    return _ablate("data", SHARES, train, request)


def _ablate(
    about: str,
    variants: Mapping[str, V],
    train: Callable[[V, TrainOptions[MOGOConfig]], dict[str, float]],
    request: AblationRequest,
) -> str:
    """Train and measure each variant with each seed, and return the table; see `marey.training.ablation.compare`."""
    use_threads(request.threads)
    config = MOGOConfig.from_dict(find_bundle(request.bundle).manifest.parameters)
    config = with_batch(config, ["tokenizer", "transformer"], request.batch)

    def measured(name: str, seed: int) -> dict[str, float]:
        run = request.output / f"{about}-{list(variants).index(name)}-{seed}"
        shutil.rmtree(run, ignore_errors=True)
        run.mkdir(parents=True)
        found = train(variants[name], request.training(run, config, seed))
        if request.protocol is None:
            return found
        generator = Generator.load(str(run / "bundle"), threads=request.threads)
        return found | dict(request.measured(generator, generator.settings({}), f"{about}-{file_name(name)}.{seed}"))

    return compare(list(variants), measured, request.output, about, seeds=request.seeds)
