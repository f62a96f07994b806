"""`/v1/texts`."""

from __future__ import annotations

from fastapi import APIRouter
from starlette.responses import Response

from marey.api.auth import Parser
from marey.api.context import Shared
from marey.http.json_bodies import UniqueKeysRoute
from marey.http.problems import RESPONSES
from marey.text_service.routes import GraphsView, ParseBody

router = APIRouter(prefix="/v1/texts", tags=["texts"], responses=RESPONSES, route_class=UniqueKeysRoute)


@router.post("/parse", response_model=GraphsView)
async def parse_texts(body: ParseBody, shared: Shared, key: Parser) -> Response:
    """Parse prompts into semantic graphs; 429 while too much is being parsed, 503 after 10 s."""
    if "model" not in body.model_fields_set:
        body = body.model_copy(update={"model": shared.config.default_model})
    return await shared.texts.parse(body)
