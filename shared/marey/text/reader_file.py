"""Files of the readers of prompts: small networks over the vectors of one encoder, computed with numpy."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar, Self, cast

import numpy as np
from numpy.typing import NDArray
from safetensors import safe_open

from marey.core.errors import InvalidFile

Float32 = NDArray[np.float32]


class Reader:
    """A reader with its weights.

    Attributes:
        classes: what it tells apart.
        encoder_sha256: hash of the encoder whose vectors it reads.
    """

    file: ClassVar[Path]
    """The shipped one."""
    reads: ClassVar[str]
    """Its object, for messages."""
    tensors: ClassVar[frozenset[str]]

    def __init__(
        self, classes: Sequence[str], encoder_sha256: str, weights: Mapping[str, NDArray[np.floating]]
    ) -> None:
        self.classes = tuple(classes)
        self.encoder_sha256 = encoder_sha256
        self._weights = {name: np.asarray(tensor, np.float32) for name, tensor in weights.items()}

    @classmethod
    def load(cls, path: Path | None = None) -> Self:
        """Load a reader; None = the shipped one.

        Raises:
            InvalidFile: it has other tensors.
        """
        path = path or cls.file
        with cast("Any", safe_open)(path, framework="np") as file:
            facts: dict[str, str] = file.metadata() or {}
            weights: dict[str, Float32] = {name: file.get_tensor(name) for name in sorted(file.keys())}
        if frozenset(weights) != cls.tensors:
            raise InvalidFile(f"is not a reader of {cls.reads}", where=str(path))
        return cls(json.loads(facts["classes"]), facts["encoder_sha256"], weights)
