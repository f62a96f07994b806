"""The encoder by which the readers read prompts (ours): MiniLM with low-rank updates of its last layers.

Its vectors lie apart where prompts ask for different actions, which those of sentences in general do not: "she sinks
onto a chair" is close to "she sinks into the sea" there. `python -m marey.reading.train_encoder` makes
`reading_encoder.safetensors` anew; the readers are trained again behind it.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from safetensors import safe_open

from marey.core.hashing import sha256_of

if TYPE_CHECKING:
    from marey.text.minilm_encoder import MiniLMEncoder

FILE = Path(__file__).with_name("reading_encoder.safetensors")


def reading_encoder(encoder: MiniLMEncoder, path: Path | None = None) -> MiniLMEncoder:
    """Return an encoder with the updates of a file; None = the shipped one. Its matrices are shared with the other."""
    with cast("Any", safe_open)(path or FILE, framework="pt") as file:
        return encoder.tuned({name: file.get_tensor(name).float() for name in sorted(file.keys())})


@cache
def reading_encoder_sha256() -> str:
    """Return the hash of the shipped file."""
    return sha256_of(FILE)
