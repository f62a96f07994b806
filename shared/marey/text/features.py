"""Text features of a prompt: the graph and one vector per node, stored as one blob in the database."""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from safetensors.numpy import save

from marey.core.arrays import parse_safetensors
from marey.core.documents import parse_json
from marey.core.errors import InvalidFile
from marey.text.graph import SemanticGraph

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
        # one entry: safetensors writes several in random order, and equal features should be equal bytes
        rows = self.nodes
        if self.action_rows is not None:
            about["acts"] = list(self.actions)
            rows = np.concatenate([self.nodes, self.action_rows])
        metadata = {"features": json.dumps(about, ensure_ascii=False)}
        return save({"nodes": np.ascontiguousarray(rows, dtype=np.float16)}, metadata=metadata)

    @classmethod
    def from_blob(cls, blob: bytes) -> TextFeatures:
        """Read the output of `to_blob`.

        Raises:
            InvalidFile: not such a blob, or a damaged one.
        """
        try:
            nodes = parse_safetensors(blob, "features")["nodes"]
            about = parse_json(_metadata(blob)["features"], "features", allow_nan=True)
            if about["format"] != FORMAT:
                raise ValueError(f"format {about['format']!r} is not {FORMAT!r}")
            graph = SemanticGraph.from_json(about["graph"])
            actions, count = tuple(about.get("acts", ())), len(graph.nodes)
            if nodes.dtype != np.float16 or nodes.ndim != 2 or len(nodes) != count + len(actions):
                raise ValueError(f"{nodes.dtype} {nodes.shape} does not fit {count} nodes and {len(actions)} actions")
            rows = nodes[count:] if actions else None
            return cls(
                about["prompt"], about["rewritten"], graph, nodes[:count], about.get("not_rewritten"), actions, rows,
                about.get("seconds"),
            )  # fmt: skip
        except (InvalidFile, ValueError, KeyError, TypeError, AttributeError, struct.error) as error:
            raise InvalidFile(
                f"these are not text features of this version: {error}",
                hint="Delete the row of text_features; the text stage makes it again.",
            ) from error


def _metadata(blob: bytes) -> dict[str, Any]:
    """The `__metadata__` of a safetensors blob: an 8-byte length, then that much JSON."""
    (length,) = struct.unpack("<Q", blob[:8])
    if length > MAX_HEADER_BYTES:
        raise ValueError(f"a header of {length} bytes")
    return parse_json(blob[8 : 8 + length], "features")["__metadata__"]
