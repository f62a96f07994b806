"""Recordings of live streams as bytes."""

from __future__ import annotations

import numpy as np
import pytest

from marey.core.errors import InvalidFile
from marey.streams.recording import StreamRecording
from tests.support.prepared import text_features


def recording() -> StreamRecording:
    tokens = np.arange(24, dtype=np.int16).reshape(8, 3)
    return StreamRecording("stream-1", tokens, [(0, "a person walks"), (5, "a person “waves”")], text_features(0))


def test_a_recording_reads_back_as_it_was_written() -> None:
    written = recording()
    read = StreamRecording.from_blob(written.to_blob())
    assert read is not None
    assert (read.stream, list(read.prompts)) == (written.stream, list(written.prompts))
    assert np.array_equal(read.tokens, written.tokens)
    assert np.array_equal(read.text.nodes, written.text.nodes)


def test_equal_recordings_are_equal_bytes() -> None:
    assert recording().to_blob() == recording().to_blob()


def test_text_features_are_no_recording() -> None:
    assert StreamRecording.from_blob(text_features(0).to_blob()) is None


@pytest.mark.parametrize(
    "damage", [lambda blob: blob[:-7], lambda blob: b"", lambda blob: blob.replace(b"prompts", b"prompt_")]
)
def test_a_damaged_recording_is_refused(damage: object) -> None:
    with pytest.raises(InvalidFile, match=r"^recording: .*not a recording"):
        StreamRecording.from_blob(damage(recording().to_blob()))  # pyright: ignore
