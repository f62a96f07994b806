"""Tensors of a bundle in networks: all of them fit, or the part is named."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from torch import nn

from marey.bundles import Bundle
from marey.core import defaults
from marey.core.errors import InvalidBundle
from marey.motion.features import layout
from marey.nn.bundling import fill, standing, stored
from marey.registry import get_model, resolve
from tests.support.models import random_bundle

PART = "tokenizer"
MATRIX = "encoder.down.0.weight"


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    return random_bundle(defaults.MODEL, tmp_path_factory.mktemp("bundle") / "random")


@pytest.fixture
def network(bundle: Bundle) -> nn.Module:
    tokenizer = get_model(defaults.MODEL).tokenizer
    assert tokenizer is not None
    return resolve(tokenizer)(bundle.manifest.parameters).train()


def test_a_filled_network_holds_the_tensors_and_does_not_train(bundle: Bundle, network: nn.Module) -> None:
    fill(network, bundle, PART)
    tensors, state = bundle.tensors(PART), network.state_dict()
    assert MATRIX in tensors
    assert all(np.array_equal(state[name].numpy().reshape(value.shape), value) for name, value in tensors.items())
    assert {name for name in state if not stored(name)} == state.keys() - tensors.keys()
    assert not network.training
    assert not any(each.requires_grad for each in network.parameters())


Damage = Callable[[dict[str, Any]], object]


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (lambda tensors: tensors.pop(MATRIX), rf"missing \['{MATRIX}'\], unknown \[\]"),
        (lambda tensors: tensors.update(other=np.zeros(3, np.float32)), r"missing \[\], unknown \['other'\]"),
        (lambda tensors: tensors.update({MATRIX: tensors[MATRIX][:-1]}), "size mismatch for .*down.0.weight"),
        (lambda tensors: tensors.update({MATRIX: tensors[MATRIX].astype(np.int8)}), "does not fit its scales"),
    ],
    ids=["missing", "unknown", "shape", "scales"],
)
def test_tensors_that_do_not_fit_are_told_with_their_part(
    damage: Damage, said: str, bundle: Bundle, network: nn.Module, monkeypatch: pytest.MonkeyPatch
) -> None:
    damaged = dict(bundle.tensors(PART))
    damage(damaged)
    monkeypatch.setattr(bundle, "tensors", lambda _part: damaged)
    with pytest.raises(InvalidBundle, match=said) as refused:
        fill(network, bundle, PART)
    assert refused.value.where == f"{bundle.path}: {PART}"


def test_a_bundle_of_random_weights_leaves_the_generator_of_torch_alone(tmp_path: Path) -> None:
    torch.manual_seed(5)
    before = torch.get_rng_state()
    made = random_bundle(defaults.MODEL, tmp_path / "random", seed=1)
    assert torch.equal(torch.get_rng_state(), before)
    assert made.tensors(PART)["quantizer.initialized"]
    assert np.abs(made.tensors(PART)["quantizer.codebooks"]).mean() > 0.5


@pytest.mark.parametrize("name", ["humanml3d-263", "kit-251"])
def test_statistics_of_random_weights_are_those_of_a_person_who_stands_on_the_ground(name: str) -> None:
    mean, std = standing(name)
    features = layout(name)
    assert mean.shape == std.shape == (features.dim,)
    assert set(std.tolist()) == {np.float32(0.01), np.float32(0.05)}
    assert (std[:4] == np.float32(0.01)).all(), "a root that hardly moves"
    joints = features.decode(np.repeat(mean[None], 5, 0))
    assert np.ptp(joints, axis=0).max() < 0.05, "it stands still"
    assert abs(joints[..., 1].min()) < 0.05
    bones = np.linalg.norm(joints[0] - joints[0, features.skeleton.parents], axis=-1)[1:]
    np.testing.assert_allclose(bones, np.linalg.norm(features.skeleton.offsets, axis=-1)[1:], atol=0.02)
