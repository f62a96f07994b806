"""Weights by the recipe of the reference values: every tensor drawn from its published name alone."""

from __future__ import annotations

import math
import zlib
from collections.abc import Mapping

import numpy as np
import torch
from torch import Tensor


def drawn(name: str, shape: tuple[int, ...]) -> Tensor:
    """One tensor: standard normals seeded by the name, scaled by the fan-in; norms around 1, biases small."""
    values = np.random.RandomState(zlib.crc32(name.encode())).standard_normal(shape)
    if len(shape) >= 2:
        values /= math.sqrt(math.prod(shape[1:]))
    else:
        values = values * 0.05 + (1 if name.endswith("weight") else 0)
    return torch.from_numpy(values.astype(np.float32))


def state_of(shapes: Mapping[str, tuple[int, ...]]) -> dict[str, Tensor]:
    return {name: drawn(name, shape) for name, shape in shapes.items()}


def inputs(seed: int, *shape: int) -> Tensor:
    return torch.from_numpy(np.random.RandomState(seed).standard_normal(shape).astype(np.float32))


def encoder_shapes(features: int, width: int = 256, feedforward: int = 1024, layers: int = 6) -> dict:
    """Names and shapes of one encoder of SnapMoGen's evaluator: 77 tensors at the published sizes."""
    head = {"linear.weight": (width, width), "linear.bias": (width,)}
    return actor_shapes(features, width, feedforward, layers) | head


def actor_shapes(features: int, width: int = 256, feedforward: int = 1024, layers: int = 6) -> dict:
    """Names and shapes of one encoder of TMR, of ACTOR's design: 75 tensors at the published sizes."""
    shapes: dict[str, tuple[int, ...]] = {
        "tokens": (2, width), "projection.weight": (width, features), "projection.bias": (width,),
    }  # fmt: skip
    for layer in (f"seqTransEncoder.layers.{n}" for n in range(layers)):
        shapes |= {
            f"{layer}.self_attn.in_proj_weight": (3 * width, width), f"{layer}.self_attn.in_proj_bias": (3 * width,),
            f"{layer}.self_attn.out_proj.weight": (width, width), f"{layer}.self_attn.out_proj.bias": (width,),
            f"{layer}.linear1.weight": (feedforward, width), f"{layer}.linear1.bias": (feedforward,),
            f"{layer}.linear2.weight": (width, feedforward), f"{layer}.linear2.bias": (width,),
            f"{layer}.norm1.weight": (width,), f"{layer}.norm1.bias": (width,),
            f"{layer}.norm2.weight": (width,), f"{layer}.norm2.bias": (width,),
        }  # fmt: skip
    return shapes
