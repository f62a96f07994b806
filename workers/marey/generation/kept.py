"""Tokens of frames that a motion keeps, for models whose decoding fills the tokens between them."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from marey.generation.port import KeptFrames, Request
from marey.nn.motion_tokenizer import MotionTokenizer


def write_kept(tokens: Tensor, request: Request, tokenizer: MotionTokenizer) -> None:
    """Write the tokens of the kept frames of a request into its row of `tokens` (n, V).

    Each span is encoded alone, so its tokens do not depend on the frames that are generated beside it.
    """
    rate = tokenizer.frames_per_token
    for span in request.kept:
        features = torch.from_numpy(whole_tokens(span.features, rate)).to(tokens.device)
        made = tokenizer.encode(features[None])[0]  # (t, V)
        first = span.start // rate
        tokens[first : first + len(made)] = made


@torch.no_grad()
def as_tokens(features: NDArray[np.float32], tokenizer: MotionTokenizer) -> NDArray[np.float32]:
    """Return features (t, D) as a model's tokens show them."""
    rate = tokenizer.frames_per_token
    whole = torch.from_numpy(whole_tokens(features, rate)).to(tokenizer.mean.device)[None]
    frames = torch.tensor([whole.shape[1]], device=whole.device)
    return tokenizer.decode(tokenizer.encode(whole, frames), frames // rate)[0, : len(features)].cpu().numpy()


def whole_tokens(features: NDArray[np.float32], rate: int) -> NDArray[np.float32]:
    """Return features (t, D) with the last frame repeated up to a multiple of `rate` frames."""
    return np.pad(features.astype(np.float32), ((0, -len(features) % rate), (0, 0)), mode="edge")


def bridged(kept: tuple[KeptFrames, ...], frames: int) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Return features (frames, D) of a whole motion, straight lines between its kept frames, and which are kept
    (frames,)."""
    whole = np.zeros((frames, kept[0].features.shape[1]), np.float32)
    is_kept = np.zeros(frames, bool)
    for span in kept:
        whole[span.start : span.end] = span.features
        is_kept[span.start : span.end] = True
    whole[: kept[0].start] = kept[0].features[0]
    whole[kept[-1].end :] = kept[-1].features[-1]
    for before, after in pairwise(kept):
        share = np.linspace(0, 1, after.start - before.end + 2, dtype=np.float32)[1:-1, None]
        whole[before.end : after.start] = (1 - share) * before.features[-1] + share * after.features[0]
    return whole, is_kept
