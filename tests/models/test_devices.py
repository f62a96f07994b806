"""Every model on a device of its own: networks and all that is computed with them."""

from __future__ import annotations

from typing import Any

import pytest
import torch
from torch import Tensor

from marey.generation.port import KeptFrames, Request
from marey.nn.bundling import NetworkParts
from marey.registry import model_names
from tests.support.devices import like_another_device, unpacked
from tests.support.generating import equal_motions
from tests.support.models import KEEPING, load, random_bundle
from tests.support.prepared import text_features


@pytest.fixture(scope="module", params=model_names())
def generator(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Any:
    """A generator of each model with random weights, which are not packed."""
    bundle = random_bundle(request.param, tmp_path_factory.mktemp("bundle") / "random")
    with unpacked():
        return load(bundle, dtype=torch.float32)


def requests(generator: Any) -> list[Request]:
    """Short, long, and of no given length; where the model can, around frames that stay, with a prompt and without."""
    least, most = generator.limits.min_frames, generator.limits.max_frames
    asked = [Request(text_features(i), i, frames) for i, frames in enumerate((least, most, most - 1, None))]
    if generator.bundle.manifest.model in KEEPING:
        (source,) = generator.generate([Request(text_features(9), 1, 88)])
        kept = (KeptFrames(0, source.features[:32]), KeptFrames(64, source.features[64:]))
        asked += [Request(text_features(5), seed, 88, kept=kept, free=bool(seed)) for seed in range(2)]
    return asked


def test_no_tensor_of_a_generation_is_made_on_another_device(generator: Any) -> None:
    asked = requests(generator)
    wanted = generator.generate(asked)
    with like_another_device():
        made = generator.generate(asked)
    assert equal_motions(made, wanted)


def tensors_of(generator: Any) -> list[Tensor]:
    """Weights and buffers of all networks that a generator has."""
    held = vars(generator).values()
    parts = [part for each in held if isinstance(each, NetworkParts) for part in each.parts().values()]
    modules = [*parts, *(each for each in held if isinstance(each, torch.nn.Module))]
    return [tensor for module in modules for tensor in (*module.parameters(), *module.buffers())]


def test_networks_are_on_the_device_that_is_asked_for(generator: Any) -> None:
    elsewhere = load(generator.bundle, device="meta")
    assert elsewhere.device == torch.device("meta")
    assert len(tensors_of(elsewhere)) == len(tensors_of(generator)) > 20
    assert {tensor.device for tensor in tensors_of(elsewhere)} == {torch.device("meta")}
    assert {tensor.device for tensor in tensors_of(generator)} == {torch.device("cpu")}
