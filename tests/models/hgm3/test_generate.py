"""Decoding: the same tokens in any batch, with every saving, and nothing else."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from marey.core.errors import InvalidBundle, InvalidInput
from marey.generation.groups import group_rows
from marey.generation.port import KeptFrames, Request
from marey.models.hgm3.bundle import random_bundle
from marey.models.hgm3.conditions import ACTION, MOTION, SPECIFIC
from marey.models.hgm3.config import InferenceConfig
from marey.models.hgm3.decoding import DecodeOptions, condition_level
from marey.models.hgm3.generate import Generated, Generator, SamplingSettings
from marey.models.hgm3.spec import SPEC
from marey.registry import Setting
from tests.support.generating import Dropping, equal_motions
from tests.support.prepared import text_features
from tests.support.processors import packs_bfloat16

COUNT = 32
FLAT = SamplingSettings(motion_steps=0, action_steps=0)


def requests() -> list[Request]:
    """Mixed lengths, with and without actions, some with open lengths."""
    return [
        Request(text_features(i, i % 4, i % 6), 1000 + i, None if i % 5 == 4 else 20 + 17 * (i % 10))
        for i in range(COUNT)
    ]


@pytest.fixture(scope="module")
def reference(generator: Generator) -> list[Generated | None]:
    return generator.generate(requests())


def test_motions_are_equal_in_batches_of_1_3_and_32(generator: Generator, reference: list[Generated | None]) -> None:
    for size in (1, 3):
        parts = [generator.generate(requests()[i : i + size]) for i in range(0, COUNT, size)]
        assert equal_motions(reference, [made for part in parts for made in part])


def test_motions_are_equal_in_a_shuffled_batch(generator: Generator, reference: list[Generated | None]) -> None:
    order = np.random.default_rng(0).permutation(COUNT)
    shuffled = generator.generate([requests()[i] for i in order])
    assert equal_motions([reference[i] for i in order], shuffled)


@packs_bfloat16
def test_tokens_are_equal_in_any_batch_with_bfloat16_matrices(generator: Generator) -> None:
    lowered = Generator.load(generator.bundle, device="cpu", dtype=torch.bfloat16)
    together = lowered.generate(requests())
    alone = [lowered.generate([r])[0] for r in requests()]
    assert equal_motions(together, alone)


@pytest.fixture
def on_two_threads(generator: Generator) -> Iterator[Generator]:
    """The same bundle on two batch threads."""
    before = torch.get_num_threads()
    yield Generator.load(generator.bundle, device="cpu", threads=2, dtype=generator.dtype)
    torch.set_num_threads(before)


def test_motions_are_equal_on_two_threads(on_two_threads: Generator, reference: list[Generated | None]) -> None:
    assert on_two_threads.batch_threads.count == 2
    assert equal_motions(reference, on_two_threads.generate(requests()))
    assert equal_motions(reference[:3], on_two_threads.generate(requests()[:3]))
    assert equal_motions(reference[7:8], on_two_threads.generate(requests()[7:8]))  # its two branches of guidance


def test_a_request_dropped_on_two_threads_ends_and_the_others_stay_the_same(
    on_two_threads: Generator, reference: list[Generated | None]
) -> None:
    made = on_two_threads.generate(requests()[:3], control=Dropping(1, after=3))
    assert made[1] is None
    assert equal_motions([reference[0], reference[2]], [made[0], made[2]])


@pytest.mark.parametrize("plain", [SamplingSettings(skip_idle=False), SamplingSettings(trim_slots=False)])
def test_savings_change_nothing(
    generator: Generator, reference: list[Generated | None], plain: SamplingSettings
) -> None:
    assert equal_motions(reference, generator.generate(requests(), plain))


def test_min_progress_and_flat_conditions_are_other_ways_to_decode(
    generator: Generator, reference: list[Generated | None]
) -> None:
    for settings in (SamplingSettings(min_progress=True), FLAT):
        assert not equal_motions(reference, generator.generate(requests(), settings))


def test_each_token_is_decided_once_and_counted_by_its_condition(generator: Generator) -> None:
    (plain,) = generator.generate([Request(text_features(0), 1, 196)])
    (flat,) = generator.generate([Request(text_features(0), 1, 196)], FLAT)
    assert plain is not None
    assert flat is not None
    assert plain.decided == (2, 12, 35)  # 49 tokens: 49 → 47 by C^m, → 35 with actions, → 0 with specifics
    assert flat.decided == (0, 0, 49)


def test_seed_text_and_length_each_change_the_motion(generator: Generator) -> None:
    base = Request(text_features(0), 1, 80)
    others = [Request(text_features(0), 2, 80), Request(text_features(9), 1, 80), Request(text_features(0), 1, 84)]
    made = generator.generate([base, *others])
    assert made[0] is not None
    for other in made[1:]:
        assert other is not None
        assert not np.array_equal(made[0].tokens, other.tokens)


def test_features_have_the_frames_asked_for(generator: Generator) -> None:
    for frames in (16, 30, 33, 196):
        (made,) = generator.generate([Request(text_features(0), 1, frames)])
        assert made is not None
        assert made.features.shape == (frames, 263)
        assert made.tokens.shape == (3, -(-frames // 4))
        assert ((made.tokens >= 0) & (made.tokens < 32)).all()
        assert np.isfinite(made.features).all()


def test_an_open_length_is_drawn_with_the_seed_and_stays_in_range(generator: Generator) -> None:
    asked = [Request(text_features(0), seed) for seed in range(40)]
    frames = [generator.frames(request) for request in asked]
    assert frames == [generator.frames(request) for request in asked]
    assert len(set(frames)) > 5
    assert all(16 <= f <= 196 for f in frames)


@pytest.mark.parametrize("frames", [2, 15, 197, 20_000])
def test_lengths_out_of_range_are_refused(generator: Generator, frames: int) -> None:
    with pytest.raises(InvalidInput, match=r"0\.8 to 9\.8 seconds"):
        generator.generate([Request(text_features(0), 1, frames)])


@pytest.mark.parametrize("seed", [-1, 2**31])
def test_seeds_out_of_range_are_refused(generator: Generator, seed: int) -> None:
    with pytest.raises(InvalidInput, match="out of range"):
        generator.generate([Request(text_features(0), seed, 40)])


@pytest.mark.parametrize("setting", SPEC.settings, ids=lambda each: each.name)
@pytest.mark.parametrize("value", [-1, 101])
def test_settings_out_of_range_are_refused(generator: Generator, setting: Setting, value: int) -> None:
    with pytest.raises(InvalidInput, match=f"{value} is outside") as refused:
        generator.generate([Request(text_features(0), 1, 40)], SamplingSettings(**{setting.name: value}))
    assert refused.value.where == setting.name


def test_features_of_another_encoder_are_refused(generator: Generator) -> None:
    with pytest.raises(InvalidInput, match="width 512; this bundle reads 384"):
        generator.generate([Request(text_features(0, width=512), 1, 40)])


def test_a_dropped_request_ends_and_its_neighbours_stay_the_same(generator: Generator) -> None:
    asked = [Request(text_features(i), i, 60) for i in range(3)]
    whole = generator.generate(asked)
    control = Dropping(1, after=3)
    made = generator.generate(asked, control=control)
    assert made[1] is None
    assert equal_motions([whole[0], whole[2]], [made[0], made[2]])
    assert control.steps[-1][0] == control.steps[-1][1]


def test_conditions_follow_equation_14() -> None:
    config = InferenceConfig()
    levels = [condition_level(step, config) for step in range(1, 11)]
    assert levels == [MOTION] * 2 + [ACTION] * 3 + [SPECIFIC] * 5
    flat = replace(config, motion_steps=0, action_steps=0)
    assert {condition_level(step, flat) for step in range(1, 11)} == {SPECIFIC}


def test_other_numbers_of_steps_keep_the_shares_of_the_conditions() -> None:
    config = SamplingSettings(steps=20).inference(InferenceConfig())
    assert (config.steps, config.motion_steps, config.action_steps) == (20, 4, 10)


def test_ends_of_the_conditions_are_settings_that_must_not_decrease(generator: Generator) -> None:
    asked = [Request(text_features(0), 1, 196)]
    ends = generator.settings({"steps": 10, "motion_steps": 10, "action_steps": 10})
    made = generator.generate(asked, ends)[0]
    assert made is not None
    assert made.decided[1:] == (0, 0), "the prompt as a whole alone"
    for values in ({"motion_steps": 6}, {"action_steps": 11}):
        with pytest.raises(InvalidInput, match="must not decrease: motion_steps"):
            generator.settings(values)


def test_the_same_seed_gives_the_same_random_bundle(tmp_path: Path) -> None:
    a, b, c = (random_bundle(tmp_path / name, seed=seed) for name, seed in (("a", 0), ("b", 0), ("c", 1)))
    assert a.manifest.random
    assert a.weights_sha256 == b.weights_sha256 != c.weights_sha256


def test_a_bundle_whose_tensors_do_not_fit_is_refused(tmp_path: Path) -> None:
    bundle = random_bundle(tmp_path / "a")
    parameters = dict(bundle.manifest.parameters) | {"max_frames": 100}
    bundle.manifest = bundle.manifest.model_copy(update={"parameters": parameters})
    with pytest.raises(InvalidBundle, match="do not fit"):
        Generator.load(bundle, device="cpu")


def test_one_pass_is_enough(generator: Generator) -> None:
    (made,) = generator.generate([Request(text_features(1, 1, 1), 7, 30)], SamplingSettings(steps=1))
    assert made is not None
    assert (made.tokens >= 0).all()


def test_the_longest_motions_come_first(generator: Generator) -> None:
    frames = [20, 196, 60, 190]
    (longest, *_, shortest) = group_rows([generator._bucket(count) for count in frames], generator.batch_threads.count)
    assert (1 in longest, 0 in shortest) == (True, True)


def test_a_pass_may_keep_no_token_unless_progress_is_asked_for() -> None:
    assert not DecodeOptions().min_progress


def keeping(generator: Generator, index: int) -> Request:
    """Request that keeps the first and the last frames of a generated motion, and fills those between."""
    (source,) = generator.generate([Request(text_features(index), index, 88)])
    assert source is not None
    spans = (KeptFrames(0, source.features[:24]), KeptFrames(56, source.features[56:]))
    return Request(text_features(index + 1, 2, 2), index + 50, 88, kept=spans, free=index % 2 == 1)


def test_the_tokens_of_kept_frames_stay_and_the_others_are_generated(generator: Generator) -> None:
    asked = keeping(generator, 0)
    (made,) = generator.generate([asked])
    (plain,) = generator.generate([replace(asked, kept=())])
    assert made is not None
    assert plain is not None
    encoder = generator.networks.tokenizer
    for span in asked.kept:
        first, last = span.start // 4, span.end // 4
        encoded = encoder.encode(torch.from_numpy(span.features)[None])[0].T.numpy()
        assert np.array_equal(made.tokens[:, first:last], encoded)
    assert (made.tokens >= 0).all()
    assert not np.array_equal(made.tokens[:, 6:14], plain.tokens[:, 6:14])
    assert sum(made.decided) == 8


def test_motions_with_kept_frames_are_equal_in_any_batch(generator: Generator) -> None:
    asked = [*(keeping(generator, index) for index in range(5)), *requests()[:3]]
    together = generator.generate(asked)
    alone = [made for each in asked for made in generator.generate([each])]
    assert equal_motions(together, alone)


def test_a_free_request_does_not_read_its_text(generator: Generator) -> None:
    asked = keeping(generator, 1)
    other = replace(asked, text=text_features(9, 3, 1))
    assert equal_motions(generator.generate([asked]), generator.generate([other]))
    assert not equal_motions(
        generator.generate([replace(asked, free=False)]), generator.generate([replace(other, free=False)])
    )


@pytest.mark.parametrize(
    ("spans", "message"),
    [
        ([(0, 24), (20, 40)], "overlap"),
        ([(60, 40)], "outside"),
        ([(2, 24)], "multiples of 4"),
        ([(0, 22)], "multiples of 4"),
        ([(0, 88)], "none is left"),
    ],
)
def test_kept_frames_off_the_grid_or_outside_are_refused(
    generator: Generator, spans: list[tuple[int, int]], message: str
) -> None:
    kept = tuple(KeptFrames(start, np.zeros((count, 263), np.float32)) for start, count in spans)
    with pytest.raises(InvalidInput, match=message):
        generator.generate([Request(text_features(0), 1, 88, kept=kept)])


def test_kept_frames_need_a_length(generator: Generator) -> None:
    kept = (KeptFrames(0, np.zeros((8, 263), np.float32)),)
    with pytest.raises(InvalidInput, match="needs a length"):
        generator.generate([Request(text_features(0), 1, kept=kept)])
