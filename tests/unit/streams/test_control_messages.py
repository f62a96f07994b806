"""Messages to the worker of a stream."""

from __future__ import annotations

import pytest

from marey.core.errors import InvalidInput
from marey.streams.control import StreamControl


@pytest.mark.parametrize(
    "data",
    [
        b'{"kind": "stop", "kind": "steer"}',
        b"[1]",
        b"{",
        b"[" * 100_000,
        b'{"kind": "steer", "prompt": 3}',
        b'{"kind": "stop", "more": 1}',
    ],
)
def test_what_no_release_sends_is_refused(data: bytes) -> None:
    with pytest.raises(InvalidInput) as caught:
        StreamControl.from_bytes(data)
    assert caught.value.where == "stream control"
