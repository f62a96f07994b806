"""The model registry: every generator model is described by one `ModelSpec`, found by an entry point.

A distribution registers a model with one line; entry point and model have the same name:

    [project.entry-points."marey.models"]
    hgm3 = "marey.models.hgm3.spec:SPEC"

A spec holds data and references, `module:attribute` strings, so that importing it needs the standard library alone:
torch is imported where a reference is resolved. docs/extending.md builds a model step by step.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING, Any

from marey.core.errors import InvalidInput, NotFound

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

GROUP = "marey.models"
NAME = re.compile(r"[a-z][a-z0-9_-]{0,39}")
"""A model's name is also its queue, a part of metric labels and of commands."""
RESERVED = frozenset({"text", "evaluator", "live"})
"""Queues of the platform itself."""


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

    def check(self, value: float) -> float:
        """Return the value as a float, or as an int where the setting is whole.

        Raises:
            InvalidInput: not a whole number where one is needed, or out of range.
        """
        if self.whole and not float(value).is_integer():
            raise InvalidInput(f"{self.name}: is {value:g}, not a whole number")
        if not self.low <= value <= self.high:
            raise InvalidInput(f"{self.name}: {value:g} is outside {self.low:g} to {self.high:g}")
        return int(value) if self.whole else float(value)


@dataclass(frozen=True)
class Stage:
    """One step of training: `marey train MODEL NAME`."""

    name: str
    help: str


@dataclass(frozen=True)
class Choice:
    """An option of a model's training that takes one of several words; by default the configuration decides."""

    name: str
    values: tuple[str, ...]
    help: str


@dataclass(frozen=True)
class Training:
    """Training of bundles. All functions are references, `module:attribute`.

    Attributes:
        help: of the group of commands.
        stages: in training order; one named `all` runs every other.
        config: `(name, **choices) -> configuration`, a `marey.core.configs.ModelConfig` with one
            `train_<stage>: StageConfig` per stage.
        train: `(stage, TrainOptions) -> {metric: value}`.
        assemble: `(prepared, run, output, configuration, *, card, overwrite) -> Bundle`.
        unpack: `(bundle, run) -> configuration`; None = bundles cannot be trained further.
        choices: passed on to `config` by name.
        bundle_help: of the command `bundle`.
    """

    help: str
    stages: tuple[Stage, ...]
    config: str
    train: str
    assemble: str
    unpack: str | None = None
    choices: tuple[Choice, ...] = ()
    bundle_help: str = "Write the bundle from the parts of a run."


@dataclass(frozen=True)
class Ablation:
    """A comparison of trained variants: `marey train ablate NAME`.

    Attributes:
        name: unique among the model's.
        help: one line.
        run: `(data, bundle, output, *, steps, batch, seeds, threads) -> Markdown table`.
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
        live: `() -> LiveModel` (`marey.runtime.live.port`); None = it does not stream.
        training: None = it is not trained here.
        tokenizer: `(parameters) -> MotionTokenizer`, untrained; its weights come from the part `tokenizer` of a bundle
            or run. None = the model has no such part.
        random_bundle: `(path) -> Bundle` with random weights, for tests and demos.
        live_adherence: `(generator, prompts, *, steers, walks) -> {title: sessions}`; see `marey eval adherence`.
        self_train: `(generator, pipeline, prepared, run, *, captions, seed, progress) -> number of kept motions`.
        ablations: comparisons for `marey train ablate`.
    """

    name: str
    title: str
    about: str
    handler: str
    load: str
    settings: tuple[Setting, ...] = ()
    live: str | None = None
    training: Training | None = None
    tokenizer: str | None = None
    random_bundle: str | None = None
    live_adherence: str | None = None
    self_train: str | None = None
    ablations: tuple[Ablation, ...] = ()


@cache
def _registered() -> Mapping[str, EntryPoint]:
    from importlib.metadata import entry_points  # 15 ms, which most commands need not spend

    found: dict[str, EntryPoint] = {}
    for entry in sorted(entry_points(group=GROUP), key=lambda each: each.name):
        other = found.setdefault(entry.name, entry)
        if other.value != entry.value:
            raise InvalidInput(
                f"two installed packages register the model {entry.name!r}: {_owner(other)} and {_owner(entry)}",
                where=GROUP,
                hint="Uninstall one of them.",
            )
    return found


def _owner(entry: EntryPoint) -> str:
    return entry.value if entry.dist is None else entry.dist.name


def model_names() -> tuple[str, ...]:
    """Return the names of all registered models, sorted; imports none of them.

    Raises:
        InvalidInput: two packages register one name.
    """
    return tuple(_registered())


@cache
def find_model(name: str) -> ModelSpec | None:
    """Return the spec of a registered model; None if it is not installed here.

    Raises:
        InvalidInput: its package cannot be imported, or registers something else.
    """
    entry = _registered().get(name)
    if entry is None:
        return None
    try:
        spec = entry.load()
    except (ImportError, AttributeError) as error:
        raise InvalidInput(
            f"the model {name!r} of the package {_owner(entry)} cannot be imported: {error}",
            where=entry.value,
            hint=f"Reinstall or uninstall {_owner(entry)}.",
        ) from error
    if not isinstance(spec, ModelSpec) or spec.name != name or not NAME.fullmatch(name) or name in RESERVED:
        raise InvalidInput(
            f"the entry point {name!r} of the package {_owner(entry)} is not the ModelSpec of a model of that name",
            where=entry.value,
            hint="See docs/extending.md.",
        )
    return spec


def get_model(name: str, where: str | None = None) -> ModelSpec:
    """Return the spec of a registered model.

    Raises:
        NotFound: it is not installed here.
        InvalidInput: see `find_model`.
    """
    spec = find_model(name)
    if spec is None:
        raise NotFound(
            f"unknown model {name!r}",
            where=where,
            hint=f"Installed here: {', '.join(model_names()) or 'none'}. A package that registers it adds it.",
        )
    return spec


def resolve(reference: str) -> Any:
    """Import the attribute of a reference `module:attribute`; the attribute may be dotted, as `Generator.load`.

    Raises:
        ImportError: there is no such module, or one that it needs is not installed.
        AttributeError: the module has no such attribute.
    """
    module, _, attribute = reference.partition(":")
    found: Any = import_module(module)
    for name in attribute.split("."):
        found = getattr(found, name)
    return found
