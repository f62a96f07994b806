"""Labeller `light`, the default: the shipped head on int8 MiniLM states, decoded by a constrained Viterbi search."""

from __future__ import annotations

import re
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields
from functools import lru_cache

import numpy as np
import torch
from numpy.typing import NDArray

from marey.bundles import Bundle
from marey.core.errors import InvalidBundle
from marey.nn.threads import one_thread
from marey.text.bio import start_scores, transition_scores, viterbi
from marey.text.encoders import find_encoder
from marey.text.light_network import SUFFIX_BUCKETS, LightConfig, LightNetwork
from marey.text.minilm import MiniLM
from marey.text.roles import Frame, spans_to_arguments

MAX_SEGMENT_WORDS = 60
MAX_PIECES = 8  # of one word: a typed-over word must not crowd out the rest; 60 * 8 + 2 < 512
THRESHOLD = 0.5
UPDATES = "minilm"  # the part of a bundle that holds updates of MiniLM; older ones have none
CACHED_WORDS = 8192  # all captions of KIT-ML have 2,042
_NOT_A_LETTER = re.compile(r"\W")
_SENTENCE_END = re.compile(r"\w{2}[.!?…]+[\"')\]]*$")


class LightLabeller:
    """Find predicates and arguments in about 5 ms for 12 words on one core."""

    name = "light"

    def __init__(self, network: LightNetwork, states: WordStates, sha256: str) -> None:
        """Put a labeller together; most callers want `load`."""
        self.sha256 = sha256
        self._network = network.for_inference()
        self._states = states
        self._decoder = Decoder(network.config.tags, network.transitions)

    @classmethod
    def load(cls, bundle: Bundle) -> LightLabeller:
        """Load the head of `bundle` on the installed MiniLM.

        Raises:
            InvalidBundle: the head is damaged, or was trained on another MiniLM.
            NotFound: MiniLM is not installed.
        """
        minilm = find_encoder("minilm")
        parameters = dict(bundle.manifest.parameters)
        expected = parameters.pop("minilm_sha256", None)
        if expected != minilm.weights_sha256:
            raise InvalidBundle(
                f"was trained on the MiniLM of sha256 {str(expected)[:12]}, not on {minilm.reference}",
                where=str(minilm.path),
                hint="Install the bundles of one release together.",
            )
        try:
            config = light_config(parameters)
            network = LightNetwork(config)
            network.load_state_dict(_tensors(bundle, "labeller"))
            updates = _tensors(bundle, UPDATES) if UPDATES in bundle.manifest.parts else None
            states = WordStates(minilm, config.layers, updates)
        except (TypeError, RuntimeError, KeyError) as error:
            raise InvalidBundle(f"its weights do not fit: {error}", where=str(bundle.path)) from error
        return cls(network, states, bundle.weights_sha256)

    @one_thread()
    def label(self, sentences: Sequence[Sequence[str]]) -> list[tuple[Frame, ...]]:
        """The frames of each text, sentence by sentence: no argument crosses a full stop."""
        return [
            tuple(_moved(frame, start) for start, stop in segments(words) for frame in self.frames(words[start:stop]))
            for words in sentences
        ]

    def predicates(self, words: Sequence[str]) -> list[int]:
        """Word indices of the predicates."""
        return [frame.predicate for frame in self.label([words])[0]]

    @torch.inference_mode()
    def frames(self, words: Sequence[str], predicates: Sequence[int] | None = None) -> list[Frame]:
        """The frames of one sentence.

        Args:
            words: at most 60.
            predicates: where they are known; None = find them.
        """
        network = self._network.get()
        hidden, found = network.find(self._states(words), surface_features(words), THRESHOLD)
        at = [int(word) for word in found] if predicates is None else predicates
        if not at:
            return []
        return self._decoder.frames(network.tag_scores(hidden, list(at)).numpy(), at)


class Decoder:
    """Scores of tags to a frame: the best legal sequence under learned transitions."""

    def __init__(self, tags: Sequence[str], transitions: torch.Tensor) -> None:
        self._tags = tags
        self._transitions = transition_scores(tags) + transitions.detach().double().numpy()
        self._start = start_scores(tags)

    def __call__(self, emissions: NDArray[np.float64], predicate: int) -> Frame:
        """The frame of a predicate (word index) from (T, K) log-probabilities, which are changed."""
        return self.frames(emissions[None], [predicate])[0]

    def frames(self, emissions: NDArray[np.float64], predicates: Sequence[int]) -> list[Frame]:
        """The frames of B predicates of a sentence from (B, T, K) log-probabilities, which are changed."""
        emissions[range(len(predicates)), predicates, 1:] = -1e9  # a predicate is no argument of itself; tag 0 is O
        paths = viterbi(emissions, self._transitions, self._start)
        return [
            Frame(predicate, spans_to_arguments([self._tags[tag] for tag in path]))
            for predicate, path in zip(predicates, paths, strict=True)
        ]


