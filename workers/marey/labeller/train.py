"""Train, score and pack the `light` role labeller.

    python -m marey.labeller.train --propbank propbank-release --words UD_English-EWT \\
        --test srl-kit-dev.json -o models/srl-open

MiniLM's updates and the head learn PropBank first (25 minutes on one CPU core; `--first` keeps the result), then the
project's own annotated sentences (five minutes). It is scored on sentences of `sentences/test.txt`, and on
`--test`, which no weights are trained on.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import torch

from marey.bundles import Bundle
from marey.core.errors import InvalidInput, MareyError
from marey.labeller.data import distinct, read_labels
from marey.labeller.fit import PROPBANK_FIT, FitConfig, fit, roles_of, tag_set
from marey.labeller.pack import pack
from marey.labeller.pools import SentencePool, frequent_roles, propbank_batches, split, with_roles
from marey.labeller.propbank import read_propbank
from marey.labeller.recipe import HELD_OUT, KIT, KIT_PARSED, Recipe, evaluate
from marey.labeller.score import Scores
from marey.labeller.sentences import TEST, TRAIN, Example, read_sentences
from marey.labeller.weights import Weights
from marey.text.encoders import find_encoder
from marey.text.light import WordStates
from marey.text.light_network import LightConfig


def _say(line: str) -> None:
    sys.stderr.write(line + "\n")
    sys.stderr.flush()


def learn_propbank(
    kept: Sequence[Example],
    held_out: Sequence[Example],
    annotated: Sequence[Example],
    minilm: Bundle,
    network: LightConfig,
    seed: int,
) -> Weights:
    """Train on PropBank, and score the result on its held-out sentences."""
    words, size = WordStates(minilm, network.layers), PROPBANK_FIT.batch
    batches = propbank_batches(kept, annotated, words, network.tags, size, seed)
    first = fit(batches, minilm, network, PROPBANK_FIT, seed, progress=_progress)
    labeller, scores = first.labeller(minilm), Scores()
    for example in held_out:
        scores.add(labeller.label([example.words])[0], example.frames)
    _say(f"PropBank: predicates {scores.predicates.f1:.3f}, arguments {scores.arguments.f1:.3f}")
    return first


def prepare(options: argparse.Namespace, annotated: Sequence[Example], minilm: Bundle) -> Recipe:
    """Return the recipe, with the training on PropBank if its folder is given.

    Raises:
        InvalidInput: its annotations without the words they belong to, or words alone.
    """
    if bool(options.propbank) != bool(options.words):
        missing = "--words" if options.propbank else "--propbank"
        raise InvalidInput("is missing: annotations and words of PropBank come together", where=missing)
    config, pool = FitConfig(steps=options.steps), SentencePool()
    roles = roles_of(annotated)
    if not options.propbank:
        return Recipe(minilm, LightConfig(tag_set(roles)), config, pool, options.seed)
    kept, held_out = split(read_propbank(options.propbank, options.words))
    roles |= frequent_roles([*kept, *held_out])
    kept, held_out = with_roles(kept, roles), with_roles(held_out, roles)
    network = LightConfig(tag_set(roles))
    if options.first and options.first.is_file():
        first = Weights.load(options.first)
    else:
        first = learn_propbank(kept, held_out, annotated, minilm, network, options.seed)
        if options.first:
            first.save(options.first)
    return Recipe(minilm, first.network, config, pool, options.seed, kept, first)


def _progress(step: int, loss: float) -> None:
    if step % 100 == 99:
        _say(f"PropBank, step {step + 1}: loss {loss:.3f}")


def _sets(options: argparse.Namespace) -> dict[str, Sequence[Example]]:
    """The sentences to score on, by name of the set."""
    sets: dict[str, Sequence[Example]] = {HELD_OUT: read_sentences(options.held_out)}
    if options.test:
        labels = distinct(read_labels(options.test))
        sets |= {KIT: labels, KIT_PARSED: [example for example in labels if example.frames]}
    return sets


def _options(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m marey.labeller.train", description="Train the role labeller.")
    parser.add_argument(
        "--sentences", type=Path, nargs="+", default=[TRAIN], metavar="FILE",
        help="annotated sentences to train on (default: the project's)",
    )  # fmt: skip
    parser.add_argument(
        "--held-out", type=Path, default=TEST, metavar="FILE",
        help="annotated sentences to score on (default: the project's)",
    )  # fmt: skip
    parser.add_argument(
        "--test",
        type=Path,
        metavar="FILE",
        help="srl-kit-dev.json: a parser's labels, to score on and never to train on",
    )
    parser.add_argument("--propbank", type=Path, help="checkout of propbank/propbank-release")
    parser.add_argument("--words", type=Path, help="checkout of UniversalDependencies/UD_English-EWT")
    parser.add_argument(
        "--first", type=Path, help="file (.safetensors) of the first training: taken if there, else made"
    )
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder of the bundle")
    parser.add_argument("--steps", type=int, default=FitConfig.steps)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--threads", type=int, default=1)
    return parser.parse_args(arguments)


def main(arguments: list[str] | None = None) -> int:
    """The command line of this module; returns the exit code."""
    options = _options(arguments)
    torch.set_num_threads(options.threads)
    began = time.monotonic()
    try:
        annotated = distinct([example for file in options.sentences for example in read_sentences(file)])
        sets = _sets(options)
        minilm = find_encoder("minilm")
        recipe = prepare(options, annotated, minilm)
        weights = recipe.make(annotated)
        result = evaluate(weights.labeller(minilm), sets)
        _say("  ".join(f"{name} {value}" for name, value in result.metrics().items()))
        bundle = pack(options.output, weights, options.sentences, recipe, result)
    except MareyError as error:
        _say(str(error))
        return error.exit_code
    _say(f"{time.monotonic() - began:.0f} s")
    sys.stdout.write(f"{bundle.path}\n")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
