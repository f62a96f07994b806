"""Answers of the model routes."""

from __future__ import annotations

from marey.bundles import BrokenBundle
from marey.bundles.limits import settings_of
from marey.http.schemas import View
from marey.jobs.generators import GeneratorCapabilities, GeneratorList
from marey.registry import find_model


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
    about: str
    """Capabilities and limits of the model, in a few lines; empty if the model is not installed on the server."""

    @classmethod
    def of(cls, generator: GeneratorCapabilities) -> ModelView:
        """Convert capabilities."""
        manifest = generator.bundle.manifest
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
