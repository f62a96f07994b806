"""Set-up shared by the HTTP server processes."""

from __future__ import annotations

import signal
import sys
from typing import Any

from marey.core.settings import Settings
from marey.core.tracing import configure_tracing
from marey.runtime.logs import configure_logging
from marey.runtime.malloc import one_heap

GRACE_SECONDS = 3
"""Seconds for open answers at SIGTERM; event streams and sockets end at once."""
SWITCH_SECONDS = 0.001
"""Switch interval of threads (Python's default: 5 ms). The event loop answers in between threads that read large
bodies."""


def prepare_process(name: str, config: Settings) -> dict[str, Any]:
    """Set up memory, signals, logs and traces of this process; return options of uvicorn."""
    one_heap()
    sys.setswitchinterval(SWITCH_SECONDS)
    # After a graceful end, uvicorn raises the signal again: that must not look like a killed process.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    configure_logging(name, level=config.log_level, json=config.log_json)
    configure_tracing(name)
    return {
        "log_config": None,
        "access_log": False,
        "server_header": False,
        "timeout_graceful_shutdown": GRACE_SECONDS,
    }
