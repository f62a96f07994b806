"""Folders that hold bundles, in the order in which they are searched.

A distribution of bundles names its package in the entry-point group `marey.bundles`; the package is a folder of bundles
and is never imported.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from functools import lru_cache
from importlib.metadata import entry_points
from importlib.util import find_spec
from pathlib import Path

from marey.core.checkout import checkout
from marey.core.settings import Settings
from marey.registry import ModelSpec, find_model, model_names

GROUP = "marey.bundles"
OPEN, STARTER = "marey-bundles-open", "marey-bundles-starter"
_OF_THE_PLATFORM = {"minilm-l6": OPEN, "srl-light": OPEN, "srl-open": OPEN, "evaluator-starter": STARTER}

log = logging.getLogger(__name__)


def folders(config: Settings) -> tuple[Path, ...]:
    """Return the folders of bundles; of several bundles with one name the first folder's is used.

    `MAREY_MODELS`, `models` of the home, `models` of the checkout unless `MAREY_MODELS` replaces it, installed
    distributions.
    """
    root = checkout()
    given = () if config.models is None else (config.models,)
    beside = (root / "models",) if root is not None and config.models is None else ()
    return (*given, config.home / "models", *beside, *installed())


@lru_cache(maxsize=1)
def installed() -> tuple[Path, ...]:
    """Return the folders of the installed distributions of bundles, by entry-point name."""
    found: list[Path] = []
    for entry in sorted(entry_points(group=GROUP), key=lambda entry: entry.name):
        try:
            spec = find_spec(entry.value)
        except (ImportError, ValueError):
            spec = None
        if spec is None or not spec.submodule_search_locations:
            log.warning("the entry point %r of %s names no package: %s", entry.name, GROUP, entry.value)
            continue
        found += map(Path, spec.submodule_search_locations)
    return tuple(found)


def distributions() -> dict[str, str]:
    """The distribution on the package index that brings each known bundle: of the platform, and of installed models."""
    return _OF_THE_PLATFORM | {name: package for spec in _specs() for name, package in spec.bundles.items()}


def preferred(model: str) -> tuple[str, ...]:
    """Return the names of a model's trained bundles, the preferred one first; none for an unknown model."""
    spec = find_model(model)
    return () if spec is None else tuple(spec.bundles)


def _specs() -> Iterator[ModelSpec]:
    return filter(None, map(find_model, model_names()))


def how_to_get(name: str) -> str:
    """Return a sentence that names the distribution of a bundle, or of a model's own bundle; empty for other names."""
    distribution = distributions().get(next(iter(preferred(name)), name))
    return f" It comes with `pip install {distribution}`." if distribution else ""
