"""An imported bundle computes as the public code does, run beside it on the same checkpoints of random weights.

MAREY_MOMASK_CODES names a checkout of EricGuo5513/momask-codes (MIT); it needs the package `einops`. Text is a random
vector: CLIP is not run. Draws are replaced by the likeliest token on both sides.
"""

from __future__ import annotations

import os
import sys
from argparse import Namespace
from collections.abc import Iterator
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
import torch
from torch import Tensor, nn

from marey.generation.port import Request
from marey.importing import run_import
from marey.models.momask.bundle import load_networks
from marey.models.momask.generate import Generator, SamplingSettings
from marey.nn.convolution import frame_mask
from tests.models.momask.download import MASKED, RESIDUAL, RVQ, write_download
from tests.models.momask.public import normals
from tests.support.prepared import text_features
from tests.support.tiny_encoders import write_tiny_clip

CHECKOUT = os.environ.get("MAREY_MOMASK_CODES")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CHECKOUT is None, reason="MAREY_MOMASK_CODES names no checkout of EricGuo5513/momask-codes"),
]

TEXT = normals(31, 3, 512)
TOKENS = (49, 25, 7)
GREEDY = SamplingSettings(temperature=0.0, residual_temperature=0.0)
OPTIONS = Namespace(
    num_tokens=512, num_quantizers=6, device="cpu", shared_codebook=False, quantize_dropout_prob=0.2, mu=0.99
)


class _NoClip(nn.Module):
    """Stands where the public classes keep CLIP, which is not asked for anything."""


@pytest.fixture(scope="module")
def public() -> Iterator[ModuleType]:
    """The public module of transformers, whose draws take the likeliest token."""
    pytest.importorskip("einops")
    clip = ModuleType("clip")
    clip.load = lambda *_args, **_options: (_NoClip(), None)  # pyright: ignore[reportAttributeAccessIssue]
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(CHECKOUT)
        patch.setitem(sys.modules, "clip", clip)
        for name in [name for name in sys.modules if name.split(".")[0] == "models"]:
            patch.delitem(sys.modules, name)
        module = import_module("models.mask_transformer.transformer")
        patch.setattr(module, "gumbel_sample", lambda logits, temperature, dim: logits.argmax(dim))
        yield module
        for name in [name for name in sys.modules if name.split(".")[0] == "models"]:
            del sys.modules[name]


