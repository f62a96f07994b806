"""Self-training (ours): motions that a finished bundle generates from training captions and the selector accepts.

    marey train self-train hgm3-open DATA --run RUN

Captions of sequences, which captures rarely show and the model follows least, are among them; a failed caption is tried
again. Accepted motions are written to the run folder, where the masked stage reads them: one round of Gulcehre et al.
2023, "Reinforced Self-Training (ReST) for Language Modeling".
"""

from __future__ import annotations

from collections import Counter, defaultdict, deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch

from marey.data.manifest import Clip
from marey.data.prepared import PreparedData
from marey.data.sampling import classes_of
from marey.generation.export import finish
from marey.generation.port import Request
from marey.models.hgm3.generate import Generator
from marey.quality.record import OF_PROMPT, SHOWN, read_quality
from marey.selector.matching import Step, WantedAction, side_of
from marey.selector.records import match_steps
from marey.selector.rules import RULES
from marey.text.pipeline import TextPipeline
from marey.training.generated_clips import Drawn, DrawnMotion
from marey.vocabulary.entries import load_vocabulary

ACTS = {1: 0.6, 2: 0.3, 3: 0.1}
"""Shares of the captions by their number of actions."""
TRIES = 3

_OF_GRAMMAR = {"dash": "run", "raise": "raise-arm", "walk_back": "walk-backward"}

Steps = tuple[Step, ...]


@dataclass(frozen=True)
class _Try:
    """A caption of a clip, with the number of its failed tries."""

    clip: int
    caption: int
    text: str
    steps: Steps
    failed: int = 0


def self_train(
    generator: Generator,
    pipeline: TextPipeline,
    prepared: PreparedData,
    captions: int,
    seed: int = 0,
    progress: Callable[[str], None] = lambda line: None,
) -> Drawn:
    """Generate motions for training captions, and keep those that show the actions of the captions' clips, by the
    selector, and have no flag in their quality record.

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
    settings, kept, drawn = generator.settings({}), list[DrawnMotion](), 0
    asked, obeyed = Counter[int](), Counter[int]()
    while waiting:
        some = [waiting.popleft() for _ in range(min(generator.batch, len(waiting)))]
        features = pipeline.features([each.text for each in some])
        requests = [Request(text, int(rng.integers(2**31))) for text in features]
        for each, request, made in zip(some, requests, generator.generate(requests, settings), strict=True):
            assert made is not None  # nothing drops rows here
            clip = finish(generator, request, made, settings)
            quality = read_quality(clip.manifest)
            shows = (match_steps(clip, each.steps).value or 0.0) >= SHOWN
            passed = shows and (quality is None or set(quality.flags) <= OF_PROMPT)
            asked[len(each.steps)] += 1
            obeyed[len(each.steps)] += passed
            if passed:
                tokens = torch.from_numpy(made.tokens.astype(np.int64)).T
                kept.append(DrawnMotion(each.clip, each.caption, tokens))
            elif each.failed + 1 < TRIES:
                waiting.append(replace(each, failed=each.failed + 1))
        drawn += len(some)
        shares = ", ".join(f"{obeyed[acts]}/{asked[acts]} of {acts}" for acts in sorted(asked))
        progress(f"{drawn} drawn, {len(waiting)} to come; accepted by number of actions: {shares}")
    return Drawn.of(kept)


def _chosen(clips: Sequence[Clip], count: int, rng: np.random.Generator) -> list[_Try]:
    """Choose captions of training clips whose actions can be checked; rare sequences of actions more often than they
    occur."""
    by_id = {clip.id: clip for clip in clips}
    groups: dict[int, dict[Steps, list[int]]] = defaultdict(lambda: defaultdict(list))
    for number, clip in enumerate(clips):
        steps = _steps(clip, by_id)
        if clip.split == "train" and clip.captions and steps is not None and len(steps) in ACTS:
            groups[len(steps)][steps].append(number)
    shares = np.array([ACTS[acts] for acts in groups])
    chosen: list[_Try] = []
    for acts in rng.choice(list(groups), count, p=shares / shares.sum()) if groups else ():
        weights = np.sqrt([len(members) for members in groups[acts].values()])
        steps = list(groups[acts])[rng.choice(len(weights), p=weights / weights.sum())]
        clip = int(rng.choice(groups[acts][steps]))
        caption = int(rng.integers(len(clips[clip].captions)))
        text = clips[clip].captions[caption]
        chosen.append(_Try(clip, caption, text, _sided(steps, text)))
    return chosen


def _steps(clip: Clip, by_id: Mapping[str, Clip]) -> Steps | None:
    """Return the actions of a clip in their order, without sides; None if there is no rule for one of them."""
    parts = [by_id.get(name) for name in clip.spliced] if len(clip.acts) > 1 else [clip]
    if None in parts:
        return None
    found = [action for part in parts if part is not None for action in _actions(part)]
    return tuple((WantedAction(action),) for action in found) if all(action in RULES for action in found) else None


def _actions(clip: Clip) -> tuple[str, ...]:
    """Return the actions of a clip that is no sequence, by the vocabulary's ids where it has them."""
    named = classes_of(clip)
    known = load_vocabulary().actions
    return named if all(name in known for name in named) else tuple(_OF_GRAMMAR.get(act, act) for act in clip.acts)


def _sided(steps: Steps, caption: str) -> Steps:
    """Give a single action the side that its caption names."""
    if len(steps) != 1:
        return steps
    (wanted,) = steps[0]
    side = side_of(caption) if load_vocabulary().actions[wanted.action].sided else ""
    return ((WantedAction(wanted.action, side),),)


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
