"""Configurations of the public checkpoints: the sizes of their networks, and how their evaluations decode."""

from __future__ import annotations

from dataclasses import replace

import pytest

from marey.models.momask.config import KIT, T2M, InferenceConfig, MoMaskConfig
from marey.models.momask.model import LengthEstimator, MaskedTransformer, ResidualTransformer
from marey.models.momask.tokenizer import Tokenizer


@pytest.mark.parametrize(
    ("config", "body", "guidance"),
    [(T2M, ("humanml3d-263", 263, 22, 20.0), 4.0), (KIT, ("kit-251", 251, 21, 12.5), 2.0)],
    ids=["t2m", "kit"],
)
def test_a_checkpoint_has_its_body_and_the_guidance_of_its_evaluation(
    config: MoMaskConfig, body: tuple[str, int, int, float], guidance: float
) -> None:
    assert (config.layout, config.features, config.joints, config.fps) == body
    assert config.inference == InferenceConfig(
        steps=10,
        guidance=guidance,
        temperature=1.0,
        top_k=0.1,
        residual_guidance=5.0,
        residual_temperature=1.0,
        residual_top_k=0.1,
    )
    assert (config.min_frames, config.max_frames, config.max_tokens) == (16, 196, 49)
    assert replace(config, **{name: getattr(T2M, name) for name in ("name", "layout", "features", "joints", "fps")},
                   inference=T2M.inference) == T2M, "the same networks"  # fmt: skip


def test_the_networks_have_the_published_sizes() -> None:
    """MoMask Sec. 4 and its public options: 6 codebooks of 512 codes, 8 layers of 6 heads and 384 numbers."""
    tokenizer, masked = Tokenizer(T2M), MaskedTransformer(T2M)
    residual, length = ResidualTransformer(T2M), LengthEstimator(T2M)
    assert tokenizer.codebooks.shape == (6, 512, 512)
    assert tokenizer.frames_per_token == 4
    assert tokenizer.encoder.in_proj.weight.shape == (512, 263, 3)
    assert [block.wide.dilation for block in tokenizer.encoder.residuals[0].blocks] == [(9,), (3,), (1,)]
    for sequence in (masked.sequence, residual.sequence):
        blocks = sequence.transformer.blocks
        assert len(blocks) == 8
        assert (blocks[0].attention.heads, blocks[0].wide.weight.shape) == (6, (1024, 384))
        assert not blocks[0].norm_first
    assert masked.embedding.weight.shape == (514, 512), "codes, [MASK] and padding"
    assert residual.output.shape == (1, 513, 512), "tables are shared with the embedding"
    assert [layer.weight.shape for layer in length.layers if hasattr(layer, "in_features")] == [
        (512, 512), (256, 512), (128, 256), (50, 128),
    ]  # fmt: skip
