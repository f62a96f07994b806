"""Training of MOGO: the MoSA-VQ tokenizer, then the RQHC-Transformer on its tokens."""

from __future__ import annotations

import numpy as np
import torch

from marey.models.mogo.assembly import RECIPE
from marey.models.mogo.config import MOGOConfig
from marey.models.mogo.level_token import build_transformer
from marey.models.mogo.losses import scale_penalty
from marey.models.mogo.memory import memory_model
from marey.models.mogo.rollouts import Rollouts
from marey.models.mogo.samples import MIN_FRAMES
from marey.models.mogo.stage_transformer import TransformerStage
from marey.models.mogo.steers import Steers, load_steers
from marey.models.mogo.tokenizer import Tokenizer
from marey.nn.devices import choose_device
from marey.training.loop import start_process_group
from marey.training.motions import MotionData, check_layout, load_tokens
from marey.training.pairs import Pairs
from marey.training.sentences import SentenceData
from marey.training.staging import TrainOptions, finish, fit_micro_batch, train_all, use_threads
from marey.training.texts import CaptionTexts
from marey.training.tokenizing import TokenizerStage


def train_stage(name: str, options: TrainOptions[MOGOConfig]) -> dict[str, float]:
    """Train one stage, or with `all` both, and write its part; return its metrics.

    Raises:
        NotFound: the tokenizer has not finished, or captions have no text features.
        InvalidInput: unknown stage, or parts of another configuration.
    """
    if name == "all":
        return train_all(RECIPE, train_stage, options)
    RECIPE.check_name(name)
    start_process_group()
    use_threads(options.threads)
    return _train_tokenizer(options) if name == "tokenizer" else _train_transformer(options)


def _train_tokenizer(options: TrainOptions[MOGOConfig]) -> dict[str, float]:
    data = _data(options)
    tokenizer = Tokenizer(options.config)
    config = options.config
    stage = TokenizerStage(config, data, tokenizer, lambda: scale_penalty(tokenizer, config.tokenizer))
    metrics = RECIPE.train(stage, options) | stage.test()
    finish(stage.module, options, stage.name, metrics, data.prepared.sha256)
    return metrics


def _train_transformer(options: TrainOptions[MOGOConfig]) -> dict[str, float]:
    options = fit_micro_batch(options, memory_model)
    stage, sha256 = transformer_stage(options)
    metrics = RECIPE.train(stage, options)
    finish(stage.module, options, stage.name, metrics, sha256)
    return metrics


def transformer_stage(options: TrainOptions[MOGOConfig]) -> tuple[TransformerStage, str]:
    """Return the transformer's stage on the tokens of the run, encoded if missing, and the hash of the data.

    Features are read for the tokens alone, and their memory is released afterwards.
    """
    data = _data(options)
    device = data.features.device
    tokenizer = RECIPE.trained("tokenizer", Tokenizer(options.config).to(device), options)
    tokens = load_tokens(options.run, tokenizer, data)
    texts, width = CaptionTexts.load(data.prepared), options.config.condition.text_width
    captions = SentenceData.of_sentences(texts, data.prepared.caption_counts, width, device)
    torch.manual_seed(options.seed)
    clips = data.prepared.clips
    steers = _steers(options, tokenizer, data, Pairs(clips, tokens, captions, MIN_FRAMES), captions)
    return TransformerStage(options.config, clips, tokens, captions, steers), data.prepared.sha256


def _data(options: TrainOptions[MOGOConfig]) -> MotionData:
    torch.manual_seed(options.seed)
    data = MotionData.load(options.prepared, choose_device(options.device))
    check_layout(options.config, data.prepared)
    return data


def _steers(
    options: TrainOptions[MOGOConfig], tokenizer: Tokenizer, data: MotionData, pairs: Pairs, captions: SentenceData
) -> Steers | None:
    """Return steered motions between training clips of one action each; some start from the finished model's motion, if
    there is one."""
    if not options.config.steers:
        return None
    single = np.array([not data.prepared.clips[int(clip)].seams for clip in pairs.train])
    clips, weights = pairs.train[single].tolist(), pairs.weights[single].tolist()
    rollouts = None
    if options.warm and options.config.rollouts:
        model = RECIPE.trained("transformer", build_transformer(options.config).to(data.features.device), options)
        rollouts = Rollouts(model, tokenizer, captions)
    return load_steers(options.run, options.config, tokenizer, data, clips, weights, rollouts)
