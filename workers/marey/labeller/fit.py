"""Fit the `light` role labeller: MiniLM's updates and the head together, a random field, averaged weights."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import torch
import torch.nn.functional as F
from torch import Tensor

from marey.bundles import Bundle
from marey.labeller.adapter import AdaptedMiniLM, TokenBatch, token_batch
from marey.labeller.sentences import Example
from marey.labeller.weights import Weights
from marey.text.bio import transition_scores
from marey.text.light import WordStates, surface_features
from marey.text.light_network import LightConfig, LightNetwork

SMOOTHING_SENTENCES = 150
"""Sentences, at least, by which the divisors for int8 are found after the training (`AdaptedMiniLM.updates`)."""


@dataclass(frozen=True)
class FitConfig:
    """Hyperparameters of the head and MiniLM's updates; the defaults are for annotated sentences."""

    steps: int = 450
    batch: int = 24  # sentences
    learning_rate: float = 1e-3  # of the head
    adapter_rate: float = 5e-4
    rank: int = 16
    weight_decay: float = 0.05  # of the head
    predicate_weight: float = 2.0
    average: float = 0.99


PROPBANK_FIT = FitConfig(steps=2500, batch=32, learning_rate=1.5e-3, adapter_rate=1e-3)


@dataclass(frozen=True)
class Encoded:
    """One sentence of T words, ready for the network."""

    tokens: tuple[list[int], Tensor]  # as `WordStates.tokens` gives them
    surface: Tensor  # (T, 3)
    predicates: tuple[int, ...]
    tags: Tensor  # (frames, T)

    def __len__(self) -> int:
        return len(self.surface)


@dataclass(frozen=True)
class SentenceBatch:
    """B sentences with F frames among them, padded to T words."""

    tokens: TokenBatch
    surface: Tensor  # (B, T, 3)
    mask: Tensor  # (B, T)
    is_predicate: Tensor  # (B, T) float
    sentence: Tensor  # (F,) row of the frame's sentence
    predicate: Tensor  # (F,)
    tags: Tensor  # (F, T), 0 on pads


def roles_of(examples: Sequence[Example]) -> set[str]:
    """The roles that occur."""
    return {a.role for example in examples for frame in example.frames for a in frame.arguments}


def tag_set(roles: set[str]) -> tuple[str, ...]:
    """`O`, then B and I of every role, in order of name."""
    return ("O", *(f"{kind}-{role}" for role in sorted(roles) for kind in "BI"))


def encode(example: Example, words: WordStates, tags: Sequence[str]) -> Encoded:
    """Find a sentence's tokens and number its tags."""
    index = {tag: number for number, tag in enumerate(tags)}
    targets = torch.zeros(len(example.frames), len(example.words), dtype=torch.long)
    for row, frame in enumerate(example.frames):
        for a in frame.arguments:
            targets[row, a.start] = index[f"B-{a.role}"]
            targets[row, a.start + 1 : a.stop] = index[f"I-{a.role}"]
    ids, pooling = words.tokens(example.words)
    predicates = tuple(frame.predicate for frame in example.frames)
    return Encoded((ids, torch.as_tensor(pooling)), surface_features(example.words), predicates, targets)


def fit(
    batches: Iterator[list[Encoded]],
    minilm: Bundle,
    network_config: LightConfig,
    config: FitConfig,
    seed: int,
    start: Weights | None = None,
    progress: Callable[[int, float], None] | None = None,
) -> Weights:
    """Train on `batches`; the weights are an average over the last part of the run.

    Args:
        batches: at least `config.steps`, and those that int8 is prepared with.
        minilm: the bundle of MiniLM.
        network_config: sizes of the head, and its tags.
        config: hyperparameters.
        seed: of the initial weights.
        start: initial weights; None = MiniLM unchanged, and a random head.
        progress: called with the step and its loss.
    """
    torch.manual_seed(seed)
    network = LightNetwork(network_config).train()
    if start:
        network.load_state_dict(start.head)
    adapted = AdaptedMiniLM(minilm, config.rank, start.updates if start else None)
    weights = [*network.parameters(), *adapted.parameters()]
    average = _Average(weights, config.average)
    optimizer = _optimizer(network, adapted, config)
    allowed = torch.tensor(transition_scores(network_config.tags), dtype=torch.float32)
    for step in range(config.steps):
        for parameters, rate in zip(optimizer.param_groups, (config.learning_rate, config.adapter_rate), strict=True):
            parameters["lr"] = rate * _schedule(step / config.steps)
        batch = collate(next(batches))
        states = adapted(batch.tokens, network_config.layers)
        loss = _loss(network, states, batch, allowed, config.predicate_weight)
        optimizer.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(weights, 1.0)
        optimizer.step()
        average.add(step)
        if progress:
            progress(step, float(loss.detach()))
    average.set_weights()
    seen: list[Encoded] = []
    while len(seen) < SMOOTHING_SENTENCES:
        seen += next(batches)
    updates = adapted.updates([token_batch([item.tokens]) for item in seen])
    return Weights(network_config, network.eval().state_dict(), updates)


