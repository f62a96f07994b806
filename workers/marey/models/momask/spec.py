"""Registry entry of MoMask. Standard library only."""

from __future__ import annotations

from marey.registry import ImportKind, LengthLimits, ModelSpec, Setting, Variety

SPEC = ModelSpec(
    name="momask",
    title="MoMask",
    about="""\
Whole motions from one English prompt, drawn by masked tokens in a few passes.
Runs the public checkpoints, imported; it is not trained here.
Reads a prompt as one vector of CLIP: order and number of actions are known to it as far as that vector knows them.
Decides the length itself where none is given.
Decoding goes from coarse to fine; steps trade quality for time.
Does not stream: a motion is drawn as a whole.
The same prompt, seed, settings and bundle give the same motion.""",
    handler="marey.models.momask.handler:create_handler",
    load="marey.models.momask.generate:Generator.load",
    settings=(
        Setting("steps", 1, 100, 10, "Passes of the base level; fewer are faster.", whole=True),
        Setting("guidance", 0.0, 100.0, 4.0, "Weight of the prompt at the base level; 1 = none."),
        Setting("temperature", 0.0, 100.0, 1.0, "Randomness of the base level; 0 = the likeliest token."),
        Setting("top_k", 0.001, 1.0, 0.1, "Share of the codes that the base level may draw."),
        Setting("residual_guidance", 0.0, 100.0, 5.0, "As guidance, for the residual levels."),
        Setting("residual_temperature", 0.0, 100.0, 1.0, "As temperature, for the residual levels."),
        Setting("residual_top_k", 0.001, 1.0, 0.1, "As top_k, for the residual levels."),
    ),
    best_of=True,
    variety=Variety(
        low={"temperature": 0.6, "residual_temperature": 0.6, "top_k": 0.5},
        high={"temperature": 1.6, "residual_temperature": 1.3, "top_k": 2.0},
    ),
    limits=LengthLimits(0.8, 15.68),  # 16 frames at HumanML3D's 20 a second; 196 at KIT-ML's 12.5
    tokenizer="marey.models.momask.tokenizer:build_tokenizer",
    random_bundle="marey.models.momask.bundle:random_bundle",
    imports=(
        ImportKind(
            name="momask",
            help="MoMask's public checkpoints: the folder checkpoints/t2m or checkpoints/kit.",
            run="marey.models.momask.importing:import_momask",
            licence="LicenseRef-MoMask-NC",
            text_encoder=True,
        ),
    ),
)
