"""What the routes of models give."""

from __future__ import annotations

from services.api.schemas import View
from shared.offers import Offer


class DataView(View):
    """What weights were trained on."""

    name: str
    licence: str
    credit: str


class ModelView(View):
    """A bundle."""

    name: str
    bundle: str
    """The exact bundle: name and weights hash."""
    model: str
    version: str
    config: str
    random: bool
    """Weights were never trained."""
    licence: str
    commercial: bool
    skeleton: str | None
    fps: float | None
    min_seconds: float
    max_seconds: float
    encoder: str
    data: list[DataView]
    metrics: dict[str, float]

    @classmethod
    def of(cls, offer: Offer) -> ModelView:
        """From an offer."""
        manifest = offer.bundle.manifest
        own = ("name", "model", "version", "config", "random", "licence", "commercial", "skeleton", "fps", "metrics")
        return cls(
            bundle=offer.bundle.reference,
            min_seconds=offer.min_seconds,
            max_seconds=offer.max_seconds,
            encoder=offer.text.encoder,
            data=[DataView(name=d.name, licence=d.licence, credit=d.credit) for d in manifest.data],
            **{name: getattr(manifest, name) for name in own},
        )


class ModelsView(View):
    """Every bundle."""

    items: list[ModelView]
