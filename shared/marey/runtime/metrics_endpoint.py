"""Prometheus endpoint of workers and the scheduler. The API has a route for that."""

from __future__ import annotations

import sys

from prometheus_client import start_http_server

from marey.core import metrics
from marey.core.errors import Conflict
from marey.core.settings import Settings
from marey.runtime.logs import logger

log = logger(__name__)


def expose(part: str, chosen: Settings) -> None:
    """Serve metrics at `MAREY_METRICS_HOST` and `MAREY_METRICS_PORT` until the process ends; disabled if no port is
    set.

    A worker's child does so, not its parent: the child does the work, and each number is exposed once.

    Args:
        part: a name of `metrics.PARTS`.

    Raises:
        Conflict: the port is taken.
    """
    if chosen.metrics_port is None:
        return
    try:
        start_http_server(chosen.metrics_port, chosen.metrics_host, metrics.PARTS[part])
    except OSError as error:
        raise Conflict(
            f"port {chosen.metrics_port} of {chosen.metrics_host} cannot be used: {error.strerror}",
            where="MAREY_METRICS_PORT",
            hint="Each worker and the scheduler need one of their own.",
        ) from error
    log.info("metrics_served", host=chosen.metrics_host, port=chosen.metrics_port)


def measure_gpu() -> None:
    """Record the memory use of the devices; does nothing if torch was not imported or uses none."""
    torch = sys.modules.get("torch")
    if torch is None or not torch.cuda.is_available() or not torch.cuda.is_initialized():
        return
    for device in range(torch.cuda.device_count()):
        reserved = torch.cuda.memory_reserved(device)
        if reserved:  # querying a device allocates memory on it
            free, total = torch.cuda.mem_get_info(device)
            kinds = {
                "allocated": torch.cuda.memory_allocated(device),
                "reserved": reserved,
                "free": free,
                "total": total,
            }
            for kind, size in kinds.items():
                metrics.GPU_MEMORY.labels(f"cuda:{device}", kind).set(size)
