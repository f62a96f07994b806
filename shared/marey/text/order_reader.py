"""Reader of the order of time: which of two clauses of a prompt comes first (ours).

MiniLM with low-rank updates of its own reads a prompt whose clauses are marked, and a network tells from the states of
two of them whether the one that is said later comes earlier: "kneels, having thrown the spear". The order that all
pairs together find likeliest is taken. `python -m marey.reading.train_order` makes `order_reader.safetensors` anew.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path

import numpy as np

from marey.core.hashing import sha256_of
from marey.text.encoders import Encoding
from marey.text.reader_file import Float32, Reader

FILE = Path(__file__).with_name("order_reader.safetensors")
MARK = " | "
"""Sign between two clauses, in the text that is encoded."""
UPDATED = (3, 4, 5)
"""Layers of MiniLM with updates: its last three."""
STATE_SCALE = 10.0
"""Length of the states of clauses."""
MOST_CLAUSES = 6
"""Clauses whose orders are all compared; more stay as they are written."""
DOUBT = 0.7
"""Score that a pair in the other order must exceed: most prompts are told in the order of time."""
_MATRICES = ("project", "attended", "inner", "outer")


class OrderReader(Reader):
    """The network of pairs, and the updates of its encoder. It has no classes."""

    file = FILE
    reads = "the order of time"
    tensors = frozenset(
        {f"{name}{end}" for name in ("pair", "earlier") for end in ("", "_bias")}
        | {f"{layer}.{name}.{end}" for layer in UPDATED for name in _MATRICES for end in ("down", "up")}
    )

    def order(
        self, clauses: Sequence[str], moving: Sequence[bool], encode: Callable[[str], Encoding]
    ) -> tuple[int, ...]:
        """Return the numbers of the clauses that ask for a movement, in the order of time.

        Args:
            clauses: all of a prompt, as they are written.
            moving: whether each asks for a movement.
            encode: by the encoder with the updates of the file.
        """
        asked = tuple(number for number, moves in enumerate(moving) if moves)
        if not is_asked_for_order(moving):
            return asked
        text, spans = marked(clauses)
        encoding = encode(text)
        found = {number: encoding.span(*spans[number]) for number in asked}
        vectors = {number: _unit(vector) for number, vector in found.items() if vector is not None}
        if len(vectors) < len(asked):
            return asked  # some lie past the encoder's limit
        return likeliest_order(asked, self.scores(vectors, list(itertools.combinations(asked, 2))))

    def scores(self, vectors: Mapping[int, Float32], pairs: Sequence[tuple[int, int]]) -> dict[tuple[int, int], float]:
        """Return the log odds that the second of each pair comes before the first, from the vectors (W,) of clauses."""
        weights = self._weights
        inputs = np.stack([np.concatenate([vectors[one], vectors[other]]) for one, other in pairs]) * STATE_SCALE
        hidden = np.maximum(inputs @ weights["pair"].T + weights["pair_bias"], 0)
        scores = (hidden @ weights["earlier"].T + weights["earlier_bias"])[:, 0]
        return dict(zip(pairs, map(float, scores), strict=True))


def _unit(vector: Float32) -> Float32:
    return (vector / np.linalg.norm(vector)).astype(np.float32)


def is_asked_for_order(moving: Sequence[bool]) -> bool:
    """Return True if `OrderReader.order` encodes the clauses, which are as many as can be compared."""
    return 1 < sum(moving) <= MOST_CLAUSES


def marked(clauses: Sequence[str]) -> tuple[str, list[tuple[int, int]]]:
    """Return a text of clauses with marks between them, and the first character of each and the one after its last."""
    bare = [clause.strip() for clause in clauses]
    ends = itertools.accumulate(bare, lambda end, clause: end + len(MARK) + len(clause), initial=-len(MARK))
    return MARK.join(bare), [(end - len(clause), end) for end, clause in zip(list(ends)[1:], bare, strict=True)]


def likeliest_order(clauses: Sequence[int], scores: Mapping[tuple[int, int], float]) -> tuple[int, ...]:
    """Return clauses in the order that is likeliest by all pairs.

    Args:
        clauses: numbers, in the order of the text.
        scores: log odds that the second of a pair comes before the first.
    """

    def likelihood(order: tuple[int, ...]) -> float:
        place = {clause: number for number, clause in enumerate(order)}
        return sum(
            -math.log1p(math.exp((DOUBT - score) * (1 if place[other] < place[one] else -1)))
            for (one, other), score in scores.items()
        )

    return max(itertools.permutations(clauses), key=likelihood)


@cache
def order_reader() -> OrderReader:
    """Return the reader, loaded once."""
    return OrderReader.load()


@cache
def order_reader_sha256() -> str:
    """Return the hash of the reader's file."""
    return sha256_of(FILE)
