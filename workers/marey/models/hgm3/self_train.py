"""Self-training (ours): motions that a finished bundle generates from training captions and the checker accepts.

    marey train self-train hgm3-starter DATA --run RUN

Most captions are sequences, which captures rarely show and the model follows least; a failed caption is tried again.
Accepted motions are written to the run folder, where the masked stage reads them: one round of Gulcehre et al. 2023,
"Reinforced Self-Training (ReST) for Language Modeling".
"""

from __future__ import annotations

from collections import Counter, defaultdict, deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from marey.checks.judge import Expectation, judge
from marey.checks.rates import expectations
from marey.data.manifest import Clip
from marey.data.prepared import PreparedData
from marey.generation.export import finish
from marey.generation.port import Request
from marey.models.hgm3.generate import Generator
from marey.text.pipeline import TextPipeline
from marey.training.drawn import Drawn

ACTS = {1: 0.2, 2: 0.6, 3: 0.2}
"""Shares of the captions by their number of actions."""
TRIES = 3

Expected = tuple[Expectation, ...]


@dataclass(frozen=True)
class _Try:
    """A caption of a clip, with the number of its failed tries."""

    clip: int
    caption: str
    expected: Expected
    failed: int = 0


def self_train(
    generator: Generator,
    pipeline: TextPipeline,
    prepared: PreparedData,
    captions: int,
    seed: int = 0,
    progress: Callable[[str], None] = lambda line: None,
) -> Drawn:
    """Generate motions for training captions, and keep those that the checker accepts.

    Args:
        generator: the loaded bundle.
        pipeline: its text pipeline.
        prepared: the data whose captions are used.
        captions: number of captions, each tried up to `TRIES` times.
        seed: of the choice and of the motions.
        progress: called now and then with a line about accepted motions.
    """
    rng = np.random.default_rng(seed)
    waiting = deque(_chosen(prepared.clips, captions, rng))
    settings, kept, drawn = generator.settings({}), list[tuple[int, torch.Tensor]](), 0
    asked, obeyed = Counter[int](), Counter[int]()
    while waiting:
        some = [waiting.popleft() for _ in range(min(generator.batch, len(waiting)))]
        features = pipeline.features([each.caption for each in some])
        requests = [Request(text, int(rng.integers(2**31))) for text in features]
        for each, request, made in zip(some, requests, generator.generate(requests, settings), strict=True):
            assert made is not None  # nothing drops rows here
            clip = finish(generator, request, made, settings)
            passed = judge(clip.joints, clip.fps, each.expected).passed
            asked[len(each.expected)] += 1
            obeyed[len(each.expected)] += passed
            if passed:
                kept.append((each.clip, torch.from_numpy(made.tokens.astype(np.int64)).T))
            elif each.failed + 1 < TRIES:
                waiting.append(_Try(each.clip, each.caption, each.expected, each.failed + 1))
        drawn += len(some)
        shares = ", ".join(f"{obeyed[acts]}/{asked[acts]} of {acts}" for acts in sorted(asked))
        progress(f"{drawn} drawn, {len(waiting)} to come; accepted by number of actions: {shares}")
    return Drawn.of(kept)


def _chosen(clips: Sequence[Clip], count: int, rng: np.random.Generator) -> list[_Try]:
    """Choose captions of training clips whose actions can be checked; rare pairs of actions more often than they
    occur."""
    groups: dict[int, dict[Expected, list[int]]] = defaultdict(lambda: defaultdict(list))
    for number, clip in enumerate(clips):
        expected = expectations(clip.acts, clip.sides)
        if clip.split == "train" and clip.captions and expected is not None and len(expected) in ACTS:
            groups[len(expected)][expected].append(number)
    shares = np.array([ACTS[acts] for acts in groups])
    chosen: list[_Try] = []
    for acts in rng.choice(list(groups), count, p=shares / shares.sum()) if groups else ():
        weights = np.sqrt([len(members) for members in groups[acts].values()])
        expected = list(groups[acts])[rng.choice(len(weights), p=weights / weights.sum())]
        clip = int(rng.choice(groups[acts][expected]))
        chosen.append(_Try(clip, str(rng.choice(clips[clip].captions)), expected))
    return chosen


def self_train_into(
    generator: Generator,
    pipeline: TextPipeline,
    prepared: PreparedData,
    run: Path,
    *,
    captions: int,
    seed: int,
    progress: Callable[[str], None],
) -> int:
    """Self-train on `captions` captions, write accepted motions to the run folder, and return their number.

    Raises:
        NotFound, InvalidInput: the run has no tokenizer, or another one than the bundle.
    """
    drawn = self_train(generator, pipeline, prepared, captions, seed, progress)
    drawn.write(run, generator.networks.tokenizer, prepared)
    return len(drawn.clips)
