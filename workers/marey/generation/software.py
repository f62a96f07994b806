"""The software behind a motion, for its manifest."""

from __future__ import annotations

from importlib.metadata import version
from typing import Any

import torch

from marey.generation.port import Generator


def software_of(generator: Generator[Any]) -> dict[str, Any]:
    """Return the inputs of equal tokens beside the request: device kind, number type, threads, versions."""
    return {
        "marey": version("marey"),
        "torch": torch.__version__,
        "device": generator.device.type,
        "dtype": str(generator.dtype).removeprefix("torch."),
        "threads": torch.get_num_threads(),
    }
