"""Traces where they are off, and what is let in of them."""

from __future__ import annotations

import pytest

from marey.core import tracing
from marey.core.errors import InvalidInput
from marey.core.tracing import ENDPOINTS

TRACE, SPAN = "0af7651916cd43dd8448eb211c80319c", "b7ad6b7169203331"
CONTEXT = f"00-{TRACE}-{SPAN}-01"


@pytest.fixture(autouse=True)
def _no_endpoint(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in (*ENDPOINTS, "OTEL_SDK_DISABLED", "OTEL_TRACES_EXPORTER", *tracing.PROTOCOLS):
        monkeypatch.delenv(name, raising=False)


@pytest.mark.parametrize(
    ("header", "kept"),
    [
        (CONTEXT, CONTEXT),
        (f"01-{TRACE}-{SPAN}-01-more", CONTEXT),  # a later version is read as this one
        (None, None),
        ("", None),
        (f"ff-{TRACE}-{SPAN}-01", None),
        (f"00-{'0' * 32}-{SPAN}-01", None),
        (f"00-{TRACE}-{'0' * 16}-01", None),
        (CONTEXT.upper(), None),
        (f"00-{TRACE[:-1]}-{SPAN}-01", None),
        ("x\nlevel=error", None),
    ],
)
def test_only_a_context_of_the_right_form_goes_into_rows_and_logs(header: str | None, kept: str | None) -> None:
    assert tracing.accepted(header) == kept


def test_without_an_endpoint_spans_hand_their_context_on_and_send_nothing() -> None:
    tracing.configure_tracing("test")
    assert not tracing.is_on()
    with tracing.under(CONTEXT), tracing.span("outer", job="j") as outer, tracing.span("inner") as inner:
        assert outer.traceparent == inner.traceparent == tracing.current() == CONTEXT
    assert tracing.current() is None
    with tracing.span("root") as root:
        assert root.traceparent is None


def test_a_made_up_context_is_one_and_asks_for_no_sampling() -> None:
    made = tracing.made_up()
    assert tracing.accepted(made) == made
    assert made.endswith("-00")
    assert tracing.made_up() != made


@pytest.mark.parametrize(
    ("environment", "on"),
    [
        ({}, False),
        ({ENDPOINTS[0]: "http://c:4318"}, True),
        ({ENDPOINTS[1]: "http://c:4318/v1/traces"}, True),
        ({ENDPOINTS[0]: "http://c:4318", "OTEL_SDK_DISABLED": "true"}, False),
        ({ENDPOINTS[0]: "http://c:4318", "OTEL_TRACES_EXPORTER": "none"}, False),
    ],
)
def test_the_standard_variables_switch_traces_on_and_off(
    monkeypatch: pytest.MonkeyPatch, environment: dict[str, str], on: bool
) -> None:
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    assert tracing.wanted() is on


def test_a_protocol_that_is_not_spoken_is_refused_and_the_one_that_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(ENDPOINTS[0], "http://collector:4317")
    monkeypatch.setenv(tracing.PROTOCOLS[0], "grpc")
    with pytest.raises(InvalidInput, match=r"grpc.*\n.*http/protobuf"):
        tracing.configure_tracing("test")
    assert not tracing.is_on()
