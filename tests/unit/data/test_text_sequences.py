"""Sequences of clips with captions of their own."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from marey.data.build import build
from marey.data.dataset import known_set
from marey.data.describe import Facts, describe_text
from marey.data.pack import JointsPack, PackClip
from marey.data.part import MAX_FRAMES
from marey.data.prepared import PreparedData
from marey.data.text_sequences import compose_texts, joined_texts
from tests.support.bodies import FPS, bower, runner, walker, waver

CAPTIONS = {
    "walk": (("walk ahead", "stroll on"), ("A man walks ahead. ", "Someone walks on.")),
    "run": (("run ahead",), ("The person runs ahead.",)),
    "bow": (("bow",), ("She bows.",)),
    "wave": (("wave",), ("It waves a hand.",)),
}
MOTIONS = {"walk": lambda: walker(3.0), "run": lambda: runner(2.5), "bow": bower, "wave": lambda: waver("left", 3.0)}


def facts(action: str) -> Facts:
    return describe_text(CAPTIONS[action], MOTIONS[action]().astype(np.float32), FPS)


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory, few_gestures: None) -> PreparedData:
    clips = [
        (
            PackClip(f"{action}-{k}", "cmu", action, "", "train", 0, 0, source=f"{action}-{k}", captions=said),
            MOTIONS[action]().astype(np.float32),
        )
        for action, said in CAPTIONS.items()
        for k in range(4)
    ]
    folder = tmp_path_factory.mktemp("prepared") / "out"
    build([JointsPack.of(clips, [known_set("cmu").terms])], folder)
    return PreparedData.open(folder)


def test_clips_of_different_actions_are_joined_and_told_in_order(data: PreparedData) -> None:
    made = [clip for clip in data.clips if clip.spliced]
    assert len(made) > 5
    assert {len(clip.acts) for clip in made} == {2, 3}
    for clip in made:
        assert clip.length <= MAX_FRAMES
        assert len(clip.seams) == len(clip.acts) - 1
        actions = [id.removeprefix("M").partition("-")[0] for id in clip.spliced]
        assert all(a != b for a, b in pairwise(actions))
        assert sum(clip.authors) == len(clip.captions)
        words = {"walk": ("walk", "stroll"), "run": ("run",), "bow": ("bow",), "wave": ("wave",)}
        for text in clip.captions[: sum(clip.authors[:2])]:  # after them come the words of the vocabulary
            places = [min(text.lower().find(w) for w in words[a] if w in text.lower()) for a in actions[:2]]
            assert places == sorted(places), text


def test_what_each_author_says_is_joined_apart() -> None:
    commands, sentences = joined_texts([facts("walk"), facts("run")], "seed")
    assert all(text.startswith(("walk ahead", "stroll on")) and text.endswith("run ahead") for text in commands)
    assert all(text.endswith("runs ahead.") and "The person" not in text for text in sentences)


def test_an_author_of_long_captions_alone_is_left_out() -> None:
    long = " ".join(["walks"] * 30)
    walk = facts("walk")
    told = joined_texts([describe_text((("walk",), (long,)), MOTIONS["walk"](), FPS), walk], "seed")
    assert len(told) == 1


def test_nothing_is_made_of_one_action() -> None:
    assert list(compose_texts([], "train")) == []
