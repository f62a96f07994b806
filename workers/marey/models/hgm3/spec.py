"""Registry entry of HGM³. Standard library only."""

from __future__ import annotations

from marey.registry import Ablation, Choice, LengthLimits, ModelSpec, Setting, Stage, Training, Variety

ABLATION = "marey.models.hgm3.ablation"

SPEC = ModelSpec(
    name="hgm3",
    title="HGM³",
    about="""\
Whole motions from one English prompt, drawn by masked tokens in a few passes.
Reads a prompt as a graph: the whole, its actions, and what is said of each action.
Several actions in one prompt come out in the order of time.
Decides the length itself where none is given.
Decoding goes from coarse to fine; steps trade quality for time.
Does not stream: a motion is drawn as a whole.
The same prompt, seed, settings and bundle give the same motion.""",
    handler="marey.models.hgm3.handler:create_handler",
    load="marey.models.hgm3.generate:Generator.load",
    settings=(
        Setting("steps", 1, 100, 10, "Passes of the base level; fewer are faster.", whole=True),
        Setting("motion_steps", 0, 100, 2, "The last pass by the prompt as a whole alone; 0 = none.", whole=True),
        Setting("action_steps", 0, 100, 5, "The last pass without what is said of each action.", whole=True),
        Setting("guidance", 0.0, 100.0, 4.0, "Weight of the prompt at the base level; 1 = none."),
        Setting("temperature", 0.0, 100.0, 1.0, "Randomness of the base level; 0 = the likeliest token."),
        Setting("top_k", 0.001, 1.0, 0.1, "Share of the codes that the base level may draw."),
        Setting("residual_guidance", 0.0, 100.0, 5.0, "As guidance, for the residual levels."),
        Setting("residual_temperature", 0.0, 100.0, 1.0, "As temperature, for the residual levels."),
        Setting("residual_top_k", 0.001, 1.0, 0.1, "As top_k, for the residual levels."),
        Setting("drawing", 0, 1, 1, "1: rules draw movements they know better; 0: the network makes all.", whole=True),
    ),
    best_of=True,
    keeps_frames=True,
    variety=Variety(
        low={"temperature": 0.6, "residual_temperature": 0.6, "top_k": 0.5},
        high={"temperature": 1.6, "residual_temperature": 1.3, "top_k": 2.0},
    ),
    limits=LengthLimits(0.8, 9.8),
    training=Training(
        help="HGM³: stages in this order, then `bundle`.",
        stages=(
            Stage("tokenizer", "Train the residual VQ-VAE."),
            Stage("masked", "Train the masked transformer, with hard token mining."),
            Stage("residual", "Train the residual transformer."),
            Stage("length", "Train the length estimator."),
            Stage("all", "All stages one after another, --max-minutes for them together; a second call continues."),
        ),
        config="marey.models.hgm3.config:named_config",
        train="marey.models.hgm3.train:train_stage",
        assemble="marey.models.hgm3.assembly:assemble",
        unpack="marey.models.hgm3.assembly:unpack",
        memory="marey.models.hgm3.memory:memory_model",
        choices=(Choice("mask", ("hard", "random"), "hard or random; default: as the configuration says."),),
    ),
    tokenizer="marey.models.hgm3.tokenizer:build_tokenizer",
    bundles={"hgm3-open": "marey-bundles-open", "hgm3-starter": "marey-bundles-starter"},
    random_bundle="marey.models.hgm3.bundle:random_bundle",
    difficulty="marey.models.hgm3.difficulty:token_difficulties",
    self_train="marey.models.hgm3.self_train:self_train_into",
    ablations=(
        Ablation("masks", "Hard and random masks, each decoded in three ways.", f"{ABLATION}:ablate_masks"),
        Ablation("conditions", "One condition or three, networks shared or not.", f"{ABLATION}:ablate_conditions"),
        Ablation("alphas", "Share of hard tokens among the masked ones.", f"{ABLATION}:ablate_alphas"),
        Ablation("passes", "Passes of decoding under each condition.", f"{ABLATION}:ablate_passes"),
    ),
)
