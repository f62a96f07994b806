"""Registry entry of MOGO. Standard library only."""

from __future__ import annotations

from marey.registry import Ablation, LengthLimits, ModelSpec, Setting, Stage, Training, Variety

ABLATION = "marey.models.mogo.ablation"

SPEC = ModelSpec(
    name="mogo",
    title="MOGO",
    about="""\
Motions from one English prompt, drawn frame by frame, and live streams that are steered while they run.
A stream follows a new prompt within about two seconds and goes on without end.
Reads a prompt as one sentence; several actions in one prompt are less reliable than one after another.
An open length ends where the model draws an end.
Only the past decides a frame: nothing is revised, so a motion is less even than one drawn as a whole.
The same prompt, seed, settings and bundle give the same motion.""",
    handler="marey.models.mogo.handler:create_handler",
    load="marey.models.mogo.generate:Generator.load",
    settings=(
        Setting("guidance", 0.0, 100.0, 1.0, "Weight of the prompt at level 0; 1 = none, else twice the work."),
        Setting("temperature", 0.0, 100.0, 1.0, "Randomness of level 0; 0 = the likeliest token."),
        Setting("top_k", 0.001, 1.0, 0.1, "Share of the codes that level 0 may draw."),
        Setting("upper_guidance", 0.0, 100.0, 1.0, "As guidance, for all other levels."),
        Setting("upper_temperature", 0.0, 100.0, 0.6, "As temperature, for all other levels."),
        Setting("upper_top_k", 0.001, 1.0, 0.1, "As top_k, for all other levels."),
    ),
    best_of=True,
    variety=Variety(
        low={"temperature": 0.7, "upper_temperature": 0.8, "top_k": 0.5},
        high={"temperature": 1.35, "upper_temperature": 1.2, "top_k": 2.0},
    ),
    limits=LengthLimits(0.8, 60.0),  # of most bundles 9.8, the length of their training clips
    live="marey.models.mogo.live:create_live_model",
    live_examples="marey.models.mogo.live_examples:prompts_of",
    training=Training(
        help="MOGO: tokenizer, transformer, then `bundle`.",
        stages=(
            Stage("tokenizer", "Train the MoSA-VQ."),
            Stage("transformer", "Train the RQHC-Transformer."),
            Stage("all", "Both stages one after another, --max-minutes for them together; a second call continues."),
        ),
        config="marey.models.mogo.config:named_config",
        train="marey.models.mogo.train:train_stage",
        assemble="marey.models.mogo.assembly:assemble",
        unpack="marey.models.mogo.assembly:unpack",
        memory="marey.models.mogo.memory:memory_model",
    ),
    tokenizer="marey.models.mogo.tokenizer:build_tokenizer",
    bundles={"mogo-starter": "marey-bundles-starter", "mogo-open": "marey-bundles-open"},
    random_bundle="marey.models.mogo.bundle:random_bundle",
    live_adherence="marey.models.mogo.adherence:judge_streams",
    ablations=(
        Ablation("tokenizer", "Ways in which MoSA scales its levels.", f"{ABLATION}:ablate_tokenizer"),
        Ablation("transformer", "How levels and depth are drawn.", f"{ABLATION}:ablate_transformer"),
        Ablation("scaling", "Learnable scaling at three sizes of codebooks.", f"{ABLATION}:ablate_scaling"),
        Ablation("levels", "One to seven levels of tokens.", f"{ABLATION}:ablate_levels"),
        Ablation("codebooks", "Five sizes of codebooks.", f"{ABLATION}:ablate_codebooks"),
        Ablation("data", "Shares of another set, named by --with.", f"{ABLATION}:ablate_data"),
    ),
)
