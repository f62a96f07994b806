"""Difficulty of a motion's tokens by the loss predictor's teacher (HGM³ Fig. 4-5), for `marey render --difficulty`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray

from marey.bundles import Bundle
from marey.core.errors import InvalidBundle
from marey.models.hgm3.bundle import Networks, load_networks
from marey.models.hgm3.conditions import SPECIFIC, GraphBatch, graph_batch
from marey.text.pipeline import TextPipeline
from marey.viz.difficulty import TokenDifficulty, normalized


def token_difficulties(
    bundle: Bundle, motions: Sequence[NDArray[np.float32]], prompts: Sequence[str]
) -> list[TokenDifficulty]:
    """Predict how hard each base token of a motion is for the masked transformer under the motion's prompt.

    Frames beyond the bundle's longest motion, and those that fill no token, are left out.

    Args:
        bundle: of HGM³.
        motions: features (T, D) in the bundle's layout, at its rate.
        prompts: one a motion.

    Raises:
        InvalidBundle: of another model, or it declares no text pipeline.
    """
    config, networks = load_networks(bundle)
    if bundle.manifest.text is None:
        raise InvalidBundle("declares no text pipeline", where=str(bundle.path))
    texts = TextPipeline.load(bundle.manifest.text).features(prompts)
    rate, found = config.tokenizer.frames_per_token, list[TokenDifficulty]()
    for motion, text in zip(motions, texts, strict=True):
        whole = torch.from_numpy(motion[: min(len(motion) // rate, config.max_tokens) * rate].astype(np.float32))
        tokens = networks.tokenizer.encode(whole[None])[..., 0]  # (1, n)
        graph = graph_batch([text], config.condition, tokens.device)
        values = predict_difficulty(networks, tokens, graph)[0].numpy()
        found.append(TokenDifficulty(normalized(values), rate / config.fps))
    return found


@torch.inference_mode()
def predict_difficulty(networks: Networks, tokens: torch.Tensor, graph: GraphBatch) -> torch.Tensor:
    """Return the teacher's difficulty (B, n) of base tokens (B, n) under the full condition."""
    condition = networks.predictor.condition
    nodes = networks.masked.text(graph)
    visible = condition.visible(graph.present, SPECIFIC)
    return networks.predictor(tokens, torch.ones_like(tokens, dtype=torch.bool), condition(nodes), visible)
