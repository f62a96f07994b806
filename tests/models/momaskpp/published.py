"""Names and shapes of the published networks' tensors, and weights drawn from the names alone."""

from __future__ import annotations

import zlib
from collections.abc import Mapping

import numpy as np
import torch
from torch import Tensor

Shapes = dict[str, tuple[int, ...]]


def _pair(name: str, *shape: int) -> Shapes:
    """A weight and its bias."""
    return {f"{name}.weight": shape, f"{name}.bias": shape[:1]}


def _attention(name: str, width: int) -> Shapes:
    projections = {f"{name}.in_proj_weight": (3 * width, width), f"{name}.in_proj_bias": (3 * width,)}
    return projections | _pair(f"{name}.out_proj", width, width)


def _residuals(name: str, width: int, depth: int) -> Shapes:
    shapes: Shapes = {}
    for block in range(depth):
        shapes |= _pair(f"{name}.model.{block}.conv1", width, width, 3)
        shapes |= _pair(f"{name}.model.{block}.conv2", width, width, 1)
    return shapes


def tokenizer_shapes(features: int, codes: int, *, width: int = 512, code_width: int = 512, depth: int = 3) -> Shapes:
    """The multi-scale RVQ-VAE."""
    shapes = _pair("encoder.embed.0", width, features, 3) | _pair("decoder.embed.0", width, code_width, 3)
    for stage in range(2):
        shapes |= _pair(f"encoder.res_blocks.{stage}.0", width, width, 4)
        shapes |= _residuals(f"encoder.res_blocks.{stage}.1", width, depth)
        shapes |= _residuals(f"decoder.res_blocks.{stage}.0", width, depth)
        shapes |= _pair(f"decoder.res_blocks.{stage}.2", width, width, 3)
        for side in ("encoder", "decoder"):
            shapes |= _attention(f"{side}.attn_blocks.{stage}.attn_block", width)
            shapes |= {f"{side}.attn_blocks.{stage}.norm.{kind}": (width,) for kind in ("weight", "bias")}
    shapes |= _pair("encoder.outproj", code_width, width, 3)
    shapes |= _pair("decoder.outproj.0", width, width, 3) | _pair("decoder.outproj.2", features, width, 3)
    return shapes | {"quantizer.codebook": (codes, code_width)}


def masked_shapes(
    codes: int,
    positions: int,
    scales: int,
    *,
    cross: bool,
    width: int = 384,
    embedding: int = 512,
    text: int = 768,
    feedforward: int = 1024,
    layers: int = 8,
) -> Shapes:
    """The masked transformer, with the tensors that nothing reads."""
    shapes: Shapes = {"token_emb.weight": (codes + 2, embedding), "lvl_embed.weight": (scales, width)}
    shapes |= {"position_enc.pe": (500, 1, width), "lvl_1L": (positions,)}
    shapes |= _pair("input_process.poseEmbedding", width, embedding) | _pair("cond_emb", width, text)
    for layer in range(layers):
        name = f"seqTransEncoder.layers.{layer}"
        shapes |= _attention(f"{name}.self_attn", width)
        shapes |= _attention(f"{name}.multihead_attn", width) if cross else {}
        shapes |= _pair(f"{name}.linear1", feedforward, width) | _pair(f"{name}.linear2", width, feedforward)
        for norm in range(1, 4 if cross else 3):
            shapes |= {f"{name}.norm{norm}.{kind}": (width,) for kind in ("weight", "bias")}
    shapes |= _pair("output_process.dense", width, width) | _pair("output_process.poseFinal", codes, width)
    return shapes | {f"output_process.LayerNorm.{kind}": (width,) for kind in ("weight", "bias")}


def refiner_shapes(inputs: int = 290, *, width: int = 512, depth: int = 3) -> Shapes:
    """The root refiner."""
    shapes = _pair("layers.0.0", width, inputs, 3) | _residuals("layers.1", width, depth)
    return shapes | _pair("layers.2", 2, width, 3)


def drawn(shapes: Mapping[str, tuple[int, ...]]) -> dict[str, Tensor]:
    """Weights that the reference values were computed with: normal numbers seeded by each tensor's name."""
    return {name: torch.from_numpy(_values(name, shape)) for name, shape in shapes.items()}


def _values(name: str, shape: tuple[int, ...]) -> np.ndarray:
    if name == "lvl_1L":
        return np.zeros(shape, np.int64)
    values = np.random.RandomState(zlib.crc32(name.encode())).standard_normal(shape)
    if values.ndim >= 2:
        values /= np.sqrt(np.prod(shape[1:]))
    else:
        values = values * 0.05 + (1.0 if name.endswith("weight") else 0.0)
    return values.astype(np.float32)


def normal(seed: int, *shape: int) -> Tensor:
    """Inputs of the reference values."""
    return torch.from_numpy(np.random.RandomState(seed).standard_normal(shape).astype(np.float32))
