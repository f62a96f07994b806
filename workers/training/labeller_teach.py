"""Teachers of the role labeller: several heads together label captions that nobody labelled, and one head learns from
them (distillation after Hinton et al. 2015, arXiv 1503.02531, with the labels rather than the probabilities)."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from pathlib import Path

import torch

from shared.errors import InvalidFile
from shared.text.light import THRESHOLD, Decoder, WordStates, segments, surface_features
from shared.text.light_network import LightNetwork
from shared.text.roles import Frame
from workers.training.labeller_data import group
from workers.training.labeller_grammar import Example, Words

DOUBT = 0.25
"""A word whose probability of being a predicate is nearer than this to the threshold leaves its caption out."""
MAX_WORDS = 40


class Teachers:
    """Heads of one configuration, trained with different seeds: mean probabilities, mean transitions."""

    def __init__(self, heads: Sequence[LightNetwork], states: WordStates) -> None:
        self._heads = heads
        self._states = states
        transitions = torch.stack([head.transitions.detach() for head in heads]).mean(0)
        self._decoder = Decoder(heads[0].config.tags, transitions)

    @torch.inference_mode()
    def frames(self, words: Sequence[str]) -> tuple[list[Frame], float]:
        """The frames of one sentence, and how far its least certain word is from the threshold."""
        states, surface = self._states(words)[None], surface_features(words)[None]
        mask = torch.ones(1, len(words), dtype=torch.bool)
        read = [head.read(states, surface, mask) for head in self._heads]
        each = [torch.sigmoid(h.predicate_logits(x)[0]) for h, x in zip(self._heads, read, strict=True)]
        probability = torch.stack(each).mean(0)
        found = (probability > THRESHOLD).nonzero()[:, 0]
        certainty = float((probability - THRESHOLD).abs().min())
        if not len(found):
            return [], certainty
        many = (len(found), -1, -1)
        logits = [h.tag_logits(x.expand(*many), found, mask.expand(many[0], -1))
                  for h, x in zip(self._heads, read, strict=True)]  # fmt: skip
        emissions = torch.stack([torch.softmax(one, -1) for one in logits]).mean(0).log().double().numpy()
        return [self._decoder(scores, int(i)) for scores, i in zip(emissions, found, strict=True)], certainty

    def label(self, captions: Iterable[Words]) -> list[Example]:
        """Captions with the frames the teachers find; without those they doubt or find no predicate in."""
        labelled: list[Example] = []
        for words in captions:
            frames, certainty = self.frames(words)
            if frames and certainty > DOUBT:
                labelled.append(Example(words, tuple(frames)))
        return labelled


def read_captions(file: Path, known: Iterable[Words]) -> list[Words]:
    """Captions of one sentence from a JSON list of texts, each once, without those `known` (whatever their case and
    punctuation).

    Raises:
        InvalidFile: not such a file.
    """
    try:
        texts = [str(text).split() for text in json.loads(file.read_bytes())]
    except (OSError, ValueError, TypeError) as error:
        raise InvalidFile(f"is not a list of captions: {error!r}", where=str(file)) from error
    seen = {group(words) for words in known}
    kept: list[Words] = []
    for words in texts:
        key = group(words)
        if key in seen or not 2 <= len(words) <= MAX_WORDS or len(list(segments(words))) > 1:
            continue
        seen.add(key)
        kept.append(tuple(words))
    return kept
