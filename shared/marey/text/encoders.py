"""Text encoders: the port, and the search for their weights. A bundle names its encoder with the hash of its
weights.

MiniLM is a bundle of the product; weights of the others are folders as the models' hub has them.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from marey.bundles import Bundle, find_bundle
from marey.bundles.places import folders
from marey.core.errors import InvalidBundle, InvalidFile, NotFound
from marey.core.hashing import sha256_of
from marey.core.settings import Settings, settings

WIDTHS = {
    "minilm": 384,
    "clip-vit-b32": 512,
    "clip-vit-l14": 768,
    "t5-base": 768,
    "t5-v1_1-base": 768,
    "distilbert-base-uncased": 768,
}
BUNDLES = {"minilm": "minilm-l6"}
"""Encoders that are bundles, by name."""
HUB = {
    "clip-vit-b32": "openai/clip-vit-base-patch32",
    "clip-vit-l14": "openai/clip-vit-large-patch14",
    "t5-base": "google-t5/t5-base",
    "t5-v1_1-base": "google/t5-v1_1-base",
    "distilbert-base-uncased": "distilbert/distilbert-base-uncased",
}


@dataclass(frozen=True)
class Encoding:
    """One text, encoded."""

    pooled: NDArray[np.float32]  # (W,)
    tokens: NDArray[np.float32]  # (T, W); what lies past the encoder's limit is left out
    offsets: tuple[tuple[int, int], ...]  # characters of the text that each token covers; (0, 0) for special ones

    def span(self, start: int, stop: int) -> NDArray[np.float32] | None:
        """Mean state (W,) of the tokens that touch the characters [start, stop); None past the encoder's limit."""
        rows = [i for i, (a, b) in enumerate(self.offsets) if a < stop and b > start and b > a]
        return self.tokens[rows].mean(axis=0) if rows else None


class TextEncoder(Protocol):
    """Port of text encoders: a text to one vector and a vector per token, all of the same width and space."""

    @property
    def name(self) -> str:
        """Name in `TextSpec.encoder`."""
        ...

    @property
    def width(self) -> int:
        """W."""
        ...

    @property
    def sha256(self) -> str:
        """Hash of its weights."""
        ...

    def encode(self, text: str) -> Encoding:
        """Encode one text."""
        ...

    def pooled(self, texts: Sequence[str]) -> list[NDArray[np.float32]]:
        """One vector (W,) a text, which depends on that text alone, never on those beside it."""
        ...

    def encodings(self, texts: Sequence[str]) -> list[Encoding]:
        """Encode several texts as `encode` does; each result depends on its text alone as well."""
        ...


def encoder_sha256(name: str, *, config: Settings | None = None) -> str:
    """Return the hash of the weights of an installed encoder, as bundles name it. Loads no model.

    Raises:
        NotFound: it is not installed; the hint says how to get it.
        InvalidBundle, InvalidFile: the installed one is damaged.
    """
    if name in BUNDLES:
        return find_encoder(name, config=config).weights_sha256
    return weights_sha256(find_weights(name, config=config))


def find_encoder(name: str, path: Path | None = None, *, config: Settings | None = None) -> Bundle:
    """Return the bundle of an encoder of `BUNDLES`; its files are checked when they are loaded.

    Args:
        name: `minilm`.
        path: its folder; None = the installed one.
        config: where bundles are searched.

    Raises:
        NotFound: it is not installed; the hint says how to get it.
        InvalidBundle: the bundle holds something else, or is broken.
        Refused: as `find_bundle`.
    """
    bundle = find_bundle(str(path.absolute()) if path else BUNDLES[name], config=config, verify=False)
    manifest = bundle.manifest
    if (manifest.kind, manifest.model) != ("encoder", name):
        raise InvalidBundle(f"is a {manifest.kind} ({manifest.model}), not {name}", where=str(bundle.path))
    return bundle


def find_weights(name: str, *, config: Settings | None = None) -> Path:
    """Return the folder of weights of an encoder of `HUB`: beside the bundles, or in the hub's cache on this machine.

    Raises:
        NotFound: there is none; the hint says how to get it.
    """
    places = [folder / name for folder in folders(config or settings())]
    for folder in places:
        if any(folder.glob("*.safetensors")):
            return folder
    if cached := _in_hub_cache(HUB[name]):
        return cached
    raise NotFound(
        f"the weights of the text encoder {name!r} are not on this machine",
        where=str(places[0]),
        hint=f"Run `hf download {HUB[name]} --local-dir {name}` in the folder that MAREY_MODELS names, or import its "
        f"files: `marey models import {name} FOLDER -o {name}`.",
    )


def _in_hub_cache(repository: str) -> Path | None:
    if find_spec("huggingface_hub") is None:
        return None
    from huggingface_hub import try_to_load_from_cache

    file = try_to_load_from_cache(repository, "model.safetensors")
    return Path(file).parent if isinstance(file, str) else None


def weights_sha256(folder: Path) -> str:
    """The hash of an encoder: sha256 of its safetensors file (of the list of hashes where it has several).

    Raises:
        InvalidFile: there is none. Pickled weights (`.bin`) are never loaded.
    """
    files = sorted(folder.glob("*.safetensors"))
    if not files:
        raise InvalidFile(
            "holds no safetensors file",
            where=str(folder),
            hint="Pickled weights are not loaded: import them once with `marey models import`.",
        )
    hashes = [_file_sha256(file, file.stat().st_mtime_ns, file.stat().st_size) for file in files]
    return hashes[0] if len(hashes) == 1 else hashlib.sha256("\n".join(hashes).encode()).hexdigest()


@lru_cache(maxsize=64)
def _file_sha256(file: Path, modified: int, size: int) -> str:  # time and size are part of the cache's key
    return sha256_of(file)
