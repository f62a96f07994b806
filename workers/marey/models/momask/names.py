"""Tensor names of MoMask's public checkpoints, and the networks' own names for them.

Names and shapes: EricGuo5513/momask-codes (MIT). Most tensors have another name here and are otherwise the same; tables
of codes are stacked or cut (`Tables`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field

import torch
from torch import Tensor

from marey.models.momask.config import MoMaskConfig, TransformerConfig

State = Mapping[str, Tensor]
Shape = tuple[int, ...]

CLIP = "clip_model."
"""Prefix of the text encoder's weights, which a few files carry: the encoder is loaded apart."""
POSITIONS = frozenset({"position_enc.pe"})


@dataclass(frozen=True)
class Tables:
    """Public tensors that are not taken over one by one.

    Attributes:
        shapes: by public name.
        convert: public tensors to those of the network, by its names.
    """

    shapes: Mapping[str, Shape] = field(default_factory=dict[str, Shape])
    convert: Callable[[State], dict[str, Tensor]] = lambda _: {}


@dataclass(frozen=True)
class PartNames:
    """Names of one network.

    Attributes:
        renamed: public name to the network's own.
        tables: the other public tensors that are needed.
        recomputed: public tensors that are not needed.
    """

    renamed: Mapping[str, str]
    tables: Tables = Tables()
    recomputed: frozenset[str] = frozenset()

    def convert(self, public: State) -> dict[str, Tensor]:
        """Return the network's tensors, made of the public ones."""
        return {ours: public[theirs] for theirs, ours in self.renamed.items()} | self.tables.convert(public)


def tokenizer_names(config: MoMaskConfig) -> PartNames:
    """Return the names of the RVQ-VAE."""
    t = config.tokenizer
    last = 2 + t.stages
    layers = {
        "encoder.model.0": "encoder.in_proj",
        f"encoder.model.{last}": "encoder.out_proj",
        "decoder.model.0": "decoder.in_proj",
        f"decoder.model.{last}": "decoder.smooth",
        f"decoder.model.{last + 2}": "decoder.out_proj",
    }
    for stage in range(t.stages):
        layers[f"encoder.model.{stage + 2}.0"] = f"encoder.down.{stage}"
        layers[f"decoder.model.{stage + 2}.2"] = f"decoder.up.{stage}"
        for block in range(t.depth):
            for theirs, ours in (("conv1", "wide"), ("conv2", "narrow")):
                place = f"residuals.{stage}.blocks.{block}.{ours}"
                layers[f"encoder.model.{stage + 2}.1.model.{block}.{theirs}"] = f"encoder.{place}"
                layers[f"decoder.model.{stage + 2}.0.model.{block}.{theirs}"] = f"decoder.{place}"
    books = [f"quantizer.layers.{level}.codebook" for level in range(t.levels)]
    tables = Tables(
        dict.fromkeys(books, (t.codes, t.code_width)),
        lambda public: {"quantizer.codebooks": torch.stack([public[name] for name in books])},
    )
    return PartNames(dict(_parameters(layers)), tables)


def masked_names(config: MoMaskConfig) -> PartNames:
    """Return the names of the masked transformer."""
    layers = {**_transformer_layers(config.masked), "output_process.poseFinal": "head.final"}
    tokens = {"token_emb.weight": "embedding.weight"}
    renamed = dict(_parameters(layers)) | _attention_names(config.masked) | tokens
    return PartNames(renamed, recomputed=POSITIONS)


def residual_names(config: MoMaskConfig) -> PartNames:
    """Return the names of the residual transformer, with shared or with separate tables."""
    layers = {
        **_transformer_layers(config.residual),
        "output_process.poseFinal": "head.final",
        "quant_emb": "level",
    }
    renamed = dict(_parameters(layers)) | _attention_names(config.residual)
    tables = _shared_tables(config) if config.shared else _separate_tables(config)
    return PartNames(renamed, tables, POSITIONS)


def length_names(config: MoMaskConfig) -> PartNames:
    """Return the names of the length estimator, whose public layers are numbered with dropout between them."""
    layers: dict[str, str] = {}
    for k in range(len(config.length_hidden)):
        layers[f"output.{4 * k}"] = f"layers.{3 * k}"
        layers[f"output.{4 * k + 1}"] = f"layers.{3 * k + 1}"
    last = len(config.length_hidden)
    layers[f"output.{4 * last - 1}"] = f"layers.{3 * last}"  # no dropout before it
    return PartNames(dict(_parameters(layers)))


def _shared_tables(config: MoMaskConfig) -> Tables:
    t = config.tokenizer
    one = (1, t.codes + 1, t.code_width)
    first, between, last = "token_embed_weight_", "embed_proj_shared_weight", "output_proj_weight_"

    def convert(public: State) -> dict[str, Tensor]:
        return {
            "embedding": torch.cat([public[first], public[between]]),
            "output": public[last],
            "bias": torch.zeros(t.levels - 1, t.codes + 1),
        }

    return Tables({first: one, between: (t.levels - 2, *one[1:]), last: one}, convert)


def _separate_tables(config: MoMaskConfig) -> Tables:
    """The public code adds the product to itself before the bias (`output += output + bias`): doubled tables give the
    same bits. Its bias has a row more than levels that are predicted, the last."""
    t = config.tokenizer
    table = (t.levels - 1, t.codes + 1, t.code_width)
    embedding, output, bias = "token_embed_weight", "output_proj_weight", "output_proj_bias"

    def convert(public: State) -> dict[str, Tensor]:
        return {"embedding": public[embedding], "output": 2 * public[output], "bias": public[bias][: t.levels - 1]}

    return Tables({embedding: table, output: table, bias: (t.levels, t.codes + 1)}, convert)


def _transformer_layers(config: TransformerConfig) -> dict[str, str]:
    """Return layers with weight and bias that both transformers have."""
    layers = {
        "input_process.poseEmbedding": "project",
        "cond_emb": "condition.project",
        "output_process.dense": "head.dense",
        "output_process.LayerNorm": "head.norm",
    }
    inner = {
        "self_attn.out_proj": "attention.out",
        "linear1": "wide",
        "linear2": "narrow",
        "norm1": "norm1",
        "norm2": "norm2",
    }
    for k in range(config.layers):
        for theirs, ours in inner.items():
            layers[f"seqTransEncoder.layers.{k}.{theirs}"] = f"sequence.transformer.blocks.{k}.{ours}"
    return layers


def _attention_names(config: TransformerConfig) -> dict[str, str]:
    return {
        f"seqTransEncoder.layers.{k}.self_attn.in_proj_{kind}": f"sequence.transformer.blocks.{k}.attention.qkv.{kind}"
        for k in range(config.layers)
        for kind in ("weight", "bias")
    }


def _parameters(layers: Mapping[str, str]) -> Iterator[tuple[str, str]]:
    for theirs, ours in layers.items():
        for kind in ("weight", "bias"):
            yield f"{theirs}.{kind}", f"{ours}.{kind}"
