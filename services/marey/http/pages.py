"""Pages and files that browsers load from the API."""

from __future__ import annotations

from starlette.requests import Request
from starlette.responses import Response


def page_response(request: Request, content: bytes, media_type: str, *, etag: str, policy: str) -> Response:
    """Answer with a page or one of its files; 304 if the browser has it already.

    Args:
        etag: ETag of the content.
        policy: the content security policy.
    """
    headers = {
        "Cache-Control": "no-cache",
        "Content-Security-Policy": policy,
        "ETag": etag,
        "Referrer-Policy": "no-referrer",
        "X-Content-Type-Options": "nosniff",
        "X-Frame-Options": "DENY",
    }
    if request.headers.get("if-none-match") == etag:
        return Response(status_code=304, headers=headers)
    return Response(content, headers=headers, media_type=media_type)
