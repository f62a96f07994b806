"""Does a bundle of MOGO do what the prompts say, in whole motions and while it streams?

    marey eval adherence mogo-starter --seeds 3 --steers 100 --walks 8 -o report

Whole motions are judged as any model's (`marey.training.adherence`). `--steers` are live sessions: 4 s of one
evaluation prompt, then another that asks for another act. It is obeyed within 2 s when a stretch that begins in these
2 s and ends 6 s after the steer does what was asked. `--walks` are sessions of one walking prompt whose frames 1,900 to
2,000 must still walk. Joints come from the live frames, by forward kinematics, as a client's do.
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from marey.checks.judge import Verdict, judge
from marey.checks.prompts import EvaluationPrompt
from marey.models.mogo.generate import Generator
from marey.models.mogo.live import LiveSessionPool
from marey.motion.kinematics import Array, forward_kinematics
from marey.streams.frames import Frame
from marey.text.features import TextFeatures
from marey.training.adherence import pipeline_of

SESSIONS = 16
BEFORE, AFTER, WITHIN = 4.0, 6.0, 2.0  # seconds
BEGINNINGS = 5  # moments within which the new act is looked for
LONG, SEEN = 2000, 100  # frames of a walk, and how many of its last are judged


@dataclass(frozen=True)
class Streamed:
    """A live session and what the checker says of it."""

    prompts: tuple[str, ...]
    seed: int
    passed: bool
    reason: str


def pairs_of(prompts: Sequence[EvaluationPrompt], count: int) -> list[tuple[EvaluationPrompt, EvaluationPrompt]]:
    """So many pairs of prompts of one act each, which ask for different things; the same at every call."""
    rng = random.Random(0)  # noqa: S311
    single = [p for p in prompts if len(p.expected) == 1 and not p.separate]
    pairs: list[tuple[EvaluationPrompt, EvaluationPrompt]] = []
    while len(pairs) < count:
        first, second = rng.sample(single, 2)
        if (first.expected[0].act, first.expected[0].side) != (second.expected[0].act, second.expected[0].side):
            pairs.append((first, second))
    return pairs


def steered(joints: Array, fps: float, expected: EvaluationPrompt) -> Verdict:
    """Whether a stretch that begins within 2 s of the steer does what is expected.

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
    generator: Generator, prompts: Sequence[EvaluationPrompt], texts: dict[str, TextFeatures], count: int
) -> list[Streamed]:
    """Steer so many sessions from one act of these prompts to another."""
    pairs = pairs_of(prompts, count)
    fps = generator.limits.fps
    found: list[Streamed] = []
    for start in range(0, count, SESSIONS):
        some = pairs[start : start + SESSIONS]
        room = LiveSessionPool(generator, len(some))
        names = [room.start(texts[first.text], start + k) for k, (first, _) in enumerate(some)]
        played(room, names, round(BEFORE * fps))
        for name, (_, second) in zip(names, some, strict=True):
            room.steer(name, texts[second.text])
        joints = played(room, names, round(AFTER * fps))
        for k, (first, second) in enumerate(some):
            verdict = steered(joints[k], fps, second)
            found.append(Streamed((first.text, second.text), start + k, verdict.passed, verdict.reason))
    return found


def walking_sessions(
    generator: Generator, prompts: Sequence[EvaluationPrompt], texts: dict[str, TextFeatures], count: int
) -> list[Streamed]:
    """Walk for 2,000 frames, so many times."""
    walking = [p for p in prompts if p.group == "walk"]
    chosen = [walking[k % len(walking)] for k in range(count)]
    room = LiveSessionPool(generator, count)
    names = [room.start(texts[p.text], seed) for seed, p in enumerate(chosen)]
    joints = played(room, names, LONG)[:, -SEEN:]
    verdicts = [judge(joints[k], generator.limits.fps, p.expected) for k, p in enumerate(chosen)]
    return [Streamed((p.text,), k, v.passed, v.reason) for k, (p, v) in enumerate(zip(chosen, verdicts, strict=True))]


def played(room: LiveSessionPool, names: Sequence[int], frames: int) -> Array:
    """Joints (sessions, frames, J, 3) of the next frames of all sessions."""
    steps = [room.step() for _ in range(frames)]
    return np.stack([_joints(room, [step[name].frame for step in steps]) for name in names])


def _joints(room: LiveSessionPool, shown: Sequence[Frame]) -> Array:
    rotations, root = (np.stack([getattr(f, part) for f in shown]) for part in ("rotations", "root"))
    return forward_kinematics(room.skeleton, rotations, root)


def judge_streams(
    generator: Generator, prompts: Sequence[EvaluationPrompt], *, steers: int, walks: int
) -> dict[str, list[Streamed]]:
    """Judge so many live sessions that are steered, and so many that walk for 2,000 frames; by title."""
    words = [p.text for p in prompts]
    texts = dict(zip(words, pipeline_of(generator).features(words), strict=True))
    return {
        "obeyed within 2 s of a steer": steered_sessions(generator, prompts, texts, steers),
        "still walking at frame 2,000": walking_sessions(generator, prompts, texts, walks) if walks else [],
    }
