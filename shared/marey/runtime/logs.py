"""Structured logs: JSON lines for machines, readable lines for people, never a prompt or a secret.

Log lines of claims carry `job`, `lease` and `trace` automatically (`marey.runtime.telemetry`); those of a request
its `trace`. Log identifiers and numbers; a prompt belongs to its tenant and stays in the database.
"""

from __future__ import annotations

import logging
import sys
import traceback
from typing import TextIO

import structlog
from structlog.stdlib import BoundLogger
from structlog.typing import EventDict, ExcInfo, Processor, WrappedLogger

from marey.core import tracing
from marey.core.characters import escape, unescaped

FORBIDDEN = frozenset({"prompt", "prompts", "text", "rewritten", "key", "api_key", "secret", "password", "url", "dsn"})
"""Keys that could carry a prompt or a secret; the processor drops them from every log line."""


def _drop_forbidden(_logger: WrappedLogger, _method: str, event: EventDict) -> EventDict:
    for name in FORBIDDEN & event.keys():
        event[name] = "(withheld)"
    return event


def _add_service(service: str) -> Processor:
    def add(_logger: WrappedLogger, _method: str, event: EventDict) -> EventDict:  # threads have no context variables
        event.setdefault("service", service)
        return event

    return add


def _brief_traceback(exc_info: ExcInfo) -> str:
    """Return the calls, and the first line of each message: no local variables, no DETAIL of a database error, which
    quotes the row with its prompt."""
    parts: list[str] = []
    error: BaseException | None = exc_info[1]
    while error is not None:
        first = (str(error).splitlines() or [""])[0]
        parts.append("".join(traceback.format_tb(error.__traceback__)) + f"{type(error).__name__}: {first}\n")
        error = error.__cause__ or (None if error.__suppress_context__ else error.__context__)
    return "caused:\n".join(reversed(parts))


def _write_traceback(stream: TextIO, exc_info: ExcInfo) -> None:
    stream.write("\n" + escape(_brief_traceback(exc_info)))


def _escape_values(_logger: WrappedLogger, _method: str, event: EventDict) -> EventDict:
    """Escape values for a terminal; the renderer writes strings as they are, and everything else by `repr`."""
    return {name: escape(value, lines=False) if isinstance(value, str) else value for name, value in event.items()}


def _add_trace(_logger: WrappedLogger, _method: str, event: EventDict) -> EventDict:
    trace = tracing.trace_id(tracing.current())
    if trace is not None:
        event.setdefault("trace", trace)
    return event


def configure_logging(service: str, *, level: str = "INFO", json: bool = False) -> None:
    """Send structlog and the standard library's loggers to stderr, one line an event, with `service` in each."""
    shared: list[Processor] = [
        structlog.contextvars.merge_contextvars,
        _add_service(service),
        _add_trace,
        structlog.stdlib.add_log_level,
        structlog.processors.TimeStamper(fmt="iso", utc=True),
        _drop_forbidden,
    ]
    renderer: list[Processor] = [
        _escape_values,
        structlog.dev.ConsoleRenderer(colors=sys.stderr.isatty(), exception_formatter=_write_traceback),
    ]
    if json:
        renderer = [structlog.processors.ExceptionRenderer(_brief_traceback), structlog.processors.JSONRenderer()]
    structlog.configure(
        processors=[*shared, structlog.stdlib.ProcessorFormatter.wrap_for_formatter],
        logger_factory=structlog.stdlib.LoggerFactory(),
        wrapper_class=structlog.stdlib.BoundLogger,
        cache_logger_on_first_use=True,
    )
    handler = logging.StreamHandler(unescaped(sys.stderr))  # the renderer colours lines
    handler.setFormatter(
        structlog.stdlib.ProcessorFormatter(
            foreign_pre_chain=shared,
            processors=[structlog.stdlib.ProcessorFormatter.remove_processors_meta, *renderer],
        )
    )
    root = logging.getLogger()
    root.handlers[:] = [handler]
    root.setLevel(level)
    # INFO lines per hint and per connection are noise; the loop logs its own. httpx2 would log whole URLs.
    for noisy in ("celery.worker.strategy", "celery.app.trace", "kombu", "amqp", "urllib3", "httpx2"):
        logging.getLogger(noisy).setLevel(max(logging.WARNING, root.level))


def logger(name: str) -> BoundLogger:
    """Return a logger of `name`; call it with an event and keywords: `log.info("claimed", items=32)`."""
    return structlog.stdlib.get_logger(name)
