"""The application, and the process that serves it."""

from __future__ import annotations

import contextlib
import json
from collections.abc import AsyncIterator, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import uvicorn
from fastapi import APIRouter, Depends, FastAPI
from fastapi.routing import APIRoute

from marey.api.broadcaster import EventBroadcaster
from marey.api.catalogue import Catalogue
from marey.api.context import CONNECTIONS, Context
from marey.api.docs.routes import router as docs_router
from marey.api.edits.routes import router as edits_router
from marey.api.evaluations.routes import SCHEMAS as EVALUATION_SCHEMAS
from marey.api.evaluations.routes import router as evaluations_router
from marey.api.health.checks import readiness_checks
from marey.api.health.metrics import Measure
from marey.api.health.routes import router as health_router
from marey.api.home.routes import router as home_router
from marey.api.jobs.events import message
from marey.api.jobs.routes import SCHEMAS as JOB_SCHEMAS
from marey.api.jobs.routes import router as jobs_router
from marey.api.live.routes import router as live_router
from marey.api.models.routes import router as models_router
from marey.api.rates import RateLimiter
from marey.api.readiness import Readiness
from marey.api.reference import build_reference
from marey.api.references.routes import router as references_router
from marey.api.rigs.routes import router as rigs_router
from marey.api.schedules.routes import SCHEMAS as SCHEDULE_SCHEMAS
from marey.api.schedules.routes import router as schedules_router
from marey.api.stream_hub import Hub
from marey.api.streams.protocol import socket_options
from marey.api.streams.routes import router as streams_router
from marey.api.takes.routes import router as motions_router
from marey.api.text_client import TextService
from marey.api.texts.routes import router as texts_router
from marey.api.webhooks.routes import router as webhooks_router
from marey.core.addresses import Allowed
from marey.core.errors import InvalidInput
from marey.core.package import own_version
from marey.core.settings import Settings, settings
from marey.db import check_listening, create_engine
from marey.http import problems
from marey.http.bodies import BodyDeadline, BodyGuard
from marey.http.connections import connection_options
from marey.http.guards import HostGuard, UpgradeGuard
from marey.http.origins import OriginGuard
from marey.http.process import prepare_process
from marey.http.queries import known_query
from marey.http.traces import Trace
from marey.runtime.systemd import notified
from marey.storage import open_store
from marey.webhooks.vault import Vault

ROUTERS = (
    *(health_router, home_router, jobs_router, motions_router, edits_router, streams_router, live_router, docs_router),
    *(models_router, texts_router),
    *(evaluations_router, schedules_router, webhooks_router, references_router, rigs_router),
)
SCHEMAS = (*JOB_SCHEMAS, *EVALUATION_SCHEMAS, *SCHEDULE_SCHEMAS)
DESCRIPTION = "Text in, 3D human motion out. Errors are problems of RFC 9457 with a stable `type`."


def create_app(config: Settings, routers: Sequence[APIRouter] = ROUTERS) -> FastAPI:
    """Create the application with these routers; connects to nothing before it starts."""
    app = FastAPI(
        title="Marey",
        version=own_version(),
        description=DESCRIPTION,
        lifespan=lambda app: _lifespan(app, config),
        generate_unique_id_function=_operation_id,
        dependencies=[Depends(known_query)],
        openapi_url=None,  # part of `docs`, which refuses unknown query parameters as all routes do
        docs_url=None,
        redoc_url=None,
    )
    app.state.catalogue = Catalogue(config)
    problems.install(app)
    for router in routers:
        app.include_router(router)
    app.add_middleware(UpgradeGuard)
    app.add_middleware(HostGuard, allowed=config.allowed_hosts, origins=config.cors_origins)
    app.add_middleware(BodyGuard, deadline=BodyDeadline(config.body_seconds, config.body_pause_seconds))
    if config.cors_origins:
        app.add_middleware(OriginGuard, origins=config.cors_origins)
    app.add_middleware(Trace)
    app.add_middleware(Measure)
    app.openapi = cache(lambda: build_reference(app, SCHEMAS, config.public_url))
    return app


@contextlib.asynccontextmanager
async def _lifespan(app: FastAPI, config: Settings) -> AsyncIterator[None]:
    """Start what the routes share, and close it after the last request."""
    shared = app.state.context = _context(config, app.state.catalogue)
    shared.broadcaster.start()
    shared.readiness.start()
    try:
        async with notified():
            yield
    finally:
        shared.readiness.stop()
        shared.broadcaster.stop()
        await shared.maker.close()
        await shared.texts.close()
        shared.rates.close()
        if shared.streams is not None:
            shared.streams.close()
        shared.engine.dispose()


def _context(config: Settings, catalogue: Catalogue) -> Context:
    """Return what the routes share, not started.

    Raises:
        InvalidInput: a setting is missing or invalid.
    """
    if config.database_url is None:
        raise InvalidInput(
            "the API needs a database",
            where="MAREY_DATABASE_URL",
            hint="Set it, or use `marey serve`, which brings one.",
        )
    Allowed.of(config.webhook_allow)  # report its faults at start-up
    if config.webhook_key is not None:
        Vault.of(config)
    url = config.database_url.get_secret_value()
    engine = create_engine(url, pool_size=CONNECTIONS // 2, max_overflow=CONNECTIONS // 2)
    broadcaster = EventBroadcaster(engine, config.notifications_url or url, message)
    redis_url = config.streams_url or config.queue_url
    hub = None
    if redis_url is not None:
        hub = Hub(redis_url.get_secret_value(), tenant=config.sockets_per_tenant, key=config.sockets_per_key)
    texts = TextService(config)
    store = open_store(config)
    readiness = Readiness(readiness_checks(config, engine, store))
    return Context(config, engine, store, catalogue, broadcaster, RateLimiter(config), texts, readiness, hub)


def _operation_id(route: APIRoute) -> str:
    return route.name


def write_openapi(path: Path) -> None:
    """Write the checked-in OpenAPI document."""
    document = create_app(Settings(public_url=None)).openapi()
    path.write_text(json.dumps(document, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def protocol_options(config: Settings) -> dict[str, Any]:
    """Return the arguments of uvicorn for HTTP connections and WebSockets."""
    return connection_options(config) | socket_options()


def serve() -> None:
    """Serve at `MAREY_HOST` and `MAREY_PORT` until SIGTERM.

    Raises:
        InvalidInput: the database does not forward notifications.
    """
    config = settings()
    options = prepare_process("api", config)
    if config.notifications_url is not None:
        check_listening(config.notifications_url)
    uvicorn.run(create_app(config), host=config.host, port=config.port, **options, **protocol_options(config))
