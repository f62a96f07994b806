"""Features of several prompts of one item, stored under one key."""

from __future__ import annotations

import hashlib
import json
import struct
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

import numpy as np
from safetensors.numpy import save

from marey.core.arrays import parse_safetensors
from marey.core.errors import InvalidFile
from marey.text.features import TextFeatures

FORMAT = 1
ENTRY = "several"
HINT = "Delete the row of text_features; the text stage makes it again."
_SIZE = struct.Struct("<Q")


@dataclass(frozen=True)
class SeveralTexts:
    """Features of prompts, in their order."""

    texts: tuple[TextFeatures, ...] = field(repr=False)

    def to_blob(self) -> bytes:
        """Encode as safetensors: the format, then the blob of each prompt behind its size."""
        blobs = [text.to_blob() for text in self.texts]
        parts = [bytes([FORMAT]), *(part for blob in blobs for part in (_SIZE.pack(len(blob)), blob))]
        return save({ENTRY: np.frombuffer(b"".join(parts), np.uint8)})

    @classmethod
    def from_blob(cls, blob: bytes) -> SeveralTexts:
        """Decode the output of `to_blob`.

        Raises:
            InvalidFile: it holds something else, is damaged, or of another version.
        """
        arrays = parse_safetensors(blob, ENTRY)
        if ENTRY not in arrays:
            raise InvalidFile("these are not the text features of several prompts", where=ENTRY, hint=HINT)
        try:
            if arrays[ENTRY].dtype != np.uint8 or arrays[ENTRY].ndim != 1:
                raise ValueError("it holds other than bytes")
            texts = tuple(TextFeatures.from_blob(part) for part in _parts(arrays[ENTRY].tobytes()))
            if not texts:
                raise ValueError("it holds no prompt")
        except (InvalidFile, ValueError, IndexError, struct.error) as error:
            raise InvalidFile(
                f"these are not text features of this version: {error}",
                where=ENTRY,
                hint=HINT,
            ) from error
        return cls(texts)


def _parts(data: bytes) -> Iterator[bytes]:
    if data[0] != FORMAT:
        raise ValueError(f"format {data[0]} is not {FORMAT}")
    at = 1
    while at < len(data):
        (size,) = _SIZE.unpack_from(data, at)
        at += _SIZE.size
        if size > len(data) - at:
            raise ValueError(f"{size} bytes are announced, {len(data) - at} are left")
        yield data[at : at + size]
        at += size


def several_key(keys: Iterable[str]) -> str:
    """Return the key of the features of several prompts, from the key of each (`marey.text.keys.feature_key`)."""
    return hashlib.sha256(json.dumps([ENTRY, FORMAT, list(keys)]).encode()).hexdigest()
