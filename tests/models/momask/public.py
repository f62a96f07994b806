"""Names and shapes of MoMask's public checkpoints, written down from a description of the files, and weights for them.

Independent of `marey.models.momask.names`, which is tested against them.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

Shapes = dict[str, tuple[int, ...]]
GOLDEN: dict[str, Any] = json.loads((Path(__file__).parent / "golden.json").read_text())
"""Numbers that the public classes gave with the weights and inputs of this module."""


@dataclass(frozen=True)
class Sizes:
    """Sizes of a public checkpoint; the defaults are the published ones."""

    features: int = 263
    width: int = 512
    depth: int = 3
    codes: int = 512
    code_width: int = 512
    levels: int = 6
    text: int = 512
    layers: int = 8
    heads: int = 6
    latent: int = 384
    feedforward: int = 1024


FULL = Sizes()
SMALL = Sizes(width=16, depth=2, codes=24, code_width=16, levels=4, layers=2, heads=2, latent=16, feedforward=32)


def _layer(name: str, *shape: int) -> Shapes:
    return {f"{name}.weight": shape, f"{name}.bias": shape[:1]}


def rvq_shapes(s: Sizes = FULL) -> Shapes:
    shapes = {
        **_layer("encoder.model.0", s.width, s.features, 3),
        **_layer("encoder.model.4", s.code_width, s.width, 3),
        **_layer("decoder.model.0", s.width, s.code_width, 3),
        **_layer("decoder.model.4", s.width, s.width, 3),
        **_layer("decoder.model.6", s.features, s.width, 3),
    }
    for stage in (2, 3):
        shapes |= _layer(f"encoder.model.{stage}.0", s.width, s.width, 4)
        shapes |= _layer(f"decoder.model.{stage}.2", s.width, s.width, 3)
        for block in range(s.depth):
            for place in (f"encoder.model.{stage}.1.model.{block}", f"decoder.model.{stage}.0.model.{block}"):
                shapes |= _layer(f"{place}.conv1", s.width, s.width, 3) | _layer(f"{place}.conv2", s.width, s.width, 1)
    return shapes | {f"quantizer.layers.{v}.codebook": (s.codes, s.code_width) for v in range(s.levels)}


def _transformer_shapes(s: Sizes, outputs: int) -> Shapes:
    shapes = {
        **_layer("input_process.poseEmbedding", s.latent, s.code_width),
        **_layer("cond_emb", s.latent, s.text),
        "position_enc.pe": (5000, 1, s.latent),
        **_layer("output_process.dense", s.latent, s.latent),
        **_layer("output_process.LayerNorm", s.latent),
        **_layer("output_process.poseFinal", outputs, s.latent),
    }
    for k in range(s.layers):
        place = f"seqTransEncoder.layers.{k}"
        shapes |= {
            f"{place}.self_attn.in_proj_weight": (3 * s.latent, s.latent),
            f"{place}.self_attn.in_proj_bias": (3 * s.latent,),
            **_layer(f"{place}.self_attn.out_proj", s.latent, s.latent),
            **_layer(f"{place}.linear1", s.feedforward, s.latent),
            **_layer(f"{place}.linear2", s.latent, s.feedforward),
            **_layer(f"{place}.norm1", s.latent),
            **_layer(f"{place}.norm2", s.latent),
        }
    return shapes


def masked_shapes(s: Sizes = FULL) -> Shapes:
    return _transformer_shapes(s, s.codes) | {"token_emb.weight": (s.codes + 2, s.code_width)}


def residual_shapes(s: Sizes = FULL, *, shared: bool) -> Shapes:
    shapes = _transformer_shapes(s, s.code_width) | _layer("quant_emb", s.latent, s.levels)
    table = (s.codes + 1, s.code_width)
    if shared:
        return shapes | {
            "embed_proj_shared_weight": (s.levels - 2, *table),
            "token_embed_weight_": (1, *table),
            "output_proj_weight_": (1, *table),
        }
    return shapes | {
        "output_proj_weight": (s.levels - 1, *table),
        "output_proj_bias": (s.levels, s.codes + 1),
        "token_embed_weight": (s.levels - 1, *table),
    }


def length_shapes(s: Sizes = FULL) -> Shapes:
    return {
        **_layer("output.0", 512, s.text),
        **_layer("output.1", 512),
        **_layer("output.4", 256, 512),
        **_layer("output.5", 256),
        **_layer("output.8", 128, 256),
        **_layer("output.9", 128),
        **_layer("output.11", 50, 128),
    }


def drawn(name: str, shape: tuple[int, ...], salt: str = "") -> Tensor:
    """The weight that the golden numbers were made with: normal numbers seeded by the tensor's name."""
    values = np.random.RandomState(zlib.crc32((salt + name).encode())).standard_normal(shape)
    if len(shape) >= 2:
        values = values / np.sqrt(np.prod(shape[1:]))
    elif name.endswith("weight"):
        values = 1 + 0.05 * values
    else:
        values = 0.05 * values
    return torch.from_numpy(values.astype(np.float32))


def weights(shapes: Mapping[str, tuple[int, ...]], salt: str = "") -> dict[str, Tensor]:
    """Weights of the golden numbers, or others with `salt`; positions as the public code computes them."""
    found = {name: drawn(name, shape, salt) for name, shape in shapes.items() if name != "position_enc.pe"}
    if "position_enc.pe" in shapes:
        found["position_enc.pe"] = _positions(shapes["position_enc.pe"])
    return found


def _positions(shape: tuple[int, ...]) -> Tensor:
    angle = np.arange(shape[0])[:, None] * np.exp(np.arange(0, shape[2], 2) * (-np.log(10000.0) / shape[2]))
    table = np.zeros((shape[0], shape[2]))
    table[:, 0::2], table[:, 1::2] = np.sin(angle), np.cos(angle)
    return torch.from_numpy(table[:, None].astype(np.float32))


def normals(seed: int, *shape: int) -> Tensor:
    """The inputs of the golden numbers."""
    return torch.from_numpy(np.random.RandomState(seed).standard_normal(shape).astype(np.float32))