@pytest.fixture(scope="module", params=[True, False], ids=["shared", "separate"])
def folder(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_download(tmp_path_factory.mktemp("public"), shared=request.param, salt="oracle/")


@pytest.fixture(scope="module")
def generator(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Generator:
    clip = write_tiny_clip(tmp_path_factory.mktemp("clip"))
    bundle = run_import("momask", folder, tmp_path_factory.mktemp("models") / "t2m", text_encoder=clip)
    return Generator.load(bundle, device="cpu", dtype=torch.float32)


def loaded(network: Any, folder: Path, part: str, file: str, key: str) -> Any:
    """A public network with the weights of a checkpoint, which must fit; it reads the vectors `TEXT` as prompts."""
    weights = torch.load(folder / part / "model" / file, weights_only=True)[key]
    network.load_state_dict(weights)
    network.encode_text = lambda prompts: torch.cat([TEXT[k : k + 1] for k in prompts])
    return network.eval().requires_grad_(False)


def sizes(folder: Path) -> dict[str, Any]:
    return {
        "code_dim": 512, "cond_mode": "text", "latent_dim": 384, "ff_size": 1024, "num_layers": 8, "num_heads": 6,
        "dropout": 0.2, "clip_dim": 512, "clip_version": "ViT-B/32", "opt": Namespace(**vars(OPTIONS)),
    }  # fmt: skip


@pytest.fixture(scope="module")
def masked(public: ModuleType, folder: Path) -> Any:
    return loaded(public.MaskTransformer(**sizes(folder)), folder, MASKED, "latest.tar", "t2m_transformer")


@pytest.fixture(scope="module")
def residual(public: ModuleType, folder: Path, generator: Generator) -> Any:
    shared = generator.config.shared
    network = public.ResidualTransformer(**sizes(folder), shared_codebook=False, share_weight=shared)
    network = loaded(network, folder, RESIDUAL, "net_best_fid.tar", "res_transformer")
    network.process_embed_proj_weight()
    return network


@pytest.fixture(scope="module")
def tokenizer(public: ModuleType, folder: Path) -> Any:
    network = import_module("models.vq.model").RVQVAE(OPTIONS, 263, 512, 512, 512, 2, 2, 512, 3, 3, "relu", None)
    return loaded(network, folder, RVQ, "net_best_fid.tar", "vq_model")


def assert_close(ours: Tensor, theirs: Tensor, tolerance: float = 1e-4) -> None:
    torch.testing.assert_close(ours, theirs, rtol=0, atol=tolerance)


@torch.inference_mode()
def test_the_tokenizer(generator: Generator, tokenizer: Any) -> None:
    ours = generator.networks.tokenizer
    features = normals(32, 2, 100, 263)
    tokens, codes = tokenizer.encode(features)
    assert torch.equal(ours.encode(ours.restore(features)), tokens)
    assert_close(ours.quantizer.decode(tokens), codes.sum(0).transpose(1, 2))
    tokens[1, 20:] = -1
    assert_close(ours.normalize(ours.decode(tokens)), tokenizer.forward_decoder(tokens))


@torch.inference_mode()
def test_logits_of_the_masked_transformer(generator: Generator, masked: Any) -> None:
    ours = generator.networks.masked
    valid = frame_mask(torch.tensor(TOKENS), 49)
    ids = torch.from_numpy(np.random.RandomState(33).randint(0, 512, (3, 49)))
    ids[:, ::2] = masked.mask_id
    padded = ids.masked_fill(~valid, masked.pad_id)
    sentence, null = ours.condition(TEXT), ours.condition.null().expand(3, -1)
    one = masked.trans_forward(padded, TEXT, ~valid).transpose(1, 2)
    assert_close(ours(ids, valid, sentence)[valid], one[valid])
    guided = masked.forward_with_cond_scale(padded, TEXT, ~valid, cond_scale=4).transpose(1, 2)
    both = ours(ids.repeat(2, 1), valid.repeat(2, 1), torch.cat([sentence, null]), 4.0)
    assert_close(both[valid], guided[valid])


@torch.inference_mode()
def test_logits_of_the_residual_transformer(generator: Generator, residual: Any) -> None:
    ours = generator.networks.residual
    valid = frame_mask(torch.tensor(TOKENS), 49)
    total = normals(34, 3, 49, 512)
    sentence, null = ours.condition(TEXT), ours.condition.null().expand(3, -1)
    for level in range(1, 6):
        theirs = residual.forward_with_cond_scale(total, level, TEXT, ~valid, cond_scale=5).transpose(1, 2)
        both = ours(total.repeat(2, 1, 1), valid.repeat(2, 1), level, torch.cat([sentence, null]), 5.0)
        assert_close(both[valid], theirs[valid])
        tokens = torch.from_numpy(np.random.RandomState(level).randint(0, 513, (3, 49)))
        assert torch.equal(ours.embed(tokens, level - 1), residual.token_embed_weight[level - 1][tokens])


@torch.inference_mode()
def test_the_length_estimator(public: ModuleType, generator: Generator, folder: Path) -> None:
    network = import_module("models.vq.model").LengthEstimator(512, 50)
    theirs = loaded(network, folder, "length_estimator", "finest.tar", "estimator")
    assert_close(generator.networks.length(TEXT), theirs(TEXT))


@torch.inference_mode()
@pytest.mark.parametrize("row", range(3))
def test_a_whole_motion(generator: Generator, masked: Any, residual: Any, tokenizer: Any, row: int) -> None:
    count = torch.tensor([TOKENS[row]])
    base = masked.generate([row], count, timesteps=10, cond_scale=4, gsample=True)
    tokens = residual.generate(base, [row], count, temperature=1, cond_scale=5)
    text = text_features(0, 0, 0, width=512)
    request = Request(replace(text, nodes=TEXT[row : row + 1].numpy()), 1, 4 * TOKENS[row])  # pyright: ignore[reportArgumentType]
    (made,) = generator.generate([request], GREEDY)
    assert made is not None
    np.testing.assert_array_equal(made.tokens.T, tokens[0].numpy())
    ours = generator.networks.tokenizer
    assert_close(ours.normalize(torch.from_numpy(made.features)), tokenizer.forward_decoder(tokens)[0])


def test_the_bundle_is_that_of_the_checkpoints(generator: Generator) -> None:
    config, _ = load_networks(generator.bundle)
    assert (config.masked.layers, config.masked.heads, config.tokenizer.levels) == (8, 6, 6)
