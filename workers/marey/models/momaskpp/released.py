"""Names of the published weights' tensors, and of ours."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from torch import Tensor

from marey.core.errors import InvalidFile

Rule = tuple[str, str]
"""Pattern of a published name, and ours."""

_RESIDUALS: tuple[Rule, ...] = (
    (r"(.*)\.model\.(\d+)\.conv1\.(\w+)", r"\1.blocks.\2.wide.\3"),
    (r"(.*)\.model\.(\d+)\.conv2\.(\w+)", r"\1.blocks.\2.narrow.\3"),
)
_ATTENTION: tuple[Rule, ...] = (
    (r"(.*)\.in_proj_(weight|bias)", r"\1.qkv.\2"),
    (r"(.*)\.out_proj\.(weight|bias)", r"\1.out.\2"),
)

TOKENIZER: tuple[Rule, ...] = (
    *_ATTENTION,
    (r"(encoder|decoder)\.embed\.0\.(\w+)", r"\1.in_proj.\2"),
    (r"encoder\.res_blocks\.(\d+)\.0\.(weight|bias)", r"encoder.down.\1.\2"),
    (r"encoder\.res_blocks\.(\d+)\.1\.(.*)", r"encoder.residuals.\1.\2"),
    (r"decoder\.res_blocks\.(\d+)\.0\.(.*)", r"decoder.residuals.\1.\2"),
    (r"decoder\.res_blocks\.(\d+)\.2\.(weight|bias)", r"decoder.up.\1.\2"),
    (r"(encoder|decoder)\.attn_blocks\.(\d+)\.attn_block\.(.*)", r"\1.attention.\2.attention.\3"),
    (r"(encoder|decoder)\.attn_blocks\.(\d+)\.norm\.(\w+)", r"\1.attention.\2.norm.\3"),
    (r"encoder\.outproj\.(\w+)", r"encoder.out_proj.\1"),
    (r"decoder\.outproj\.0\.(\w+)", r"decoder.smooth.\1"),
    (r"decoder\.outproj\.2\.(\w+)", r"decoder.out_proj.\1"),
    (r"quantizer\.codebook", r"quantizer.codebooks"),
    *_RESIDUALS,
)
MASKED: tuple[Rule, ...] = (
    *_ATTENTION,
    (r"token_emb\.weight", r"embedding.weight"),
    (r"input_process\.poseEmbedding\.(\w+)", r"project.\1"),
    (r"cond_emb\.(\w+)", r"words.project.\1"),
    (r"seqTransEncoder\.layers\.(\d+)\.self_attn\.(.*)", r"transformer.blocks.\1.attention.\2"),
    (r"seqTransEncoder\.layers\.(\d+)\.multihead_attn\.(.*)", r"transformer.blocks.\1.cross.\2"),
    (r"seqTransEncoder\.layers\.(\d+)\.linear1\.(\w+)", r"transformer.blocks.\1.wide.\2"),
    (r"seqTransEncoder\.layers\.(\d+)\.linear2\.(\w+)", r"transformer.blocks.\1.narrow.\2"),
    (r"seqTransEncoder\.layers\.(\d+)\.(norm\d\.\w+)", r"transformer.blocks.\1.\2"),
    (r"output_process\.dense\.(\w+)", r"dense.\1"),
    (r"output_process\.LayerNorm\.(\w+)", r"norm.\1"),
    (r"output_process\.poseFinal\.(\w+)", r"codes.\1"),
)
REFINER: tuple[Rule, ...] = (
    (r"layers\.0\.0\.(\w+)", r"in_proj.\1"),
    (r"layers\.1\.(model\..*)", r"residuals.\1"),
    (r"layers\.2\.(\w+)", r"out_proj.\1"),
    *_RESIDUALS,
)
UNUSED = re.compile(r"position_enc\.pe|lvl_1L|lvl_embed\.weight|clip_model\..*")
"""Tensors of the transformer's file that nothing reads: made anew, or of an option that is off."""


def renamed(state: Mapping[str, Tensor], rules: Sequence[Rule], where: str = "") -> dict[str, Tensor]:
    """Return published tensors under our names; those of `UNUSED` are left out.

    Args:
        state: of one network, names without a prefix.
        rules: `TOKENIZER`, `MASKED` or `REFINER`.
        where: for errors.

    Raises:
        InvalidFile: a tensor that no rule knows.
    """
    ours: dict[str, Tensor] = {}
    for name, value in state.items():
        if UNUSED.fullmatch(name):
            continue
        new = name
        for pattern, replacement in rules:
            new = re.sub(f"^(?:{pattern})$", replacement, new)
        if new == name:
            raise InvalidFile(
                f"holds a tensor {name!r} that this network does not have",
                where=where,
                hint="Give the published file as it was downloaded.",
            )
        ours.update(_values(new, value))
    return ours


def _values(name: str, value: Tensor) -> dict[str, Tensor]:
    """Tensors of ours that one published tensor fills: queries are apart from keys and values in cross-attention."""
    if name == "quantizer.codebooks":
        return {name: value[None]}
    module, _, kind = name.rpartition(".")
    if module.endswith("cross.qkv"):
        module = module.removesuffix(".qkv")
        width = len(value) // 3
        return {f"{module}.query.{kind}": value[:width], f"{module}.memory.{kind}": value[width:]}
    return {name: value}
