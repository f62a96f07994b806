"""`/v1/models`."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Path

from marey.api.auth import Reader
from marey.api.context import Shared
from marey.api.models.schemas import ModelsView, ModelView
from marey.bundles import named_by
from marey.core.validation import worded
from marey.http.problems import RESPONSES
from marey.jobs.generators import list_generators

NAME = worded(r"^[A-Za-z0-9][A-Za-z0-9._@-]{0,180}$", "names of models and bundles: `GET /v1/models` lists them")
router = APIRouter(prefix="/v1/models", tags=["models"], responses=RESPONSES)


@router.get("")
def list_models(shared: Shared, key: Reader) -> ModelsView:
    """List the bundles that this server can make motions with."""
    return ModelsView.of(list_generators(shared.config))


@router.get("/{name}")
def get_model(name: Annotated[str, Path(pattern=NAME)], shared: Shared, key: Reader) -> ModelView:
    """Get the bundle of a model's or bundle's name."""
    with named_by("name"):
        return ModelView.of(shared.catalogue.capabilities(name))
