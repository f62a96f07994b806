"""`GET /docs` and `/openapi.json`: Swagger UI for every route of the API."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cache
from importlib import resources

from fastapi import APIRouter, Request, Response
from fastapi.responses import JSONResponse

from marey.http.pages import page_response

router = APIRouter()

POLICY = "; ".join(
    (
        "default-src 'none'",
        "script-src 'self'",
        "style-src 'self'",
        "img-src 'self' data:",
        "connect-src 'self'",
        "base-uri 'none'",
        "form-action 'none'",
        "frame-ancestors 'none'",
    )
)
"""Content security policy: files of this server only, no inline code or style."""
TYPES = {"html": "text/html", "css": "text/css", "js": "text/javascript"}
FILES = ("swagger-ui.css", "swagger-ui-bundle.js", "docs.css", "docs.js")


@dataclass(frozen=True)
class _File:
    content: bytes
    etag: str
    media_type: str


@cache
def _file(name: str) -> _File:
    content = (resources.files("marey.api.docs") / "assets" / name).read_bytes()
    return _File(content, f'"{hashlib.sha256(content).hexdigest()[:32]}"', TYPES[name.rpartition(".")[2]])


def _answer(request: Request, name: str) -> Response:
    file = _file(name)
    return page_response(request, file.content, file.media_type, etag=file.etag, policy=POLICY)


@router.get("/docs", include_in_schema=False)
def docs(request: Request) -> Response:
    """The API reference. The page needs no key; requests made from it do."""
    return _answer(request, "docs.html")


@router.get("/openapi.json", include_in_schema=False)
def openapi(request: Request) -> JSONResponse:
    """The API reference as JSON."""
    return JSONResponse(request.app.openapi())


def _serve(name: str) -> None:
    @router.get(f"/docs/{name}", include_in_schema=False, name=f"docs_{name}")
    def asset(request: Request) -> Response:
        return _answer(request, name)


for _name in FILES:
    _serve(_name)
