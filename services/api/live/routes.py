"""`GET /live`: the page on which a person starts, watches and steers live streams."""

from __future__ import annotations

from fastapi import APIRouter, Request, Response

from shared.motion.live_page import live_page

router = APIRouter()


@router.get("/live", include_in_schema=False)
def live(request: Request) -> Response:
    """The page itself holds nothing that is anybody's: it asks for a key, and the API asks for that."""
    page = live_page()
    headers = {
        "Cache-Control": "no-cache",
        "Content-Security-Policy": page.policy(request.headers.get("host", "")),
        "ETag": page.etag,
        "Referrer-Policy": "no-referrer",
        "X-Content-Type-Options": "nosniff",
        "X-Frame-Options": "DENY",
    }
    if request.headers.get("if-none-match") == page.etag:
        return Response(status_code=304, headers=headers)
    return Response(page.content, headers=headers, media_type="text/html")
