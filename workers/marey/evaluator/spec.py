"""The evaluator's training, and imports of published evaluators, as the registry knows them. Standard library only."""

from __future__ import annotations

from marey.registry import ImportKind, Stage, Training

TRAINING = Training(
    help="Evaluator of generated motions: stage `tmr`, then `bundle`.",
    stages=(Stage("tmr", "Train the motion and the text encoder of the evaluator."),),
    config="marey.evaluator.config:named_config",
    train="marey.evaluator.train:train_stage",
    assemble="marey.evaluator.assembly:assemble",
    bundle_help="Write the bundle from the part of a run, with captions and embeddings of the real test clips.",
)

T2M_IMPORT = ImportKind(
    name="t2m-evaluator",
    help="Evaluator of HumanML3D (Guo et al. 2022): checkpoints/t2m, with the folder glove in it or beside it.",
    run="marey.evaluator.t2m_import:import_t2m",
    licence="LicenseRef-AMASS-NC",  # the weights have no stated terms, and derive from AMASS
)

SNAPMOGEN_IMPORT = ImportKind(
    name="snapmogen-evaluator",
    help="Evaluator of SnapMoGen (Guo et al. 2025): checkpoint_dir, with the data set's meta_data in it or beside it.",
    run="marey.evaluator.snapmogen_import:import_snapmogen",
    licence="LicenseRef-Snap-NC",
    text_encoder=True,
)

TMR_IMPORT = ImportKind(
    name="tmr",
    help="Evaluator TMR (Petrovich et al. 2023): a folder tmr_… of models, with the repository's stats in or above it.",
    run="marey.evaluator.tmr_import:import_tmr",
    text_encoder=True,  # its repository states terms of the code, and refers to those of the data sets
)
