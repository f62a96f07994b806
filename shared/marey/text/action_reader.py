"""Reader of the action that a prompt asks for (ours): a small network over the sentence vector and the words.

Words alone miss every phrase that no list has ("a goblin hunkers low"), and find too much in others ("he jumps up and
lands facing the other way"). The network was trained on sentences that ask for each action of the vocabulary, on those
of several, and on those that no action covers: `python -m marey.reading.train` makes `action_reader.safetensors` anew.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from marey.core.hashing import sha256_of
from marey.text.reader_file import Float32, Reader
from marey.vocabulary.entries import load_vocabulary
from marey.vocabulary.scope import STANDING, every_action, match_scope

FILE = Path(__file__).with_name("action_reader.safetensors")
VECTOR_SCALE, WORD_SCALE = 10.0, 3.0
"""Factors of the sentence vector, whose length is 1, and of the marks of actions that the words name."""
SURE, SURE_OF_SEVERAL = 0.5, 0.8
"""Probabilities from which on a prompt asks for one action, and does so though its words name several."""
AGREED = 0.2
"""Probability from which on it is believed that a prompt asks for the only action that its words name, and which is no
other that is only close to it."""
LOST = 0.35
"""Probability under which who stands or waits by the words does so: "a guard stands at the gate" is no fighter."""
RISING = frozenset({"stand-up", "get-up"})
"""Actions whose words say that one who does not stand does so at the end."""
SEVERAL, OUTSIDE = "several actions", "no action of the vocabulary"
"""Classes behind the actions."""

_JOINTS = re.compile(
    r"\b(?:then|after|afterwards?|before|until|till|followed|next|finally|first|lastly?|once|having)\b|->|→|>|\+|;"
)
"""Words and signs that put one action before another."""


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
        return self.likely(self.least)

    def likely(self, least: float) -> str | None:
        """Return the id of the action from a probability of `least` on; None = several, none, or in doubt."""
        return None if self.name in (SEVERAL, OUTSIDE) or self.probability < least else self.name


class ActionReader(Reader):
    """The network: two layers, on what `inputs_of` returns. Its classes are the ids of the vocabulary's actions,
    `SEVERAL` and `OUTSIDE`."""

    file = FILE
    reads = "actions"
    tensors = frozenset({"hidden", "hidden_bias", "out", "out_bias"})

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
        named = load_vocabulary().without_implied(named_actions(prompt))
        named = named - {STANDING} or named
        name, probability = self.classes[best], float(shares[best] / shares.sum())
        if named == {STANDING} and probability < LOST:
            name, probability = STANDING, AGREED
        one = next(iter(named)) if len(named) == 1 else None
        if one in RISING and name == STANDING:  # "stands up slowly"
            name, probability = one, AGREED
        if one is not None and name == SEVERAL and probability < SURE_OF_SEVERAL and not _JOINTS.search(prompt.lower()):
            name, probability = one, AGREED  # "he walks off"
        agreed = named == {name} and name in named_actions(prompt, surely=True)
        least = SURE_OF_SEVERAL if len(named) > 1 else AGREED if agreed else SURE
        return ReadAction(name, probability, least)


def inputs_of(prompt: str, vector: Float32, classes: Sequence[str]) -> Float32:
    """Return the input (W + C + 2,) of the network: the sentence vector (W,) and the marks of the words."""
    return np.concatenate([np.asarray(vector, np.float32) * VECTOR_SCALE, word_marks(prompt, classes)])


def word_marks(text: str, classes: Sequence[str]) -> Float32:
    """Return marks (C + 2,) of a text: of each class that its words name, of words that name several actions, and of
    words that join clauses in time."""
    named = named_actions(text)
    several = len(load_vocabulary().without_implied(named)) > 1
    joined = _JOINTS.search(text.lower()) is not None
    return np.array([*(name in named for name in classes), several, joined], np.float32) * WORD_SCALE


def joins_clauses(text: str) -> bool:
    """Return True if a text has words or signs that may join clauses."""
    return "," in text or _JOINTS.search(text.lower()) is not None


def named_actions(text: str, *, surely: bool = False) -> set[str]:
    """Return the ids of the actions that the words of a text name; `surely`: without those that are only close to what
    the words mean, such as "sweeps the floor" to a slash."""
    found = match_scope(text, every_action()).actions
    return {each.action for each in found if each.action is not None and (each.verdict == "known" or not surely)}


@cache
def action_reader() -> ActionReader:
    """Return the reader, loaded once."""
    return ActionReader.load()


@cache
def reader_sha256() -> str:
    """Return the hash of the reader's file."""
    return sha256_of(FILE)
