"""Training the evaluator: one stage."""

from __future__ import annotations

import torch

from marey.evaluator.assembly import RECIPE
from marey.evaluator.config import EvaluatorConfig
from marey.evaluator.sentences import open_encoder
from marey.evaluator.stage_tmr import TMRStage
from marey.nn.devices import choose_device
from marey.training.loop import start_process_group
from marey.training.motions import MotionData
from marey.training.staging import TrainOptions, finish, use_threads
from marey.training.texts import CaptionTexts


def train_stage(name: str, options: TrainOptions[EvaluatorConfig]) -> dict[str, float]:
    """Train the stage `tmr` and write its part; return its metrics, including those of the test split.

    Raises:
        NotFound: captions have no text features, or their encoder's weights are not on this machine.
        InvalidInput: unknown stage, or data of another layout.
        InvalidFile: texts of another width than the configuration's.
    """
    RECIPE.check_name(name)
    start_process_group()
    use_threads(options.threads)
    data = MotionData.load(options.prepared, choose_device(options.device))
    encoder = open_encoder(CaptionTexts.load(data.prepared).spec)
    torch.manual_seed(options.seed)
    stage, sha256 = TMRStage(options.config, data, encoder), data.prepared.sha256
    del data  # the stage keeps only what it reads, a quarter of the features
    metrics = RECIPE.train(stage, options) | stage.test()
    finish(stage.module, options, stage.name, metrics, sha256)
    return metrics
