"""The Celery app: every process that publishes or consumes hints creates it here, with the same settings.

A message is only a hint that a queue has work; the rows in Postgres are authoritative. Lost or duplicate messages
are harmless, and each setting below fixes a failure that was not.
"""

# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false
from __future__ import annotations

from typing import Any

from celery import Celery
from celery.app.amqp import AMQP
from kombu.connection import Connection

DRAIN = "marey.drain"
"""Name of the only task: `drain(queue)` claims, runs and commits until no work is left or 300 s have passed."""

TIME_LIMIT = 1200
"""Seconds until the parent kills a child that hangs in a task; its leases have long expired by then."""

VISIBILITY_TIMEOUT = 3600
"""Redis redelivers an unacknowledged message after this long, running or not (celery #5935): more than twice the
time limit, so that it never happens to a running task; the lease makes a duplicate harmless even so."""

SOCKET_TIMEOUT = 3.0
"""Deadline of a Redis call: each takes milliseconds, or has an explicit block time. Without it a silent connection
would be waited for without end; keepalives do not detect it, since the peer's kernel still acknowledges."""
CONNECT_TIMEOUT = 3.0
HEALTH_CHECK_INTERVAL = 2
"""A worker that waits for a hint asks with a timeout of 1 s at the server. Kombu drops the connection when no answer
came for this many seconds longer, and checks as often: within 5 s after a connection fell silent."""
RECONNECT_START, RECONNECT_STEP, RECONNECT_MAX = 0.5, 0.5, 3.0
"""Seconds between a worker's reconnects. Kombu's own grow to 30: a worker would stay idle that long after the queue
is back."""

PUBLISH_RETRY = {"max_retries": 2, "interval_start": 0.1, "interval_step": 0.2, "interval_max": 0.5}
"""Bounded: the relay must start its next round rather than hang on a broker that is down (celery #4296, #6911)."""


def transport_options() -> dict[str, Any]:
    """Return options of the Redis transport, shared by workers and publishers."""
    return {
        "visibility_timeout": VISIBILITY_TIMEOUT,
        # The restore sweep runs only every ~100 s by default (kombu #2558).
        "unacked_restore_interval": 5,
        "unacked_restore_throttle": 1,
        # redis-py waits for ever on a half-open connection (redis-py #2243, celery #8030, #8384, #10205).
        "socket_timeout": SOCKET_TIMEOUT,
        "socket_connect_timeout": CONNECT_TIMEOUT,
        "socket_keepalive": True,  # kombu drops it for a Unix socket, where redis-py would raise TypeError
        "health_check_interval": HEALTH_CHECK_INTERVAL,
        "retry_on_timeout": True,
    }


class QueueConnection(Connection):
    """Broker connection with short pauses between retries."""

    def ensure_connection(self, *args: Any, **options: Any) -> Any:
        """See `kombu.Connection`. Celery's consumer passes no pauses, and has no setting for them."""
        pauses = {"interval_start": RECONNECT_START, "interval_step": RECONNECT_STEP, "interval_max": RECONNECT_MAX}
        return super().ensure_connection(*args, **(pauses | options))


class QueueAMQP(AMQP):
    """Celery's AMQP that uses `QueueConnection`."""

    Connection = QueueConnection


def create_app(queue_url: str) -> Celery:
    """Create the app on `queue_url` (`redis://…`, `rediss://…` or `redis+socket:///path`). Does not connect yet."""
    app = Celery("marey", broker=queue_url, amqp=f"{__name__}:{QueueAMQP.__name__}", include=["marey.runtime.tasks"])
    app.conf.update(
        broker_transport_options=transport_options(),
        result_backend_transport_options={"visibility_timeout": VISIBILITY_TIMEOUT},
        visibility_timeout=VISIBILITY_TIMEOUT,
        broker_connection_retry_on_startup=True,
        broker_connection_max_retries=None,  # a worker survives any outage of the queue
        broker_pool_limit=2,
        # No results: outcomes are stored in rows, and result keys leak (celery #3812, #4824, #6963).
        result_backend=None,
        task_ignore_result=True,
        task_store_errors_even_if_ignored=False,
        # A killed child returns its hint (celery #1628, #3541); the attempts column stops a toxic loop.
        task_acks_late=True,
        task_reject_on_worker_lost=True,
        task_acks_on_failure_or_timeout=True,  # but an exception does not: the rows hold the remaining work
        task_time_limit=TIME_LIMIT,
        task_create_missing_queues=True,
        task_serializer="json",
        accept_content=["json"],  # never pickle
        # Prefetched hints would wait behind a long drain (celery #2788, #6500). A prefetch count of 1 prevents that
        # too, but an acknowledgement that fails while the queue is away then counts as a message in hand for ever:
        # the worker reconnects and consumes nothing (measured; as in #8030). Without a count nothing counts wrong.
        worker_disable_prefetch=True,
        worker_prefetch_multiplier=0,
        # One child = one device. CUDA does not survive fork (celery #6036), nor do torch's threads.
        worker_pool="prefork",
        worker_concurrency=1,
        worker_pool_start_method="spawn",
        worker_proc_alive_timeout=300,  # importing torch and loading a bundle happen before the child reports
        worker_cancel_long_running_tasks_on_connection_loss=False,  # a lost hint must not stop the work
        worker_max_tasks_per_child=None,  # the model stays loaded
        worker_send_task_events=False,
        worker_enable_remote_control=False,  # liveness is the age of the last tick, not `inspect ping`
        worker_hijack_root_logger=False,  # structlog configures it
        worker_redirect_stdouts=False,
        enable_utc=True,
    )
    return app