def _optimizer(network: LightNetwork, adapted: AdaptedMiniLM, config: FitConfig) -> torch.optim.AdamW:
    """Return an optimizer with two groups of parameters: the head, and the updates of MiniLM without weight decay."""
    groups = [
        {"params": list(network.parameters()), "weight_decay": config.weight_decay},
        {"params": list(adapted.parameters()), "weight_decay": 0.0},
    ]
    return torch.optim.AdamW(groups, lr=config.learning_rate)


class _Average:
    """Exponential moving average of weights; its decay grows to `most` during the first steps."""

    def __init__(self, weights: Sequence[Tensor], most: float) -> None:
        self._weights, self._most = weights, most
        self._means = [weight.detach().clone() for weight in weights]

    def add(self, step: int) -> None:
        """Take in the weights after a step."""
        decay = min(self._most, (2 + step) / (11 + step))
        for mean, weight in zip(self._means, self._weights, strict=True):
            mean.lerp_(weight.detach(), 1 - decay)

    def set_weights(self) -> None:
        """Put the average in place of the weights."""
        with torch.no_grad():
            for weight, mean in zip(self._weights, self._means, strict=True):
                weight.copy_(mean)


def _schedule(done: float) -> float:
    """Warm-up over 5 % of the steps, then a cosine to zero."""
    return min(1.0, done / 0.05 + 1e-3) * (0.5 + 0.5 * math.cos(math.pi * done))


def collate(items: Sequence[Encoded]) -> SentenceBatch:
    """Pad sentences to the longest."""
    rows, length = len(items), max(len(item) for item in items)
    surface = torch.zeros(rows, length, items[0].surface.shape[1], dtype=torch.long)
    mask = torch.zeros(rows, length, dtype=torch.bool)
    is_predicate = torch.zeros(rows, length)
    frames = [(row, predicate) for row, item in enumerate(items) for predicate in item.predicates]
    tags = torch.zeros(len(frames), length, dtype=torch.long)
    at = 0
    for row, item in enumerate(items):
        words = len(item)
        surface[row, :words], mask[row, :words] = item.surface, True
        is_predicate[row, list(item.predicates)] = 1.0
        tags[at : at + len(item.tags), :words] = item.tags
        at += len(item.tags)
    sentences = torch.tensor([row for row, _ in frames], dtype=torch.long)
    predicates = torch.tensor([predicate for _, predicate in frames], dtype=torch.long)
    tokens = token_batch([item.tokens for item in items])
    return SentenceBatch(tokens, surface, mask, is_predicate, sentences, predicates, tags)


def _loss(
    network: LightNetwork, states: Tensor, batch: SentenceBatch, allowed: Tensor, predicate_weight: float
) -> Tensor:
    """Loss of predicates, and of the tags of frames with given predicates."""
    hidden = network.read(states, batch.surface, batch.mask)
    logits = network.predicate_logits(hidden)[batch.mask]
    loss = predicate_weight * F.binary_cross_entropy_with_logits(logits, batch.is_predicate[batch.mask])
    if not len(batch.predicate):
        return loss
    mask = batch.mask[batch.sentence]
    emissions = network.tag_logits(hidden[batch.sentence], batch.predicate, mask)
    return loss + crf_loss(emissions, batch.tags, mask, network.transitions, allowed).sum() / mask.sum()


def crf_loss(emissions: Tensor, tags: Tensor, mask: Tensor, transitions: Tensor, allowed: Tensor) -> Tensor:
    """Negative log-likelihood (F,) of tag sequences under a linear-chain CRF whose forbidden steps have no mass.

    Args:
        emissions: (F, T, K).
        tags: (F, T), 0 on pads; mask: (F, T), the first word of each is real.
        transitions: (K, K) learned, from and to; allowed: (K, K), 0 or a large negative number.
    """
    rows = torch.arange(len(tags))
    steps = transitions + allowed
    # A sentence cannot begin with an I- tag: those are the tags that some other tag must not be followed by.
    start = torch.where(allowed.amin(dim=0) < -1, allowed.amin(), 0.0)
    total = emissions[:, 0] + start
    path = emissions[rows, 0, tags[:, 0]]
    for t in range(1, tags.shape[1]):
        real = mask[:, t]
        following = torch.logsumexp(total[:, :, None] + steps, dim=1) + emissions[:, t]
        total = torch.where(real[:, None], following, total)
        score = emissions[rows, t, tags[:, t]] + transitions[tags[:, t - 1], tags[:, t]]
        path = path + torch.where(real, score, 0.0)
    return torch.logsumexp(total, dim=1) - path
