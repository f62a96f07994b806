"""MOGO frame by frame with random weights: frames a second of one session and of several, windows, guidance, memory.

`paper` on two CPU threads, as its goal is set; `starter` beside it, with the whole way to a finished frame (decoder,
pose, feet), and the time to the first frame.
"""

from __future__ import annotations

import resource
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch

from benchmarks.harness import measure, table
from shared.text.features import TextFeatures
from shared.text.graph import Node, SemanticGraph
from workers.mogo.bundle import random_bundle
from workers.mogo.generate import Generator, Settings
from workers.mogo.live import LiveRoom
from workers.mogo.streaming import Streams

THREADS = 2
FRAMES = 100
"""Of one measurement, behind a full window."""
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
    config = generator.config.inference
    runs: dict[str, Callable[[], object]] = {}
    for name, settings, window in (
        ("window 196 (goal: 30 frames/s)", Settings(guidance=1.0), 196),
        ("window 98", Settings(guidance=1.0), 98),
        ("window 196, guidance", Settings(guidance=3.0), 196),
    ):
        inference = replace(settings.inference(config), window=window)
        streams = Streams(generator.transformer, 1, inference, dtype=generator.dtype)
        streams.start(torch.zeros(generator.config.condition.text_width), 1)
        _run(streams.step, window)
        runs[name] = lambda streams=streams: _run(streams.step, FRAMES)
    timings = measure(runs, repeats=6, warm_up=0, seconds=120)
    rates = ", ".join(f"{t.name}: {FRAMES / t.median:.1f}" for t in timings)
    note = f"Frames/s: {rates}. {generator.dtype}, {THREADS} threads."
    print(table(f"MOGO paper, tokens alone, {FRAMES} frames", timings, note=note))


def _starter(generator: Generator) -> None:
    runs: dict[str, Callable[[], object]] = {}
    for sessions in (1, 4, 8):
        room = LiveRoom(generator, sessions)
        for seed in range(sessions):
            room.start(_text(generator), seed)
        _run(room.step, generator.config.inference.window)
        runs[f"{sessions} sessions"] = lambda room=room: _run(room.step, FRAMES)
    timings = measure(runs, repeats=6, warm_up=0, seconds=60)
    rates = ", ".join(f"{t.name}: {FRAMES / t.median:.0f}" for t in timings)
    note = f"Frames/s of each session: {rates} (goal of one: 100)."
    print(table(f"MOGO starter, finished frames, {FRAMES} of each", timings, note=note))
    room, text = LiveRoom(generator, 1), _text(generator)

    def first() -> None:
        session = room.start(text, 1)
        room.step()
        room.stop(session)

    print(table("MOGO starter, first frame (goal: 100 ms)", measure({"first frame": first}, repeats=20)))
    room.start(text, 1)
    _run(room.step, 500)
    before = _memory_mib()
    _run(room.step, ENDLESS)
    print(f"Memory over {ENDLESS} frames: {before:.1f} → {_memory_mib():.1f} MiB (resident, peak)\n")


def _text(generator: Generator) -> TextFeatures:
    graph = SemanticGraph("-", ("-",), (Node(0, "motion", "-", ()),), ())
    vector = np.random.default_rng(0).normal(size=(1, generator.config.condition.text_width))
    return TextFeatures("-", "-", graph, vector.astype(np.float16))


def _run(step: Callable[[], object], frames: int) -> None:
    for _ in range(frames):
        step()


def _memory_mib() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


if __name__ == "__main__":
    main()
