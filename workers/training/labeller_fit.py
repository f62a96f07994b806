"""Fitting the `light` role labeller's head: batches by length, conditional random field, averaged weights."""

from __future__ import annotations

import itertools
import math
import random
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import torch
import torch.nn.functional as F

from shared.text.bio import transition_scores
from shared.text.light import WordStates, surface_features
from shared.text.light_network import LightConfig, LightNetwork
from workers.training.labeller_data import Augmenter
from workers.training.labeller_grammar import Example, sentence


@dataclass(frozen=True)
class FitConfig:
    """How the head is trained."""

    steps: int = 1000
    batch: int = 24  # sentences
    learning_rate: float = 2e-3
    weight_decay: float = 0.05
    variants: int = 6  # augmented copies of each gold sentence
    grammar: int = 1000  # silver sentences
    gold_weight: float = 2.0
    grammar_weight: float = 0.7
    predicate_weight: float = 2.0
    average: float = 0.995


@dataclass(frozen=True)
class Encoded:
    """One sentence, ready for the network."""

    states: torch.Tensor  # (T, L, 384) float16
    surface: torch.Tensor  # (T, 3)
    predicates: tuple[int, ...]
    tags: torch.Tensor  # (frames, T)

    def __len__(self) -> int:
        return len(self.surface)


@dataclass(frozen=True)
class SentenceBatch:
    """B sentences with F frames among them, padded to T words."""

    states: torch.Tensor  # (B, T, L, 384)
    surface: torch.Tensor  # (B, T, 3)
    mask: torch.Tensor  # (B, T)
    is_predicate: torch.Tensor  # (B, T) float
    sentence: torch.Tensor  # (F,) row of the frame's sentence
    predicate: torch.Tensor  # (F,)
    tags: torch.Tensor  # (F, T), 0 on pads


def tag_set(examples: Sequence[Example]) -> tuple[str, ...]:
    """`O`, then B and I of every role, in order of name."""
    roles = sorted({a.role for example in examples for frame in example.frames for a in frame.arguments})
    return ("O", *(f"{kind}-{role}" for role in roles for kind in "BI"))


def encode(example: Example, states: WordStates, tags: Sequence[str]) -> Encoded:
    """Run MiniLM on a sentence and number its tags."""
    index = {tag: number for number, tag in enumerate(tags)}
    targets = torch.zeros(len(example.frames), len(example.words), dtype=torch.long)
    for row, frame in enumerate(example.frames):
        for a in frame.arguments:
            targets[row, a.start] = index[f"B-{a.role}"]
            targets[row, a.start + 1 : a.stop] = index[f"I-{a.role}"]
    return Encoded(
        states(example.words).half(),
        surface_features(example.words),
        tuple(frame.predicate for frame in example.frames),
        targets,
    )


def fit(
    gold: Sequence[Example],
    states: WordStates,
    network_config: LightConfig,
    config: FitConfig,
    seed: int,
    progress: Callable[[int, float], None] | None = None,
) -> LightNetwork:
    """Train a head on `gold`, its variants and the grammar; the weights are an average over the run.

    Args:
        progress: called with the step and its loss.
    """
    torch.manual_seed(seed)
    rng = random.Random(seed)  # noqa: S311
    network = LightNetwork(network_config).train()
    average = [weight.detach().clone() for weight in network.parameters()]
    allowed = torch.tensor(transition_scores(network_config.tags), dtype=torch.float32)
    optimizer = torch.optim.AdamW(network.parameters(), lr=config.learning_rate, weight_decay=config.weight_decay)
    batches = _batches(gold, states, network_config, config, rng)
    for step, batch in enumerate(itertools.islice(batches, config.steps)):
        done = step / config.steps
        for parameters in optimizer.param_groups:
            parameters["lr"] = config.learning_rate * _schedule(done)
        loss = _loss(network, batch, allowed, config.predicate_weight)
        optimizer.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        optimizer.step()
        decay = min(config.average, (2 + step) / (11 + step))
        for mean, weight in zip(average, network.parameters(), strict=True):
            mean.lerp_(weight.detach(), 1 - decay)
        if progress:
            progress(step, float(loss.detach()))
    with torch.no_grad():
        for weight, mean in zip(network.parameters(), average, strict=True):
            weight.copy_(mean)
    return network.eval()


