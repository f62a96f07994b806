"""A collector of traces: a real HTTP server that speaks OTLP, and keeps what it is sent."""

from __future__ import annotations

import gzip
from dataclasses import dataclass

from opentelemetry.proto.collector.trace.v1.trace_service_pb2 import ExportTraceServiceRequest

from tests.servers.receiver import Receiver


@dataclass(frozen=True)
class Spanned:
    """A span as it arrived; identifiers in hex, `parent` empty for a root."""

    trace: str
    id: str
    parent: str
    name: str
    service: str
    attributes: dict[str, object]
    failed: bool

    @property
    def items(self) -> set[str]:
        """Identifiers of the items it names."""
        return set(str(self.attributes.get("marey.item", "")).split(",")) - {""}


class Collector:
    """Listens on 127.0.0.1 until the end of the block."""

    def __init__(self) -> None:
        self._receiver = Receiver()

    def environment(self) -> dict[str, str]:
        """Environment that makes a process send its spans here, and soon."""
        return {
            "OTEL_EXPORTER_OTLP_ENDPOINT": self._receiver.url(path=""),
            "OTEL_BSP_SCHEDULE_DELAY": "100",
        }

    def spans(self) -> list[Spanned]:
        """Spans received so far."""
        found: list[Spanned] = []
        for request in list(self._receiver.received):
            assert request.path == "/v1/traces"
            body = gzip.decompress(request.body) if request.headers.get("content-encoding") == "gzip" else request.body
            message = ExportTraceServiceRequest.FromString(body)
            for resource in message.resource_spans:
                service = _values(resource.resource.attributes)["service.name"]
                for scope in resource.scope_spans:
                    found += [_spanned(span, str(service)) for span in scope.spans]
        return found

    def raw(self) -> bytes:
        """Everything that came, to be searched for what must not."""
        return b"".join(request.body for request in self._receiver.received)

    def __enter__(self) -> Collector:
        self._receiver.__enter__()
        return self

    def __exit__(self, *_: object) -> None:
        self._receiver.__exit__()


def _spanned(span: object, service: str) -> Spanned:
    values = _values(span.attributes)  # pyright: ignore[reportAttributeAccessIssue]
    return Spanned(
        span.trace_id.hex(),  # pyright: ignore[reportAttributeAccessIssue]
        span.span_id.hex(),  # pyright: ignore[reportAttributeAccessIssue]
        span.parent_span_id.hex(),  # pyright: ignore[reportAttributeAccessIssue]
        span.name,  # pyright: ignore[reportAttributeAccessIssue]
        service,
        values,
        span.status.code == 2,  # pyright: ignore[reportAttributeAccessIssue]
    )


def _values(attributes: object) -> dict[str, object]:
    return {each.key: getattr(each.value, each.value.WhichOneof("value")) for each in attributes}  # pyright: ignore
