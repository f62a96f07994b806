"""`/livez`, `/readyz`, `/metrics`."""

from __future__ import annotations

from fastapi import APIRouter, Response
from fastapi.responses import JSONResponse, PlainTextResponse
from prometheus_client import CONTENT_TYPE_LATEST

from marey.api.auth import Watcher
from marey.api.context import Shared
from marey.api.health.metrics import render
from marey.http.schemas import View

router = APIRouter(tags=["health"])


class Check(View):
    """One readiness check."""

    ok: bool
    message: str | None = None


class ReadyView(View):
    """Readiness, and the failed checks."""

    ready: bool
    checks: dict[str, Check]


@router.get("/livez", response_class=PlainTextResponse)
async def livez() -> str:
    """Return 200 while the process answers."""
    return "ok"


@router.get("/readyz", response_model=ReadyView, responses={503: {"model": ReadyView, "description": "Not yet"}})
async def readyz(shared: Shared) -> JSONResponse:
    """Check that database, queue and store answered within seconds, and that a worker has loaded its model. A stalled
    scheduler is reported too, and leaves the API ready.

    The checks run in the background, so the answer is immediate. It names what is down, without authentication; the
    server's log has the reason.
    """
    results = shared.readiness.results()
    checks = {name: Check(ok=result.ok, message=result.message) for name, result in results.items()}
    ready = all(result.ok for result in results.values() if result.required)
    view = ReadyView(ready=ready, checks=checks)
    return JSONResponse(view.model_dump(mode="json"), 200 if view.ready else 503)


@router.get("/metrics", response_class=PlainTextResponse)
def metrics(shared: Shared, key: Watcher) -> Response:
    """Prometheus metrics; the key needs the scope `metrics`: they include all tenants."""
    return Response(render(shared.engine), media_type=CONTENT_TYPE_LATEST)
