"""Train the reader of actions: `python -m marey.reading.train`, some minutes of one core.

It writes `action_reader.safetensors`, and prints how many of the development prompts are read right.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np

from marey.checks.reader_prompts import outside_prompts, sequence_prompts
from marey.reading.networks import NetworkRecipe, Trained, fit, side_by_side, train_and_write
from marey.reading.texts import LabelledText, labelled_texts
from marey.referee.prompts import development_prompts
from marey.text.action_reader import FILE, OUTSIDE, SEVERAL, ActionReader, inputs_of
from marey.text.encoders import TextEncoder
from marey.text.minilm_encoder import MiniLMEncoder
from marey.text.parsed import without_punctuation
from marey.vocabulary.entries import load_vocabulary

RECIPE = NetworkRecipe(units=200, epochs=45, batch=1024, rate=3e-3, decay=0.02, dropout=0.4, smoothing=0.05)
MEMBERS = 3
"""Number of networks whose scores are averaged; side by side they are one network."""
BALANCE = 0.5
"""Exponent of a class's number of texts by which each of them weighs less."""


def train(texts: Sequence[LabelledText], encoder: TextEncoder, seed: int) -> Trained:
    """Return the classes and the weights of a reader."""
    classes = [*load_vocabulary().actions, SEVERAL, OUTSIDE]
    vectors = encoder.pooled([without_punctuation(each.text) for each in texts])
    inputs = np.stack([inputs_of(each.text, vector, classes) for each, vector in zip(texts, vectors, strict=True)])
    counts = Counter(each.asks for each in texts)
    weights = np.array([each.weight / counts[each.asks] ** BALANCE for each in texts], np.float32)
    wanted = [classes.index(each.asks) for each in texts]
    networks = [fit(inputs, wanted, weights, len(classes), seed + member, RECIPE) for member in range(MEMBERS)]
    return classes, side_by_side(networks)


def main() -> None:
    """Train and write a reader."""
    train_and_write(
        __doc__,
        FILE,
        lambda encoder, seed: train(labelled_texts(seed), encoder, seed),
        lambda path, encoder: _rates(ActionReader.load(path), encoder),
    )


def _rates(reader: ActionReader, encoder: MiniLMEncoder) -> str:
    """Return how many held-out prompts are read right, and how many of those that are read as one action."""
    asked = {
        "one action": [(each.text, each.actions[0]) for each in development_prompts()],
        "several": [(text, SEVERAL) for text, _ in sequence_prompts()],
        "outside": [(text, OUTSIDE) for text in outside_prompts()],
    }
    lines: list[str] = []
    for kind, prompts in asked.items():
        vectors = encoder.pooled([without_punctuation(text) for text, _ in prompts])
        read = [reader.read(text, vector) for (text, _), vector in zip(prompts, vectors, strict=True)]
        right = sum(each.name == wanted for each, (_, wanted) in zip(read, prompts, strict=True))
        single = [each.action == wanted for each, (_, wanted) in zip(read, prompts, strict=True) if each.action]
        lines.append(f"{kind}: {right} of {len(prompts)} right; {len(single)} as one action, {sum(single)} right\n")
    return "".join(lines)


if __name__ == "__main__":
    main()
