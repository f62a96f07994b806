"""Prompt adherence of a MOGO bundle, in whole motions and in live streams.

    marey eval adherence mogo-starter --seeds 3 --steers 100 --walks 8 -o report

Whole motions are judged as any model's (`marey.training.adherence`). `--steers` are live sessions: 4 s of one
evaluation prompt, then another prompt with another action. The new prompt is followed within 2 s if a stretch that
begins in these 2 s and ends 6 s after the steer shows its action. `--walks` are sessions of one walking prompt whose
frames 1,900 to 2,000 must still walk. Joints come from the live frames by forward kinematics, as in a client.
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from marey.checks.judge import CheckVerdict, judge
from marey.checks.prompts import HeldOutPrompt
from marey.models.mogo.generate import Generator
from marey.models.mogo.live import LiveSessionPool
from marey.motion.kinematics import Array, forward_kinematics
from marey.streams.frames import Frame
from marey.text.features import TextFeatures
from marey.training.adherence import pipeline_of

SESSIONS = 16
BEFORE, AFTER, WITHIN = 4.0, 6.0, 2.0  # seconds
BEGINNINGS = 5  # moments within which the new action is searched
LONG, SEEN = 2000, 100  # frames of a walk, and how many of the last ones are judged


@dataclass(frozen=True)
class Streamed:
    """A live session with the checker's verdict."""

    prompts: tuple[str, ...]
    seed: int
    passed: bool
    reason: str


def pairs_of(prompts: Sequence[HeldOutPrompt], count: int) -> list[tuple[HeldOutPrompt, HeldOutPrompt]]:
    """Return `count` pairs of prompts of one action each, with different actions; the same at every call."""
    rng = random.Random(0)  # noqa: S311
    single = [p for p in prompts if len(p.expected) == 1 and not p.separate]
    pairs: list[tuple[HeldOutPrompt, HeldOutPrompt]] = []
    while len(pairs) < count:
        first, second = rng.sample(single, 2)
        if (first.expected[0].act, first.expected[0].side) != (second.expected[0].act, second.expected[0].side):
            pairs.append((first, second))
    return pairs


def steered(joints: Array, fps: float, expected: HeldOutPrompt) -> CheckVerdict:
    """Judge if a stretch that begins within 2 s of the steer shows the expected action.

    Args:
        joints: (T, 22, 3) from the steer on.
        fps: frames a second.
        expected: the new prompt.
    """
    verdicts = [
        judge(joints[round(at * fps) :], fps, expected.expected) for at in np.linspace(0, WITHIN, BEGINNINGS).tolist()
    ]
    return next((v for v in verdicts if v.passed), verdicts[-1])


def steered_sessions(
    generator: Generator, prompts: Sequence[HeldOutPrompt], texts: dict[str, TextFeatures], count: int
) -> list[Streamed]:
    """Run `count` sessions, each steered from one action of these prompts to another."""
    pairs = pairs_of(prompts, count)
    fps = generator.limits.fps
    found: list[Streamed] = []
    for start in range(0, count, SESSIONS):
        some = pairs[start : start + SESSIONS]
        pool = LiveSessionPool(generator, len(some))
        names = [pool.start(texts[first.text], start + k) for k, (first, _) in enumerate(some)]
        played(pool, names, round(BEFORE * fps))
        for name, (_, second) in zip(names, some, strict=True):
            pool.steer(name, texts[second.text])
        joints = played(pool, names, round(AFTER * fps))
        for k, (first, second) in enumerate(some):
            verdict = steered(joints[k], fps, second)
            found.append(Streamed((first.text, second.text), start + k, verdict.passed, verdict.reason))
    return found


def walking_sessions(
    generator: Generator, prompts: Sequence[HeldOutPrompt], texts: dict[str, TextFeatures], count: int
) -> list[Streamed]:
    """Run `count` sessions that walk for 2,000 frames."""
    walking = [p for p in prompts if p.group == "walk"]
    chosen = [walking[k % len(walking)] for k in range(count)]
    pool = LiveSessionPool(generator, count)
    names = [pool.start(texts[p.text], seed) for seed, p in enumerate(chosen)]
    joints = played(pool, names, LONG)[:, -SEEN:]
    verdicts = [judge(joints[k], generator.limits.fps, p.expected) for k, p in enumerate(chosen)]
    return [Streamed((p.text,), k, v.passed, v.reason) for k, (p, v) in enumerate(zip(chosen, verdicts, strict=True))]


def played(pool: LiveSessionPool, names: Sequence[int], frames: int) -> Array:
    """Return joints (sessions, frames, J, 3) of the next frames of all sessions."""
    steps = [pool.step() for _ in range(frames)]
    return np.stack([_joints(pool, [step[name].frame for step in steps]) for name in names])


def _joints(pool: LiveSessionPool, shown: Sequence[Frame]) -> Array:
    rotations, root = (np.stack([getattr(f, part) for f in shown]) for part in ("rotations", "root"))
    return forward_kinematics(pool.skeleton, rotations, root)


def judge_streams(
    generator: Generator, prompts: Sequence[HeldOutPrompt], *, steers: int, walks: int
) -> dict[str, list[Streamed]]:
    """Judge `steers` live sessions that are steered, and `walks` that walk for 2,000 frames; by title."""
    words = [p.text for p in prompts]
    texts = dict(zip(words, pipeline_of(generator).features(words), strict=True))
    return {
        "new prompt followed within 2 s of a steer": steered_sessions(generator, prompts, texts, steers),
        "still walking at frame 2,000": walking_sessions(generator, prompts, texts, walks) if walks else [],
    }
