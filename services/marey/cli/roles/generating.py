"""A model in this process, for `marey generate` and `make demo`."""

from __future__ import annotations

from pathlib import Path

from marey.core.errors import InvalidInput
from marey.generate.oneshot import OneShot, Wanted
from marey.generate.poses import constraints_of, read_file
from marey.registry import get_model, resolve

__all__ = ["OneShot", "Wanted", "constraints_of", "make_random_bundle", "read_file"]


def make_random_bundle(model: str, path: Path) -> None:
    """Write a tiny bundle of a model with random weights: it exercises everything and generates nonsense.

    Raises:
        NotFound: there is no such model.
        InvalidInput: the model makes no such bundles.
    """
    spec = get_model(model)
    if spec.random_bundle is None:
        raise InvalidInput(f"the model {model!r} makes no bundles with random weights")
    resolve(spec.random_bundle)(path)
