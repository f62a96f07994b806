"""Edits by a model: adherence of new frames, jerk around their seams, and time beside that of a generation.

Development prompts of single actions that the bundle supports are painted into motions of 9 s, appended to them, and
put between two of them, and judged by the referee beside motions of the prompt alone. Jerk is that of all joints within
half a second of a seam, beside the same in the middle of real clips with `MAREY_PREPARED=folder`.

    OMP_NUM_THREADS=1 MAREY_PREPARED=prepared python -m benchmarks edits
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.harness import measure, table
from marey.bundles import choose_bundle
from marey.data.prepared import PreparedData
from marey.editing.judge import judged
from marey.generate import LocalModel, load
from marey.motion import MotionClip
from marey.motion.finish import finish_motion
from marey.referee import Body
from marey.referee.adherence import judge_trial
from marey.referee.prompts import ActionPrompt, development_prompts

BUNDLE = os.environ.get("MAREY_BUNDLE", "hgm3-open")
SEEDS = (0, 1)
HOSTS = ("a person walks forward", "a person stands idle", "a person walks in a circle")
"""Prompts of the motions that are edited."""
START, END = 2.5, 6.5
"""Range that is painted, in seconds."""
NEAR = 0.5
"""Seconds on each side of a seam."""
CLIPS = 300
"""Real clips."""
Window = tuple[float, float]
"""Peak and mean of the jerk, m/s³."""


def main() -> None:
    """Print adherence, jerk and times."""
    model = load(BUNDLE, threads=1)
    actions = choose_bundle(BUNDLE).manifest.actions
    known = set(actions.supported if actions else ())
    prompts = [each for each in development_prompts() if len(each.actions) == 1 and each.actions[0] in known]
    hosts = model.generate(HOSTS, seed=5, seconds=9)
    print(f"{BUNDLE}, {len(prompts)} prompts, {len(SEEDS)} seeds\n")
    print("| | adherence | peak jerk, m/s³ | mean jerk, m/s³ |\n|---|---|---|---|")
    row("alone", *judge(prompts, partial(alone, model)))
    row("repaint of 4 s", *judge(prompts, partial(repainted, model, hosts)))
    row("extension by 4 s", *judge(prompts, partial(extended, model, hosts)))
    row("4 s between two motions", *judge(prompts, partial(between, model, hosts)))
    if folder := os.environ.get("MAREY_PREPARED"):
        row("real clips, in their middle", [], [*real(Path(folder))])
    print()
    time_edits(model)


def judge(
    prompts: Sequence[ActionPrompt], make: Callable[[ActionPrompt, int], tuple[MotionClip, int, int, Sequence[int]]]
) -> tuple[list[bool], list[Window]]:
    """Return for each prompt and seed whether the referee passes the new frames, and the jerk around their seams."""
    passed: list[bool] = []
    windows: list[Window] = []
    for seed in SEEDS:
        for prompt in prompts:
            clip, first, end, seams = make(prompt, seed)
            joints = clip.joints[first:end] - clip.joints[first, 0] * np.array([1, 0, 1], np.float32)
            passed.append(judge_trial(prompt, seed, Body(joints, clip.fps)).passed)
            windows += [window(clip.joints, clip.fps, seam) for seam in seams]
    return passed, windows


def alone(model: LocalModel, prompt: ActionPrompt, seed: int) -> tuple[MotionClip, int, int, Sequence[int]]:
    """Generate a prompt as a motion of its own."""
    (clip,) = model.generate([prompt.text], seed=seed, seconds=END - START)
    return clip, 0, clip.frames, [clip.frames // 2]


def repainted(
    model: LocalModel, hosts: Sequence[MotionClip], prompt: ActionPrompt, seed: int
) -> tuple[MotionClip, int, int, Sequence[int]]:
    """Paint a prompt into a motion."""
    host = hosts[seed % len(hosts)]
    op = {"op": "repaint", "from": START, "to": END, "prompt": prompt.text, "seed": seed, "force": True}
    (clip,) = model.edit(host, [op])
    first, end = round(START * clip.fps), round(END * clip.fps) + 1
    return clip, first, end, [first, end]


def extended(
    model: LocalModel, hosts: Sequence[MotionClip], prompt: ActionPrompt, seed: int
) -> tuple[MotionClip, int, int, Sequence[int]]:
    """Append a prompt to a motion."""
    host = hosts[seed % len(hosts)]
    cut = {"op": "trim", "to": START}
    op = {"op": "extend", "seconds": END - START, "prompt": prompt.text, "seed": seed, "force": True}
    (clip,) = model.edit(host, [cut, op])
    first = round(START * clip.fps) + 1
    return clip, first, clip.frames, [first]


def between(
    model: LocalModel, hosts: Sequence[MotionClip], prompt: ActionPrompt, seed: int
) -> tuple[MotionClip, int, int, Sequence[int]]:
    """Lead a motion to another one by a prompt."""
    before, after = hosts[seed % len(hosts)], hosts[(seed + 1) % len(hosts)]
    cut = {"op": "trim", "to": START}
    way = {"op": "in-between", "with": after, "seconds": END - START, "prompt": prompt.text, "seed": seed}
    (clip,) = model.edit(before, [cut, {**way, "force": True}])
    first = round(START * clip.fps) + 1
    end = first + round((END - START) * clip.fps)
    return clip, first, end, [first, end]


def real(folder: Path) -> Iterator[Window]:
    """Yield the jerk in the middle of captured clips, finished as motions are."""
    data = PreparedData.open(folder, verify=False)
    held = [clip for clip in data.clips if clip.split != "train" and clip.length > 60 and len(clip.acts) == 1]
    for clip in held[:CLIPS]:
        finished = finish_motion(np.asarray(data.features(clip)), data.layout)
        yield window(finished.joints, finished.fps, finished.frames // 2)


def window(joints: NDArray[np.floating[Any]], fps: float, at: int) -> Window:
    """Return peak and mean of the jerk of joints (T, J, 3) within `NEAR` of a frame."""
    jerk = np.linalg.norm(np.diff(joints.astype(np.float64), n=3, axis=0) * fps**3, axis=-1)
    near = jerk[max(0, at - round(NEAR * fps) - 1) : at + round(NEAR * fps) - 1]
    return float(near.max()), float(near.mean())


def row(name: str, passed: Sequence[bool], windows: Sequence[Window]) -> None:
    """Print a row of the table."""
    share = f"{np.mean(passed):.1%} of {len(passed)}" if len(passed) else ""
    peak, mean = np.mean(windows, axis=0)
    print(f"| {name} | {share} | {peak:.0f} | {mean:.0f} |", flush=True)


def time_edits(model: LocalModel) -> None:
    """Print the times of edits of the longest motion, judged as files are, beside that of its generation."""
    (clip,) = model.generate(HOSTS[:1], seed=1, seconds=9.8)
    edits: dict[str, dict[str, object]] = {
        "extend by 2 s": {"op": "extend", "seconds": 2, "prompt": "a person jumps"},
        "repaint 7.5 s": {"op": "repaint", "from": 1, "to": 8.5, "prompt": "a person jumps"},
        "repaint 2 s without a prompt": {"op": "repaint", "from": 4, "to": 6},
        "in-between, 1 s": {"op": "in-between", "with": clip},
        "upper body": {"op": "body-part", "part": "upper-body", "prompt": "a person waves"},
    }
    functions: dict[str, Callable[[], object]] = {
        f"generate {clip.frames} frames": partial(model.generate, HOSTS[:1], seed=1, seconds=9.8)
    }
    for name, op in edits.items():
        functions[name] = partial(edit_and_judge, model, clip, op)
    timings = measure(functions, seconds=60)
    print(table(f"edits of {clip.frames} frames, {BUNDLE}, one thread", timings, baseline=timings[0].name))


def edit_and_judge(model: LocalModel, clip: MotionClip, op: dict[str, object]) -> None:
    """Edit a clip, and measure the quality of the result."""
    (made,) = model.edit(clip, [op])
    judged(made)
