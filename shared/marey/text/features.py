"""Text features of a prompt: the graph and one vector per node, stored as one blob in the database."""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from safetensors.numpy import save

from marey.core.arrays import parse_safetensors
from marey.core.documents import parse_json
from marey.core.errors import InvalidFile
from marey.text.graph import SemanticGraph
from marey.vocabulary.take_names import as_words

FORMAT = 1
MAX_HEADER_BYTES = 2**20


@dataclass(frozen=True)
class TextFeatures:
    """Features of one prompt."""

    prompt: str
    rewritten: str
    graph: SemanticGraph  # of the rewritten prompt
    nodes: NDArray[np.float16]  # (N, W), a row a node of the graph; row 0 = pooled encoding of the whole sentence
    not_rewritten: str | None = None  # why the rewriter's prompt, if there is one, was not used
    actions: tuple[str, ...] = ()  # in the order of time, each as a sentence (`marey.text.actions`)
    action_rows: NDArray[np.float16] | None = None  # (A, W) their pooled encodings
    seconds: float | None = None  # length of the motion that the rewriter proposes
    left_out: tuple[str, ...] = ()  # its parts that ask for a movement, and that nothing of its reading covers
    movements: tuple[TextFeatures, ...] = ()  # its movements in the order of time, if there are several

    @property
    def said(self) -> str:
        """The prompt, with names of takes as words."""
        return as_words(self.prompt)

    @property
    def sentence(self) -> NDArray[np.float16]:
        """Pooled encoding of the whole sentence, (W,)."""
        return self.nodes[0]

    @property
    def action_vectors(self) -> NDArray[np.float16]:
        """Pooled encodings of the actions in order, (A, W); that of the whole sentence if there is one action."""
        return self.nodes[:1] if self.action_rows is None else self.action_rows

    def to_blob(self) -> bytes:
        """Encode as safetensors fp16 with prompt, rewritten prompt, graph and actions in the metadata."""
        # one entry: safetensors writes several in random order, and equal features should be equal bytes
        rows = np.ascontiguousarray(np.concatenate(list(self._rows())), dtype=np.float16)
        return save({"nodes": rows}, metadata={"features": json.dumps(self._about(), ensure_ascii=False)})

    def _about(self) -> dict[str, Any]:
        about: dict[str, Any] = {
            "format": FORMAT,
            "prompt": self.prompt,
            "rewritten": self.rewritten,
            "graph": self.graph.to_json(),
        }
        if self.not_rewritten is not None:
            about["not_rewritten"] = self.not_rewritten
        if self.seconds is not None:
            about["seconds"] = self.seconds
        if self.action_rows is not None:
            about["acts"] = list(self.actions)
        if self.left_out:
            about["left_out"] = list(self.left_out)
        if self.movements:
            about["movements"] = [movement._about() for movement in self.movements]
        return about

    def _rows(self) -> Iterator[NDArray[np.float16]]:
        yield self.nodes
        if self.action_rows is not None:
            yield self.action_rows
        for movement in self.movements:
            yield from movement._rows()

    @classmethod
    def from_blob(cls, blob: bytes) -> TextFeatures:
        """Read the output of `to_blob`.

        Raises:
            InvalidFile: not such a blob, or a damaged one.
        """
        try:
            nodes = parse_safetensors(blob, "features")["nodes"]
            if nodes.dtype != np.float16 or nodes.ndim != 2:
                raise ValueError(f"{nodes.dtype} {nodes.shape} are no vectors")
            features, left = cls._of(parse_json(_metadata(blob)["features"], "features", allow_nan=True), nodes)
            if len(left):
                raise ValueError(f"{nodes.shape} has {len(left)} vectors too many")
            return features
        except (InvalidFile, ValueError, KeyError, TypeError, AttributeError, struct.error) as error:
            raise InvalidFile(
                f"these are not text features of this version: {error}",
                hint="Delete the row of text_features; the text stage makes it again.",
            ) from error

    @classmethod
    def _of(cls, about: Mapping[str, Any], rows: NDArray[np.float16]) -> tuple[TextFeatures, NDArray[np.float16]]:
        """Return the features that `about` and the first of the rows hold, and the other rows."""
        if about["format"] != FORMAT:
            raise ValueError(f"format {about['format']!r} is not {FORMAT!r}")
        graph = SemanticGraph.from_json(about["graph"])
        actions, count = tuple(about.get("acts", ())), len(graph.nodes)
        end = count + len(actions)
        if len(rows) < end:
            raise ValueError(f"{len(rows)} vectors do not fit {count} nodes and {len(actions)} actions")
        left, movements = rows[end:], list[TextFeatures]()
        for each in about.get("movements", ()):
            movement, left = cls._of(each, left)
            movements.append(movement)
        return cls(
            about["prompt"], about["rewritten"], graph, rows[:count], about.get("not_rewritten"), actions,
            rows[count:end] if actions else None, about.get("seconds"), tuple(about.get("left_out", ())),
            tuple(movements),
        ), left  # fmt: skip


def _metadata(blob: bytes) -> dict[str, Any]:
    """The `__metadata__` of a safetensors blob: an 8-byte length, then that much JSON."""
    (length,) = struct.unpack("<Q", blob[:8])
    if length > MAX_HEADER_BYTES:
        raise ValueError(f"a header of {length} bytes")
    return parse_json(blob[8 : 8 + length], "features")["__metadata__"]
