"""Registry entry of MoMask++. Standard library only."""

from __future__ import annotations

from marey.registry import Ablation, ImportKind, LengthLimits, ModelSpec, Setting, Stage, Training, Variety

ABLATION = "marey.models.momaskpp.ablation"

SPEC = ModelSpec(
    name="momaskpp",
    title="MoMask++",
    about="""\
Whole motions from one English prompt, drawn by masked tokens in a few passes.
Reads a prompt word by word: long descriptions count in full, up to the bundle's number of words.
Tokens of four time scales, coarse to fine, are drawn in one loop by one network.
Public weights of SnapMoGen and HumanML3D can be imported.
Without a given length, a bundle's estimator decides; a bundle without one draws among a few lengths by the seed.
Does not stream: a motion is drawn as a whole.
The same prompt, seed, settings and bundle give the same motion.""",
    handler="marey.models.momaskpp.handler:create_handler",
    load="marey.models.momaskpp.generate:Generator.load",
    settings=(
        Setting("steps", 1, 100, 18, "Passes; fewer are faster.", whole=True),
        Setting("guidance", 0.0, 100.0, 4.0, "Weight of the prompt; 1 = none."),
        Setting("temperature", 0.0, 100.0, 1.0, "Randomness; 0 = the likeliest token."),
        Setting("top_k", 0.001, 1.0, 0.1, "Share of the codes that may be drawn."),
    ),
    best_of=True,
    keeps_frames=True,
    variety=Variety(low={"temperature": 0.6, "top_k": 0.5}, high={"temperature": 1.6, "top_k": 2.0}),
    limits=LengthLimits(0.8, 10.7),
    training=Training(
        help="MoMask++: stages in this order, then `bundle`.",
        stages=(
            Stage("tokenizer", "Train the multi-scale RVQ-VAE."),
            Stage("masked", "Train the masked transformer over all scales."),
            Stage("refiner", "Train the root refiner, where the configuration has one."),
            Stage("length", "Train the length estimator, where the configuration has one."),
            Stage("all", "All stages one after another, --max-minutes for them together; a second call continues."),
        ),
        config="marey.models.momaskpp.config:named_config",
        train="marey.models.momaskpp.train:train_stage",
        assemble="marey.models.momaskpp.assembly:assemble",
        unpack="marey.models.momaskpp.assembly:unpack",
        memory="marey.models.momaskpp.memory:memory_model",
    ),
    tokenizer="marey.models.momaskpp.tokenizer:build_tokenizer",
    random_bundle="marey.models.momaskpp.bundle:random_bundle",
    ablations=(
        Ablation("scales", "Multi-scale tokens against full-scale ones.", f"{ABLATION}:ablate_scales"),
        Ablation("attention", "The tokenizer with and without attention.", f"{ABLATION}:ablate_attention"),
        Ablation("conditioning", "In-context against cross-attention.", f"{ABLATION}:ablate_conditioning"),
    ),
    imports=(
        ImportKind(
            name="momaskpp",
            help="MoMask++ (Guo et al. 2025): checkpoint_dir/snapmogen, with the data set's meta_data, or /humanml3d.",
            run="marey.models.momaskpp.importing:import_momaskpp",
            licence="LicenseRef-Snap-NC",
            text_encoder=True,
        ),
    ),
)
