"""The Celery task of a worker, and the child behind it."""
# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false, reportUntypedFunctionDecorator=false
# pyright: reportUnknownVariableType=false

from __future__ import annotations

import os
import signal
import time

from celery import shared_task
from celery.signals import worker_process_init, worker_process_shutdown

from marey.core.errors import MareyError, Unreachable
from marey.core.settings import settings
from marey.runtime.app import DRAIN
from marey.runtime.child import NAME_VARIABLE, Child
from marey.runtime.logs import logger
from marey.runtime.status import WorkerStatus, write_status

log = logger(__name__)

_child: Child | None = None


@worker_process_init.connect
def _start(**_: object) -> None:
    """Start the child, or end it and its parent: a worker that cannot load its model must not take hints."""
    global _child
    try:
        _child = Child.of_environment()
        _child.start()
    except Exception as error:
        expected = isinstance(error, MareyError)
        log.error("worker_cannot_start", error=str(error), exc_info=None if expected else error)
        status = WorkerStatus(os.getpid(), ready=False, tick_age=0.0, written=time.time(), error=str(error))
        write_status(settings().home, os.environ[NAME_VARIABLE], status)
        os.kill(os.getppid(), signal.SIGTERM)
        os._exit(1)


@worker_process_shutdown.connect
def _stop(**_: object) -> None:
    if _child is not None:
        _child.stop()


@shared_task(name=DRAIN, ignore_result=True)
def drain(queue: str) -> None:
    """Handle a hint that `queue` has work. The child serves all its queues, in its own order."""
    if _child is None:
        raise RuntimeError("drain outside of a worker child")
    try:
        items = _child.drain()
    except Unreachable as error:
        log.warning("drain_ended", queue=queue, error=error.message)
    except Exception:
        # Celery would log the exception's text, and that of a failed row holds the row. The next hint comes.
        log.exception("drain_failed", queue=queue)
    else:
        log.debug("drained", queue=queue, items=items)
