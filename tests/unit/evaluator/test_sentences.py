"""Sentences as token states: the same wherever they are encoded."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest
import torch

from marey.evaluator.sentences import CaptionStates
from marey.text.loading import load_encoder
from tests.support.tiny_encoders import write_tiny_clip, write_tiny_distilbert, write_tiny_t5

SAID = ("a person walks", "he waves his left hand slowly")


@pytest.mark.parametrize(
    ("name", "write"),
    [
        ("clip-vit-b32", write_tiny_clip),
        ("t5-base", partial(write_tiny_t5, "t5-base")),
        ("distilbert-base-uncased", write_tiny_distilbert),
    ],
)
def test_a_training_step_in_bfloat16_reads_the_same_states(
    name: str, write: Callable[[Path], Path], tmp_path: Path
) -> None:
    encoder, device = load_encoder(name, write(tmp_path)), torch.device("cpu")
    expected, lengths = CaptionStates(encoder, device).batch(SAID)
    with torch.autocast("cpu", dtype=torch.bfloat16):
        states, again = CaptionStates(encoder, device).batch(SAID)
    assert torch.equal(states, expected)
    assert torch.equal(again, lengths)
