"""Text encoders: MiniLM as it is, CLIP and T5 with tiny random weights."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
import torch

from marey.bundles import TextSpec
from marey.core.errors import InvalidBundle, InvalidFile, NotFound
from marey.core.settings import Settings
from marey.text.encoders import Encoding, find_encoder, find_weights, weights_sha256
from marey.text.loading import load_encoder
from marey.text.minilm import MiniLM
from marey.text.minilm_bundle import LAYERS, WIDTH, load_tokenizer, load_weights
from marey.text.minilm_encoder import MiniLMEncoder
from marey.text.pipeline import TextPipeline
from marey.text.truncation import truncated_tokens
from tests.support.processors import packs_bfloat16

TEXT = "a person walks, and waves his left hand"
LONG = " ".join(["a person walks forward and then turns left slowly"] * 20)


@pytest.fixture(scope="module")
def minilm() -> MiniLMEncoder:
    return MiniLMEncoder(find_encoder("minilm"))


def check_alignment(encoding: Encoding, text: str, word: str) -> None:
    """The span of a word is the mean of exactly the tokens whose characters lie in it."""
    start = text.index(word)
    rows = [i for i, (a, b) in enumerate(encoding.offsets) if a >= start and b <= start + len(word) and b > a]
    assert rows
    assert "".join(text[a:b] for a, b in (encoding.offsets[i] for i in rows)) == word
    span = encoding.span(start, start + len(word))
    assert span is not None
    assert np.allclose(span, encoding.tokens[rows].mean(axis=0))


def test_minilm_gives_what_transformers_gives(monkeypatch: pytest.MonkeyPatch) -> None:
    from transformers import BertConfig, BertModel

    monkeypatch.setenv("MAREY_BF16", "0")
    bundle = find_encoder("minilm")
    config = BertConfig(hidden_size=WIDTH, num_hidden_layers=LAYERS, intermediate_size=4 * WIDTH)
    model = BertModel(config, add_pooling_layer=False).eval()
    model.load_state_dict(load_weights(bundle))
    ids = load_tokenizer(bundle).encode(TEXT).ids
    with torch.inference_mode():
        reference = model(torch.tensor([ids]), output_hidden_states=True).hidden_states
    states = MiniLM(bundle).states(ids)
    assert len(states) == 7
    for mine, theirs in zip(states, reference, strict=True):
        assert torch.allclose(mine, theirs[0], atol=2e-5)
    mean = reference[-1][0].mean(0)
    assert np.allclose(MiniLMEncoder(bundle).encode(TEXT).pooled, (mean / mean.norm()).numpy(), atol=2e-6)


@packs_bfloat16
def test_minilm_in_bfloat16_is_close_and_no_text_depends_on_others(monkeypatch: pytest.MonkeyPatch) -> None:
    bundle = find_encoder("minilm")
    texts = [TEXT, "a person bows", "wave", LONG]
    vectors = {}
    for fast in (False, True):
        monkeypatch.setattr("marey.text.minilm.fast_bf16", lambda _, fast=fast: fast)
        encoder = MiniLMEncoder(bundle)
        vectors[fast] = encoder.pooled(texts)
        alone = [encoder.pooled([text])[0] for text in texts]
        np.testing.assert_allclose(np.stack(vectors[fast]), np.stack(alone), atol=2e-6)
    cosines = [float(exact @ near) for exact, near in zip(vectors[False], vectors[True], strict=True)]
    assert min(cosines) > 0.9998
    assert max(abs(exact - near).max() for exact, near in zip(vectors[False], vectors[True], strict=True)) > 1e-5


def test_minilm_int8_is_close_but_not_equal() -> None:
    ids = [101, 1037, 2711, 7365, 102]
    bundle = find_encoder("minilm")
    exact, coarse = MiniLM(bundle).states(ids)[-1], MiniLM(bundle, int8=True).states(ids)[-1]
    similarity = float((exact * coarse).sum() / exact.norm() / coarse.norm())
    assert 0.9 < similarity < 0.9999


def test_minilm_int8_gives_the_same_bits_compiled_and_not(monkeypatch: pytest.MonkeyPatch) -> None:
    texts = [[101, 1037, 2711, 7365, 102], [101, 2711, 102], [101, 7365, 2830, 102], [101, 1037, 102]]
    bundle = find_encoder("minilm")
    monkeypatch.setattr("marey.nn.compiled.OFTEN", 0)
    compiled = MiniLM(bundle, int8=True)
    compiled.states(texts[0])
    monkeypatch.setattr("marey.nn.compiled.OFTEN", -1)
    plain = MiniLM(bundle, int8=True)
    for ids in [*texts, *texts]:  # torch compiles a script again in its second call
        for one, other in zip(compiled.states(ids), plain.states(ids), strict=True):
            assert torch.equal(one, other)
    for one, other in zip(compiled.last(texts), plain.last(texts), strict=True):
        assert torch.equal(one, other)


def test_minilm_vectors_are_unit_and_tell_sides_apart(minilm: MiniLMEncoder) -> None:
    left, right = (minilm.encode(f"a person raises the {side} hand").pooled for side in ("left", "right"))
    assert left.shape == (384,)
    assert np.isclose(np.linalg.norm(left), 1.0, atol=1e-5)
    assert float(left @ right) < 0.999


def test_minilm_tokens_align_with_words(minilm: MiniLMEncoder) -> None:
    encoding = minilm.encode(TEXT)
    for word in ("person", "waves", "left hand"):
        assert encoding.span(TEXT.index(word), TEXT.index(word) + len(word)) is not None
    check_alignment(encoding, TEXT, "waves")


def test_minilm_leaves_out_what_lies_past_its_limit(minilm: MiniLMEncoder) -> None:
    text = "counterclockwise " * 200
    encoding = minilm.encode(text)
    assert len(encoding.tokens) == len(encoding.offsets) == 256
    assert encoding.span(len(text) - 10, len(text)) is None


def test_clip_gives_512_wide_vectors_and_aligned_tokens(tiny_clip: Path) -> None:
    encoder = load_encoder("clip-vit-b32", tiny_clip)
    encoding = encoder.encode(TEXT)
    assert encoder.width == 512
    assert encoding.pooled.shape == (512,)
    assert encoding.tokens.shape == (len(encoding.offsets), 512)
    check_alignment(encoding, TEXT, "waves")


def test_clip_pools_the_end_token_in_the_space_of_its_tokens(tiny_clip: Path) -> None:
    encoding = load_encoder("clip-vit-b32", tiny_clip).encode(TEXT)
    assert np.allclose(encoding.pooled, encoding.tokens[-1], atol=1e-5)


def test_clip_reads_prompts_past_77_tokens(tiny_clip: Path) -> None:
    encoding = load_encoder("clip-vit-b32", tiny_clip).encode(LONG)
    assert len(encoding.tokens) == 77
    assert np.isfinite(encoding.pooled).all()
    assert encoding.span(len(LONG) - 6, len(LONG)) is None


def test_t5_gives_768_wide_vectors_and_aligned_tokens(tiny_t5: tuple[str, Path]) -> None:
    name, folder = tiny_t5
    encoder = load_encoder(name, folder)
    encoding = encoder.encode("a person walks and waves")
    assert (encoder.name, encoder.width) == (name, 768)
    assert encoding.tokens.shape == (len(encoding.offsets), 768)
    assert np.allclose(encoding.pooled, encoding.tokens.mean(axis=0), atol=1e-5)
    first, last = encoding.span(0, 1), encoding.span(19, 24)
    assert first is not None
    assert last is not None
    assert not np.allclose(first, last)


def test_t5_reads_prompts_past_77_tokens(tiny_t5: tuple[str, Path]) -> None:
    encoding = load_encoder(*tiny_t5).encode(LONG)
    assert len(encoding.tokens) > 77
    assert encoding.span(len(LONG) - 6, len(LONG)) is not None


def test_states_of_fewer_tokens_are_those_of_a_tokenizer_that_truncates(tiny_t5: tuple[str, Path]) -> None:
    from transformers import AutoTokenizer, T5EncoderModel

    name, folder = tiny_t5
    found = truncated_tokens(load_encoder(name, folder), ["a person waves", LONG], 20)
    inputs = AutoTokenizer.from_pretrained(folder)(LONG, truncation=True, max_length=20, return_tensors="pt")
    with torch.inference_mode():
        expected = T5EncoderModel.from_pretrained(folder).eval()(inputs.input_ids).last_hidden_state[0].numpy()
    assert found[1].shape == (20, 768)
    np.testing.assert_allclose(found[1], expected, atol=1e-5)
    np.testing.assert_array_equal(found[0], load_encoder(name, folder).encode("a person waves").tokens)


def test_the_two_t5_of_one_width_are_not_taken_for_each_other(tiny_t5: tuple[str, Path]) -> None:
    name, folder = tiny_t5
    other = {"t5-base": "t5-v1_1-base", "t5-v1_1-base": "t5-base"}[name]
    with pytest.raises(InvalidFile, match="feed-forward"):
        load_encoder(other, folder)


def test_distilbert_gives_aligned_tokens_without_case_up_to_512(tiny_distilbert: Path) -> None:
    encoder = load_encoder("distilbert-base-uncased", tiny_distilbert)
    encoding = encoder.encode(TEXT)
    assert (encoder.width, encoding.pooled.shape) == (768, (768,))
    assert encoding.tokens.shape == (len(encoding.offsets), 768)
    assert encoding.offsets[0] == encoding.offsets[-1] == (0, 0)
    check_alignment(encoding, TEXT, "waves")
    np.testing.assert_array_equal(encoder.encode(TEXT.upper()).tokens, encoding.tokens)
    long = encoder.encode(" ".join([LONG] * 4))
    assert len(long.tokens) == 512
    assert long.offsets[-1] == (0, 0)


def test_another_model_is_not_taken_for_clip(tiny_t5: tuple[str, Path]) -> None:
    with pytest.raises(InvalidFile, match="CLIP"):
        load_encoder("clip-vit-b32", tiny_t5[1])


def test_truncated_weights_are_refused(tiny_clip: Path, tmp_path: Path) -> None:
    broken = tmp_path / "clip"
    shutil.copytree(tiny_clip, broken)
    file = broken / "model.safetensors"
    file.write_bytes(file.read_bytes()[:10_000])
    with pytest.raises(InvalidFile):
        load_encoder("clip-vit-b32", broken)


def test_pickled_weights_are_not_loaded(tiny_clip: Path, tmp_path: Path) -> None:
    pickled = tmp_path / "clip"
    shutil.copytree(tiny_clip, pickled)
    (pickled / "model.safetensors").rename(pickled / "pytorch_model.bin")
    with pytest.raises(InvalidFile, match="safetensors"):
        load_encoder("clip-vit-b32", pickled)


def test_weights_that_are_nowhere_say_how_to_get_them(tmp_path: Path) -> None:
    with pytest.raises(NotFound) as caught:
        find_weights("clip-vit-b32", config=Settings(models=tmp_path, home=tmp_path))
    assert "openai/clip-vit-base-patch32" in str(caught.value)


def test_other_weights_than_the_bundle_names_are_refused(tiny_clip: Path) -> None:
    spec = TextSpec(encoder="clip-vit-b32", width=512, encoder_sha256="0" * 64, labeller="none")
    with pytest.raises(InvalidBundle, match="trained with encoder"):
        TextPipeline.load(spec, encoder_path=tiny_clip)


def test_another_width_than_the_bundle_names_is_refused(tiny_clip: Path) -> None:
    with pytest.raises(InvalidBundle, match="width"):
        TextPipeline.load(TextSpec(encoder="clip-vit-b32", width=384, labeller="none"), encoder_path=tiny_clip)


def test_a_pipeline_on_clip_encodes_nodes_of_both_kinds(tiny_clip: Path) -> None:
    for kind in ("pooled", "span"):
        spec = TextSpec(encoder="clip-vit-b32", width=512, labeller="none", node_features=kind)
        pipeline = TextPipeline.load(spec, encoder_path=tiny_clip)
        assert pipeline.spec.encoder_sha256 == weights_sha256(tiny_clip)
        assert pipeline.features([LONG])[0].nodes.shape == (1, 512)


def test_a_vector_does_not_depend_on_the_texts_beside_it(minilm: MiniLMEncoder) -> None:
    texts = [TEXT, "left", "to the left hand side", "right", "she waves", "a person bows", " ".join(["walk"] * 400)] * 7
    together = minilm.pooled(texts)
    for text, vector in zip(texts[:7], together, strict=False):
        np.testing.assert_allclose(vector, minilm.encode(text).pooled, atol=2e-6)
        np.testing.assert_allclose(vector, minilm.pooled([text])[0], atol=2e-6)
    assert minilm.pooled([]) == []


def test_token_states_of_many_texts_are_those_of_each_alone(minilm: MiniLMEncoder) -> None:
    texts = [TEXT, "left", "a person bows", " ".join(["walk"] * 400)] * 12
    together = minilm.encodings(texts)
    assert len(together) == len(texts)
    for text, encoding in zip(texts[:4], together, strict=False):
        alone = minilm.encode(text)
        np.testing.assert_allclose(encoding.tokens, alone.tokens, atol=2e-6)
        np.testing.assert_allclose(encoding.pooled, alone.pooled, atol=2e-6)
        np.testing.assert_allclose(encoding.tokens, minilm.encodings([text])[0].tokens, atol=2e-6)
        assert encoding.offsets == alone.offsets
    assert minilm.encodings([]) == []
