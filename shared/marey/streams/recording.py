"""Recording of a live stream: tokens and prompts, from which the queue of its model makes its clip."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from safetensors.numpy import save

from marey.core.arrays import parse_safetensors
from marey.core.documents import parse_json
from marey.core.errors import InvalidFile
from marey.text.features import TextFeatures

FORMAT = 1
Prompts: TypeAlias = Sequence[tuple[int, str]]
"""Prompts with their first frames."""


@dataclass(frozen=True, eq=False)
class StreamRecording:
    """Everything of a stream that determines its clip.

    Attributes:
        stream: its id.
        tokens: (T, V) int16.
        prompts: the first one begins at frame 0.
        text: features of the first prompt.
    """

    stream: str
    tokens: NDArray[np.int16] = field(repr=False)
    prompts: Prompts
    text: TextFeatures = field(repr=False)

    def to_blob(self) -> bytes:
        """Encode as safetensors; equal recordings are equal bytes."""
        about = {"format": FORMAT, "stream": self.stream, "prompts": [[frame, text] for frame, text in self.prompts]}
        arrays = {
            "recording": np.frombuffer(json.dumps(about, ensure_ascii=False).encode(), np.uint8),
            "text": np.frombuffer(self.text.to_blob(), np.uint8),
            "tokens": np.ascontiguousarray(self.tokens, np.int16),
        }
        return save(arrays)

    @classmethod
    def from_blob(cls, blob: bytes) -> StreamRecording | None:
        """Decode the output of `to_blob`; None for any other safetensors.

        Raises:
            InvalidFile: damaged, or of another version.
        """
        try:
            arrays = parse_safetensors(blob, "recording")
            if "recording" not in arrays:
                return None
            about = parse_json(arrays["recording"].tobytes(), "recording")
            if about["format"] != FORMAT:
                raise ValueError(f"format {about['format']!r} is not {FORMAT!r}")
            tokens = arrays["tokens"]
            if tokens.dtype != np.int16 or tokens.ndim != 2 or len(tokens) == 0:
                raise ValueError(f"tokens are {tokens.dtype} {tokens.shape}")
            prompts = [(int(frame), str(text)) for frame, text in about["prompts"]]
            return cls(str(about["stream"]), tokens, prompts, TextFeatures.from_blob(arrays["text"].tobytes()))
        except (InvalidFile, ValueError, KeyError, TypeError, AttributeError) as error:
            raise InvalidFile(f"this is not a recording of this version: {error}", where="recording") from error