def _schedule(done: float) -> float:
    """Warm-up over 5 % of the steps, then a cosine to zero."""
    return min(1.0, done / 0.05 + 1e-3) * (0.5 + 0.5 * math.cos(math.pi * done))


def _batches(
    gold: Sequence[Example],
    states: WordStates,
    network: LightConfig,
    config: FitConfig,
    rng: random.Random,
) -> Iterator[SentenceBatch]:
    augmenter = Augmenter(gold, rng)
    pool = [(example, config.gold_weight) for example in gold]
    pool += [(augmenter.variant(example), 1.0) for _ in range(config.variants) for example in gold]
    pool += [(augmenter.noise(sentence(rng)), config.grammar_weight) for _ in range(config.grammar)]
    encoded = [encode(example, states, network.tags) for example, _ in pool]
    weights = [weight for _, weight in pool]
    while True:
        drawn = rng.choices(encoded, weights, k=16 * config.batch)
        lengths = sorted((len(item) + rng.uniform(-1.5, 1.5), n) for n, item in enumerate(drawn))
        order = [drawn[n] for _, n in lengths]  # sentences of like length together: little padding
        chunks = [order[i : i + config.batch] for i in range(0, len(order), config.batch)]
        rng.shuffle(chunks)
        yield from map(collate, chunks)


def collate(items: Sequence[Encoded]) -> SentenceBatch:
    """Pad sentences to the longest."""
    rows, length = len(items), max(len(item) for item in items)
    states = torch.zeros(rows, length, *items[0].states.shape[1:])
    surface = torch.zeros(rows, length, items[0].surface.shape[1], dtype=torch.long)
    mask = torch.zeros(rows, length, dtype=torch.bool)
    is_predicate = torch.zeros(rows, length)
    frames = [(row, predicate) for row, item in enumerate(items) for predicate in item.predicates]
    tags = torch.zeros(len(frames), length, dtype=torch.long)
    at = 0
    for row, item in enumerate(items):
        words = len(item)
        states[row, :words], surface[row, :words], mask[row, :words] = item.states.float(), item.surface, True
        is_predicate[row, list(item.predicates)] = 1.0
        tags[at : at + len(item.tags), :words] = item.tags
        at += len(item.tags)
    sentences = torch.tensor([row for row, _ in frames], dtype=torch.long)
    predicates = torch.tensor([predicate for _, predicate in frames], dtype=torch.long)
    return SentenceBatch(states, surface, mask, is_predicate, sentences, predicates, tags)


def _loss(network: LightNetwork, batch: SentenceBatch, allowed: torch.Tensor, predicate_weight: float) -> torch.Tensor:
    hidden = network.read(batch.states, batch.surface, batch.mask)
    logits = network.predicate_logits(hidden)[batch.mask]
    loss = predicate_weight * F.binary_cross_entropy_with_logits(logits, batch.is_predicate[batch.mask])
    if not len(batch.predicate):
        return loss
    mask = batch.mask[batch.sentence]
    emissions = network.tag_logits(hidden[batch.sentence], batch.predicate, mask)
    return loss + crf_loss(emissions, batch.tags, mask, network.transitions, allowed).sum() / mask.sum()


def crf_loss(
    emissions: torch.Tensor, tags: torch.Tensor, mask: torch.Tensor, transitions: torch.Tensor, allowed: torch.Tensor
) -> torch.Tensor:
    """Negative log-likelihood (F,) of tag sequences under a linear-chain CRF whose forbidden steps have no mass.

    Args:
        emissions: (F, T, K).
        tags: (F, T), 0 on pads; mask: (F, T), the first word of each is real.
        transitions: (K, K) learned, from and to; allowed: (K, K), 0 or a large negative number.
    """
    rows = torch.arange(len(tags))
    steps = transitions + allowed
    start = torch.where(allowed.amin(dim=0) < -1, allowed.amin(), 0.0)  # tags some step is barred to are I- tags
    total = emissions[:, 0] + start
    path = emissions[rows, 0, tags[:, 0]]
    for t in range(1, tags.shape[1]):
        real = mask[:, t]
        following = torch.logsumexp(total[:, :, None] + steps, dim=1) + emissions[:, t]
        total = torch.where(real[:, None], following, total)
        score = emissions[rows, t, tags[:, t]] + transitions[tags[:, t - 1], tags[:, t]]
        path = path + torch.where(real, score, 0.0)
    return torch.logsumexp(total, dim=1) - path
