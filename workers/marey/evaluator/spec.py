"""The evaluator's training as the registry knows it. Standard library only."""

from __future__ import annotations

from marey.registry import Stage, Training

TRAINING = Training(
    help="Evaluator of generated motions: stage `tmr`, then `bundle`.",
    stages=(Stage("tmr", "Train the motion and the text encoder of the evaluator."),),
    config="marey.evaluator.config:named_config",
    train="marey.evaluator.train:train_stage",
    assemble="marey.evaluator.assembly:assemble",
    bundle_help="Write the bundle from the part of a run, with captions and embeddings of the real test clips.",
)
