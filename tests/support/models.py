"""Models of the registry, for tests of the platform: chosen by what they can, never by name.

A test of one model lies in `tests/models/<model>`.
"""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import pytest

from marey.bundles import Bundle
from marey.core import defaults
from marey.registry import get_model, model_names, resolve, streaming_models

GENERATORS = tuple(sorted(name for model in model_names() for name in get_model(model).bundles))
"""The shipped bundles of models, by name."""
TEXT_BUNDLES = ("minilm-l6", "srl-light", "srl-open")
"""The shipped bundles that read prompts."""
KEEPING = tuple(name for name in model_names() if get_model(name).keeps_frames)
"""The models that generate frames around others."""
NOT_KEEPING = next(name for name in model_names() if name not in KEEPING)
"""A model that does not."""
OTHERS = tuple(name for name in model_names() if name != defaults.MODEL)
"""The models that are not the default."""


def is_of(model: str, name: str) -> bool:
    """Return True for a file of a model's own: its code, tests, benchmarks, bundle, and what was measured of that.

    Args:
        name: path in the checkout.
    """
    return name.startswith(
        (
            f"workers/marey/models/{model}/",
            f"tests/models/{model}/",
            f"models/{model}-",
            f"models/evaluator-starter/reconstructions/{model}-",
            f"benchmarks/bench_{model}.",
            f"benchmarks/bench_{model}_",
        )
    )


def add_text_bundles(folder: Path) -> None:
    """Copy the encoder and the labellers of the product into a folder of bundles."""
    models = Path(__file__).resolve().parents[2] / "models"
    for name in TEXT_BUNDLES:
        shutil.copytree(models / name, folder / name)


def random_bundle(model: str, path: Path, **options: Any) -> Bundle:
    """A small bundle of random weights."""
    reference = get_model(model).random_bundle
    assert reference is not None, f"{model} makes no bundle of random weights"
    return resolve(reference)(path, **options)


def load(bundle: Bundle, **options: Any) -> Any:
    """The generator of a bundle, on the processor."""
    load = resolve(get_model(bundle.manifest.model).load)
    return load(str(bundle.path), **{"device": "cpu", "threads": 1, **options})


def streaming_model() -> str:
    """A model that streams; where none is installed, the test is skipped."""
    if not streaming_models():
        pytest.skip("no installed model streams")
    return streaming_models()[0]


def another_model() -> str:
    """A model beside the default one; where none is installed, the test is skipped."""
    if not OTHERS:
        pytest.skip("only the default model is installed")
    return OTHERS[0]
