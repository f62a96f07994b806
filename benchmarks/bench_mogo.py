"""MOGO frame by frame with random weights: frames a second of one session and of several, windows, guidance, cache,
memory.

`paper` on two CPU threads, as its goal is set; `starter` beside it, with the whole way to a finished frame (decoder,
pose, feet), and the time to the first frame.
"""

from __future__ import annotations

import statistics
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import psutil
import torch

from benchmarks.harness import measure, table
from marey.models.mogo.bundle import random_bundle
from marey.models.mogo.generate import Generator, SamplingSettings
from marey.models.mogo.live import LiveSessionPool
from marey.models.mogo.streaming import StreamBatch
from marey.text.features import TextFeatures
from marey.text.graph import Node, SemanticGraph

THREADS = 2
FRAMES = 100
"""Of one measurement, behind a full window."""
LENGTHS = (12, 49, 98, 196)
"""Frames behind which one is drawn with and without cache."""
ENDLESS = 10_000


def main() -> None:
    """Print the tables."""
    torch.set_num_threads(THREADS)
    with tempfile.TemporaryDirectory() as folder:
        paper = Generator.load(random_bundle(Path(folder) / "random-paper", "paper"), device="cpu", threads=THREADS)
        _paper(paper)
        del paper
        starter = random_bundle(Path(folder) / "random-starter", "starter")
        _starter(Generator.load(starter, device="cpu", threads=THREADS))


def _paper(generator: Generator) -> None:
    runs: dict[str, Callable[[], object]] = {}
    for name, guidance, window in (
        ("window 196 (goal: 30 frames/s)", 1.0, 196),
        ("window 98", 1.0, 98),
        ("window 196, guidance", 3.0, 196),
    ):
        streams = _streams(generator, guidance, window)
        streams.start(sentence(generator), 1)
        _run(streams.step, window)
        runs[name] = lambda streams=streams: _run(streams.step, FRAMES)
    timings = measure(runs, repeats=6, warm_up=0, seconds=120)
    rates = ", ".join(f"{t.name}: {FRAMES / t.median:.1f}" for t in timings)
    note = f"Frames/s: {rates}. {generator.dtype}, {torch.get_num_threads()} threads."
    print(table(f"MOGO paper, tokens alone, {FRAMES} frames", timings, note=note))
    _without_cache(generator)


def _without_cache(generator: Generator) -> None:
    """A frame after many others, against recomputing them all for it (goal: 20 times at 196)."""
    streams = _streams(generator, 1.0, max(LENGTHS))
    codes = generator.config.tokenizer.codes
    past = torch.randint(codes, (max(LENGTHS), generator.config.tokenizer.levels))

    def again(frames: int) -> None:
        streams.stop(streams.start(sentence(generator), 1, past=past[:frames]))

    for frames in LENGTHS:
        cached = _streams(generator, 1.0, max(LENGTHS))
        cached.start(sentence(generator), 1, past=past[:frames])
        runs = {"cached": cached.step, "read again": lambda frames=frames: again(frames)}
        timings = measure(runs, repeats=7, seconds=30)
        ratio = timings[1].median / timings[0].median
        print(table(f"MOGO {generator.config.name}, frame {frames}", timings, note=f"{ratio:.1f} times as fast."))


def _starter(generator: Generator) -> None:
    threads = torch.get_num_threads()
    torch.set_num_threads(1)  # as `marey worker` does for small networks
    print(f"MOGO starter, finished frames, one thread, {FRAMES} of each session (goal of one: 100 frames/s)\n")
    print("| sessions | frames/s of each | frames/s of all | 99th percentile of a step |\n|---|---|---|---|")
    for sessions in (1, 2, 4, 8, 16, 32):
        room = LiveSessionPool(generator, sessions)
        for seed in range(sessions):
            room.start(text(generator), seed)
        _run(room.step, generator.config.inference.window)
        steps = sorted(_seconds(room.step) for _ in range(FRAMES))
        rate = 1 / statistics.median(steps)
        print(f"| {sessions} | {rate:.0f} | {rate * sessions:.0f} | {steps[int(0.99 * FRAMES)] * 1e3:.1f} ms |")
    print()
    _without_cache(generator)
    _first_frame(generator)
    _memory(generator)
    torch.set_num_threads(threads)


def _first_frame(generator: Generator) -> None:
    room, asked = LiveSessionPool(generator, 1), text(generator)

    def first() -> None:
        session = room.start(asked, 1)
        room.step()
        room.stop(session)

    print(table("MOGO starter, first frame (goal: 100 ms)", measure({"first frame": first}, repeats=20)))


def _memory(generator: Generator) -> None:
    """Resident memory now; the peak of the process is set by `paper` and would hide a stream's growth."""
    room = LiveSessionPool(generator, 1)
    room.start(text(generator), 1)
    _run(room.step, 500)
    before = _resident_mib()
    _run(room.step, ENDLESS)
    print(f"Memory over {ENDLESS} frames: {before:.1f} → {_resident_mib():.1f} MiB resident\n")


def _streams(generator: Generator, guidance: float, window: int) -> StreamBatch:
    inference = replace(SamplingSettings(guidance=guidance).inference(generator.config.inference), window=window)
    return StreamBatch(generator.packed(1), 1, inference)


def sentence(generator: Generator) -> torch.Tensor:
    """Features (W,) of a prompt that says nothing."""
    return torch.zeros(generator.config.condition.text_width)


def _seconds(step: Callable[[], object]) -> float:
    began = time.perf_counter()
    step()
    return time.perf_counter() - began


def text(generator: Generator) -> TextFeatures:
    """Features of a made-up prompt."""
    graph = SemanticGraph("-", ("-",), (Node(0, "motion", "-", ()),), ())
    vector = np.random.default_rng(0).normal(size=(1, generator.config.condition.text_width))
    return TextFeatures("-", "-", graph, vector.astype(np.float16))


def _run(step: Callable[[], object], frames: int) -> None:
    for _ in range(frames):
        step()


def _resident_mib() -> float:
    return psutil.Process().memory_info().rss / 2**20


if __name__ == "__main__":
    main()
