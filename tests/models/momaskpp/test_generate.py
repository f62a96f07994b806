"""Generation: the same motion in any batch, words that are read one by one, and lengths."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from torch import nn

from marey.bundles import Bundle
from marey.core.errors import InvalidBundle, InvalidInput
from marey.generation.port import KeptFrames, Request
from marey.models.momaskpp.attention import CrossBlock
from marey.models.momaskpp.bundle import load_networks, random_bundle
from marey.models.momaskpp.config import CONFIGS, TINY, MoMaskPPConfig
from marey.models.momaskpp.generate import Generator, SamplingSettings
from marey.models.momaskpp.spec import SPEC
from marey.models.momaskpp.words import pad_states
from marey.nn.batch_threads import BatchThreads
from marey.registry import Setting
from tests.support.generating import Dropping, equal_motions
from tests.support.prepared import text_features
from tests.support.processors import packs_bfloat16

COUNT = 6
PROMPTS = ("a person walks", "someone waves with the left hand, then bows", "jumping", "a man turns around slowly")


def request(index: int, seed: int, frames: int | None = None, prompt: str | None = None) -> Request:
    text = replace(text_features(index), rewritten=prompt or PROMPTS[index % len(PROMPTS)])
    return Request(text, seed, frames)


def requests() -> list[Request]:
    """Mixed lengths, some open."""
    return [request(i, 1000 + i, None if i % 5 == 4 else 20 + 17 * (i % 10)) for i in range(COUNT)]


def load_beside(
    generator: Generator, bundle: Bundle, threads: int = 1, dtype: torch.dtype = torch.float32, *, packed: bool = True
) -> Generator:
    """Load a bundle with the text encoder of a loaded one."""
    config, networks = load_networks(bundle)
    batch_threads = BatchThreads(threads)
    if packed:
        networks.masked.prepare_inference(dtype, batch_threads)
        networks.tokenizer.decoder.prepare_inference(dtype)
    return Generator(bundle, config, networks, generator.reader, torch.device("cpu"), dtype, batch_threads)


@pytest.fixture(scope="module", params=["cross-attention", "in-context", "padded"])
def variant(
    request: pytest.FixtureRequest, generator: Generator, tmp_path_factory: pytest.TempPathFactory
) -> Generator:
    """Both ways to read the text, and both layouts."""
    if request.param == "cross-attention":
        return generator
    config = TINY
    if request.param == "in-context":
        config = replace(config, masked=replace(config.masked, conditioning="in-context", norm_first=True))
    else:
        config = replace(config, tokenizer=replace(config.tokenizer, layout="padded"))
    return load_beside(generator, random_bundle(tmp_path_factory.mktemp("bundle") / "other", config))


def test_motions_are_equal_in_any_batch_and_order(variant: Generator) -> None:
    together = variant.generate(requests())
    for size in (1, 4):
        parts = [variant.generate(requests()[i : i + size]) for i in range(0, COUNT, size)]
        assert equal_motions(together, [made for part in parts for made in part])
    order = np.random.default_rng(0).permutation(COUNT)
    shuffled = variant.generate([requests()[i] for i in order])
    assert equal_motions([together[i] for i in order], shuffled)


@packs_bfloat16
def test_motions_are_equal_in_any_batch_with_bfloat16_matrices(variant: Generator) -> None:
    lowered = load_beside(variant, variant.bundle, dtype=torch.bfloat16)
    together = lowered.generate(requests())
    assert equal_motions(together, [lowered.generate([each])[0] for each in requests()])
    exact = variant.generate(requests())
    shown = [np.mean(a.tokens == b.tokens) for a, b in zip(together, exact, strict=True) if a and b]
    assert np.mean(shown) > 0.5  # one token that is drawn otherwise changes those after it


def test_tokens_are_equal_without_savings(variant: Generator) -> None:
    plain = load_beside(variant, variant.bundle, packed=False)
    for fast, slow in zip(variant.generate(requests()), plain.generate(requests()), strict=True):
        assert fast is not None
        assert slow is not None
        assert np.array_equal(fast.tokens, slow.tokens)


def test_motions_are_equal_on_two_threads(variant: Generator) -> None:
    on_two = load_beside(variant, variant.bundle, threads=2)
    reference = variant.generate(requests())
    assert equal_motions(reference, on_two.generate(requests()))
    assert equal_motions(reference[2:3], on_two.generate(requests()[2:3]))  # its two branches of guidance


def test_matrices_of_blocks_are_packed(variant: Generator) -> None:
    networks = load_networks(variant.bundle)[1]
    blocks = [each for each in networks.masked.modules() if isinstance(each, CrossBlock)]
    assert any(isinstance(each, nn.Linear) for block in blocks for each in block.modules()) == bool(blocks)
    networks.masked.prepare_inference(torch.float32, BatchThreads(1))
    assert not any(isinstance(each, nn.Linear) for block in blocks for each in block.modules())
    assert all(isinstance(block.gelu, nn.Identity) for block in blocks)  # in the pass before it


def test_seed_words_and_length_each_change_the_motion(generator: Generator) -> None:
    others = [request(0, 2, 80), request(0, 1, 80, "a person walks away"), request(0, 1, 84)]
    first, *made = generator.generate([request(0, 1, 80), *others])
    assert first is not None
    for other in made:
        assert other is not None
        assert not np.array_equal(first.tokens, other.tokens)


def test_features_have_the_frames_asked_for_and_tokens_their_scales(generator: Generator) -> None:
    for frames in (16, 30, 196):
        (made,) = generator.generate([request(0, 1, frames)])
        assert made is not None
        assert made.features.shape == (frames, 263)
        assert np.isfinite(made.features).all()
        assert made.tokens.shape == (1, 91)
        assert int((made.tokens >= 0).sum()) == generator.scales.total(-(-frames // 4))


def test_a_refiner_sets_the_velocity_of_the_root_alone(generator: Generator) -> None:
    (made,) = generator.generate([request(0, 1, 80)])
    refiner = generator.networks.refiner
    assert refiner is not None
    generator.networks = replace(generator.networks, refiner=None)
    (plain,) = generator.generate([request(0, 1, 80)])
    generator.networks = replace(generator.networks, refiner=refiner)
    assert made is not None
    assert plain is not None
    changed = np.abs(made.features - plain.features).max(0) > 1e-5
    assert np.flatnonzero(changed).tolist() == [1, 2]


def test_an_open_length_is_drawn_with_the_seed_and_stays_in_range(generator: Generator) -> None:
    frames = [generator.frames(request(0, seed)) for seed in range(40)]
    assert frames == [generator.frames(request(0, seed)) for seed in range(40)]
    assert len(set(frames)) > 5
    assert all(16 <= f <= 196 for f in frames)
    assert generator.resolve_length(request(0, 3)).frames == frames[3]


def test_a_bundle_without_an_estimator_draws_one_of_its_open_lengths(generator: Generator, tmp_path: Path) -> None:
    config = replace(TINY, length_hidden=(), refiner=replace(TINY.refiner, width=0), open_frames=(40, 60))
    bundle = random_bundle(tmp_path / "plain", config)
    assert set(bundle.manifest.parts) == {"tokenizer", "masked", "statistics"}
    plain = load_beside(generator, bundle)
    assert {plain.frames(request(0, seed)) for seed in range(20)} == {40, 60}
    (made,) = plain.generate([request(0, 1)])
    assert made is not None
    assert len(made.features) in (40, 60)


@pytest.mark.parametrize("frames", [2, 15, 197])
def test_lengths_out_of_range_are_refused(generator: Generator, frames: int) -> None:
    with pytest.raises(InvalidInput, match=r"0\.8 to 9\.8 seconds"):
        generator.generate([request(0, 1, frames)])


@pytest.mark.parametrize("setting", SPEC.settings, ids=lambda each: each.name)
@pytest.mark.parametrize("value", [-1, 101])
def test_settings_out_of_range_are_refused(generator: Generator, setting: Setting, value: int) -> None:
    for refuse in (
        lambda: generator.settings({setting.name: value}),
        lambda: generator.generate([request(0, 1, 40)], SamplingSettings(**{setting.name: value})),
    ):
        with pytest.raises(InvalidInput, match=f"{value} is outside") as refused:
            refuse()
        assert refused.value.where == setting.name


def test_settings_are_described_in_full_and_unknown_ones_refused(generator: Generator) -> None:
    described = generator.describe_settings(SamplingSettings(steps=3))
    assert described == {"steps": 3, "guidance": 4.0, "temperature": 1.0, "top_k": 0.1}
    with pytest.raises(InvalidInput, match="unknown setting"):
        generator.settings({"residual_guidance": 1.0})


def test_a_dropped_request_ends_and_its_neighbours_stay_the_same(generator: Generator) -> None:
    asked = [request(i, i, 60) for i in range(3)]
    whole = generator.generate(asked)
    control = Dropping(1, after=3)
    made = generator.generate(asked, control=control)
    assert made[1] is None
    assert equal_motions([whole[0], whole[2]], [made[0], made[2]])
    assert control.steps[-1][0] == control.steps[-1][1]


def test_a_bundle_of_another_encoder_or_of_other_shapes_is_refused(tmp_path: Path) -> None:
    bundle = random_bundle(tmp_path / "a")
    text = bundle.manifest.text
    assert text is not None
    manifest = bundle.manifest
    bundle.manifest = manifest.model_copy(update={"text": text.model_copy(update={"encoder_sha256": "0" * 64})})
    with pytest.raises(InvalidBundle, match="minilm"):
        Generator.load(bundle, device="cpu")
    bundle.manifest = manifest.model_copy(update={"parameters": dict(manifest.parameters) | {"max_frames": 100}})
    with pytest.raises(InvalidBundle, match="do not fit"):
        Generator.load(bundle, device="cpu")


def test_the_same_seed_gives_the_same_random_bundle(tmp_path: Path) -> None:
    a, b, c = (random_bundle(tmp_path / name, seed=seed) for name, seed in (("a", 0), ("b", 0), ("c", 1)))
    assert a.manifest.random
    assert a.weights_sha256 == b.weights_sha256 != c.weights_sha256


def test_prompts_of_too_many_words_are_read_up_to_their_limit(generator: Generator) -> None:
    words = "a person walks forward and waves with the left"
    long, cut = generator.reader.states([f"{words} hand many times before sitting down", f"{words} hand"])
    assert len(long) == TINY.text.max_words
    assert np.allclose(long, cut, atol=1e-5)


def test_states_of_a_prompt_are_read_once(generator: Generator, monkeypatch: pytest.MonkeyPatch) -> None:
    reader = generator.reader
    first = reader.states(["a person walks", "a person walks"])
    monkeypatch.setattr(reader, "encoder", None)
    assert np.array_equal(first[1], reader.states(["a person walks"])[0])


def test_absent_words_are_zero_and_masked() -> None:
    text = pad_states([np.ones((2, 3), np.float32), np.ones((4, 3), np.float32)], 5, torch.device("cpu"))
    assert text.present.sum(1).tolist() == [2, 4]
    assert torch.equal(text.states.any(-1), text.present)


def test_configurations_survive_their_manifest() -> None:
    for config in CONFIGS.values():
        assert MoMaskPPConfig.from_dict(config.to_dict()) == config


def keeping(generator: Generator, index: int) -> Request:
    """Request that keeps the first and the last frames of a generated motion, and fills those between."""
    (source,) = generator.generate([request(index, index, 96)])
    assert source is not None
    spans = (KeptFrames(0, source.features[:32]), KeptFrames(64, source.features[64:]))
    return replace(request(index + 1, index + 50, 96), kept=spans, free=index % 2 == 1)


def test_tokens_that_cover_kept_frames_alone_stay(variant: Generator) -> None:
    asked = keeping(variant, 0)
    (made,), (plain,) = variant.generate([asked]), variant.generate([replace(asked, kept=())])
    assert made is not None
    assert plain is not None
    written = variant._kept_tokens(asked).numpy()
    kept = written >= 0
    assert np.array_equal(made.tokens[0][kept], written[kept])
    blocks = [block[0] for block in variant.scales.split(torch.from_numpy(kept)[None])]
    assert blocks[-1][:24].tolist() == [True] * 8 + [False] * 8 + [True] * 8
    valid = variant.scales.valid(torch.tensor([24]))[0].numpy()
    assert (made.tokens[0][valid] >= 0).all()
    assert not np.array_equal(made.tokens[0][valid & ~kept], plain.tokens[0][valid & ~kept])


def test_coarse_tokens_are_kept_only_where_all_they_cover_is(variant: Generator) -> None:
    chosen = torch.ones(16, dtype=torch.bool)
    chosen[5] = False
    for divisor, block in zip(
        variant.scales.divisors, variant.scales.split(variant.scales.within(chosen)[None]), strict=True
    ):
        covered = block[0, : 16 // divisor]
        if variant.scales.layout == "own":
            assert (~covered).nonzero().flatten().tolist() == [5 // divisor]


def test_motions_with_kept_frames_are_equal_in_any_batch(variant: Generator) -> None:
    asked = [*(keeping(variant, index) for index in range(3)), *requests()[:2]]
    assert equal_motions(variant.generate(asked), [made for each in asked for made in variant.generate([each])])


def test_a_free_request_does_not_read_its_text(variant: Generator) -> None:
    asked = keeping(variant, 1)
    other = replace(asked, text=request(3, 1).text)
    assert equal_motions(variant.generate([asked]), variant.generate([other]))
