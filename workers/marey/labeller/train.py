"""Train, cross-validate and pack the `light` role labeller.

    python -m marey.labeller.train --gold srl-kit-dev.json new_test_data.json \\
        --propbank propbank-release --words UD_English-EWT -o models/srl-light

MiniLM's updates and the head learn PropBank first (25 minutes on one CPU core), then the captions (three
minutes a fold). Folds are grouped by caption without case and punctuation; augmentation draws its phrases from
the training folds alone, and PropBank has no captions.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import torch

from marey.bundles import Bundle
from marey.core.errors import InvalidInput, MareyError
from marey.labeller.data import distinct, fold_of, read_gold
from marey.labeller.fit import PROPBANK_FIT, FitConfig, fit, roles_of, tag_set
from marey.labeller.grammar import Example
from marey.labeller.pack import pack
from marey.labeller.pools import (
    CaptionPool,
    frequent_roles,
    propbank_batches,
    split,
    with_roles,
)
from marey.labeller.propbank import read_propbank
from marey.labeller.recipe import Recipe, Validation
from marey.labeller.score import Scores
from marey.labeller.weights import Weights
from marey.text.encoders import find_encoder
from marey.text.light import WordStates
from marey.text.light_network import LightConfig


def cross_validate(gold: Sequence[Example], more: Sequence[Example], recipe: Recipe, folds: int) -> Validation:
    """Cross-validate: train on all folds but one of the gold and on all of `more`, and score the one left out."""
    occurs = Counter(example.words for example in gold)
    unique = distinct([*gold, *more])
    found = Validation(folds=folds)
    for fold in range(folds):
        weights = recipe.make([example for example in unique if fold_of(example.words, folds) != fold])
        labeller = weights.labeller(recipe.minilm)
        for example in unique:
            if fold_of(example.words, folds) != fold:
                continue
            frames = labeller.label([example.words])[0]
            known = labeller.frames(example.words, [frame.predicate for frame in example.frames])
            found.add(frames, known, example.frames, occurs[example.words])
        scores = found.every
        _say(f"fold {fold + 1}: predicates {scores.predicates.f1:.3f}, arguments {scores.arguments.f1:.3f} so far")
    return found


def _say(line: str) -> None:
    sys.stderr.write(line + "\n")
    sys.stderr.flush()


def learn_propbank(
    kept: Sequence[Example], held_out: Sequence[Example], minilm: Bundle, network: LightConfig, seed: int
) -> Weights:
    """The first training, and what it comes to on sentences that were held out."""
    words, size = WordStates(minilm, network.layers), PROPBANK_FIT.batch
    batches = propbank_batches(kept, words, network.tags, size, seed)
    first = fit(batches, minilm, network, PROPBANK_FIT, seed, progress=_progress)
    labeller, scores = first.labeller(minilm), Scores()
    for example in held_out:
        scores.add(labeller.label([example.words])[0], example.frames)
    _say(f"PropBank: predicates {scores.predicates.f1:.3f}, arguments {scores.arguments.f1:.3f}")
    return first


def prepare(options: argparse.Namespace, gold: Sequence[Example], minilm: Bundle) -> Recipe:
    """The recipe, with the first training where PropBank is given.

    Raises:
        InvalidInput: its annotations without the words they belong to, or words alone.
    """
    if bool(options.propbank) != bool(options.words):
        missing = "--words" if options.propbank else "--propbank"
        raise InvalidInput("is missing: annotations and words of PropBank come together", where=missing)
    config, pool = FitConfig(steps=options.steps), CaptionPool()
    roles = roles_of(gold)
    if not options.propbank:
        return Recipe(minilm, LightConfig(tag_set(roles)), config, pool, options.seed)
    kept, held_out = split(read_propbank(options.propbank, options.words))
    roles |= frequent_roles([*kept, *held_out])
    kept, held_out = with_roles(kept, roles), with_roles(held_out, roles)
    network = LightConfig(tag_set(roles))
    if options.first and options.first.is_file():
        first = Weights.load(options.first)
    else:
        first = learn_propbank(kept, held_out, minilm, network, options.seed)
        if options.first:
            first.save(options.first)
    return Recipe(minilm, first.network, config, pool, options.seed, kept, first)


def _progress(step: int, loss: float) -> None:
    if step % 100 == 99:
        _say(f"PropBank, step {step + 1}: loss {loss:.3f}")


def main(arguments: list[str] | None = None) -> int:
    """The command line of this module; returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m marey.labeller.train", description="Train the role labeller.")
    parser.add_argument(
        "--gold", type=Path, required=True, nargs="+", metavar="FILE",
        help="srl-kit-dev.json, which scores are given of; then more of its kind",
    )  # fmt: skip
    parser.add_argument("--propbank", type=Path, help="checkout of propbank/propbank-release")
    parser.add_argument("--words", type=Path, help="checkout of UniversalDependencies/UD_English-EWT")
    parser.add_argument(
        "--first", type=Path, help="file (.safetensors) of the first training: taken if there, else made"
    )
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder of the bundle")
    parser.add_argument("--folds", type=int, default=5, help="0 = no cross-validation")
    parser.add_argument("--steps", type=int, default=FitConfig.steps)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--threads", type=int, default=1)
    options = parser.parse_args(arguments)
    torch.set_num_threads(options.threads)
    began = time.monotonic()
    try:
        gold, *others = [read_gold(file) for file in options.gold]
        more = [example for other in others for example in other]
        minilm = find_encoder("minilm")
        recipe = prepare(options, [*gold, *more], minilm)
        result = None
        if options.folds:
            result = cross_validate(gold, more, recipe, options.folds)
            _say("  ".join(f"{name} {value}" for name, value in result.metrics().items()))
        weights = recipe.make(distinct([*gold, *more]))
        bundle = pack(options.output, weights, options.gold, recipe, result)
    except MareyError as error:
        _say(str(error))
        return error.exit_code
    _say(f"{time.monotonic() - began:.0f} s")
    sys.stdout.write(f"{bundle.path}\n")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
