"""Recipe of the role labeller's weights, and its scores on sentences that it was not trained on."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from marey.bundles import Bundle
from marey.labeller.fit import FitConfig, fit
from marey.labeller.pools import SentencePool, sentence_batches
from marey.labeller.score import Scores, confusions
from marey.labeller.sentences import Example
from marey.labeller.weights import Weights
from marey.text.light import LightLabeller, WordStates
from marey.text.light_network import LightConfig

HELD_OUT = "held_out"
KIT, KIT_PARSED = "kit", "kit_parsed"


@dataclass
class Evaluation:
    """Scores by set: `held_out` sentences of the project, `kit` captions, and those of them with a verb in the gold.

    Attributes:
        scores: by name of the set.
        sentences: how many each has.
        given: of the held-out sentences with predicates given.
        confused: roles of the held-out sentences, (wanted, said) counts.
    """

    scores: dict[str, Scores] = field(default_factory=dict[str, Scores])
    sentences: dict[str, int] = field(default_factory=dict[str, int])
    given: Scores = field(default_factory=Scores)
    confused: Counter[tuple[str, str]] = field(default_factory=Counter[tuple[str, str]])

    def metrics(self) -> dict[str, float]:
        """Return the scores as the manifest of the bundle keeps them."""
        found = {
            f"{name}_{what}_f1": getattr(scores, f"{what}s").f1
            for name, scores in self.scores.items()
            for what in ("predicate", "argument")
        }
        found[f"{HELD_OUT}_argument_f1_given_predicates"] = self.given.arguments.f1
        return {name: round(value, 4) for name, value in found.items()}


def evaluate(labeller: LightLabeller, sets: Mapping[str, Sequence[Example]]) -> Evaluation:
    """Score a labeller on sets of sentences by name."""
    result = Evaluation()
    for name, examples in sets.items():
        scores = result.scores[name] = Scores()
        result.sentences[name] = len(examples)
        for example in examples:
            said = labeller.label([example.words])[0]
            scores.add(said, example.frames)
            if name == HELD_OUT:
                known = labeller.frames(example.words, [frame.predicate for frame in example.frames])
                result.given.add(known, example.frames)
                result.confused.update(confusions([said], [example.frames]))
    return result


@dataclass(frozen=True)
class Recipe:
    """The recipe of the weights."""

    minilm: Bundle
    network: LightConfig
    config: FitConfig
    pool: SentencePool
    seed: int
    propbank: Sequence[Example] = ()
    first: Weights | None = None
    """Weights after PropBank; None = the project's sentences alone."""

    def make(self, sentences: Sequence[Example]) -> Weights:
        """Weights from annotated sentences."""
        words = WordStates(self.minilm, self.network.layers)
        tags, size = self.network.tags, self.config.batch
        batches = sentence_batches(sentences, self.propbank, words, tags, self.pool, size, self.seed)
        return fit(batches, self.minilm, self.network, self.config, self.seed, self.first)
