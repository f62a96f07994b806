"""Labeller `bert-srl`: AllenNLP's `structured-prediction-srl-bert.2020.12.15` (Shi & Lin 2019, arXiv 1904.05255),
the parser that GraphMotion and HGM³ used.

BERT over the words' pieces, the predicate marked by token type 1, one linear layer to BIO tags, Viterbi over the
probabilities. AllenNLP took its predicates from spaCy's part-of-speech tagger; here they come from the `light`
labeller, which learned them from that tool's output. `marey models import allennlp-srl` imports the archive.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import torch

from marey.bundles import Bundle, find_bundle
from marey.core.errors import InvalidBundle
from marey.nn.threads import one_thread
from marey.text.bio import start_scores, transition_scores, viterbi
from marey.text.keys import labeller_bundle
from marey.text.roles import Frame, PredicateFinder, spans_to_arguments
from marey.text.wordpiece import WordPieces

PREFIX = "bert_model."
PROJECTION = "tag_projection_layer."


class BertLabeller:
    """The imported parser. Requires `transformers`."""

    name = "bert-srl"

    def __init__(self, bundle: Bundle, predicates: PredicateFinder | None = None) -> None:
        """Load `bundle`; `predicates` is the `light` labeller unless another is given.

        Raises:
            InvalidBundle: it lacks weights, labels or vocabulary.
        """
        from transformers import BertConfig, BertModel

        self.sha256 = bundle.weights_sha256
        parameters = bundle.manifest.parameters
        try:
            self._tags: list[str] = list(parameters["labels"])
            self._pieces = WordPieces(parameters["vocabulary"], lowercase=bool(parameters["lowercase"]))
            config = BertConfig(**parameters["bert"])
        except (KeyError, TypeError) as error:
            raise InvalidBundle(f"lacks parameters of an imported parser: {error!r}", where=str(bundle.path)) from error
        tensors = {name: torch.tensor(value) for name, value in bundle.tensors("srl").items()}
        self._model: Any = BertModel(config, add_pooling_layer=False).eval()
        bert = {name.removeprefix(PREFIX): value for name, value in tensors.items() if name.startswith(PREFIX)}
        try:
            self._model.load_state_dict(bert)
            self._weight, self._bias = tensors[f"{PROJECTION}weight"], tensors[f"{PROJECTION}bias"]
            if self._weight.shape != (len(self._tags), config.hidden_size):
                raise ValueError(f"{len(self._tags)} labels, but a projection of {tuple(self._weight.shape)}")
        except (RuntimeError, KeyError, ValueError) as error:
            raise InvalidBundle(f"its weights do not fit: {error}", where=str(bundle.path)) from error
        self._max_pieces: int = config.max_position_embeddings
        self._transitions, self._start = transition_scores(self._tags), start_scores(self._tags)
        self._predicates = predicates or _light()

    @one_thread()
    def label(self, sentences: Sequence[Sequence[str]]) -> list[tuple[Frame, ...]]:
        """The frames of each sentence."""
        return [
            tuple(self.frame(words, predicate) for predicate in self._predicates.predicates(words))
            for words in sentences
        ]

    @torch.inference_mode()
    def frame(self, words: Sequence[str], predicate: int) -> Frame:
        """The frame of one predicate (a word index). Words past BERT's 512 pieces have no role."""
        ids, starts, owners = self._pieces.encode(words)
        ids, owners = ids[: self._max_pieces], owners[: self._max_pieces]
        starts = [start for start in starts if start < len(ids)]
        indicator = torch.tensor([[int(owner == predicate) for owner in owners]])
        hidden = self._model(input_ids=torch.tensor([ids]), token_type_ids=indicator).last_hidden_state[0]
        probabilities = torch.softmax(hidden @ self._weight.T + self._bias, dim=-1).double().numpy()
        # AllenNLP adds up probabilities, not their logarithms; so do we, to decode what it decodes
        (path,) = viterbi(probabilities[None], self._transitions, self._start)
        tags = [self._tags[path[start]] for start in starts]
        return Frame(predicate, tuple(a for a in spans_to_arguments(tags) if predicate not in a.words))


def _light() -> PredicateFinder:
    from marey.text.light import LightLabeller

    return LightLabeller.load(find_bundle(labeller_bundle("light")))
