"""`GET /live`: a page to start, watch and steer live streams."""

from __future__ import annotations

from fastapi import APIRouter, Request, Response

from marey.api.catalogue import Catalogue
from marey.core.errors import MareyError
from marey.http.pages import page_response
from marey.registry import find_model, resolve
from marey.viz.live_page import live_page

router = APIRouter()

MOST_EXAMPLES = 6


def examples(catalogue: Catalogue) -> tuple[str, ...]:
    """Return prompts that this server's model performed correctly while streaming; none for a bundle without
    measurements (`ModelSpec.live_examples`)."""
    try:
        bundle = catalogue.live_capabilities().bundle
    except MareyError:
        return ()  # no such model here: the page reports it when a stream is started
    spec = find_model(bundle.manifest.model)
    if spec is None or spec.live_examples is None:
        return ()
    return tuple(resolve(spec.live_examples)(bundle.reference)[:MOST_EXAMPLES])


@router.get("/live", include_in_schema=False)
def live(request: Request) -> Response:
    """The live page. It holds no data of a tenant: it asks for a key, and its API calls need that."""
    page = live_page(examples(request.app.state.catalogue))
    policy = page.policy(request.headers.get("host", ""))
    return page_response(request, page.content, "text/html", etag=page.etag, policy=policy)
