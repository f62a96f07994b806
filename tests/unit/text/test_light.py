"""The shipped role labeller."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from marey.bundles import Bundle, find_bundle
from marey.core.errors import InvalidBundle
from marey.nn.compiled import OFTEN
from marey.text.encoders import find_encoder
from marey.text.light import LightLabeller, WordStates, segments
from marey.text.light_network import LightConfig, LightNetwork, sentence_dropout
from marey.text.loading import load_labeller
from marey.text.minilm import MiniLM
from marey.text.roles import Frame


@pytest.fixture(scope="module")
def labeller() -> LightLabeller:
    loaded = load_labeller("light")
    assert isinstance(loaded, LightLabeller)
    return loaded


def parsed(labeller: LightLabeller, text: str) -> dict[str, dict[str, str]]:
    """Arguments by predicate and role, punctuation stripped."""
    words = text.split()
    return {
        words[f.predicate].strip(".,!").lower(): {
            a.role: " ".join(words[a.start : a.stop]).strip(".,!").lower() for a in f.arguments
        }
        for f in labeller.label([words])[0]
    }


@pytest.mark.parametrize(
    "text",
    [
        "a person walks forward",
        "A person walks forward.",
        "A PERSON WALKS FORWARD",
        "a person walks forward!!",
    ],
)
def test_case_and_punctuation_do_not_matter(labeller: LightLabeller, text: str) -> None:
    assert parsed(labeller, text) == {"walks": {"ARG0": "a person", "ARGM-DIR": "forward"}}


@pytest.mark.parametrize(
    ("text", "verb", "role", "phrase"),
    [
        ("a person waves his left hand", "waves", "ARG1", "his left hand"),
        ("someone raises both hands slowly", "raises", "ARG1", "both hands"),
        ("someone raises both hands slowly", "raises", "ARGM-MNR", "slowly"),
        ("the man kicks with his right foot", "kicks", "ARGM-MNR", "with his right foot"),
        ("a woman is walking backwards", "walking", "ARGM-DIR", "backwards"),
        ("a person bows deeply", "bows", "ARG0", "a person"),
        ("a person runs to the left", "runs", "ARGM-DIR", "to the left"),
    ],
)
def test_motion_captions_are_read(labeller: LightLabeller, text: str, verb: str, role: str, phrase: str) -> None:
    assert parsed(labeller, text)[verb][role] == phrase


def test_two_verbs_share_their_subject(labeller: LightLabeller) -> None:
    found = parsed(labeller, "a person walks forward and then waves his right hand")
    assert list(found) == ["walks", "waves"]
    assert found["walks"]["ARG0"] == found["waves"]["ARG0"] == "a person"
    assert found["waves"]["ARG1"] == "his right hand"


def test_an_imperative_has_its_verb(labeller: LightLabeller) -> None:
    assert "walk" in parsed(labeller, "walk forward and wave")


def test_a_typo_does_not_lose_the_sentence(labeller: LightLabeller) -> None:
    assert parsed(labeller, "a persn walks forwrd slowly")["walks"]


def test_several_sentences_are_read_one_by_one(labeller: LightLabeller) -> None:
    found = parsed(labeller, "A person walks forward. Someone bows. The man waves.")
    assert list(found) == ["walks", "bows", "waves"]
    assert found["waves"] == {"ARG0": "the man"}


def test_a_hundred_words_are_read(labeller: LightLabeller) -> None:
    text = " ".join(["a person walks forward and turns to the left, then waves"] * 9)
    (frames,) = labeller.label([text.split()])
    assert len(frames) >= 20


def test_labels_do_not_depend_on_the_batch(labeller: LightLabeller) -> None:
    sentences = [text.split() for text in ("a person walks", "someone jumps and kicks", "a man sits down slowly")]
    together = labeller.label(sentences)
    assert together == [labeller.label([words])[0] for words in sentences]


def check_frames(frames: tuple[Frame, ...], words: list[str]) -> None:
    predicates = [f.predicate for f in frames]
    assert predicates == sorted(set(predicates))
    for frame in frames:
        assert 0 <= frame.predicate < len(words)
        covered: list[int] = [i for a in frame.arguments for i in a.words]
        assert len(covered) == len(set(covered)), "arguments of one predicate do not overlap"
        assert frame.predicate not in covered
        assert all(0 <= a.start < a.stop <= len(words) for a in frame.arguments)


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.text(st.characters(exclude_categories=("Z", "C")), min_size=1, max_size=12), min_size=1, max_size=30)
)
def test_any_words_give_well_formed_frames(labeller: LightLabeller, words: list[str]) -> None:
    words = [word for word in words if word.split() == [word]] or ["x"]
    check_frames(labeller.label([words])[0], words)


@pytest.mark.parametrize("words", [["🕺"], ["."] * 70, ["ÄÖÜ" * 30] * 60, ["walk"] * 200, ["#"] * 60, ["a", "\u200b"]])
def test_odd_words_give_well_formed_frames(labeller: LightLabeller, words: list[str]) -> None:
    check_frames(labeller.label([words])[0], words)


@given(st.lists(st.sampled_from(["walks", "forward,", "end.", "1.", "x!"]), min_size=1, max_size=200))
def test_segments_cover_all_words_once_in_pieces_of_at_most_sixty(words: list[str]) -> None:
    pieces = list(segments(words))
    assert [i for a, b in pieces for i in range(a, b)] == list(range(len(words)))
    assert all(0 < b - a <= 60 for a, b in pieces)


def test_a_damaged_head_is_refused(tmp_path: Path) -> None:
    copy = tmp_path / "srl-light"
    shutil.copytree(find_bundle("srl-light").path, copy)
    file = copy / "labeller.safetensors"
    file.write_bytes(file.read_bytes()[:-100])
    with pytest.raises(InvalidBundle):
        load_labeller(str(copy))


def test_a_head_of_another_minilm_is_refused() -> None:
    bundle = find_bundle("srl-light")
    manifest = bundle.manifest.model_copy(
        update={"parameters": {**bundle.manifest.parameters, "minilm_sha256": "0" * 64}}
    )
    with pytest.raises(InvalidBundle, match="MiniLM"):
        LightLabeller.load(Bundle(bundle.path, manifest))


def test_the_bundle_is_small_and_says_where_it_comes_from() -> None:
    bundle = find_bundle("srl-light")
    assert bundle.manifest.kind == "labeller"
    assert sum(entry.bytes for entry in bundle.manifest.files.values()) < 4_000_000
    assert "GraphMotion" in bundle.manifest.data[0].credit
    card = (bundle.path / "README.md").read_text()
    assert "argument F1" in card
    # the targets: where the parser found a verb at all (docs/decisions/0010-roles-from-propbank.md)
    assert bundle.manifest.metrics["cv_parsed_predicate_f1"] >= 0.96
    assert bundle.manifest.metrics["cv_parsed_argument_f1"] >= 0.82


def test_pads_do_not_change_the_scores() -> None:
    torch.manual_seed(0)
    network = LightNetwork(LightConfig(tags=("O", "B-ARG0", "I-ARG0"), layers=(0, 6), width=24, heads=2)).eval()
    states, surface = torch.randn(1, 5, 2, 384), torch.randint(0, 3, (1, 5, 3))
    mask = torch.tensor([[True, True, True, False, False]])
    whole = network.read(states, surface, mask)
    cut = network.read(states[:, :3], surface[:, :3], mask[:, :3])
    assert torch.allclose(whole[:, :3], cut, atol=1e-5)
    at = torch.tensor([1])
    padded = network.tag_logits(whole, at, mask)[:, :3]
    assert torch.allclose(padded, network.tag_logits(cut, at, mask[:, :3]), atol=1e-5)


@pytest.fixture
def network() -> LightNetwork:
    torch.manual_seed(0)
    return LightNetwork(LightConfig(tags=("O", "B-ARG0", "I-ARG0"), layers=(0, 6), width=24, heads=2))


@pytest.mark.parametrize("script", [True, False])
@pytest.mark.parametrize("length", [1, 5, 40])
@torch.inference_mode()
def test_the_copy_for_labelling_says_what_the_network_says(
    network: LightNetwork, length: int, script: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not script:
        monkeypatch.setattr("marey.nn.compiled.compiled", lambda module: module)
    states, surface = torch.randn(length, 2, 384), torch.randint(0, 3, (length, 3))
    copy = network.eval().for_inference()
    mask = torch.ones(1, length, dtype=torch.bool)
    hidden = network.read(states[None], surface[None], mask)
    probabilities = torch.sigmoid(network.predicate_logits(hidden)[0])
    threshold = float(probabilities.median()) - 1e-3
    at = (probabilities > threshold).nonzero()[:, 0]
    logits = network.tag_logits(hidden.expand(len(at), -1, -1), at, mask.expand(len(at), -1))
    first = None
    for _ in range(OFTEN + 4):  # then it is compiled; torch compiles a script again in its second call
        used = copy.get()
        read, found = used.find(states, surface, threshold)
        assert torch.allclose(read, hidden, atol=1e-5)
        assert found.tolist() == at.tolist()
        scores = used.tag_scores(read, found.tolist())
        assert torch.allclose(scores, torch.log_softmax(logits, -1).double(), atol=1e-5)
        first = scores if first is None else first
        assert torch.equal(scores, first)
    assert isinstance(copy.get(), torch.jit.ScriptModule) == script


def test_the_copy_for_labelling_leaves_the_network_to_be_trained(network: LightNetwork) -> None:
    states, surface = torch.randn(1, 5, 2, 384), torch.randint(0, 3, (1, 5, 3))
    network.train().for_inference()
    network.predicate_logits(network.read(states, surface)).sum().backward()
    assert network.training
    assert network.states.weight.grad is not None
    assert network.states.weight.is_contiguous()


def test_dropout_drops_the_same_features_of_every_word() -> None:
    dropped = sentence_dropout(torch.ones(2, 7, 50), 0.5)
    assert (dropped == dropped[:, :1]).all()
    assert (dropped == 0).any()


WORDS = ["a", "jumping-jack,", "(naïve)", "3x", "counterclockwise...", "#!?", "\u200b", "🕺", "it's", "左手"]


def test_word_states_are_means_over_the_pieces_of_the_sentence() -> None:
    bundle = find_encoder("minilm")
    minilm = MiniLM(bundle, int8=True)
    encoded = minilm.tokenizer.encode(WORDS, is_pretokenized=True)
    hidden = minilm.states(encoded.ids)[6]
    found = WordStates(bundle, (6,))(WORDS)
    for word, state in enumerate(found[:, 0]):
        pieces = [index for index, owner in enumerate(encoded.word_ids) if owner == word]
        content = [index for index in pieces if any(c.isalnum() for c in encoded.tokens[index])]
        wanted = hidden[content or pieces].mean(0) if pieces else torch.zeros(384)
        assert torch.allclose(state, wanted, atol=1e-6), WORDS[word]


def test_word_states_leave_out_punctuation() -> None:
    states = WordStates(find_encoder("minilm"), (0,))
    (plain,), (stopped,) = states(["forward"]), states(["forward."])
    # embeddings (layer 0) of one token at one position: equal only if the full stop's are not averaged in
    assert torch.allclose(plain, stopped, atol=1e-6)
