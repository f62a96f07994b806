"""MoMask++ at the size of the published HumanML3D weights: random weights, 196 frames, 18 steps, guidance, two CPU
threads, batches of 1 and 32.

What a machine could give is its bfloat16 product rate over the arithmetic of a motion, counted in the path without
savings; the share of it that is reached stands in the note.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.utils.flop_counter import FlopCounterMode

from benchmarks.bench_hgm3 import requests
from benchmarks.harness import matrix_products, measure, peak_mib, processor_seconds, table
from marey.bundles import Bundle
from marey.generation.port import Request
from marey.models.momaskpp.bundle import load_networks, random_bundle
from marey.models.momaskpp.generate import Generator
from marey.models.momaskpp.model import ScaleTransformer
from marey.models.momaskpp.words import WordReader
from marey.nn.batch_threads import BatchThreads

THREADS = 2
BATCHES = (1, 32)
WORDS, WIDTH = 14, 768
"""Tokens of a sentence of a dozen words, and the width of their states."""


class RandomWords(WordReader):
    """States of words without a text encoder: the time of the encoder is not measured here."""

    def __init__(self, width: int) -> None:
        self.width = width

    def states(self, texts: Sequence[str]) -> list[NDArray[np.float32]]:
        """Return random states (L, W) of each text."""
        rng = np.random.default_rng(0)
        return [rng.normal(size=(WORDS, self.width)).astype(np.float32) for _ in texts]


class EveryRow(ScaleTransformer):
    """The transformer that computes every row in all its blocks."""

    def forward(
        self,
        tokens: Tensor,
        positions: Tensor,
        valid: Tensor,
        words: Tensor,
        present: Tensor,
        guidance: float | None = None,
        wanted: Tensor | None = None,
    ) -> Tensor:
        """Logits as `ScaleTransformer`'s."""
        logits = super().forward(tokens, positions, valid, words, present, guidance)
        return logits if wanted is None else logits[wanted[: len(logits)]]


def same(generator: Generator, other: Generator, asked: Sequence[Request]) -> int:
    """Return how many motions have equal tokens from both."""
    pairs = zip(generator.generate(asked), other.generate(asked), strict=True)
    return sum(a is not None and b is not None and np.array_equal(a.tokens, b.tokens) for a, b in pairs)


def main() -> None:
    """Print a table for each batch size, the arithmetic of a motion, and the memory used."""
    torch.set_num_threads(THREADS)
    with tempfile.TemporaryDirectory() as folder:
        bundle = random_bundle(Path(folder) / "random-released", "released-humanml3d")
        before = peak_mib()
        fast = load(bundle, torch.bfloat16)
        fast.generate(requests(32, WIDTH))
        print(f"peak memory with batch 32: {peak_mib():.0f} MiB (before loading: {before:.0f} MiB)\n")
        slow, plain = load(bundle, torch.float32), load(bundle, torch.float32, savings=False)
        whole = load(bundle, torch.float32)
    whole.networks.masked.__class__ = EveryRow
    asked = requests(8, WIDTH)
    print(
        f"motions whose tokens in float32 are equal: {same(slow, whole, asked)} of {len(asked)} where every row of each"
    )
    print(
        f"pass is computed, {same(slow, plain, asked)} without any savings (another order of additions decides ties)\n"
    )
    gflop = arithmetic(plain)
    for batch in BATCHES:
        asked = requests(batch, WIDTH)
        runs: dict[str, Callable[[], object]] = {
            "momaskpp": lambda asked=asked: fast.generate(asked),
            "momaskpp, float32": lambda asked=asked: slow.generate(asked),
            "momaskpp, float32, no savings": lambda asked=asked: plain.generate(asked),
        }
        timings = measure(runs, repeats=9, warm_up=1, seconds=120)
        float32, bfloat16 = matrix_products()
        rates = ", ".join(f"{t.name} {batch / t.median:.2f}" for t in timings)
        used = ", ".join(f"{name} {processor_seconds(run) / batch:.3f}" for name, run in runs.items())
        reached = batch / timings[0].median / (bfloat16 / gflop)
        note = (
            f"Motions/s: {rates}. Processor seconds a motion: {used}. A motion: {gflop:.0f} GFLOP. "
            f"Matrix products now: float32 {float32:.0f}, bfloat16 {bfloat16:.0f} GFLOP/s. "
            f"Reached: {reached:.0%} of the bfloat16 rate."
        )
        print(table(f"batch {batch}", timings, baseline="momaskpp, float32, no savings", note=note))


def load(bundle: Bundle, dtype: torch.dtype, *, savings: bool = True) -> Generator:
    """Load a bundle of random weights, without a text encoder; without savings nothing is packed or left out."""
    config, networks = load_networks(bundle)
    threads = BatchThreads(THREADS if savings else 1)
    if savings:
        networks.masked.prepare_inference(dtype, threads)
        networks.tokenizer.decoder.prepare_inference(dtype)
    reader = RandomWords(config.text.width)
    return Generator(bundle, config, networks, reader, torch.device("cpu"), dtype, threads)


def arithmetic(plain: Generator) -> float:
    """Count the arithmetic of one motion, GFLOP."""
    counter = FlopCounterMode(display=False)
    with counter:
        plain.generate(requests(1, WIDTH))
    return counter.get_total_flops() / 1e9


if __name__ == "__main__":
    main()
