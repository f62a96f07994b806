"""Captions by which a language model is shown the style of a data set."""

from __future__ import annotations

import random

from marey.bundles import TextSpec
from marey.data.manifest import Clip, Measured
from marey.data.style import CAPTIONS, style_of

VERBS = ("walks", "runs", "jumps", "waves", "kicks", "punches", "bows", "sits down")


def clip(*captions: str) -> Clip:
    return Clip(
        id="a", start=0, length=1, joints_start=0, split="train", dataset="own", content="", style="", mirrored=False,
        spliced=(), acts=(), measured=Measured(seconds=1, path=0, turn=0, speed=0, steps=0, side=""), captions=captions,
    )  # fmt: skip


def said(verb: str, length: int) -> str:
    return f"a person {verb} " + " ".join(["slowly"] * length)


def test_captions_are_of_several_lengths_and_actions_whatever_the_order_of_the_clips() -> None:
    clips = [clip(said(verb, length), said(verb, length)) for verb in VERBS for length in range(1, 13)]
    clips += [clip(said("walks", 0) + f"path {number}") for number in range(200)]
    chosen = style_of(clips)
    assert len(chosen) == len(set(chosen)) == CAPTIONS
    random.Random(1).shuffle(clips)
    assert style_of(clips) == chosen
    lengths = [len(text.split()) for text in chosen]
    assert min(lengths) <= 5 < 9 <= max(lengths)
    assert all(any(verb in text for text in chosen) for verb in VERBS)
    TextSpec(style=chosen)


def test_what_is_no_caption_of_a_rewrite_is_left_out() -> None:
    long, words = "a person walks " + "on " * 60, "a person " + "w" * 99 + " " + " ".join(["v" * 99] * 6)
    assert style_of([clip("walks", long, words, "走路的人 在 走", "a  person\nwalks off")]) == ("a person walks off",)
    assert style_of([]) == ()
