"""HGM³ at `paper` size: random weights, 196 frames, L = 10, guidance, two CPU threads, batches of 1 and 32.

With `MOMASK_CODES=folder` naming a checkout of github.com/EricGuo5513/momask-codes, that code runs in turns beside it,
at the same size (6 layers, 10 steps, guidance 4 and 5). What the machine's matrices give stands in the note: compare
machines by it. Ratios of processor time stand there too, for machines that are shared.
"""

from __future__ import annotations

import os
import sys
import tempfile
import types
from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch

from benchmarks.harness import matrix_products, measure, peak_mib, processor_seconds, table
from marey.generation.port import Request
from marey.models.hgm3.bundle import random_bundle
from marey.models.hgm3.generate import Generator, SamplingSettings
from marey.text.features import TextFeatures
from marey.text.graph import Edge, Node, SemanticGraph

THREADS = 2
FRAMES = 196
BATCHES = (1, 32)


def main() -> None:
    """Print a table for each batch size, and the memory used."""
    torch.set_num_threads(THREADS)
    with tempfile.TemporaryDirectory() as folder:
        bundle = random_bundle(Path(folder) / "random-paper", "paper")
        before = peak_mib()
        fast = Generator.load(bundle, device="cpu", threads=THREADS)
        fast.generate(requests(32))
        print(f"peak memory with batch 32: {peak_mib():.0f} MiB (before loading: {before:.0f} MiB)\n")
        slow = Generator.load(bundle, device="cpu", threads=THREADS, dtype=torch.float32)
    peer = momask()
    plain = SamplingSettings(skip_idle=False, trim_slots=False)
    for batch in BATCHES:
        asked = requests(batch)
        runs: dict[str, Callable[[], object]] = {
            "hgm3": lambda asked=asked: fast.generate(asked),
            "hgm3, float32": lambda asked=asked: slow.generate(asked),
            "hgm3, float32, no savings": lambda asked=asked: slow.generate(asked, plain),
        }
        if peer is not None:
            runs["momask-codes"] = lambda batch=batch: peer(batch)
        baseline = "momask-codes" if peer is not None else "hgm3, float32, no savings"
        timings = measure(runs, repeats=9, seconds=90)
        rates = ", ".join(f"{t.name} {batch / t.median:.2f}" for t in timings)
        used = ", ".join(f"{name} {processor_seconds(run) / batch:.3f}" for name, run in runs.items())
        float32, bfloat16 = matrix_products()
        note = (
            f"Motions/s: {rates}. Processor seconds a motion: {used}. "
            f"Matrix products now: float32 {float32:.0f}, bfloat16 {bfloat16:.0f} GFLOP/s."
        )
        print(table(f"batch {batch}", timings, baseline=baseline, note=note))


def requests(batch: int, width: int = 512) -> list[Request]:
    """Prompts with two actions and four specifics, as a sentence of a dozen words gives."""
    nodes = [Node(0, "motion", "-", ())]
    nodes += [Node(1 + a, "action", "-", ()) for a in range(2)] + [Node(3 + s, "specific", "-", ()) for s in range(4)]
    edges = [Edge(0, 1, "MA", "MA"), Edge(0, 2, "MA", "MA")]
    edges += [Edge(1 + s % 2, 3 + s, "ARG0", "ARG0") for s in range(4)]
    graph = SemanticGraph("-", ("-",), tuple(nodes), tuple(edges))
    rng = np.random.default_rng(0)
    vectors = rng.normal(size=(batch, len(nodes), width)).astype(np.float16)
    return [Request(TextFeatures("-", "-", graph, v), seed, FRAMES) for seed, v in enumerate(vectors)]


def momask() -> Callable[[int], object] | None:
    """MoMask's public code at the same size with random weights, or None where there is no checkout."""
    folder = os.environ.get("MOMASK_CODES")
    if not folder:
        return None
    sys.path.insert(0, folder)
    sys.modules.setdefault("clip", types.ModuleType("clip"))
    from models.mask_transformer.transformer import MaskTransformer, ResidualTransformer
    from models.vq.model import RVQVAE

    opt = types.SimpleNamespace(
        num_tokens=512, num_quantizers=6, device="cpu", shared_codebook=False, quantize_dropout_prob=0.2, mu=0.99,
        code_dim=512, dataset_name="t2m",
    )  # fmt: skip
    for kind in (MaskTransformer, ResidualTransformer):
        kind.load_and_freeze_clip = lambda self, version: torch.nn.Linear(1, 1)
        kind.encode_text = lambda self, texts: torch.randn(len(texts), 512)
    size = {
        "code_dim": 512, "cond_mode": "text", "latent_dim": 384, "ff_size": 1024, "num_layers": 6, "num_heads": 6,
        "dropout": 0.2, "clip_dim": 512, "cond_drop_prob": 0.1, "clip_version": "-", "opt": opt,
    }  # fmt: skip
    masked = MaskTransformer(**size).eval()
    residual = ResidualTransformer(**size, shared_codebook=False, share_weight=True).eval()
    vq = RVQVAE(opt, 263, 512, 512, 512, 2, 2, 512, 3, 3, "relu", None).eval()

    @torch.no_grad()
    def run(batch: int) -> object:
        lengths, captions = torch.full((batch,), FRAMES // 4), ["-"] * batch
        tokens = masked.generate(
            captions, lengths, timesteps=10, cond_scale=4, temperature=1, topk_filter_thres=0.9, gsample=False
        )
        return vq.forward_decoder(residual.generate(tokens, captions, lengths, temperature=1, cond_scale=5))

    return run


if __name__ == "__main__":
    main()
