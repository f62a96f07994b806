"""`GET /live`: a page to start, watch and steer live streams."""

from __future__ import annotations

import json
from functools import cache
from importlib import resources
from typing import Any

from fastapi import APIRouter, Request, Response

from marey.api.catalogue import Catalogue
from marey.core.errors import MareyError
from marey.http.pages import page_response
from marey.viz.live_page import live_page

router = APIRouter()

MOST_EXAMPLES = 6


@cache
def _measured() -> dict[str, list[dict[str, Any]]]:
    return json.loads((resources.files("marey.api.live") / "examples.json").read_text(encoding="utf-8"))


def examples(catalogue: Catalogue) -> tuple[str, ...]:
    """Return prompts that this server's model performed correctly while streaming; none for a bundle without
    measurements.

    Measured by `python -m marey.models.mogo.examples`.
    """
    try:
        reference = catalogue.capabilities(catalogue.live_model).bundle.reference
    except MareyError:
        return ()  # no such model here: the page reports it when a stream is started
    return tuple(row["prompt"] for row in _measured().get(reference, [])[:MOST_EXAMPLES])


@router.get("/live", include_in_schema=False)
def live(request: Request) -> Response:
    """The live page. It holds no data of a tenant: it asks for a key, and its API calls need that."""
    page = live_page(examples(request.app.state.catalogue))
    policy = page.policy(request.headers.get("host", ""))
    return page_response(request, page.content, "text/html", etag=page.etag, policy=policy)
