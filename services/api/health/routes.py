"""`/livez`, `/readyz`, `/metrics`."""

from __future__ import annotations

from collections.abc import Callable

import redis
from fastapi import APIRouter, Response
from fastapi.responses import JSONResponse, PlainTextResponse
from prometheus_client import CONTENT_TYPE_LATEST

from services.api.auth import Watcher
from services.api.context import Context, Shared
from services.api.health.metrics import render
from services.api.schemas import View
from shared.errors import MareyError, Unreachable
from shared.jobs import TEXT_QUEUE, check_revision, list_workers, transaction
from shared.runtime.queue import redis_client

router = APIRouter(tags=["health"])


class Check(View):
    """One thing that must work."""

    ok: bool
    message: str | None = None


class ReadyView(View):
    """Whether requests will be answered, and why not."""

    ready: bool
    checks: dict[str, Check]


@router.get("/livez", response_class=PlainTextResponse)
def livez() -> str:
    """The process answers."""
    return "ok"


@router.get("/readyz", response_model=ReadyView, responses={503: {"model": ReadyView, "description": "Not yet"}})
def readyz(shared: Shared) -> JSONResponse:
    """Database, queue and store answer, and a worker has had its model loaded since this process started."""
    checks = {
        "database": _try(lambda: check_revision(shared.engine)),
        "queue": _try(lambda: _ping(shared)),
        "store": _try(shared.store.check),
        "model": _try(lambda: _model(shared)),
    }
    view = ReadyView(ready=all(check.ok for check in checks.values()), checks=checks)
    return JSONResponse(view.model_dump(mode="json"), 200 if view.ready else 503)


@router.get("/metrics", response_class=PlainTextResponse)
def metrics(shared: Shared, key: Watcher) -> Response:
    """For Prometheus; wants a key with the scope `metrics`: it tells of all tenants."""
    return Response(render(shared.engine), media_type=CONTENT_TYPE_LATEST)


def _try(check: Callable[[], object]) -> Check:
    try:
        check()
    except MareyError as error:
        return Check(ok=False, message=error.message)
    return Check(ok=True)


def _ping(shared: Context) -> None:
    url = shared.config.queue_url
    if url is None:
        raise Unreachable("no queue is named", hint="Set MAREY_QUEUE_URL.")
    try:
        with redis_client(url.get_secret_value()) as client:
            client.ping()
    except redis.RedisError as error:
        raise Unreachable(f"the queue does not answer ({type(error).__name__})") from error


def _model(shared: Context) -> None:
    """A generator's worker is ready. Once seen, its absence no longer counts: jobs wait in the queue meanwhile."""
    if shared.seen_ready:
        return
    with transaction(shared.engine) as conn:
        workers = list_workers(conn)
    if not any(w.live and w.bundle is not None and w.queue != TEXT_QUEUE for w in workers):
        raise Unreachable("no worker has its model loaded yet")
    shared.seen_ready = True
