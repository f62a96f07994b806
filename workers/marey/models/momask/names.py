"""Tensor names of MoMask's public checkpoints, and the networks' own names for them.

Names and shapes: EricGuo5513/momask-codes (MIT). Most tensors have another name here and are otherwise the same; tables
of codes are stacked, joined or cut.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import torch
from torch import Tensor, nn

from marey.importing import Section
from marey.models.momask.config import MoMaskConfig, TransformerConfig

State = dict[str, Tensor]


def _no_tables(_section: Section) -> State:
    return {}


@dataclass(frozen=True)
class PartNames:
    """Names of one network.

    Attributes:
        renamed: the network's own names to public ones, of tensors that are otherwise the same.
        tables: makes the network's other tensors of the public ones.
    """

    renamed: Mapping[str, str]
    tables: Callable[[Section], State] = _no_tables

    def fill(self, network: nn.Module, section: Section) -> None:
        """Load the public tensors into a network.

        Raises:
            InvalidFile: see `Section.fill`.
        """
        section.ignore(r"position_enc\.pe", "positions, computed anew")
        section.ignore(r"clip_model\..*", "the text encoder, installed apart")
        section.fill(network, lambda name: self.renamed.get(name, name), made=self.tables(section))


def tokenizer_names(config: MoMaskConfig) -> PartNames:
    """Return the names of the RVQ-VAE."""
    t = config.tokenizer
    last = 2 + t.stages
    layers = {  # `enter` and `leave`: see `marey.nn.stored_names`
        "encoder.model.0": "encoder.enter",
        f"encoder.model.{last}": "encoder.leave",
        "decoder.model.0": "decoder.enter",
        f"decoder.model.{last}": "decoder.smooth",
        f"decoder.model.{last + 2}": "decoder.leave",
    }
    for stage in range(t.stages):
        layers[f"encoder.model.{stage + 2}.0"] = f"encoder.down.{stage}"
        layers[f"decoder.model.{stage + 2}.2"] = f"decoder.up.{stage}"
        for block in range(t.depth):
            for theirs, ours in (("conv1", "wide"), ("conv2", "narrow")):
                place = f"residuals.{stage}.blocks.{block}.{ours}"
                layers[f"encoder.model.{stage + 2}.1.model.{block}.{theirs}"] = f"encoder.{place}"
                layers[f"decoder.model.{stage + 2}.0.model.{block}.{theirs}"] = f"decoder.{place}"

    def tables(section: Section) -> State:
        books = [
            section.take(f"quantizer.layers.{level}.codebook", (t.codes, t.code_width)) for level in range(t.levels)
        ]
        return {
            "quantizer.codebooks": torch.stack(books),
            "quantizer.counts": torch.ones(t.levels, t.codes),  # only training reads them
            "quantizer.initialized": torch.tensor(True),
        }

    return PartNames(dict(_parameters(layers)), tables)


def masked_names(config: MoMaskConfig) -> PartNames:
    """Return the names of the masked transformer."""
    layers = {**_transformer_layers(config.masked), "output_process.poseFinal": "head.final"}
    tokens = {"embedding.weight": "token_emb.weight"}
    return PartNames(dict(_parameters(layers)) | _attention_names(config.masked) | tokens)


def residual_names(config: MoMaskConfig) -> PartNames:
    """Return the names of the residual transformer, with shared or with separate tables."""
    layers = {
        **_transformer_layers(config.residual),
        "output_process.poseFinal": "head.final",
        "quant_emb": "level",
    }
    renamed = dict(_parameters(layers)) | _attention_names(config.residual)
    return PartNames(renamed, _shared_tables(config) if config.shared else _separate_tables(config))


def length_names(config: MoMaskConfig) -> PartNames:
    """Return the names of the length estimator, whose public layers are numbered with dropout between them."""
    layers: dict[str, str] = {}
    for k in range(len(config.length_hidden)):
        layers[f"output.{4 * k}"] = f"layers.{3 * k}"
        layers[f"output.{4 * k + 1}"] = f"layers.{3 * k + 1}"
    last = len(config.length_hidden)
    layers[f"output.{4 * last - 1}"] = f"layers.{3 * last}"  # no dropout before it
    return PartNames(dict(_parameters(layers)))


def _shared_tables(config: MoMaskConfig) -> Callable[[Section], State]:
    t = config.tokenizer
    table = (t.codes + 1, t.code_width)

    def tables(section: Section) -> State:
        first = section.take("token_embed_weight_", (1, *table))
        between = section.take("embed_proj_shared_weight", (t.levels - 2, *table))
        return {
            "embedding": torch.cat([first, between]),
            "output": section.take("output_proj_weight_", (1, *table)),
            "bias": torch.zeros(t.levels - 1, t.codes + 1),
        }

    return tables


def _separate_tables(config: MoMaskConfig) -> Callable[[Section], State]:
    """The public code adds the product to itself before the bias (`output += output + bias`): doubled tables give the
    same bits. Its bias has a row more than levels that are predicted, the last."""
    t = config.tokenizer
    table = (t.levels - 1, t.codes + 1, t.code_width)

    def tables(section: Section) -> State:
        return {
            "embedding": section.take("token_embed_weight", table),
            "output": 2 * section.take("output_proj_weight", table),
            "bias": section.take("output_proj_bias", (t.levels, t.codes + 1))[: t.levels - 1],
        }

    return tables


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
        f"sequence.transformer.blocks.{k}.attention.qkv.{kind}": f"seqTransEncoder.layers.{k}.self_attn.in_proj_{kind}"
        for k in range(config.layers)
        for kind in ("weight", "bias")
    }


def _parameters(layers: Mapping[str, str]) -> Iterator[tuple[str, str]]:
    """Yield own and public names of weights and biases of layers, given by public names."""
    for theirs, ours in layers.items():
        for kind in ("weight", "bias"):
            yield f"{ours}.{kind}", f"{theirs}.{kind}"
