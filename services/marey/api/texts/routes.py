"""`/v1/texts`."""

from __future__ import annotations

from fastapi import APIRouter
from starlette.responses import Response

from services.api.auth import Parser
from services.api.context import Shared
from services.http.problems import RESPONSES
from services.text.routes import GraphsView, ParseBody

router = APIRouter(prefix="/v1/texts", tags=["texts"], responses=RESPONSES)


@router.post("/parse", response_model=GraphsView)
async def parse_texts(body: ParseBody, shared: Shared, key: Parser) -> Response:
    """The semantic graph of each prompt; 429 while too much is being parsed, 503 after 10 s."""
    return await shared.texts.parse(body)
