"""The published networks, rebuilt: values that the published code computed with weights drawn from their names."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from torch import Tensor, nn

from marey.core.errors import InvalidFile
from marey.models.momaskpp.config import RELEASED_HUMANML3D, RELEASED_SNAPMOGEN, MoMaskPPConfig
from marey.models.momaskpp.model import RootRefiner, ScaleTransformer
from marey.models.momaskpp.released import MASKED, REFINER, TOKENIZER, renamed
from marey.models.momaskpp.scales import Scales
from marey.models.momaskpp.tokenizer import Tokenizer
from marey.nn.convolution import frame_mask
from tests.models.momaskpp.published import drawn, masked_shapes, normal, refiner_shapes, tokenizer_shapes

GOLDEN: dict[str, Any] = json.loads((Path(__file__).parent / "golden.json").read_text(encoding="utf-8"))
CONFIGS = {"snap": RELEASED_SNAPMOGEN, "hml": RELEASED_HUMANML3D}
TRANSFORMERS = ["tr_snap_ca", "tr_snap_ic", "tr_hml_ca", "tr_hml_ic"]


def near(found: Tensor, expected: dict[str, Any], *, tolerance: float = 1e-4) -> None:
    """Compare with the picked values, and with mean and deviation."""
    assert list(found.shape) == expected["shape"]
    for place, value in expected["at"].items():
        assert float(found[tuple(json.loads(place))]) == pytest.approx(value, abs=tolerance), place
    assert float(found.mean()) == pytest.approx(expected["mean"], abs=1e-5)
    assert float(found.std(correction=0)) == pytest.approx(expected["std"], abs=1e-5)


def filled(network: nn.Module, state: dict[str, Tensor]) -> None:
    """Load tensors under our names; what stays is set in training alone, or is the identity."""
    found: Any = network.load_state_dict(state, strict=False)
    kept = {"mean", "std", "quantizer.counts", "quantizer.sums", "quantizer.initialized"}
    kept |= {"words.normalizer.mean", "words.normalizer.std"}
    assert not found.unexpected_keys
    assert set(found.missing_keys) <= kept
    network.eval().requires_grad_(False)


def transformer(config: MoMaskPPConfig, *, cross: bool) -> ScaleTransformer:
    masked = replace(config.masked, conditioning="cross-attention" if cross else "in-context")
    config = replace(config, masked=masked)
    scales = Scales.of(config)
    model = ScaleTransformer(config)
    shapes = masked_shapes(config.tokenizer.codes, scales.size, len(scales.divisors), cross=cross)
    filled(model, renamed(drawn(shapes), MASKED))
    return model


@pytest.mark.parametrize("name", ["snap", "hml"])
@torch.no_grad()
def test_the_tokenizer_gives_the_published_latents_indices_and_features(name: str) -> None:
    config, golden = CONFIGS[name], GOLDEN[f"vq_{name}"]
    model = Tokenizer(config)
    filled(model, renamed(drawn(tokenizer_shapes(config.features, config.tokenizer.codes)), TOKENIZER))
    lengths = torch.tensor([320, 200] if name == "snap" else [196, 100])
    features = normal(7, 2, config.max_frames, config.features)
    features = features * frame_mask(lengths, config.max_frames)[..., None]  # statistics are zero and one
    latent, tokens = model.latents(features, lengths)
    near(latent.transpose(1, 2), golden["enc"])
    ours = model.quantizer.indices(latent, tokens)
    for scale, index in enumerate(model.scales.split(ours)):
        assert index[:, :6].tolist() == golden["idx_toklens"][scale]
        assert int((index < 0).sum()) == golden["neg_toklens"][scale]
    vectors = model.quantizer.vectors(ours, tokens, model.scales.longest)
    near(vectors.transpose(1, 2), golden["f"])
    near(model.reconstruct(vectors, tokens), golden["dec"])
    # encoding cuts residuals at the number of frames, and then the tokens at the clip's end
    cut = model.scales.split(model.encode(features, lengths)[..., 0])
    for scale, index in enumerate(cut):
        expected = torch.tensor(golden["idx_framelens"][scale])
        valid = frame_mask(model.scales.counts(tokens, scale), 6)
        assert index[:, :6].tolist() == expected.masked_fill(~valid, -1).tolist()


@pytest.mark.parametrize("name", TRANSFORMERS)
@torch.no_grad()
def test_the_transformers_give_the_published_logits(name: str) -> None:
    _, data, variant = name.split("_")
    golden, config = GOLDEN[name], CONFIGS[data]
    assert golden["heads"] == config.masked.heads
    model = transformer(config, cross=variant == "ca")
    scales, codes = Scales.of(config), config.tokenizer.codes
    assert scales.size == golden["N"]
    lengths, words = (torch.tensor(each) for each in (([80, 50], [120, 37]) if data == "snap" else ([49, 25], [20, 9])))
    tokens = torch.from_numpy(np.random.RandomState(11).randint(0, codes, (2, scales.size)))
    tokens[:, ::3] = model.mask_token
    valid = scales.valid(lengths)
    assert int((~valid).sum()) == golden["npad"]
    states = normal(13, 2, config.text.max_words, 768)
    present = frame_mask(words, config.text.max_words)
    positions = torch.arange(scales.size)
    null = model.words(states, torch.tensor([True, True]))
    branches = {"cond": model.words(states), "uncond": null}
    for branch, condition in branches.items():
        logits = model(tokens, positions, valid, condition, present)
        near((logits * valid[..., None]).transpose(1, 2), golden[branch])
    both = torch.cat(list(branches.values()))
    guided = model(tokens.repeat(2, 1), positions, valid.repeat(2, 1), both, present.repeat(2, 1), golden["cs"])
    near((guided * valid[..., None]).transpose(1, 2), golden["cfg"])


@torch.no_grad()
def test_the_refiner_gives_the_published_velocity() -> None:
    model = RootRefiner(RELEASED_SNAPMOGEN)
    filled(model, renamed(drawn(refiner_shapes()), REFINER))
    near(model(normal(17, 1, 60, 290)), GOLDEN["gmr"])


@pytest.mark.parametrize(
    ("rules", "shapes", "parameters"),
    [
        (TOKENIZER, tokenizer_shapes(296, 2048), 23_744_808),
        (TOKENIZER, tokenizer_shapes(263, 512), 23_643_399),
        (MASKED, masked_shapes(2048, 120, 2, cross=True), 18_262_656),
        (MASKED, masked_shapes(2048, 120, 2, cross=False), 13_525_632),
        (MASKED, masked_shapes(512, 91, 4, cross=True), 16_885_632),
        (MASKED, masked_shapes(512, 91, 4, cross=False), 12_148_608),
        (REFINER, refiner_shapes(), 3_597_826),
    ],
)
def test_every_published_tensor_has_a_place(rules: Any, shapes: dict[str, Any], parameters: int) -> None:
    state = {name: torch.empty(shape, device="meta") for name, shape in shapes.items()}
    ours = renamed(state, rules)
    published = {n: v for n, v in state.items() if not n.startswith(("position_enc", "lvl_"))}
    assert sum(v.numel() for v in ours.values()) == sum(v.numel() for v in published.values())
    levels = sum(v.numel() for n, v in state.items() if n == "lvl_embed.weight")
    books = sum(v.numel() for n, v in state.items() if n == "quantizer.codebook")  # no parameter there
    assert sum(v.numel() for v in published.values()) + levels - books == parameters


def test_a_tensor_of_another_network_is_refused() -> None:
    with pytest.raises(InvalidFile, match=r"'res_transformer\.a' that this network does not have") as told:
        renamed({"res_transformer.a": torch.zeros(1)}, MASKED, "net.tar")
    assert told.value.where == "net.tar"
