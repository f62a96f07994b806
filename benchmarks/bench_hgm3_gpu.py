"""HGM³'s motions per second on a CUDA device, with random weights."""

from __future__ import annotations

import tempfile
from pathlib import Path

from benchmarks.bench_hgm3 import requests
from benchmarks.harness import has_cuda, measure, table
from marey.models.hgm3.bundle import random_bundle
from marey.models.hgm3.generate import Generator


def main() -> None:
    """Print the tables, or say that there is nothing to measure on."""
    if not has_cuda():
        return
    with tempfile.TemporaryDirectory() as folder:
        generator = Generator.load(random_bundle(Path(folder) / "hgm3", "paper"), device="cuda")
        for batch in (1, 32, 128):
            asked = requests(batch)
            runs = {f"batch {batch}": lambda asked=asked: generator.generate(asked)}
            (timing,) = measure(runs, repeats=9, seconds=30)
            note = f"{batch / timing.median:.1f} motions/s. {generator.dtype}."
            print(table("HGM³ paper, 196 frames", [timing], note=note))


if __name__ == "__main__":
    main()
