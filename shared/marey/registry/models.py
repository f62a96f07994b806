"""The model registry: every generator model is described by one `ModelSpec`, found by an entry point.

A distribution registers a model with one line; entry point and model have the same name:

    [project.entry-points."marey.models"]
    hgm3 = "marey.models.hgm3.spec:SPEC"

A spec holds data and references, `module:attribute` strings, so that importing it needs the standard library alone:
torch is imported where a reference is resolved. docs/extending.md builds a model step by step.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any

from marey.core.configs import Between
from marey.core.errors import InvalidInput, NotFound, PluginError
from marey.core.garbage import no_collection
from marey.registry.imports import IMPORTS, ImportKind
from marey.registry.plugins import PlugIns
from marey.registry.training import TRAININGS, Training

GROUP = "marey.models"
NAME = re.compile(r"[a-z][a-z0-9_-]{0,39}")
"""A model's name is also its queue, a part of metric labels and of commands."""
RESERVED = frozenset({"text", "evaluator", "live", "models"})
"""Queues of the platform itself, and the word for all models."""


@dataclass(frozen=True)
class Setting:
    """A number that changes how a model samples.

    Attributes:
        name: as in requests and `--set NAME=VALUE`.
        low, high: the range, both ends included.
        default: the value where a bundle gives none.
        help: one line for `marey models show`.
        whole: True = an integer.
    """

    name: str
    low: float
    high: float
    default: float
    help: str = ""
    whole: bool = False

    @property
    def range(self) -> Between:
        """The range, for the field of a configuration that holds a bundle's default."""
        return Between(self.low, self.high)

    def problem(self, value: float) -> str | None:
        """Return what is wrong with a value: not a whole number where one is needed, or out of range; else None."""
        if self.whole and not float(value).is_integer():
            return f"is {value:g}, not a whole number"
        return None if self.range.contains(value) else f"{value:g} is outside {self.range}"

    def check(self, value: float) -> float:
        """Return the value as a float, or as an int where the setting is whole.

        Raises:
            InvalidInput: see `problem`; the message begins with the setting's name.
        """
        if problem := self.problem(value):
            raise InvalidInput(f"{self.name}: {problem}")
        return int(value) if self.whole else float(value)


@dataclass(frozen=True)
class Variety:
    """Settings of sampling at two levels of how much motions of one prompt differ, as factors of a bundle's defaults.

    Attributes:
        low: by setting, where motions should differ less.
        high: by setting, where motions should differ more.
    """

    low: Mapping[str, float]
    high: Mapping[str, float]


@dataclass(frozen=True)
class LengthLimits:
    """The lengths of the motions that a model makes, in seconds, both ends included. A bundle may narrow them."""

    min_seconds: float
    max_seconds: float

    def __post_init__(self) -> None:
        """Check the range.

        Raises:
            ValueError: it is empty.
        """
        if not 0 < self.min_seconds <= self.max_seconds < math.inf:
            raise ValueError(f"no motion has {self.min_seconds:g} to {self.max_seconds:g} seconds")


@dataclass(frozen=True)
class Ablation:
    """A comparison of trained variants: `marey train ablate NAME`.

    Attributes:
        name: unique among the model's.
        help: one line.
        run: `(marey.training.ablation.AblationRequest) -> Markdown table`.
    """

    name: str
    help: str
    run: str


@dataclass(frozen=True)
class ModelSpec:
    """Description of a generator model for the product.

    Attributes:
        name: of the model, its queue, and `model` in the manifests of its bundles.
        title: display name.
        about: abilities and limits, in about ten lines.
        handler: `() -> Handler` of its queue.
        load: `(bundle, *, device, threads) -> Generator` (`marey.generation.port`).
        settings: of sampling.
        best_of: True if its handler can choose among candidates, as `marey.generation.handler.GeneratorHandler` can.
        variety: what `--variety low` and `high` change; None = it has no such levels.
        keeps_frames: True if its generator makes motion around frames that stay (`marey.generation.port.Request.kept`),
            which timelines need.
        limits: lengths of motions; None = each bundle states its own.
        live: `() -> LiveModel` (`marey.runtime.live.port`); None = it does not stream.
        live_examples: `(reference) -> prompts` that this bundle performs well while it streams, for the page `/live`;
            it may import the standard library only, because the API calls it. None = no examples.
        training: None = it is not trained here.
        tokenizer: `(parameters) -> MotionTokenizer`, untrained; its weights come from the part `tokenizer` of a bundle
            or run. None = the model has no such part.
        bundles: its trained bundles, the preferred one first, each with the package on the index that provides it.
        random_bundle: `(path) -> Bundle` with random weights, for tests and demos.
        live_adherence: `(generator, prompts, *, steers, walks) -> {title: sessions}`; see `marey eval adherence`.
        self_train: `(generator, pipeline, prepared, run, *, captions, seed, progress) -> number of kept motions`.
        difficulty: `(bundle, motions, prompts) -> [marey.viz.difficulty.TokenDifficulty]`, of features (T, D) of each
            motion; None = the model does not know which tokens are hard.
        ablations: comparisons for `marey train ablate`.
        imports: kinds of published weights that become its bundles by `marey models import`.
    """

    name: str
    title: str
    about: str
    handler: str
    load: str
    settings: tuple[Setting, ...] = ()
    best_of: bool = False
    variety: Variety | None = None
    keeps_frames: bool = False
    limits: LengthLimits | None = None
    live: str | None = None
    training: Training | None = None
    tokenizer: str | None = None
    bundles: Mapping[str, str] = field(default_factory=dict[str, str])
    random_bundle: str | None = None
    live_examples: str | None = None
    live_adherence: str | None = None
    self_train: str | None = None
    difficulty: str | None = None
    ablations: tuple[Ablation, ...] = ()
    imports: tuple[ImportKind, ...] = ()

    def __post_init__(self) -> None:
        """Check the name and the settings that a variety changes.

        Raises:
            ValueError: the name cannot be a queue's or is one of the platform's own, or there is no such setting.
        """
        if not NAME.fullmatch(self.name) or self.name in RESERVED:
            raise ValueError(f"a model cannot be named {self.name!r}")
        changed = {} if self.variety is None else {**self.variety.low, **self.variety.high}
        if unknown := sorted(set(changed) - {setting.name for setting in self.settings}):
            raise ValueError(f"the variety of {self.name!r} changes {unknown[0]!r}, which is none of its settings")

    def range_of(self, setting: str) -> Between:
        """Return the range of a setting.

        Raises:
            KeyError: the model has no such setting.
        """
        return {each.name: each for each in self.settings}[setting].range


