"""Training of MoMask++: tokenizer, tokens, masked transformer, refiner, length estimator, then the bundle."""

from __future__ import annotations

import torch

from marey.models.momaskpp.assembly import recipe_of
from marey.models.momaskpp.captions import WordData
from marey.models.momaskpp.config import MoMaskPPConfig
from marey.models.momaskpp.memory import memory_model
from marey.models.momaskpp.stage_masked import ScaleStage
from marey.models.momaskpp.stage_refiner import RefinerStage, length_stage
from marey.models.momaskpp.stage_tokenizer import ScaleTokenizerStage
from marey.models.momaskpp.tokenizer import Tokenizer
from marey.models.momaskpp.tokens import load_scale_tokens
from marey.nn.devices import choose_device
from marey.training.loop import start_process_group
from marey.training.motions import MotionData, check_layout
from marey.training.stages import TrainingStage
from marey.training.staging import TrainOptions, finish, fit_micro_batch, train_all, use_threads


def train_stage(name: str, options: TrainOptions[MoMaskPPConfig]) -> dict[str, float]:
    """Train one stage, or with `all` every stage that the configuration has, and write its part; return its metrics.

    Raises:
        NotFound: a stage it builds on has not finished, or captions have no text features.
        InvalidInput: unknown stage, one that the configuration does not have, or parts or data of another one.
    """
    recipe = recipe_of(options.config)
    if name == "all":
        return train_all(recipe, train_stage, options)
    recipe.check_name(name)
    start_process_group()
    use_threads(options.threads)
    data = MotionData.load(options.prepared, choose_device(options.device))
    check_layout(options.config, data.prepared)
    if name == "masked":
        options = fit_micro_batch(options, memory_model)
    torch.manual_seed(options.seed)
    stage = _stage(name, options, data)
    metrics = recipe.train(stage, options)
    if isinstance(stage, ScaleTokenizerStage):
        metrics |= stage.test()
    finish(stage.module, options, name, metrics, data.prepared.sha256)
    return metrics


def _stage(name: str, options: TrainOptions[MoMaskPPConfig], data: MotionData) -> TrainingStage:
    config = options.config
    if name == "tokenizer":
        return ScaleTokenizerStage(config, data, Tokenizer(config))
    if name == "refiner":
        return RefinerStage(config, data)
    device = data.features.device
    tokenizer = recipe_of(config).trained("tokenizer", Tokenizer(config).to(device), options)
    tokens = load_scale_tokens(options.run, tokenizer, data)
    words = WordData.load(data.prepared, config.text, device)
    torch.manual_seed(options.seed)
    clips = data.prepared.clips
    kind = ScaleStage if name == "masked" else length_stage
    return kind(config, clips, tokens, words)
