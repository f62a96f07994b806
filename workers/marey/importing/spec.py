"""Imports of text encoders and role labellers as the registry knows them. Standard library only."""

from __future__ import annotations

from marey.registry import ImportKind

ALLENNLP_SRL = ImportKind(
    name="allennlp-srl",
    help="Role labeller of AllenNLP (Shi & Lin 2019): structured-prediction-srl-bert, packed or unpacked.",
    run="marey.importing.allennlp:import_allennlp",
    licence="Apache-2.0",
    text_encoder=True,  # the folder of BERT, which the archive only names
)
CLIP = ImportKind(
    name="clip-vit-b32",
    help="Text encoder CLIP ViT-B/32: the folder of openai/clip-vit-base-patch32.",
    run="marey.importing.encoders:import_encoder",
    licence="MIT",
)
CLIP_L14 = ImportKind(
    name="clip-vit-l14",
    help="Text encoder CLIP ViT-L/14: the folder of openai/clip-vit-large-patch14.",
    run="marey.importing.encoders:import_encoder",
    licence="MIT",
)
DISTILBERT = ImportKind(
    name="distilbert-base-uncased",
    help="Text encoder DistilBERT: the folder of distilbert/distilbert-base-uncased.",
    run="marey.importing.encoders:import_encoder",
    licence="Apache-2.0",
)
T5 = ImportKind(
    name="t5-base",
    help="Text encoder T5 base: the folder of google-t5/t5-base.",
    run="marey.importing.encoders:import_encoder",
    licence="Apache-2.0",
)
T5_V1_1 = ImportKind(
    name="t5-v1_1-base",
    help="Text encoder T5 v1.1 base: the folder of google/t5-v1_1-base.",
    run="marey.importing.encoders:import_encoder",
    licence="Apache-2.0",
)
