"""Training of the readers of actions, of sequences and of the order of time."""

from __future__ import annotations

import re
from collections import defaultdict

import numpy as np
import pytest
import torch

from marey.checks.reader_prompts import outside_prompts, sequence_prompts
from marey.reading import train as training
from marey.reading import train_encoder as encoder_training
from marey.reading import train_sequences as sequence_training
from marey.reading.sequences import PartedText, TextPart, parted_texts, written_parts
from marey.reading.texts import LabelledText, labelled_texts
from marey.reading.train_order import OrderNetwork, in_time, ordered_texts, weights_of
from marey.referee.prompts import action_prompts, development_prompts, studio_prompts
from marey.referee.prompts import sequence_prompts as referee_sequences
from marey.text.action_reader import OUTSIDE, SEVERAL, ActionReader
from marey.text.clause_order import CONTEXT
from marey.text.encoders import find_encoder
from marey.text.minilm import MiniLM
from marey.text.minilm_bundle import load_weights
from marey.text.minilm_encoder import MiniLMEncoder
from marey.text.order_reader import OrderReader, marked
from marey.text.reader_file import Float32
from marey.text.sequence_reader import SequenceReader
from marey.vocabulary.bearing_words import as_written
from marey.vocabulary.entries import load_vocabulary
from tests.support.texts import order_of_time, shared_encoder


@pytest.fixture(scope="module")
def texts() -> list[LabelledText]:
    return labelled_texts(0)


@pytest.fixture(scope="module")
def parted() -> list[PartedText]:
    return parted_texts(0)


def test_every_class_has_texts_and_none_is_a_prompt_for_measuring(texts: list[LabelledText]) -> None:
    by_class = defaultdict[str, set[str]](set)
    for each in texts:
        by_class[each.asks].add(each.text.casefold())
    assert set(by_class) == {*load_vocabulary().actions, SEVERAL, OUTSIDE}
    assert min(map(len, by_class.values())) >= 60
    asked = (*action_prompts(), *development_prompts(), *studio_prompts())
    held_out = {prompt.text.casefold() for prompt in asked} | {text.casefold() for text, _ in sequence_prompts()}
    assert not (held_out | {text.casefold() for text in outside_prompts()}) & set().union(*by_class.values())
    assert labelled_texts(0) == texts
    assert labelled_texts(1) != texts


