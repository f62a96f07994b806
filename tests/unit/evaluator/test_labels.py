"""Labels: what captions can tell apart, and nothing else."""

from __future__ import annotations

from typing import Any

import numpy as np

from marey.data.manifest import Clip, Measured
from marey.data.sampling import UNLABELLED
from marey.evaluator.labels import label_ids, label_of

MEASURED = Measured(seconds=1, path=1, turn=0, speed=1, steps=1, side="")


def clip(**changes: Any) -> Clip:
    values: dict[str, Any] = {
        "id": "a", "start": 0, "length": 40, "joints_start": 0, "split": "test", "dataset": "bandai-namco",
        "content": "2/raise-up-left-hand", "style": "active", "mirrored": False, "spliced": (), "acts": ("raise",),
        "sides": ("left",), "measured": MEASURED, "captions": ("raise the left hand",),
    }  # fmt: skip
    return Clip(**{**values, **changes})


def test_acts_sides_and_style_tell_labels_apart() -> None:
    labels = {
        label_of(clip()),
        label_of(clip(sides=("right",))),
        label_of(clip(style="elderly")),
        label_of(clip(acts=("wave",))),
        label_of(clip(acts=("raise", "bow"), sides=("left", ""))),
        label_of(clip(acts=("bow", "raise"), sides=("", "left"))),
    }
    assert len(labels) == 6
    assert label_of(clip()) == "raise left, active"
    assert label_of(clip(acts=("raise", "bow"), sides=("left", ""))) == "raise left + bow, active"


def test_what_no_caption_says_makes_no_label() -> None:
    assert label_of(clip(content="1/respond", id="b", mirrored=True, spliced=("a", "a"))) == label_of(clip())
    assert label_of(clip(style="old")) == label_of(clip(style="elderly"))
    assert label_of(clip(style="")) == label_of(clip(style="normal"))


def test_clips_with_their_sources_own_words_are_told_apart_by_them() -> None:
    dance, dribble = (
        clip(acts=("cmu",), sides=("",), dataset="cmu", style="", content=content)
        for content in ("dance - pirouette", "basketball - dribble, shoot")
    )
    assert label_of(dance) != label_of(dribble)
    assert label_of(clip(acts=("walk",), sides=())) == "walk, active"


def test_clips_of_published_sets_answer_their_own_captions_alone() -> None:
    unknown: dict[str, Any] = {"acts": (UNLABELLED,), "sides": (), "dataset": "humanml3d", "content": UNLABELLED}
    labels = {label_of(clip(**unknown, id=name)) for name in ("000021", "M000021", "000021#1")}
    assert labels == {"humanml3d: 000021", "humanml3d: M000021", "humanml3d: 000021#1"}
    assert label_of(clip(**unknown | {"dataset": "cmp"}, id="000021")) not in labels


def test_equal_labels_have_equal_numbers() -> None:
    assert np.array_equal(label_ids(["b", "a", "b", "c"]), [1, 0, 1, 2])
