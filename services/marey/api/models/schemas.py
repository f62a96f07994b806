"""Answers of the model routes."""

from __future__ import annotations

from marey.bundles import BrokenBundle
from marey.bundles.limits import settings_of
from marey.http.schemas import View
from marey.jobs.generators import GeneratorCapabilities, GeneratorList
from marey.registry import find_model
from marey.vocabulary.scope import ActionLists


class DataView(View):
    """Training data of the weights."""

    name: str
    licence: str
    credit: str


class SettingView(View):
    """A setting of sampling."""

    name: str
    minimum: float
    maximum: float
    default: float
    """Of this bundle."""
    whole: bool
    """Whole numbers only."""
    help: str


class ActionsView(View):
    """Actions of a bundle, by their ids in the vocabulary."""

    supported: list[str]
    """At least 80 % adherence."""
    single_take: list[str]
    """Supported, learned from fewer than four sources."""
    tried: list[str]
    """Trained on, below 80 % adherence or hardly measured."""

    @classmethod
    def of(cls, lists: ActionLists) -> ActionsView:
        """Convert the lists of a manifest."""
        return cls(**{name: list(getattr(lists, name)) for name in cls.model_fields})


class ModelView(View):
    """A bundle."""

    name: str
    bundle: str
    """The exact bundle: name and weights hash."""
    model: str
    version: str
    config: str
    random: bool
    """True for random weights that were never trained."""
    licence: str
    commercial: bool
    skeleton: str | None
    fps: float | None
    min_seconds: float
    max_seconds: float
    encoder: str
    data: list[DataView]
    metrics: dict[str, float]
    settings: list[SettingView]
    actions: ActionsView | None
    """Null if the bundle lists none: its prompts have no scope."""
    about: str
    """Capabilities and limits of the model, in a few lines; empty if the model is not installed on the server."""

    @classmethod
    def of(cls, generator: GeneratorCapabilities) -> ModelView:
        """Convert capabilities."""
        manifest = generator.bundle.manifest
        lists = manifest.actions
        spec = find_model(manifest.model)
        own = ("name", "model", "version", "config", "random", "licence", "commercial", "skeleton", "fps", "metrics")
        return cls(
            bundle=generator.bundle.reference,
            min_seconds=generator.min_seconds,
            max_seconds=generator.max_seconds,
            encoder=generator.text.encoder,
            data=[DataView(name=d.name, licence=d.licence, credit=d.credit) for d in manifest.data],
            settings=[
                SettingView(
                    name=each.name,
                    minimum=each.low,
                    maximum=each.high,
                    default=each.default,
                    whole=each.whole,
                    help=each.help,
                )
                for each in settings_of(generator.bundle)
            ],
            actions=None if lists is None else ActionsView.of(lists),
            about="" if spec is None else spec.about,
            **{name: getattr(manifest, name) for name in own},
        )


class BrokenView(View):
    """A bundle that exists and cannot be used."""

    name: str
    """Name of its folder."""
    reason: str

    @classmethod
    def of(cls, broken: BrokenBundle) -> BrokenView:
        """Convert a broken bundle."""
        return cls(name=broken.name, reason=broken.reason)


class ModelsView(View):
    """Every bundle."""

    items: list[ModelView]
    broken: list[BrokenView]
    """Bundles that are left out, each with the reason."""

    @classmethod
    def of(cls, generators: GeneratorList) -> ModelsView:
        """Convert the bundles of this machine."""
        return cls(
            items=[ModelView.of(generator) for generator in generators.found],
            broken=[BrokenView.of(broken) for broken in generators.broken],
        )