class WordStates:
    """Hidden states of int8 MiniLM, with `updates` as it takes them, for the words of a sentence."""

    def __init__(
        self, minilm: Bundle, layers: Sequence[int], updates: Mapping[str, torch.Tensor] | None = None
    ) -> None:
        self._minilm = MiniLM(minilm, int8=True, updates=updates)
        self._layers = list(layers)
        self._first, self._last = self._minilm.tokenizer.encode("").ids  # [CLS], [SEP]
        self._pieces = lru_cache(CACHED_WORDS)(self._find_pieces)

    def __call__(self, words: Sequence[str]) -> torch.Tensor:
        """(T, L, 384): the mean over a word's pieces, without its punctuation where it has anything else."""
        ids, weights = self.tokens(words)
        hidden = self._minilm.states(ids)
        states = torch.stack([hidden[layer] for layer in self._layers], dim=1)  # (tokens, L, 384)
        means = torch.as_tensor(weights) @ states.flatten(1)
        return means.view(len(words), *states.shape[1:])

    def tokens(self, words: Sequence[str]) -> tuple[list[int], NDArray[np.float32]]:
        """The N token ids of a sentence, and (T, N) with which weights their states make up the words'."""
        ids = [self._first]
        weights = np.zeros((len(words), 2 + MAX_PIECES * len(words)), np.float32)  # (T, tokens at most)
        for row, word in zip(weights, words, strict=True):
            pieces, kept = self._pieces(word)
            for index in kept:
                row[len(ids) + index] = 1 / len(kept)
            ids += pieces
        ids.append(self._last)
        return ids, weights[:, : len(ids)]

    def _find_pieces(self, word: str) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Token ids of a word, and which of them its state is the mean of."""
        encoded = self._minilm.tokenizer.encode([word], is_pretokenized=True, add_special_tokens=False)
        pieces = encoded.tokens[:MAX_PIECES]
        kept = [index for index, piece in enumerate(pieces) if any(map(str.isalnum, piece))]
        return tuple(encoded.ids[:MAX_PIECES]), tuple(kept or range(len(pieces)))


def surface_features(words: Sequence[str]) -> torch.Tensor:
    """(T, 3): buckets of the last two and three letters, and how the word ends (0 plain, 1 comma, 2 full stop)."""
    return torch.as_tensor(np.array([_surface(word) for word in words]))


@lru_cache(CACHED_WORDS)
def _surface(word: str) -> tuple[int, int, int]:
    core = (word if word.isalnum() else _NOT_A_LETTER.sub("", word)).lower()
    ending = 2 if word[-1] in ".!?;" else 1 if word[-1] == "," else 0
    return _bucket("2" + core[-2:]), _bucket("3" + core[-3:]), ending


def _bucket(suffix: str) -> int:
    return zlib.crc32(suffix.encode()) % SUFFIX_BUCKETS


def segments(words: Sequence[str]) -> Iterator[tuple[int, int]]:
    """Sentences as [start, stop): cut after a full stop, and after 60 words at the latest comma."""
    start = 0
    for index, word in enumerate(words):
        if _SENTENCE_END.search(word) or index + 1 == len(words):
            yield from _at_most(words, start, index + 1)
            start = index + 1


def _at_most(words: Sequence[str], start: int, stop: int) -> Iterator[tuple[int, int]]:
    while stop - start > MAX_SEGMENT_WORDS:
        latest = start + MAX_SEGMENT_WORDS
        commas = [i + 1 for i in range(start + MAX_SEGMENT_WORDS // 2, latest) if words[i].endswith(",")]
        cut = commas[-1] if commas else latest
        yield start, cut
        start = cut
    yield start, stop


def light_config(parameters: dict[str, object]) -> LightConfig:
    """The network's sizes from the manifest. Raises TypeError for anything else."""
    known = {field.name for field in fields(LightConfig)}
    if foreign := set(parameters) - known:
        raise TypeError(f"unknown parameters {', '.join(sorted(foreign))}")
    return LightConfig(**{k: tuple(v) if isinstance(v, list) else v for k, v in parameters.items()})  # pyright: ignore


def _tensors(bundle: Bundle, part: str) -> dict[str, torch.Tensor]:
    return {name: torch.tensor(value) for name, value in bundle.tensors(part).items()}


def _moved(frame: Frame, offset: int) -> Frame:
    if offset == 0:
        return frame
    return Frame(
        frame.predicate + offset,
        tuple(type(a)(a.role, a.start + offset, a.stop + offset) for a in frame.arguments),
    )
