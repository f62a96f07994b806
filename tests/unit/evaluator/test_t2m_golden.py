"""The T2M networks give the numbers that the public classes gave, with the same weights: at full size, 1e-4."""

from __future__ import annotations

import json
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
import torch.nn.functional as F
from torch import Tensor, nn

from marey.evaluator.t2m_model import T2MConfig, T2MMotionEncoder, T2MTextEncoder
from marey.evaluator.t2m_words import TAGS
from tests.support.golden import assert_golden

GOLDEN: dict[str, Any] = json.loads((Path(__file__).parent / "t2m_golden.json").read_text())


def fill(network: nn.Module) -> None:
    """Give a network the weights of the golden numbers: normal numbers seeded by each tensor's own name."""
    state: dict[str, Tensor] = {}
    for name, value in network.state_dict().items():
        drawn = np.random.RandomState(zlib.crc32(name.encode())).standard_normal(tuple(value.shape))
        if value.dim() >= 2:
            drawn = drawn / np.sqrt(np.prod(value.shape[1:]))
        else:
            drawn = 0.05 * drawn + (1 if name.endswith("weight") else 0)
        state[name] = torch.from_numpy(drawn.astype(np.float32))
    network.load_state_dict(state)


def normals(seed: int, *shape: int) -> Tensor:
    return torch.from_numpy(np.random.RandomState(seed).standard_normal(shape).astype(np.float32))


@pytest.fixture
def config() -> T2MConfig:
    return T2MConfig()


@torch.no_grad()
def test_motions_are_embedded_as_by_the_public_networks(config: T2MConfig) -> None:
    network = T2MMotionEncoder(config).eval()
    fill(network.movement)
    fill(network.motion)
    # `forward` sets frames beyond a motion's length to zero; these numbers were made without
    steps = network.movement(normals(21, 2, 196, 263))
    assert_golden(steps, GOLDEN["t2m_movement"])
    assert_golden(network.motion(steps, torch.tensor([49, 30])), GOLDEN["t2m_motion"])


@torch.no_grad()
def test_sentences_are_embedded_as_by_the_public_networks(config: T2MConfig) -> None:
    network = T2MTextEncoder(config).eval()
    fill(network)
    tags = F.one_hot(torch.full((2, 22), TAGS.index("ADP")), config.tags).float()
    assert_golden(network.embed(normals(22, 2, 22, 300), tags, torch.tensor([12, 7])), GOLDEN["t2m_text"])
