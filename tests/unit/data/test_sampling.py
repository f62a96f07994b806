"""Sampling of training clips: by class, by author of a caption, by data set."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

import numpy as np
import pytest

from marey.data.manifest import Clip, Measured
from marey.data.sampling import ACT_WEIGHT, Draws, author_table, classes_of, draw_captions, sampling_weights
from marey.training.tokenizing import SHARES, tokenizer_weights

STILL = Measured(seconds=1, path=0, turn=0, speed=0, steps=0, side="")


def clip(content: str, dataset: str = "studio", length: int = 20) -> Clip:
    return Clip(
        id=f"{dataset}/{content}",
        start=0,
        length=length,
        joints_start=0,
        split="train",
        dataset=dataset,
        content=content,
        style="",
        mirrored=False,
        spliced=(),
        acts=("cmu",),
        measured=STILL,
        captions=("a person moves",),
    )


def mass_of(clips: Sequence[Clip]) -> dict[str, float]:
    mass: dict[str, float] = defaultdict(float)
    for each, weight in zip(clips, sampling_weights(clips), strict=True):
        mass[each.content] += weight
    return mass


def test_a_class_is_drawn_by_the_root_of_its_clips_whatever_set_they_come_from() -> None:
    clips = [clip("kneel", "one")] * 8 + [clip("kneel", "two")] * 8 + [clip("sit", "one")] * 4
    mass = mass_of(clips)
    assert mass["kneel"] / mass["sit"] == pytest.approx(2)


@pytest.mark.parametrize(("power", "ratio"), [(1.0, 16), (0.5, 4), (0.0, 1)])
def test_a_power_decides_how_far_classes_with_many_clips_are_drawn_more_often(power: float, ratio: float) -> None:
    clips = [clip("kneel")] * 32 + [clip("sit")] * 2
    weights = sampling_weights(clips, Draws(power))
    assert weights[:32].sum() / weights[32:].sum() == pytest.approx(ratio)


def test_sequences_have_their_share_whatever_their_number() -> None:
    pair = clip("walk - bow").model_copy(update={"acts": ("cmu", "cmu")})
    for share in (0.1, 0.3):
        weights = sampling_weights([clip("sit")] * 3 + [pair] * 9, Draws(sequences=share))
        # pairs have 0.36 of the 0.46 of the sequences; the absent triples' part goes to all others
        pairs = share * 0.36 / 0.46
        assert weights[3:].sum() == pytest.approx(pairs)


def test_a_clip_with_several_actions_belongs_to_each_in_equal_parts() -> None:
    clips = [clip("kneel")] * 7 + [clip("kneel; sit")] * 4 + [clip("sit")] * 2
    assert classes_of(clips[7]) == ("kneel", "sit")
    mass = mass_of(clips)
    # kneel has 7 + 4 / 2 = 9 clips and sit 2 + 4 / 2 = 4: roots 3 and 2
    assert mass["kneel"] == pytest.approx(3 * (7 / 9) / 5)
    assert mass["kneel; sit"] == pytest.approx((3 * (2 / 9) + 2 * (2 / 4)) / 5)


def test_a_gait_is_drawn_more_often_whether_its_clips_name_it_as_kind_or_as_class() -> None:
    mass = mass_of([clip("walk-backward")] * 4 + [clip("sit")] * 4)
    assert mass["walk-backward"] / mass["sit"] == pytest.approx(ACT_WEIGHT["walk-backward"])


def test_free_text_after_a_dash_makes_no_class_of_its_own() -> None:
    assert classes_of(clip("dance - ballet, pirouette")) == ("dance",)
    assert classes_of(clip("2/walk")) == ("2/walk",)


def test_sets_without_a_share_weigh_in_the_tokenizer_what_their_clips_weigh() -> None:
    clips = [clip("walk", "large")] * 96 + [clip("walk", "small")] * 4
    weights = tokenizer_weights(clips, 64)
    assert weights[96:].sum() == pytest.approx(0.04)


def test_sets_with_a_share_have_it_and_all_others_the_rest() -> None:
    (first, share), (second, other) = SHARES.items()
    clips = [clip(f"{name[-1]}/walk", name[:-2]) for name in (first, second)]
    clips += [clip("walk", "large")] * 30 + [clip("sit", "small")]
    weights = tokenizer_weights(clips, 64)
    assert (weights[0], weights[1]) == (pytest.approx(share), pytest.approx(other))
    assert weights[2:].sum() == pytest.approx(1 - share - other)
    longer = tokenizer_weights([clip("walk", length=25), clip("walk", length=100)], 64)
    assert longer[1] / longer[0] == pytest.approx(2)


def test_a_caption_is_drawn_by_author_first_and_then_among_the_authors_own() -> None:
    authors = author_table([(1, 3), (4,)])
    draws = np.linspace(0, 1, 600, endpoint=False)
    first = np.bincount(draw_captions(authors[[0] * 600], draws), minlength=4) / 600
    assert first == pytest.approx([1 / 2, 1 / 6, 1 / 6, 1 / 6])
    # one author: the number that it would be without authors
    assert (draw_captions(authors[[1] * 600], draws) == np.floor(draws * 4)).all()
