"""Bundle, settings and software behind a motion, for its manifest."""

from __future__ import annotations

from typing import Any

import torch

from marey.core.package import own_version
from marey.generation.port import Generator, S


def origin_of(generator: Generator[S], settings: S) -> dict[str, Any]:
    """Return what decides the motions of a generator beside their requests."""
    bundle = generator.bundle
    return {
        "bundle": bundle.reference,
        "weights_sha256": bundle.weights_sha256,
        "licence": bundle.manifest.licence,
        "settings": generator.describe_settings(settings),
        "software": software_of(generator),
    }


def software_of(generator: Generator[Any]) -> dict[str, Any]:
    """Return the inputs of equal tokens beside the request: device kind, number type, threads, versions."""
    return {
        "marey": own_version(),
        "torch": torch.__version__,
        "device": generator.device.type,
        "dtype": str(generator.dtype).removeprefix("torch."),
        "threads": torch.get_num_threads(),
    }
