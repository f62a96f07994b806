"""Results of `client.models`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from marey.client.results import Result


@dataclass(frozen=True, kw_only=True)
class TrainingData(Result):
    """A data set that weights were trained on."""

    name: str = ""
    licence: str = ""
    credit: str = ""


@dataclass(frozen=True, kw_only=True)
class SamplingSetting(Result):
    """A setting of a model's sampling; minimum and maximum are allowed themselves."""

    name: str = ""
    minimum: float = 0.0
    maximum: float = 0.0
    default: float = 0.0
    whole: bool = False
    """Whole numbers only."""
    help: str = ""


@dataclass(frozen=True, kw_only=True)
class ModelActions(Result):
    """Actions of a bundle, by their ids in the vocabulary.

    Attributes:
        supported: at least 80 % adherence.
        single_take: supported, learned from fewer than four sources.
        tried: trained on, below 80 % adherence or hardly measured.
    """

    supported: tuple[str, ...] = ()
    single_take: tuple[str, ...] = ()
    tried: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Model(Result):
    """A bundle."""

    name: str = ""
    bundle: str = ""
    model: str = ""
    version: str = ""
    config: str = ""
    random: bool = False
    licence: str = ""
    commercial: bool = False
    skeleton: str | None = None
    fps: float | None = None
    min_seconds: float = 0.0
    max_seconds: float = 0.0
    encoder: str = ""
    data: tuple[TrainingData, ...] = ()
    metrics: Mapping[str, float] = field(default_factory=dict[str, float])
    settings: tuple[SamplingSetting, ...] = ()
    actions: ModelActions | None = None
    """None where the bundle lists none."""
    about: str = ""
    """A few lines on the abilities and limits of the model; empty where the server does not know it."""


@dataclass(frozen=True, kw_only=True)
class BrokenModel(Result):
    """A bundle that the server leaves out because it cannot be used."""

    name: str = ""
    reason: str = ""


@dataclass(frozen=True, kw_only=True)
class ModelCatalogue(Result):
    """All bundles of a server."""

    items: tuple[Model, ...] = ()
    broken: tuple[BrokenModel, ...] = ()
