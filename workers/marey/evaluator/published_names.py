"""Names of tensors in published encoders of ACTOR's design (Petrovich et al. 2021): those of TMR and SnapMoGen."""

from __future__ import annotations

import re

PUBLISHED = (
    (r"encoder\.project\.(.*)", r"projection.\1"),
    (r"encoder\.distribution", "tokens"),
    (r"encoder\.transformer\.blocks\.(\d+)\.attention\.qkv\.(.*)", r"seqTransEncoder.layers.\1.self_attn.in_proj_\2"),
    (r"encoder\.transformer\.blocks\.(\d+)\.attention\.out\.(.*)", r"seqTransEncoder.layers.\1.self_attn.out_proj.\2"),
    (r"encoder\.transformer\.blocks\.(\d+)\.wide\.(.*)", r"seqTransEncoder.layers.\1.linear1.\2"),
    (r"encoder\.transformer\.blocks\.(\d+)\.narrow\.(.*)", r"seqTransEncoder.layers.\1.linear2.\2"),
    (r"encoder\.transformer\.blocks\.(\d+)\.(norm.*)", r"seqTransEncoder.layers.\1.\2"),
    (r"head\.(.*)", r"linear.\1"),
)
"""Our names of tensors, and the published ones."""


def published_name(name: str) -> str:
    """Return the published name of one of our tensors; see `PUBLISHED`.

    Raises:
        KeyError: it has none.
    """
    for own, published in PUBLISHED:
        if re.fullmatch(own, name):
            return re.sub(own, published, name)
    raise KeyError(name)
