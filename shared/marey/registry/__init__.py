"""Plug-in registries: what an installed distribution adds to the product by an entry point. Standard library only."""

from marey.registry.imports import ImportKind
from marey.registry.models import (
    Ablation,
    LengthLimits,
    ModelSpec,
    Setting,
    Variety,
    find_model,
    get_model,
    import_kinds,
    model_names,
    models_by_range,
    models_with,
    resolve,
    streaming_models,
    trainings,
)
from marey.registry.plugins import PlugIns
from marey.registry.training import Choice, Stage, Training

__all__ = [
    "Ablation",
    "Choice",
    "ImportKind",
    "LengthLimits",
    "ModelSpec",
    "PlugIns",
    "Setting",
    "Stage",
    "Training",
    "Variety",
    "find_model",
    "get_model",
    "import_kinds",
    "model_names",
    "models_by_range",
    "models_with",
    "resolve",
    "streaming_models",
    "trainings",
]
