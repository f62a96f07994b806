"""Recipe of the role labeller's weights, and the scores of its cross-validation."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

from marey.bundles import Bundle
from marey.labeller.data import corrected
from marey.labeller.fit import FitConfig, fit
from marey.labeller.grammar import Example
from marey.labeller.pools import CaptionPool, caption_batches
from marey.labeller.score import Scores, confusions
from marey.labeller.weights import Weights
from marey.text.light import WordStates
from marey.text.light_network import LightConfig
from marey.text.roles import Frame


@dataclass(frozen=True)
class Validation:
    """Cross-validated scores.

    Attributes:
        occurring: captions of the first gold file as often as they occur there.
        distinct: each of them once.
        parsed: of those, the ones in which the parser found a verb at all.
        every: the distinct captions of all gold files.
        every_parsed: of those, the ones in which the parser found a verb at all.
        given: these again, with predicates given.
        confused: roles of these, (wanted, said) counts.
        folds: how many.
    """

    occurring: Scores = field(default_factory=Scores)
    distinct: Scores = field(default_factory=Scores)
    parsed: Scores = field(default_factory=Scores)
    every: Scores = field(default_factory=Scores)
    every_parsed: Scores = field(default_factory=Scores)
    given: Scores = field(default_factory=Scores)
    confused: Counter[tuple[str, str]] = field(default_factory=Counter[tuple[str, str]])
    folds: int = 0

    def add(self, said: Sequence[Frame], known: Sequence[Frame], wanted: Sequence[Frame], occurs: int) -> None:
        """Count one caption that occurs so often in the first file; `known` is said of given predicates."""
        counts = {"every": 1, "distinct": min(occurs, 1), "occurring": occurs}
        if wanted:
            counts |= {"every_parsed": 1, "parsed": min(occurs, 1)}
            self.given.add(known, wanted)
        for name, count in counts.items():
            for _ in range(count):
                getattr(self, name).add(said, wanted)
        self.confused.update(confusions([said], [wanted]))

    def metrics(self) -> dict[str, float]:
        """For the manifest."""
        named = {name: getattr(self, name) for name in ("occurring", "distinct", "parsed", "every", "every_parsed")}
        found = {
            f"cv_{name}_{what}_f1": getattr(scores, f"{what}s").f1
            for name, scores in named.items()
            for what in ("predicate", "argument")
        }
        found["cv_argument_f1_given_predicates"] = self.given.arguments.f1
        return {name: round(value, 4) for name, value in found.items()}


@dataclass(frozen=True)
class Recipe:
    """The recipe of the weights."""

    minilm: Bundle
    network: LightConfig
    config: FitConfig
    pool: CaptionPool
    seed: int
    propbank: Sequence[Example] = ()
    first: Weights | None = None
    """Weights after PropBank; None = captions alone."""

    def make(self, gold: Sequence[Example]) -> Weights:
        """Weights from annotated sentences."""
        words = WordStates(self.minilm, self.network.layers)
        tags, size = self.network.tags, self.config.batch
        batches = caption_batches(corrected(gold), self.propbank, words, tags, self.pool, size, self.seed)
        return fit(batches, self.minilm, self.network, self.config, self.seed, self.first)
