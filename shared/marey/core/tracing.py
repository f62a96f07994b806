"""Traces from a command through API, queue and worker to the motion row. Off unless an exporter is configured.

`OTEL_EXPORTER_OTLP_ENDPOINT` (or `…_TRACES_ENDPOINT`) switches tracing on; the other `OTEL_*` variables have their
usual meaning. Until then nothing of OpenTelemetry is imported, and a span is an empty object. A context travels as a
W3C `traceparent`: in the header of a request, in the row of a job, and here, in a context variable. Attributes are
identifiers and numbers, as in logs: no prompts, no names.
"""

from __future__ import annotations

import os
import re
from collections.abc import Generator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, Literal

from marey.core.errors import InvalidInput, MareyError

HEADER = "traceparent"
FORM = re.compile(r"(?!ff)[0-9a-f]{2}-(?!0{32})([0-9a-f]{32})-(?!0{16})([0-9a-f]{16})-([0-9a-f]{2})")
ENDPOINTS = ("OTEL_EXPORTER_OTLP_ENDPOINT", "OTEL_EXPORTER_OTLP_TRACES_ENDPOINT")
PROTOCOLS = ("OTEL_EXPORTER_OTLP_PROTOCOL", "OTEL_EXPORTER_OTLP_TRACES_PROTOCOL")
SPOKEN = "http/protobuf"

Kind = Literal["internal", "server", "client", "producer", "consumer"]
Value = str | int | float | bool

_current: ContextVar[str | None] = ContextVar("marey_trace", default=None)
_tracer: Any = None
_provider: Any = None


class Span:
    """A unit of work. Without an exporter it only carries the context it was started in.

    Attributes:
        traceparent: its context, for child spans elsewhere; None if there is none.
    """

    __slots__ = ("_inner", "traceparent")

    def __init__(self, traceparent: str | None, inner: Any = None) -> None:
        self.traceparent = traceparent
        self._inner = inner

    def set(self, **attributes: Value) -> None:
        """Add attributes; `job` becomes `marey.job`."""
        if self._inner is not None:
            self._inner.set_attributes(_named(attributes))

    def rename(self, name: str) -> None:
        """Change the name of the span."""
        if self._inner is not None:
            self._inner.update_name(name)

    def fail(self, error: BaseException) -> None:
        """Mark the span as failed. Only the type of an unexpected error is recorded: its text may quote a prompt."""
        if self._inner is not None:
            from opentelemetry.trace import Status, StatusCode

            description = error.message if isinstance(error, MareyError) else type(error).__name__
            self._inner.set_status(Status(StatusCode.ERROR, description))

    def end(self) -> None:
        """End the span."""
        if self._inner is not None:
            self._inner.end()


def wanted() -> bool:
    """Return True if the environment names a trace exporter."""
    off = os.environ.get("OTEL_SDK_DISABLED", "").lower() == "true" or os.environ.get("OTEL_TRACES_EXPORTER") == "none"
    return not off and any(os.environ.get(name) for name in ENDPOINTS)


def is_on() -> bool:
    """Return True if this process exports spans."""
    return _tracer is not None


def configure_tracing(service: str, *, patience: float | None = None) -> None:
    """Export spans of this process as the service `marey-…`, if `wanted`. Call it once, at start-up.

    Args:
        patience: seconds to wait for a collector, if `OTEL_EXPORTER_OTLP_TIMEOUT` is unset.

    Raises:
        InvalidInput: the packages are not installed, or another protocol is requested.
    """
    global _tracer, _provider
    if _tracer is not None or not wanted():
        return
    protocol = next((value for name in PROTOCOLS if (value := os.environ.get(name))), SPOKEN)
    if protocol != SPOKEN:
        raise InvalidInput(
            f"{protocol!r} is not supported", where=PROTOCOLS[0], hint=f"Unset it, or set {SPOKEN} (port 4318)."
        )
    try:
        from opentelemetry.exporter.otlp.proto.http.trace_exporter import OTLPSpanExporter
        from opentelemetry.sdk.resources import SERVICE_NAME, SERVICE_NAMESPACE, Resource
        from opentelemetry.sdk.trace import TracerProvider
        from opentelemetry.sdk.trace.export import BatchSpanProcessor
    except ImportError as error:
        raise InvalidInput(
            f"tracing is configured, but {error.name} is not installed",
            where=ENDPOINTS[0],
            hint="pip install 'marey[tracing]', or unset it.",
        ) from error
    named = {} if os.environ.get("OTEL_SERVICE_NAME") else {SERVICE_NAME: f"marey-{service}"}
    timed = any("OTLP" in name and name.endswith("TIMEOUT") for name in os.environ)
    exporter = OTLPSpanExporter(timeout=None if timed else patience)
    _provider = TracerProvider(resource=Resource.create({**named, SERVICE_NAMESPACE: "marey"}))
    _provider.add_span_processor(BatchSpanProcessor(exporter))
    _tracer = _provider.get_tracer("marey")


