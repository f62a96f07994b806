"""A bare Celery task that only counts its runs: the baseline of the overhead per item."""
# pyright: reportMissingTypeStubs=false

from __future__ import annotations

import os
import sys

from celery import Celery
from celery.platforms import set_pdeathsig

from marey.runtime.app import create_app
from marey.runtime.queue import redis_client

QUEUE = "noop"
COUNTER = "noop-done"
URL = os.environ.get("MAREY_QUEUE_URL", "")


def make_app(url: str) -> Celery:
    """The product's settings and one task; forked, as Celery's default is."""
    app = create_app(url)
    app.conf.update(include=[], worker_pool_start_method="fork")
    client = redis_client(url)

    @app.task(name="noop")
    def noop(_item: str) -> None:
        client.incr(COUNTER)

    return app


if __name__ == "__main__":
    set_pdeathsig("SIGKILL")
    worker = make_app(URL).Worker(
        queues=[QUEUE], without_gossip=True, without_mingle=True, without_heartbeat=True, quiet=True, loglevel="WARNING"
    )
    worker.start()
    sys.exit(worker.exitcode)