def test_a_reader_learns_its_texts(texts: list[LabelledText], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(training, "MEMBERS", 1)
    some = [each for each in texts if each.asks in ("walk", "wave", OUTSIDE)][::12]
    encoder = shared_encoder()
    classes, weights = training.train(some, encoder, 0)
    assert classes == [*load_vocabulary().actions, SEVERAL, OUTSIDE]
    halves = {name: part.astype(np.float16) for name, part in weights.items()}
    reader = ActionReader(classes, encoder.sha256, halves)
    vectors = encoder.pooled([training.without_punctuation(each.text) for each in some])
    right = [reader.read(each.text, vector).name == each.asks for each, vector in zip(some, vectors, strict=True)]
    assert np.mean(right) > 0.9


def test_vectors_of_the_reading_encoder_tell_actions_apart(
    parted: list[PartedText], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(encoder_training, "EPOCHS", 12)
    monkeypatch.setattr(encoder_training, "BATCH", 16)
    monkeypatch.setattr(encoder_training, "WARMUP", 5)
    monkeypatch.setattr(encoder_training, "UPDATED", 1)
    single = [text for text in parted if len(text.parts) == 1 and len(text.text.split()) <= 8]
    known = [text for text in single if text.parts[0].asks in ("walk", "run")]
    bundle = find_encoder("minilm")
    updates = encoder_training.train(known[::5], MiniLM(bundle), load_weights(bundle), 0)
    assert {name.partition(".")[0] for name in updates} == {"5"}
    encoder = MiniLMEncoder(bundle)
    other = known[4::30]
    same = np.equal.outer(*[[text.parts[0].asks == "run" for text in other]] * 2)

    def gap(vectors: list[Float32]) -> float:
        cosines = np.stack(vectors) @ np.stack(vectors).T
        return float(cosines[same].mean() - cosines[~same].mean())

    texts = [text.text for text in other]
    tuned = encoder.tuned({name: part.detach() for name, part in updates.items()})
    assert gap(tuned.pooled(texts)) > gap(encoder.pooled(texts)) + 0.1


def test_texts_in_parts_are_whole_and_none_is_a_prompt_for_measuring(parted: list[PartedText]) -> None:
    known = {*load_vocabulary().actions, OUTSIDE, CONTEXT}
    assert {part.asks for text in parted for part in text.parts} == known
    assert all(part.text.strip() for text in parted for part in text.parts)
    held_out = {prompt.text.casefold() for prompt in (*referee_sequences(), *development_prompts())}
    held_out |= {text.casefold() for text, _ in sequence_prompts()}
    assert not held_out & {text.text.casefold() for text in parted}
    assert len(list(written_parts())) > 1700


def test_a_reader_of_sequences_learns_its_texts(parted: list[PartedText], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sequence_training, "ACTION_MEMBERS", 1)
    monkeypatch.setattr(sequence_training, "CUT_BATCH", 16)
    monkeypatch.setattr(sequence_training, "CUT_EPOCHS", 12)
    wanted = {"walk", "wave", "bow", "jump"}
    known = [text for text in parted if {part.asks for part in text.parts} <= wanted]
    several = [text for text in known if len(text.parts) > 1][:12]
    some = [text for text in known if len(text.parts) == 1][::20]
    assert len(several) == 12
    encoder = shared_encoder()
    classes, weights = sequence_training.train([*some, *several * 4], encoder, 0)
    reader = SequenceReader(classes, encoder.sha256, {name: part.astype(np.float16) for name, part in weights.items()})
    read = [
        reader.read(bare, reader.written_clauses(bare, encoding, encoder.pooled), order_of_time)
        for bare, encoding in zip(
            [as_written(text.text) for text in several],
            encoder.encodings([text.text for text in several]),
            strict=True,
        )
    ]
    right = [
        {each.action for each in found} == {part.asks for part in text.parts}
        for found, text in zip(read, several, strict=True)
    ]
    assert np.mean(right) > 0.7


ASKS = ("throw", "run", "kneel")


@torch.no_grad()
def test_the_order_of_time_is_scored_as_it_was_trained() -> None:
    pieces = ["He throws the spear,", " but only after running up to the line,", " and kneels."]
    parts = [TextPart(piece, asks, place=place) for piece, asks, place in zip(pieces, ASKS, (2, 1, 3), strict=True)]
    bundle = find_encoder("minilm")
    (text,) = ordered_texts([PartedText(tuple(parts), 1.0)], MiniLM(bundle))
    assert text.pairs.tolist() == [[0, 1], [0, 2], [1, 2]]
    assert text.earlier.tolist() == [1, 0, 0]
    torch.manual_seed(0)
    network = OrderNetwork(load_weights(bundle)).eval()
    for name, parameter in network.layers.named_parameters():
        if name.endswith("ups"):
            parameter.normal_(std=0.02)
    encoder = MiniLMEncoder(bundle)
    tuned = encoder.tuned({name: part.detach() for name, part in network.layers.updates().items()})
    written, spans = marked(pieces)
    encoding = tuned.encode(written)
    found = [encoding.span(*span) for span in spans]
    vectors = {
        number: (each / np.linalg.norm(each)).astype(np.float32)
        for number, each in enumerate(found)
        if each is not None
    }
    scores = OrderReader([], encoder.sha256, weights_of(network)).scores(vectors, [(0, 1), (0, 2), (1, 2)])
    assert list(scores.values()) == pytest.approx(network([text]).tolist(), abs=2e-3)
    bare = encoder.encode(written).tokens
    assert np.abs(bare - encoding.tokens).max() > 1e-3, "the updates count"


def test_places_in_time_of_parts() -> None:
    def places(*asks: tuple[str, bool, int]) -> list[int]:
        return PartedText(tuple(TextPart("", name, once, place) for name, once, place in asks), 1.0).places()

    assert places(("walk", False, 0), (CONTEXT, False, 0), ("bow", False, 0)) == [1, 0, 2]
    assert places(("flip", False, 2), ("run", False, 1), ("cheer", False, 3)) == [2, 1, 3]
    assert places(("walk", False, 0), ("wave", True, 0), ("bow", False, 0)) == [1, 1, 3]


def test_made_texts_say_their_order_in_time(parted: list[PartedText]) -> None:
    reordered = [text for text in parted if not in_time(text)]
    made = [text for text in reordered if text.weight == 1.0]
    assert len(made) > 1000
    for text in made:
        joined = text.text.lower()
        assert re.search(r"\b(?:before|after|once|prior|following|first|done)\b", joined), joined
