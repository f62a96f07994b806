"""Training batches of the role labeller: first PropBank, then the project's sentences."""

from __future__ import annotations

import random
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from marey.labeller.data import Augmenter
from marey.labeller.fit import Encoded, encode
from marey.labeller.sentences import Example
from marey.text.light import WordStates
from marey.text.roles import Frame

VARIANTS = 3  # augmented copies of each annotated sentence in the first training
CHUNKS = 16  # batches that are drawn together, so that sentences of like length share one: little padding


@dataclass(frozen=True)
class SentencePool:
    """Sentences of the second training, and their weights; a variant's is 1."""

    variants: int = 8  # augmented copies of each annotated sentence
    propbank: int = 1000  # sentences of the first training, so that it is not forgotten
    annotated_weight: float = 2.0
    propbank_weight: float = 0.4


def frequent_roles(examples: Sequence[Example], least: int = 100) -> set[str]:
    """Roles that occur often enough to be learned."""
    counts = Counter(a.role for example in examples for frame in example.frames for a in frame.arguments)
    return {role for role, count in counts.items() if count >= least}


def with_roles(examples: Sequence[Example], roles: set[str]) -> list[Example]:
    """The examples without arguments of any other role."""
    return [
        Example(
            example.words,
            tuple(Frame(f.predicate, tuple(a for a in f.arguments if a.role in roles)) for f in example.frames),
        )
        for example in examples
    ]


def split(examples: Sequence[Example]) -> tuple[list[Example], list[Example]]:
    """Sentences to train on, and 300 to score; names and greetings of three words at most are left out."""
    kept = [example for example in examples if example.frames or len(example.words) > 3]
    random.Random(5).shuffle(kept)  # noqa: S311
    return kept[300:], kept[:300]


def propbank_batches(
    examples: Sequence[Example],
    annotated: Sequence[Example],
    words: WordStates,
    tags: Sequence[str],
    size: int,
    seed: int,
) -> Iterator[list[Encoded]]:
    """PropBank and variants of annotated sentences again and again, `size` sentences at a time, without end."""
    rng = random.Random(seed)  # noqa: S311
    augmenter = Augmenter(annotated, rng)
    more = [augmenter.variant(example) for _ in range(VARIANTS) for example in annotated]
    pool = [encode(example, words, tags) for example in [*examples, *more]]
    while True:
        rng.shuffle(pool)
        for start in range(0, len(pool), CHUNKS * size):
            drawn = sorted(pool[start : start + CHUNKS * size], key=lambda item: len(item.tokens[0]))
            yield from _chunks(drawn, size, rng)


def sentence_batches(
    annotated: Sequence[Example],
    propbank: Sequence[Example],
    words: WordStates,
    tags: Sequence[str],
    config: SentencePool,
    size: int,
    seed: int,
) -> Iterator[list[Encoded]]:
    """Annotated sentences, their variants and some of PropBank, drawn by weight, without end."""
    rng = random.Random(seed)  # noqa: S311
    augmenter = Augmenter(annotated, rng)
    pool = [(example, config.annotated_weight) for example in annotated]
    pool += [(augmenter.variant(example), 1.0) for _ in range(config.variants) for example in annotated]
    some = rng.sample(propbank, min(config.propbank, len(propbank)))
    pool += [(example, config.propbank_weight) for example in some]
    encoded = [encode(example, words, tags) for example, _ in pool]
    weights = [weight for _, weight in pool]
    while True:
        drawn = rng.choices(encoded, weights, k=CHUNKS * size)
        drawn.sort(key=lambda item: len(item.tokens[0]) + rng.uniform(-1.5, 1.5))
        yield from _chunks(drawn, size, rng)


def _chunks(drawn: Sequence[Encoded], size: int, rng: random.Random) -> Iterator[list[Encoded]]:
    chunks = [list(drawn[i : i + size]) for i in range(0, len(drawn), size)]
    rng.shuffle(chunks)
    yield from chunks
