"""Reader of the action that a prompt asks for (ours): a small network over the sentence vector and the words.

Words alone miss every phrase that no list has ("a goblin hunkers low"), and find too much in others ("he jumps up and
lands facing the other way"). The network was trained on sentences that ask for each action of the vocabulary, on those
of several, and on those that no action covers: `python -m marey.reading.train` makes `action_reader.safetensors` anew.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray
from safetensors import safe_open

from marey.core.errors import InvalidFile
from marey.core.hashing import sha256_of
from marey.vocabulary.entries import load_vocabulary
from marey.vocabulary.scope import every_action, match_scope

FILE = Path(__file__).with_name("action_reader.safetensors")
STANDING = "idle"
"""Said beside other actions: "stands and waves"."""
VECTOR_SCALE, WORD_SCALE = 10.0, 3.0
"""Factors of the sentence vector, whose length is 1, and of the marks of actions that the words name."""
SURE, SURE_OF_SEVERAL = 0.5, 0.8
"""Probabilities from which on a prompt asks for one action, and does so though its words name several."""
SEVERAL, OUTSIDE = "several actions", "no action of the vocabulary"
"""Classes behind the actions."""

_JOINTS = re.compile(
    r"\b(?:then|after|afterwards?|before|until|till|followed|next|finally|first|lastly?|once|having)\b|->|→|>|\+|;"
)
"""Words and signs that put one action before another."""

Float32 = NDArray[np.float32]


@dataclass(frozen=True)
class ReadAction:
    """The action that a prompt asks for.

    Attributes:
        name: id of the action in the vocabulary, `SEVERAL`, or `OUTSIDE`.
        probability: 0 to 1.
        least: probability from which on it is believed.
    """

    name: str
    probability: float
    least: float = SURE

    @property
    def action(self) -> str | None:
        """Return the id of the action; None = several, none, or in doubt."""
        return None if self.name in (SEVERAL, OUTSIDE) or self.probability < self.least else self.name


class ActionReader:
    """The network: two layers, on what `inputs_of` returns.

    Attributes:
        classes: ids of the vocabulary's actions, `SEVERAL`, `OUTSIDE`.
        encoder_sha256: hash of the encoder whose sentence vectors it reads.
    """

    def __init__(
        self, classes: Sequence[str], encoder_sha256: str, weights: Mapping[str, NDArray[np.floating]]
    ) -> None:
        self.classes = tuple(classes)
        self.encoder_sha256 = encoder_sha256
        self._weights = {name: np.asarray(tensor, np.float32) for name, tensor in weights.items()}

    @classmethod
    def load(cls, path: Path = FILE) -> ActionReader:
        """Load the reader.

        Raises:
            InvalidFile: it has other tensors.
        """
        with cast("Any", safe_open)(path, framework="np") as file:
            facts: dict[str, str] = file.metadata() or {}
            weights: dict[str, Float32] = {name: file.get_tensor(name) for name in sorted(file.keys())}
        if set(weights) != {"hidden", "hidden_bias", "out", "out_bias"}:
            raise InvalidFile("is not a reader of actions", where=str(path))
        return cls(json.loads(facts["classes"]), facts["encoder_sha256"], weights)

    def read(self, prompt: str, vector: Float32) -> ReadAction:
        """Return what a prompt asks for.

        Args:
            prompt: as `check_prompt` returns it.
            vector: (W,) its sentence vector, by `TextPipeline.pooled`.
        """
        weights = self._weights
        hidden = weights["hidden"] @ inputs_of(prompt, vector, self.classes) + weights["hidden_bias"]
        scores = weights["out"] @ np.maximum(hidden, 0) + weights["out_bias"]
        shares = np.exp(scores - scores.max())
        best = int(scores.argmax())
        several = len(load_vocabulary().without_implied(named_actions(prompt)) - {STANDING}) > 1
        least = SURE_OF_SEVERAL if several else SURE
        return ReadAction(self.classes[best], float(shares[best] / shares.sum()), least)


def inputs_of(prompt: str, vector: Float32, classes: Sequence[str]) -> Float32:
    """Return the input (W + C + 2,) of the network: the sentence vector (W,), a mark of each class that the words name,
    and marks of prompts whose words name several actions, and that join clauses in time."""
    named = named_actions(prompt)
    marks = [
        *(name in named for name in classes),
        len(load_vocabulary().without_implied(named)) > 1,
        _JOINTS.search(prompt.lower()) is not None,
    ]
    return np.concatenate([np.asarray(vector, np.float32) * VECTOR_SCALE, np.array(marks, np.float32) * WORD_SCALE])


def named_actions(text: str) -> set[str]:
    """Return the ids of the actions that the words of a text name."""
    return {each.action for each in match_scope(text, every_action()).actions if each.action is not None}


@cache
def action_reader() -> ActionReader:
    """Return the reader, loaded once."""
    return ActionReader.load()


@cache
def reader_sha256() -> str:
    """Return the hash of the reader's file."""
    return sha256_of(FILE)
