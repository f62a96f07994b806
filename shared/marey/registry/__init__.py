"""Plug-in registries: what an installed distribution adds to the product by an entry point. Standard library only."""

from marey.registry.models import (
    Ablation,
    Choice,
    ModelSpec,
    Setting,
    Stage,
    Training,
    find_model,
    get_model,
    model_names,
    resolve,
)

__all__ = [
    "Ablation",
    "Choice",
    "ModelSpec",
    "Setting",
    "Stage",
    "Training",
    "find_model",
    "get_model",
    "model_names",
    "resolve",
]
