"""Train, cross-validate and pack the `light` role labeller.

    python -m workers.training.labeller --gold srl-kit-dev.json -o models/srl-light

Minutes on one CPU core a head. Folds are grouped by caption without case and punctuation; augmentation draws its
phrases from the training folds alone.
"""

from __future__ import annotations

import argparse
import hashlib
import sys
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import torch

from shared.bundles import Bundle, BundleWriter, DataSource
from shared.errors import MareyError
from shared.text.encoders import find_weights, weights_sha256
from shared.text.light import LightLabeller, WordStates
from shared.text.light_network import LightConfig, LightNetwork
from shared.text.roles import Frame
from workers.training.labeller_card import card
from workers.training.labeller_data import corrected, distinct, fold_of, read_gold
from workers.training.labeller_fit import FitConfig, fit, tag_set
from workers.training.labeller_grammar import Example
from workers.training.labeller_score import Scores, confusions

SOURCE = DataSource(
    name="AllenNLP SRL-BERT labels of 655 KIT-ML captions",
    licence="Apache-2.0 (labels, jpthu17/GraphMotion); captions: KIT Motion-Language data set",
    credit="Jin et al. 2023 (GraphMotion); Shi & Lin 2019 (the parser); Plappert et al. 2016 (KIT-ML)",
)


@dataclass(frozen=True)
class Validation:
    """Cross-validated scores: over all sentences as they occur, and with predicates given."""

    scores: Scores
    given: Scores
    distinct: Scores
    confused: Counter[tuple[str, str]]
    folds: int

    def metrics(self) -> dict[str, float]:
        """For the manifest."""
        return {
            "cv_predicate_f1": round(self.scores.predicates.f1, 4),
            "cv_argument_f1": round(self.scores.arguments.f1, 4),
            "cv_span_f1": round(self.scores.spans.f1, 4),
            "cv_argument_f1_given_predicates": round(self.given.arguments.f1, 4),
            "cv_distinct_predicate_f1": round(self.distinct.predicates.f1, 4),
            "cv_distinct_argument_f1": round(self.distinct.arguments.f1, 4),
        }


@dataclass(frozen=True)
class Recipe:
    """How a head is made."""

    states: WordStates
    network: LightConfig
    config: FitConfig
    seed: int

    def make(self, gold: Sequence[Example]) -> LightNetwork:
        """A head from annotated sentences."""
        return fit(corrected(gold), self.states, self.network, self.config, self.seed)


def cross_validate(gold: Sequence[Example], recipe: Recipe, folds: int) -> Validation:
    """Train on all folds but one, score that one, for each."""
    counts = Counter(example.words for example in gold)
    unique = distinct(gold)
    scores, given, single = Scores(), Scores(), Scores()
    said: list[tuple[Frame, ...]] = []
    wanted: list[tuple[Frame, ...]] = []
    for fold in range(folds):
        head = recipe.make([example for example in unique if fold_of(example.words, folds) != fold])
        labeller = LightLabeller(head, recipe.states, "")
        for example in unique:
            if fold_of(example.words, folds) != fold:
                continue
            frames = labeller.label([example.words])[0]
            known = labeller.frames(example.words, [frame.predicate for frame in example.frames])
            single.add(frames, example.frames)
            for _ in range(counts[example.words]):
                scores.add(frames, example.frames)
                given.add(known, example.frames)
            said.append(frames)
            wanted.append(example.frames)
        _say(f"fold {fold + 1}: predicates {scores.predicates.f1:.3f}, arguments {scores.arguments.f1:.3f} so far")
    return Validation(scores, given, single, confusions(said, wanted), folds)


def pack(
    output: Path,
    head: LightNetwork,
    minilm: Path,
    gold_file: Path,
    recipe: Recipe,
    result: Validation | None,
) -> Bundle:
    """Write the bundle."""
    tensors = {name: value.numpy() for name, value in head.state_dict().items()}
    with BundleWriter(output, overwrite=True) as writer:
        writer.add_part("labeller", tensors)
        writer.add_card(card(result))
        return writer.finish(
            name=output.name,
            version="1",
            kind="labeller",
            model="light",
            config="light",
            parameters={**asdict(head.config), "minilm_sha256": weights_sha256(minilm)},
            data=(SOURCE.model_copy(update={"sha256": hashlib.sha256(gold_file.read_bytes()).hexdigest()}),),
            licence="Apache-2.0",
            metrics=result.metrics() if result else {},
            training={
                "command": "python -m workers.training.labeller",
                "seed": recipe.seed,
                **asdict(recipe.config),
            },
        )


def _say(line: str) -> None:
    sys.stderr.write(line + "\n")
    sys.stderr.flush()


def main(arguments: list[str] | None = None) -> int:
    """The command line of this module; returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m workers.training.labeller", description="Train the role labeller.")
    parser.add_argument("--gold", type=Path, required=True, help="srl-kit-dev.json")
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder of the bundle")
    parser.add_argument("--folds", type=int, default=5, help="0 = no cross-validation")
    parser.add_argument("--steps", type=int, default=FitConfig.steps)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--threads", type=int, default=1)
    options = parser.parse_args(arguments)
    torch.set_num_threads(options.threads)
    config = FitConfig(steps=options.steps)
    began = time.monotonic()
    try:
        gold = read_gold(options.gold)
        minilm = find_weights("minilm")
        network = LightConfig(tags=tag_set(gold))
        states = WordStates(minilm, network.layers)
        recipe = Recipe(states, network, config, options.seed)
        result = None
        if options.folds:
            result = cross_validate(gold, recipe, options.folds)
            _say("  ".join(f"{name} {value}" for name, value in result.metrics().items()))
        head = recipe.make(distinct(gold))
        bundle = pack(options.output, head, minilm, options.gold, recipe, result)
    except MareyError as error:
        _say(str(error))
        return error.exit_code
    _say(f"{time.monotonic() - began:.0f} s")
    sys.stdout.write(f"{bundle.path}\n")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
