"""A real uvicorn with the whole API on a database of its own, and hands to do a worker's part."""

from __future__ import annotations

import contextlib
import hashlib
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import httpx2
import numpy as np
import sqlalchemy as sa
import structlog
import uvicorn
from fastapi import FastAPI
from pydantic import SecretStr

from marey.api.app import create_app, protocol_options
from marey.bundles import BundleWriter, TextSpec
from marey.client.server_address import Server
from marey.client.transport import Transport
from marey.core.settings import Settings
from marey.db import create_engine, transaction
from marey.jobs import (
    AssetDigest,
    FailureReason,
    ItemFailure,
    NewMotion,
    NewText,
    asset_key,
    begin_assets,
    claim,
    commit_motions,
    commit_texts,
    fail_items,
)
from marey.quality.record import Flag, MotionQuality
from marey.storage import AssetStore, open_store
from marey.tenants import DEFAULT_TENANT, create_key
from marey.text_service.server import create_text_app
from marey.vocabulary.scope import ActionLists
from tests.servers.ports import free_ports
from tests.servers.receiver import LOOPBACK
from tests.support.webhooks import KEY

BUNDLE = "hgm3-paperclip"


QUALITY = MotionQuality(
    support=["feet"], float_s=0.9, skate=0.1, penetration_mm=2.0, pops=3, range_deg=0.0, self_contact=11.5,
    flags=[Flag.FLOATING, Flag.POPPING], ok=False,
)  # fmt: skip
"""Of every motion."""
METADATA = {"quality": QUALITY.model_dump(mode="json")}


@dataclass
class LiveApi:
    """A running API."""

    url: str
    key: str
    engine: sa.Engine
    store: AssetStore

    def client(self) -> Transport:
        """The command line's client, with all scopes."""
        return Transport(Server(self.url, self.key))

    def http(self, *scopes: str) -> httpx2.Client:
        """A plain HTTP client; with `scopes`, a key that has only these."""
        key = self.key
        if scopes:
            with transaction(self.engine) as conn:
                key = create_key(conn, "+".join(scopes), scopes).secret
        return httpx2.Client(base_url=self.url, headers={"Authorization": f"Bearer {key}"}, timeout=20)

    def work(
        self, content: bytes = b"motion", *, fail: frozenset[str] = frozenset(), batch: int = 64, pause: float = 0.0
    ) -> None:
        """Do what is in the queues, as workers would.

        Args:
            content: of every file.
            fail: prompts whose items are refused.
            batch: items of one claim.
            pause: seconds before each commit.
        """
        while self._texts():
            pass
        digest = AssetDigest(hashlib.sha256(content).hexdigest(), len(content))
        self.store.put(asset_key(DEFAULT_TENANT, digest.sha256), content)
        while True:
            with transaction(self.engine) as conn:
                found = claim(conn, "hgm3", "hands", batch)
                if found is None:
                    return
                begin_assets(conn, found.lease_token, [digest])
            time.sleep(pause)
            problem = FailureReason("invalid-input", "this cannot be danced", None, "Walk.")
            failures = [ItemFailure(item.id, problem, False) for item in found.items if item.prompt in fail]
            motions = [
                NewMotion(
                    item.id, {"npz": digest, "bvh": digest}, 40, 20.0, "MIT", 0.5, METADATA | {"prompt": item.prompt}
                )
                for item in found.items
                if item.prompt not in fail
            ]
            with transaction(self.engine) as conn:
                fail_items(conn, found.lease_token, failures)
                commit_motions(conn, found.lease_token, motions)

    def _texts(self) -> bool:
        with transaction(self.engine) as conn:
            found = claim(conn, "text", "hands", 64)
            if found is not None:
                commit_texts(conn, found.lease_token, [NewText(i.id, i.text_key, b"text") for i in found.items])
        return found is not None


def write_bundle(models: Path, name: str = BUNDLE, model: str = "hgm3", actions: ActionLists | None = None) -> None:
    """A generator's bundle that is only looked at."""
    with BundleWriter(models / name) as writer:
        writer.add_part("masked", {"w": np.zeros(3, np.float32)})
        writer.finish(
            name=name,
            version="1",
            kind="generator",
            model=model,
            config="tiny",
            parameters={"min_frames": 16, "max_frames": 196, "inference": {"steps": 1}},
            fps=20.0,
            licence="MIT",
            text=TextSpec(labeller="none", encoder_sha256="0" * 64),
            actions=actions,
        )


def settings_of(home: Path, database_url: str, queue_url: str) -> Settings:
    """Settings of an API whose model is `BUNDLE`."""
    models = home / "models"
    if not models.exists():
        write_bundle(models)
    return Settings.model_validate(
        {
            "home": home,
            "models": models,
            "database_url": database_url,
            "queue_url": queue_url,
            "port": free_ports(1)[0],
            "webhook_key": KEY,
            "webhook_allow": ["public", *LOOPBACK],
        }
    )


class ApiThread:
    """Serves an application until the end of the block; its log lines go to stderr, as those of a server of its own."""

    def __init__(self, config: Settings, app: FastAPI | None = None) -> None:
        """`app`: None = the API."""
        structlog.configure(logger_factory=structlog.PrintLoggerFactory(sys.__stderr__))
        self.config = config
        self._server = uvicorn.Server(
            uvicorn.Config(
                create_app(config) if app is None else app,
                port=config.port,
                log_level="warning",
                timeout_graceful_shutdown=1,
                **protocol_options(config),
            )
        )
        self._thread = threading.Thread(target=self._server.run, daemon=True)

    def __enter__(self) -> str:
        self._thread.start()
        deadline = time.monotonic() + 20
        while not self._server.started:
            assert time.monotonic() < deadline, "uvicorn does not start"
            assert self._thread.is_alive(), "uvicorn ended"
            time.sleep(0.01)
        return f"http://127.0.0.1:{self.config.port}"

    def __exit__(self, *_: object) -> None:
        self._server.should_exit = True
        self._thread.join(20)


@contextlib.contextmanager
def with_text_service(config: Settings) -> Iterator[Settings]:
    """A text service beside the API of these settings; yields the settings that name it."""
    port = free_ports(1)[0]
    named = config.model_copy(
        update={"text_url": f"http://127.0.0.1:{port}", "text_key": SecretStr("the text service's")}
    )
    own = named.model_copy(update={"port": port})
    with ApiThread(own, create_text_app(own, preload=False)):
        yield named


def wait_until(happened: Callable[[], bool], seconds: float = 20) -> None:
    """Wait until something is so; fails after a while."""
    deadline = time.monotonic() + seconds
    while not happened():
        assert time.monotonic() < deadline, "it does not happen"
        time.sleep(0.05)


@contextlib.contextmanager
def running_api(config: Settings, database_url: str) -> Iterator[LiveApi]:
    """The API of these settings, with a key that may do everything."""
    engine = create_engine(database_url)
    with transaction(engine) as conn:
        key = create_key(conn, "all", ["admin"]).secret
    with with_text_service(config) as named, ApiThread(named) as url:
        yield LiveApi(url, key, engine, open_store(config))
    engine.dispose()
