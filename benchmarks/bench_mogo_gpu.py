"""MOGO on a CUDA device with random weights: frames per second with and without recorded steps, and the number of live
sessions in real time.

A session keeps up when 99 of 100 frames are ready within a twentieth of a second, including all processing of a frame
on the way to the client (decoder, pose, feet), which runs on the processor.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import torch

from benchmarks.bench_mogo import sentence, text
from benchmarks.harness import has_cuda, measure, table
from marey.models.mogo.bundle import random_bundle
from marey.models.mogo.generate import Generator
from marey.models.mogo.live import LiveSessionPool
from marey.models.mogo.streaming import StreamBatch

FRAMES = 200
SESSIONS = (1, 2, 4, 8, 16, 32, 64, 128, 256, 512)
REAL_TIME = 0.05  # seconds a frame


def main() -> None:
    """Print the tables, or say that there is nothing to measure on."""
    if not has_cuda():
        return
    with tempfile.TemporaryDirectory() as folder:
        for name in ("paper", "starter"):
            generator = Generator.load(random_bundle(Path(folder) / name, name), device="cuda")
            _one_session(generator)
            _sessions(generator)
            del generator
            torch.cuda.empty_cache()


def _one_session(generator: Generator) -> None:
    """Tokens alone of one session (goal of `paper`: 300 frames/s)."""
    runs: dict[str, Callable[[], object]] = {}
    for name, guidance in (("recorded", 1.0), ("recorded, guidance", 3.0), ("step by step", 1.0)):
        inference = replace(generator.config.inference, guidance=guidance)
        streams = StreamBatch(generator.packed(1), 1, inference)
        if name == "step by step":
            streams._draw = streams._next
        streams.prepare()
        streams.start(sentence(generator).to(generator.device), 1)
        _run(streams.step, inference.window)
        runs[name] = lambda streams=streams: _run(streams.step, FRAMES)
    timings = measure(runs, repeats=9, warm_up=1, seconds=60)
    rates = ", ".join(f"{t.name}: {FRAMES / t.median:.0f}" for t in timings)
    note = f"Frames/s: {rates}. {generator.dtype}."
    print(
        table(
            f"MOGO {generator.config.name}, tokens alone, {FRAMES} frames", timings, baseline="step by step", note=note
        )
    )


def _sessions(generator: Generator) -> None:
    """Finished frames of more and more sessions, until they no longer keep up."""
    print(f"MOGO {generator.config.name}, finished frames, {FRAMES} of each session\n")
    print("| sessions | frames/s of each | 99th percentile of a step | GPU memory |\n|---|---|---|---|")
    for sessions in SESSIONS:
        torch.cuda.empty_cache()
        torch.cuda.reset_peak_memory_stats()
        try:
            steps = _steps(generator, sessions)
        except torch.OutOfMemoryError:
            print(f"| {sessions} | do not fit | | |")
            break
        slowest, peak = steps[int(0.99 * FRAMES)], torch.cuda.max_memory_allocated() / 2**30
        print(f"| {sessions} | {FRAMES / sum(steps):.0f} | {slowest * 1e3:.1f} ms | {peak:.1f} GiB |", flush=True)
        if slowest > REAL_TIME:
            break
    print()


def _steps(generator: Generator, sessions: int) -> list[float]:
    """Seconds of each step, the shortest first."""
    room = LiveSessionPool(generator, sessions)
    for seed in range(sessions):
        room.start(text(generator), seed)
    _run(room.step, 20)
    return sorted(_seconds(room.step) for _ in range(FRAMES))


def _run(step: Callable[[], object], frames: int) -> None:
    for _ in range(frames):
        step()
    torch.cuda.synchronize()


def _seconds(step: Callable[[], object]) -> float:
    began = time.perf_counter()
    step()
    return time.perf_counter() - began


if __name__ == "__main__":
    main()
