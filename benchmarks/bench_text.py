"""Text on one thread: labelling captions, encoding one, and a whole new prompt."""

from __future__ import annotations

import itertools

import torch

from benchmarks.harness import measure, table
from marey.bundles import TextSpec
from marey.text.encoders import find_encoder
from marey.text.minilm import MiniLM
from marey.text.pipeline import TextPipeline

CAPTION = "a person walks forward in a circle and then waves his hand"
LONG = (
    "a person walks slowly forward while holding the handrail with the left hand and then turns around to the right "
    "before he sits down on a chair and waves twice"
)


def main() -> None:
    """Print the tables."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        pipeline = TextPipeline.load(TextSpec())
        words = CAPTION.split()
        coarse = MiniLM(find_encoder("minilm"), int8=True)
        ids = coarse.tokenizer.encode(CAPTION).ids
        numbers = itertools.count()
        functions = {
            "MiniLM int8, one sentence": lambda: coarse.states(ids),
            "label 12 words (goal: 5 ms)": lambda: pipeline.labeller.label([words]),
            "label 30 words": lambda: pipeline.labeller.label([LONG.split()]),
            "MiniLM float32, one sentence": lambda: pipeline.encoder.encode(CAPTION),
            "features of a prompt with new words": lambda: pipeline.features([f"{CAPTION} x{next(numbers)}"]),
        }
        print(table("Text, one thread", measure(functions, repeats=200, warm_up=20)))
    finally:
        torch.set_num_threads(threads)


if __name__ == "__main__":
    main()
