"""Training of HGM³: tokenizer, tokens, masked transformer, residual transformer, length estimator, then the bundle."""

from __future__ import annotations

import dataclasses

import torch

from marey.models.hgm3.assembly import RECIPE
from marey.models.hgm3.config import HGM3Config
from marey.models.hgm3.data import CaptionData, check_texts
from marey.models.hgm3.memory import masked_memory, residual_memory
from marey.models.hgm3.stage_masked import MaskedStage
from marey.models.hgm3.stage_residual import ResidualStage, length_stage
from marey.models.hgm3.tokenizer import Tokenizer
from marey.nn.devices import choose_device
from marey.training.generated_clips import load_drawn
from marey.training.loop import start_process_group
from marey.training.motions import MotionData, check_layout, load_tokens
from marey.training.staging import TrainOptions, finish, fit_micro_batch, train_all, use_threads
from marey.training.texts import CaptionTexts
from marey.training.tokenizing import TokenizerStage


def train_stage(name: str, options: TrainOptions[HGM3Config]) -> dict[str, float]:
    """Train one stage, or with `all` every stage, and write its part; return its metrics.

    Raises:
        NotFound: a stage it builds on has not finished, or captions have no text features.
        InvalidInput: unknown stage, or parts of another configuration.
    """
    if name == "all":
        return train_all(RECIPE, train_stage, options)
    RECIPE.check_name(name)
    start_process_group()
    use_threads(options.threads)
    device = choose_device(options.device)
    data = MotionData.load(options.prepared, device)
    check_layout(options.config, data.prepared)
    torch.manual_seed(options.seed)
    if name == "tokenizer":
        return _train_tokenizer(options, data)
    texts = CaptionTexts.load(data.prepared)
    check_texts(texts, options.config)
    captions = CaptionData.of(texts, data.prepared.caption_counts, options.config.condition, device)
    tokenizer = RECIPE.trained("tokenizer", Tokenizer(options.config).to(device), options)
    tokens = load_tokens(options.run, tokenizer, data)
    codebooks = tokenizer.quantizer.codebooks
    torch.manual_seed(options.seed)
    clips = data.prepared.clips
    data = dataclasses.replace(data, features=data.features[:0])  # only the tokens are needed: release the memory
    if name == "masked":
        options = fit_micro_batch(options, masked_memory)
        drawn = load_drawn(options.run, tokenizer, data.prepared)
        if drawn is not None:
            clips, tokens, captions = drawn.extend(clips, tokens, captions)
        stage = MaskedStage(options.config, clips, tokens, captions)
    elif name == "residual":
        options = fit_micro_batch(options, residual_memory)
        stage = ResidualStage(options.config, clips, tokens, captions, codebooks)
    else:
        stage = length_stage(options.config, clips, tokens, captions)
    metrics = RECIPE.train(stage, options)
    finish(stage.module, options, name, metrics, data.prepared.sha256)
    return metrics


def _train_tokenizer(options: TrainOptions[HGM3Config], data: MotionData) -> dict[str, float]:
    stage = TokenizerStage(options.config, data, Tokenizer(options.config))
    metrics = RECIPE.train(stage, options) | stage.test()
    finish(stage.module, options, stage.name, metrics, data.prepared.sha256)
    return metrics