MODELS = PlugIns(GROUP, ModelSpec, lambda spec: spec.name)


def model_names() -> tuple[str, ...]:
    """Return the names of all registered models, sorted; imports none of them.

    Raises:
        PluginError: two packages register one name.
    """
    return MODELS.names()


def find_model(name: str) -> ModelSpec | None:
    """Return the spec of a registered model; None if it is not installed here.

    Raises:
        PluginError: its package cannot be imported, or registers something else.
    """
    return MODELS.find(name)


def get_model(name: str, where: str | None = None) -> ModelSpec:
    """Return the spec of a registered model.

    Raises:
        NotFound: it is not installed here.
        PluginError: see `find_model`.
    """
    spec = find_model(name)
    if spec is None:
        raise NotFound(
            f"unknown model {name!r}",
            where=where,
            hint=f"Installed here: {', '.join(model_names()) or 'none'}. A package that registers it adds it.",
        )
    return spec


def models_by_range(setting: str) -> dict[str, list[str]]:
    """Return the names of the installed models that have a setting, by its values in words: `whole numbers, 1 to 100`.

    Raises:
        PluginError: a model cannot be loaded.
    """
    found: dict[str, list[str]] = {}
    for name, spec in MODELS.all().items():
        for each in spec.settings:
            if each.name == setting:
                found.setdefault(f"{'whole numbers, ' if each.whole else ''}{each.range}", []).append(name)
    return found


def models_with(field: str) -> tuple[str, ...]:
    """Return the names of the registered models whose specs have a field that others leave out, sorted.

    Raises:
        PluginError: a model cannot be loaded.
    """
    return tuple(name for name, spec in MODELS.all().items() if getattr(spec, field))


def streaming_models() -> tuple[str, ...]:
    """The names of the registered models that make live streams, sorted.

    Raises:
        PluginError: a model cannot be loaded.
    """
    return models_with("live")


def trainings() -> dict[str, Training]:
    """All that can be trained here, by name: models, in the order of their names, then what else is registered.

    Raises:
        PluginError: a plug-in cannot be loaded, or has the name of a model.
    """
    found = {name: spec.training for name, spec in MODELS.all().items() if spec.training is not None}
    for name, training in TRAININGS.all().items():
        if name in MODELS.names():
            raise PluginError(
                f"a model and another training have the name {name!r}",
                where=f"entry points {TRAININGS.group}",
                hint=f"Uninstall one of {MODELS.owner(name)} and {TRAININGS.owner(name)}.",
            )
        found[name] = training
    return found


def import_kinds() -> dict[str, ImportKind]:
    """All kinds of published weights that can be imported here, by name, sorted: of models, and what else is
    registered.

    Raises:
        PluginError: a plug-in cannot be loaded, or two kinds have one name.
    """
    found: dict[str, ImportKind] = {}
    kinds = [kind for spec in MODELS.all().values() for kind in spec.imports]
    for kind in [*kinds, *IMPORTS.all().values()]:
        if found.setdefault(kind.name, kind) is not kind:
            raise PluginError(
                f"two kinds of import have the name {kind.name!r}: {found[kind.name].run} and {kind.run}",
                where=f"entry points {GROUP} and {IMPORTS.group}",
                hint="Uninstall the package of one of them.",
            )
    return dict(sorted(found.items()))


def resolve(reference: str) -> Any:
    """Import the attribute of a reference `module:attribute`; the attribute may be dotted, as `Generator.load`.

    Raises:
        ImportError: there is no such module, or one that it needs is not installed.
        AttributeError: the module has no such attribute.
    """
    module, _, attribute = reference.partition(":")
    with no_collection():
        found: Any = import_module(module)
    for name in attribute.split("."):
        found = getattr(found, name)
    return found
