"""The model as the registry knows it. Standard library only."""

from __future__ import annotations

from marey.registry import Choice, LengthLimits, ModelSpec, Setting, Stage, Training

SPEC = ModelSpec(
    name="sway",
    title="Sway",
    about="Stands where training clips stand on average, and sways. Reads no prompt.",
    handler="marey_sway.generate:create_handler",
    load="marey_sway.generate:Generator.load",
    settings=(
        Setting("width", 0.0, 0.5, 0.1, "Metres from side to side."),
        Setting("beats", 1, 8, 2, "Sways per motion.", whole=True),
    ),
    limits=LengthLimits(0.8, 9.8),
    training=Training(
        help="Sway: the pose, then `bundle`.",
        stages=(Stage("pose", "Average the training clips."),),
        config="marey_sway.train:named_config",
        train="marey_sway.train:train_stage",
        assemble="marey_sway.train:assemble",
        choices=(Choice("side", ("left", "right"), "First side; default: as the configuration says."),),
    ),
    random_bundle="marey_sway.train:random_bundle",
)