def end_tracing() -> None:
    """Flush remaining spans and switch tracing off. Needed in a worker's child only; other processes flush at exit."""
    global _tracer, _provider
    if _provider is not None:
        _provider.shutdown()
    _tracer = _provider = None


def begin(
    name: str, *, parent: str | None = None, kind: Kind = "internal", ago: float = 0.0, **attributes: Value
) -> Span:
    """Start a span that is ended later, perhaps on another thread.

    Args:
        parent: `traceparent` of the parent; None = the current context.
        ago: seconds since the span started.
    """
    parent = parent or _current.get()
    if _tracer is None:
        return Span(parent)
    import time

    from opentelemetry.trace import SpanKind

    inner = _tracer.start_span(
        name,
        context=_context(parent),
        kind=SpanKind[kind.upper()],
        attributes=_named(attributes),
        start_time=time.time_ns() - int(ago * 1e9),
    )
    context = inner.get_span_context()
    return Span(f"00-{context.trace_id:032x}-{context.span_id:016x}-{context.trace_flags:02x}", inner)


@contextmanager
def span(name: str, *, parent: str | None = None, kind: Kind = "internal", **attributes: Value) -> Generator[Span]:
    """Open a span around a block; spans started inside become its children."""
    made = begin(name, parent=parent, kind=kind)
    made.set(**attributes)
    with under(made.traceparent):
        try:
            yield made
        except BaseException as error:
            made.fail(error)
            raise
        finally:
            made.end()


@contextmanager
def under(traceparent: str | None) -> Generator[None]:
    """Run a block under a given trace context."""
    token = _current.set(traceparent)
    try:
        yield
    finally:
        _current.reset(token)


def current() -> str | None:
    """Return the `traceparent` of the current context."""
    return _current.get()


def trace_id(traceparent: str | None) -> str | None:
    """Return the trace id of a context, 32 hex digits."""
    return None if traceparent is None else traceparent.split("-")[1]


def accepted(header: str | None) -> str | None:
    """Return an incoming `traceparent` if it is valid, else None: it is written to rows and logs."""
    found = None if header is None else FORM.match(header)
    return None if found is None else f"00-{found[1]}-{found[2]}-{found[3]}"


def made_up() -> str:
    """Return a new context for a request without one, so that its log lines can be told apart without tracing."""
    return f"00-{os.urandom(16).hex()}-{os.urandom(8).hex()}-00"


def _named(attributes: dict[str, Value]) -> dict[str, Value]:
    return {name if "." in name else f"marey.{name}": value for name, value in attributes.items()}


def _context(traceparent: str | None) -> Any:
    """Return OpenTelemetry's context of a `traceparent`; an empty one starts a new trace."""
    from opentelemetry.context import Context
    from opentelemetry.trace import NonRecordingSpan, SpanContext, TraceFlags, set_span_in_context

    if traceparent is None:
        return Context()
    _, trace, span_id, flags = traceparent.split("-")
    known = SpanContext(int(trace, 16), int(span_id, 16), is_remote=True, trace_flags=TraceFlags(int(flags, 16)))
    return set_span_in_context(NonRecordingSpan(known), Context())
