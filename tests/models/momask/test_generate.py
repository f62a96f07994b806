"""Decoding: the same tokens in any batch, by the public schedule."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from marey.core.errors import InvalidBundle, InvalidInput
from marey.generation.base import GeneratedMotion
from marey.generation.export import finish
from marey.generation.port import Request
from marey.models.momask.bundle import random_bundle
from marey.models.momask.config import KIT, TINY, InferenceConfig
from marey.models.momask.decoding import Items, decode_base, decode_residual, masked_counts
from marey.models.momask.generate import Generator, SamplingSettings
from marey.models.momask.model import MaskedTransformer, ResidualTransformer
from marey.models.momask.spec import SPEC
from tests.support.generating import Dropping, equal_motions
from tests.support.prepared import text_features

COUNT = 32


def requests() -> list[Request]:
    """Mixed lengths, some open."""
    return [Request(text_features(i), 1000 + i, None if i % 5 == 4 else 20 + 17 * (i % 10)) for i in range(COUNT)]


@pytest.fixture(scope="module")
def reference(generator: Generator) -> list[GeneratedMotion | None]:
    return generator.generate(requests())


def test_motions_are_equal_in_batches_of_1_3_and_32(
    generator: Generator, reference: list[GeneratedMotion | None]
) -> None:
    for size in (1, 3):
        parts = [generator.generate(requests()[i : i + size]) for i in range(0, COUNT, size)]
        assert equal_motions(reference, [made for part in parts for made in part])


def test_motions_are_equal_in_a_shuffled_batch(generator: Generator, reference: list[GeneratedMotion | None]) -> None:
    order = np.random.default_rng(0).permutation(COUNT)
    shuffled = generator.generate([requests()[i] for i in order])
    assert equal_motions([reference[i] for i in order], shuffled)


@pytest.fixture
def on_two_threads(generator: Generator) -> Iterator[Generator]:
    """The same bundle on two batch threads."""
    before = torch.get_num_threads()
    yield Generator.load(generator.bundle, device="cpu", threads=2, dtype=generator.dtype)
    torch.set_num_threads(before)


def test_motions_are_equal_on_two_threads(on_two_threads: Generator, reference: list[GeneratedMotion | None]) -> None:
    assert on_two_threads.batch_threads.count == 2
    assert equal_motions(reference, on_two_threads.generate(requests()))
    assert equal_motions(reference[7:8], on_two_threads.generate(requests()[7:8]))


def test_seed_text_and_length_each_change_the_motion(generator: Generator) -> None:
    base = Request(text_features(0), 1, 80)
    others = [Request(text_features(0), 2, 80), Request(text_features(9), 1, 80), Request(text_features(0), 1, 84)]
    made = generator.generate([base, *others])
    assert made[0] is not None
    for other in made[1:]:
        assert other is not None
        assert not np.array_equal(made[0].tokens, other.tokens)


def test_the_sentence_alone_is_read(generator: Generator) -> None:
    text = text_features(0)
    nodes = text.nodes.copy()
    nodes[1:] += 1
    made = generator.generate([Request(text, 1, 40), Request(replace(text, nodes=nodes), 1, 40)])
    assert equal_motions(made[:1], made[1:])


@pytest.mark.parametrize("setting", SPEC.settings, ids=lambda each: each.name)
def test_each_setting_is_checked_and_changes_tokens(generator: Generator, setting: object) -> None:
    name = getattr(setting, "name", "")
    other = {"steps": 3, "top_k": 1.0, "residual_top_k": 1.0}.get(name, 0.0)
    asked = [Request(text_features(i), i, 196) for i in range(2)]
    settings = generator.settings({name: other})
    assert generator.describe_settings(settings)[name] == other
    assert not equal_motions(generator.generate(asked), generator.generate(asked, settings))
    with pytest.raises(InvalidInput, match=f"{name}: .* is outside"):
        generator.settings({name: 1000})
    with pytest.raises(InvalidInput, match="unknown setting"):
        generator.settings({"motion_steps": 1})


def test_features_have_the_frames_asked_for(generator: Generator) -> None:
    for frames in (16, 30, 33, 196):
        (made,) = generator.generate([Request(text_features(0), 1, frames)])
        assert made is not None
        assert made.features.shape == (frames, 263)
        assert made.tokens.shape == (3, -(-frames // 4))
        assert ((made.tokens[0] >= 0) & (made.tokens < 32)).all()
        assert np.isfinite(made.features).all()


def test_an_open_length_is_drawn_from_the_estimated_distribution_with_the_seed(generator: Generator) -> None:
    asked = [Request(text_features(0), seed) for seed in range(400)]
    frames = [generator.frames(request) for request in asked]
    assert frames[:20] == [generator.frames(request) for request in asked[:20]]
    share = torch.softmax(generator.networks.length(torch.from_numpy(text_features(0).nodes[:1]).float()), -1)[0]
    middle = float((share * torch.arange(50)).sum())  # class k is k tokens
    assert abs(np.mean([f / 4 for f in frames]) - middle) < 3
    assert (min(frames), max(frames)) == (16, 196)


@pytest.mark.parametrize("frames", [2, 15, 197])
def test_lengths_out_of_range_are_refused(generator: Generator, frames: int) -> None:
    with pytest.raises(InvalidInput, match=r"0\.8 to 9\.8 seconds"):
        generator.generate([Request(text_features(0), 1, frames)])


def test_features_of_another_encoder_are_refused(generator: Generator) -> None:
    with pytest.raises(InvalidInput, match="width 512; this bundle reads 384"):
        generator.generate([Request(text_features(0, width=512), 1, 40)])


@pytest.mark.parametrize("after", [3, 11])
def test_a_dropped_request_ends_and_its_neighbours_stay_the_same(generator: Generator, after: int) -> None:
    asked = [Request(text_features(i), i, 60) for i in range(3)]
    whole = generator.generate(asked)
    control = Dropping(1, after=after)
    made = generator.generate(asked, control=control)
    assert made[1] is None
    assert equal_motions([whole[0], whole[2]], [made[0], made[2]])
    assert control.steps[-1][0] == control.steps[-1][1]


def test_a_batch_whose_requests_are_all_dropped_ends(generator: Generator) -> None:
    asked = [Request(text_features(i), i, 60) for i in range(2)]
    assert generator.generate(asked, control=Dropping(0, 1, after=3)) == [None, None]


def test_the_masked_tokens_follow_the_public_schedule() -> None:
    counts = masked_counts([49, 25, 1], 10).tolist()
    assert [row[0] for row in counts] == [49, 48, 46, 42, 38, 31, 24, 17, 9, 1]
    assert [row[1] for row in counts] == [25, 25, 23, 22, 19, 16, 12, 9, 4, 1]
    assert [row[2] for row in counts] == [1] * 10
    assert masked_counts([7], 1).tolist() == [[7]]


class Recorder(MaskedTransformer):
    """Keeps the tokens that it was shown."""

    shown: list[torch.Tensor]

    def forward(
        self, tokens: torch.Tensor, valid: torch.Tensor, sentence: torch.Tensor, guidance: float | None = None
    ) -> torch.Tensor:
        self.shown.append(tokens)
        return super().forward(tokens, valid, sentence, guidance)


def items(model: MaskedTransformer, residual: ResidualTransformer, lengths: list[int]) -> Items:
    text = torch.randn(len(lengths), 384, generator=torch.Generator().manual_seed(0))
    return Items(
        lengths=torch.tensor(lengths),
        seeds=torch.arange(len(lengths)),
        masked_sentence=model.condition(text),
        residual_sentence=residual.condition(text),
        tokens=torch.full((len(lengths), 24, 3), -1),
    )


@torch.inference_mode()
def test_a_token_that_was_kept_stays_and_guidance_1_reads_one_branch() -> None:
    model, residual = Recorder(TINY).eval(), ResidualTransformer(TINY)
    for guidance, rows in ((4.0, 4), (1.0, 2)):
        model.shown = []
        config = InferenceConfig(steps=6, guidance=guidance)
        made = decode_base(model, items(model, residual, [20, 9]), config, lambda: None).tokens[..., 0]
        counts = masked_counts([20, 9], 6)
        for step, shown in enumerate(model.shown):
            assert len(shown) == rows
            for row, size in enumerate((20, 9)):
                own = shown[row, :size]
                assert int((own == model.mask_token).sum()) == counts[step, row]
                kept = own != model.mask_token
                assert torch.equal(own[kept], made[row, :size][kept])
        assert (made[1, 9:] == -1).all()


@torch.inference_mode()
def test_a_drawn_padding_token_is_no_token_and_is_embedded_for_the_levels_above() -> None:
    model, residual = MaskedTransformer(TINY), ResidualTransformer(TINY).eval()
    residual.embedding.data[1, residual.pad_token] = 0  # predicts level 1 of 1, 2: tables are shared
    residual.bias.data[0, residual.pad_token] = 1e4
    start = items(model, residual, [20, 9])
    start.tokens[..., 0] = 3
    totals: list[torch.Tensor] = []
    embed = residual.embed

    def watched(tokens: torch.Tensor, level: int) -> torch.Tensor:
        totals.append(tokens)
        return embed(tokens, level)

    residual.embed = watched  # pyright: ignore[reportAttributeAccessIssue]
    made = decode_residual(residual, start, InferenceConfig(), lambda: None).tokens
    assert (made[..., 1] == -1).all()
    assert (made[0, :20, 2] >= 0).any()
    assert (totals[1] == residual.pad_token).all()


@torch.inference_mode()
def test_packed_networks_give_the_logits_of_unpacked_ones(generator: Generator, tmp_path: Path) -> None:
    for shared in (True, False):
        plain = ResidualTransformer(replace(TINY, shared=shared)).eval()
        plain.bias.data.normal_()
        packed = ResidualTransformer(replace(TINY, shared=shared)).eval()
        packed.load_state_dict(plain.state_dict())
        packed.prepare_inference(torch.float32)
        valid = torch.ones(2, 16, dtype=torch.bool)
        total, text = torch.randn(2, 16, 16), torch.randn(2, 384)
        for level in (1, 2):
            expected = plain(total, valid, level, plain.condition(text))
            torch.testing.assert_close(packed(total, valid, level, packed.condition(text)), expected)


def test_a_motion_of_kit_is_exported(tmp_path: Path) -> None:
    config = replace(KIT, text_width=384, tokenizer=TINY.tokenizer, masked=TINY.masked, residual=TINY.residual)
    generator = Generator.load(random_bundle(tmp_path / "kit", config), device="cpu")
    request = Request(text_features(0), 1, 196)
    (made,) = generator.generate([request])
    assert made is not None
    assert made.features.shape == (196, 251)
    clip = finish(generator, request, made, SamplingSettings())
    assert clip.seconds == pytest.approx(15.68, abs=0.1)
    assert generator.describe_settings(SamplingSettings())["guidance"] == 2.0


def test_the_same_seed_gives_the_same_random_bundle(tmp_path: Path) -> None:
    a, b, c = (random_bundle(tmp_path / name, seed=seed) for name, seed in (("a", 0), ("b", 0), ("c", 1)))
    assert a.manifest.random
    assert a.weights_sha256 == b.weights_sha256 != c.weights_sha256
    assert a.tensors("masked")["head.final.weight"].dtype == np.float32


def test_a_bundle_whose_tensors_do_not_fit_is_refused(tmp_path: Path) -> None:
    bundle = random_bundle(tmp_path / "a")
    parameters = dict(bundle.manifest.parameters) | {"shared": False}
    bundle.manifest = bundle.manifest.model_copy(update={"parameters": parameters})
    with pytest.raises(InvalidBundle, match="do not fit"):
        Generator.load(bundle, device="cpu")
