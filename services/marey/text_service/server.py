"""`marey text serve`: the process that parses prompts for the API.

It needs no database: callers authenticate with the secret that it shares with the API (`MAREY_TEXT_KEY`).
"""

from __future__ import annotations

import contextlib
import os
import socket
import threading
from collections.abc import AsyncIterator, Iterator
from pathlib import Path

import structlog
import uvicorn
from fastapi import FastAPI
from fastapi.responses import PlainTextResponse
from starlette.responses import Response

from marey.bundles import list_bundles
from marey.core.errors import InvalidInput, MareyError
from marey.core.garbage import no_collection
from marey.core.settings import Settings, settings
from marey.http import problems
from marey.http.bodies import BodyDeadline, BodyGuard
from marey.http.connections import connection_options
from marey.http.process import prepare_process
from marey.http.traces import Trace
from marey.runtime.systemd import notified
from marey.text_service.routes import load_pipeline, text_router

log = structlog.get_logger(__name__)


def create_text_app(config: Settings, *, preload: bool = True) -> FastAPI:
    """Create the application of the text service.

    Args:
        preload: load the pipelines of all bundles at start-up; `/readyz` answers 503 until then.

    Raises:
        InvalidInput: `MAREY_TEXT_KEY` is not set.
    """
    loaded = threading.Event()

    @contextlib.asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        if preload:
            threading.Thread(target=_preload, args=(config, loaded), name="preload", daemon=True).start()
        else:
            loaded.set()
        async with notified():
            yield

    app = FastAPI(title="Marey text service", lifespan=lifespan, docs_url=None, redoc_url=None, openapi_url=None)
    problems.install(app)
    app.include_router(text_router(config))

    @app.get("/livez")
    async def livez() -> Response:
        return PlainTextResponse("ok")

    @app.get("/readyz")
    async def readyz() -> Response:
        ready = loaded.is_set()
        return PlainTextResponse("ready" if ready else "loading", 200 if ready else 503)

    app.add_middleware(BodyGuard, deadline=BodyDeadline(config.body_seconds, config.body_pause_seconds))
    app.add_middleware(Trace)
    return app


def serve_text(path: Path | None = None) -> None:
    """Serve until SIGTERM.

    Args:
        path: path of the Unix socket to listen on, readable by this user alone; None = `MAREY_HOST` and
            `MAREY_PORT`.
    """
    config = settings()
    app = create_text_app(config)
    with no_collection():
        import torch

    torch.set_num_threads(1)
    options = prepare_process("text", config)
    if path is None:
        uvicorn.run(app, host=config.host, port=config.port, ws="none", **options, **connection_options(config))
        return
    with _unix_socket(path) as listening:
        uvicorn.Server(uvicorn.Config(app, ws="none", **options, **connection_options(config))).run(sockets=[listening])


@contextlib.contextmanager
def _unix_socket(path: Path) -> Iterator[socket.socket]:
    """Open a listening socket that only its owner can use."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as listening:
        path.unlink(missing_ok=True)
        before = os.umask(0o177)
        try:
            listening.bind(str(path))
        except OSError as error:
            raise InvalidInput(f"cannot be listened on: {error.strerror or error}", where=str(path)) from error
        finally:
            os.umask(before)
        yield listening


def _preload(config: Settings, loaded: threading.Event) -> None:
    """Load the pipeline of each bundle. A broken bundle is reported when it is requested."""
    try:
        with no_collection():
            for bundle in list_bundles(config=config, kind="generator"):
                if bundle.manifest.text is not None:
                    load_pipeline(bundle.manifest.text)
    except MareyError as error:
        log.warning("not_preloaded", error=str(error))
    except Exception:
        log.exception("preload_failed")
    finally:
        loaded.set()
