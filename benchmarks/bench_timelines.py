"""Timelines of prompts: adherence of rows, jerk around the boundaries between them, time and memory for 20 and 60 s.

Timelines of 5 rows of 2 to 6 s are drawn from development prompts of single actions that the bundle supports. Each row
is judged by the referee, in the timeline and as a motion of its own. Jerk is that of all joints within half a second of
a boundary, beside the same in the middle of rows made alone, and with `MAREY_PREPARED=folder` in real clips.

    OMP_NUM_THREADS=1 MAREY_PREPARED=prepared python -m benchmarks timelines
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from benchmarks.harness import measure, table
from benchmarks.platform import forget_peak, peak_megabytes
from marey.bundles import choose_bundle
from marey.data.prepared import PreparedData
from marey.generation.port import Request
from marey.generation.shots.dispatch import timeline_request
from marey.generation.shots.timelines import generate_timelines
from marey.items.timeline import TimelineRow
from marey.motion.finish import finish_motion
from marey.referee import Body
from marey.referee.adherence import judge_trial
from marey.referee.prompts import ActionPrompt, development_prompts
from marey.registry import get_model, resolve
from marey.text.features import TextFeatures
from marey.training.adherence import pipeline_of

BUNDLE = os.environ.get("MAREY_BUNDLE", "hgm3-open")
TIMELINES = 80
ROWS = 5
BATCH = 32
NEAR = 0.5
"""Seconds on each side of a boundary."""
CLIPS = 2000
"""Real clips."""
Joints = NDArray[np.float64]


@dataclass(frozen=True)
class Case:
    """A timeline: its prompts, and the frames of each row at 20 fps."""

    prompts: tuple[ActionPrompt, ...]
    frames: tuple[int, ...]
    seed: int


def main() -> None:
    """Print adherence, jerk and times."""
    torch.set_num_threads(1)
    bundle = choose_bundle(BUNDLE)
    generator = resolve(get_model(bundle.manifest.model).load)(bundle, threads=1)
    pipeline = pipeline_of(generator)
    known = set(bundle.manifest.actions.known if bundle.manifest.actions else ())
    prompts = [each for each in development_prompts() if len(each.actions) == 1 and each.actions[0] in known]
    cases = [*draw(prompts, TIMELINES)]
    texts = [pipeline.features([prompt.text for prompt in case.prompts]) for case in cases]
    alone, rows = rows_alone(generator, cases, texts), timelines(generator, cases, texts)
    print(f"{BUNDLE}, {TIMELINES} timelines of {ROWS} rows\n")
    print("| | adherence of rows | peak jerk, m/s³ | mean jerk, m/s³ |\n|---|---|---|---|")
    report("rows alone, in their middle", passed(cases, alone), [windows(one, len(one) // 2) for one in alone])
    ends = [np.cumsum(case.frames) for case in cases]
    parts = [whole[a:b] for whole, end in zip(rows, ends, strict=True) for a, b in pairwise([0, *end])]
    seams = [windows(whole, int(at)) for whole, end in zip(rows, ends, strict=True) for at in end[:-1]]
    report("timelines, at boundaries", passed(cases, parts), seams)
    if folder := os.environ.get("MAREY_PREPARED"):
        report("real clips, in their middle", [], [windows(one, len(one) // 2) for one in real(Path(folder))])
    print()
    time_lengths(generator, texts[0])


def draw(prompts: Sequence[ActionPrompt], count: int) -> Iterator[Case]:
    """Yield timelines of prompts and lengths drawn at random, always the same."""
    rng = np.random.default_rng(1)
    for seed in range(count):
        chosen = tuple(prompts[index] for index in rng.choice(len(prompts), ROWS))
        yield Case(chosen, tuple(int(4 * tokens) for tokens in rng.integers(10, 31, ROWS)), seed)


def request_of(case: Case, texts: Sequence[TextFeatures]) -> Request:
    """Return the request of a timeline."""
    times = pairwise([0, *np.cumsum(case.frames) / 20])
    rows = [
        TimelineRow(float(start), float(end), prompt.text)
        for (start, end), prompt in zip(times, case.prompts, strict=True)
    ]
    return timeline_request(rows, texts, case.seed, None)


def timelines(generator: Any, cases: Sequence[Case], texts: Sequence[Sequence[TextFeatures]]) -> list[Joints]:
    """Generate each timeline; return its joints (T, J, 3)."""
    requests = [request_of(case, each) for case, each in zip(cases, texts, strict=True)]
    made = (motion for some in batches(requests) for motion in generate_timelines(generator, some))
    return [joints_of(generator, motion) for motion in made]


def rows_alone(generator: Any, cases: Sequence[Case], texts: Sequence[Sequence[TextFeatures]]) -> list[Joints]:
    """Generate each row of each timeline as a motion of its own; return its joints."""
    requests = [
        Request(text, 1000 * case.seed + number, frames)
        for case, each in zip(cases, texts, strict=True)
        for number, (text, frames) in enumerate(zip(each, case.frames, strict=True))
    ]
    made = (motion for some in batches(requests) for motion in generator.generate(some))
    return [joints_of(generator, motion) for motion in made]


def batches(requests: Sequence[Request]) -> Iterator[Sequence[Request]]:
    """Yield so many requests as are generated together."""
    return (requests[first : first + BATCH] for first in range(0, len(requests), BATCH))


def joints_of(generator: Any, motion: Any) -> Joints:
    """Return the joints of a finished motion."""
    return finish_motion(motion.features, generator.layout).joints.astype(np.float64)


def passed(cases: Sequence[Case], parts: Sequence[Joints]) -> list[bool]:
    """Judge the motion of each row, from the place where it begins."""
    prompts = [prompt for case in cases for prompt in case.prompts]
    placed = [part - part[0, 0] * [1, 0, 1] for part in parts]
    return [judge_trial(each, 0, Body(part, 20.0)).passed for each, part in zip(prompts, placed, strict=True)]


def windows(joints: Joints, at: int) -> tuple[float, float]:
    """Return the largest and the mean jerk of joints within `NEAR` of a frame."""
    jerk = np.linalg.norm(np.diff(joints, n=3, axis=0) * 20.0**3, axis=-1)
    near = round(NEAR * 20)
    window = jerk[max(0, at - near - 1) : at + near - 1]
    return float(window.max()), float(window.mean())


def real(folder: Path) -> Iterator[Joints]:
    """Yield the joints of real clips of 2 s and more."""
    data = PreparedData.open(folder, verify=False)
    clips = [clip for clip in data.clips if clip.length >= 40 and not clip.made and not clip.spliced]
    for number in np.random.default_rng(0).choice(len(clips), min(CLIPS, len(clips)), replace=False):
        yield data.joints(clips[number]).astype(np.float64)


def report(name: str, shown: Sequence[bool], jerks: Sequence[tuple[float, float]]) -> None:
    """Print a line of the table."""
    peak, mean = np.array(jerks).mean(axis=0)
    share = f"{100 * np.mean(shown):.1f} %" if shown else ""
    print(f"| {name} | {share} | {peak:.0f} | {mean:.1f} |")


def time_lengths(generator: Any, texts: Sequence[TextFeatures]) -> None:
    """Print the seconds of timelines of 20 s and 60 s, of rows of 4 s, and the memory that they take with finishing."""

    def run(rows: int, count: int = 1) -> list[Any]:
        times = [TimelineRow(4.0 * row, 4.0 * row + 4, "-") for row in range(rows)]
        own = [texts[row % ROWS] for row in range(rows)]
        return generate_timelines(generator, [timeline_request(times, own, seed, None) for seed in range(count)])

    timings = measure({"20 s": lambda: run(5), "60 s": lambda: run(15)}, repeats=7, seconds=90)
    print(table("one timeline", timings, baseline="20 s"))
    for count, rows in ((1, 5), (1, 15), (BATCH, 5), (BATCH, 15)):
        forget_peak(os.getpid())
        before = peak_megabytes(os.getpid())
        for motion in run(rows, count):
            joints_of(generator, motion)
        print(f"{count} of {4 * rows} s: {peak_megabytes(os.getpid()) - before:.0f} MB more at the peak", flush=True)
