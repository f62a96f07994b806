"""The model card of the role labeller."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from marey.labeller.recipe import Validation

TEXT = """# srl-light: semantic roles of motion captions

A small tagger on the states of MiniLM (int8): it finds the predicates of a caption and, for each, its arguments with
their PropBank roles. Marey's semantic graphs are made of them. The network is `shared/marey/text/light_network.py`;
the part `minilm` holds updates of rank 16, which are added to MiniLM's matrices when the labeller is loaded, and scales
of features for int8 (Xiao et al. 2022).

## Data and terms

- First, MiniLM's updates and the head learn PropBank: verbs with their roles in 12,114 sentences of at most 30 words of
  the English Web Treebank. Roles: github.com/propbank/propbank-release; words: UD_English-EWT (Universal Dependencies);
  both CC BY-SA 4.0, changed as `workers/marey/labeller/propbank.py` says. A thousand stay in the
  second training, which is on the gold, its variants and the silver:
- Gold: 1,536 captions of KIT Motion-Language (938 distinct) with the output of AllenNLP's
  `structured-prediction-srl-bert.2020.12.15` (Shi & Lin 2019), from jpthu17/GraphMotion (Jin et al. 2023), Apache-2.0:
  its `datasets/kit-ml/new_test_data.json`. `srl-kit-dev.json`, by which this labeller was to be judged, holds 655 of
  them (431 distinct).
  Argument-less auxiliaries ("is" beside "walking") are dropped first. For training (not for the scores below) so are
  the verb "left" (where it is the side) and captions in which the parser found no verb ("A person is
  waving."). The "gold" is a parser's output, and who agrees with it makes its mistakes.
- Augmentation keeps the labels: words and phrases exchanged between captions, clauses joined, typos, punctuation.
- Silver: sentences of a small grammar (`workers/marey/labeller/grammar.py`) for what the captions hardly have:
  bows, waves, raised hands, punches, slashes, dances, styles, imperatives. It was written with the whole gold in
  sight, so the numbers below are a little kind to it.

The weights are under CC BY-SA 4.0, as PropBank and the treebank are; MiniLM (all-MiniLM-L6-v2, Apache-2.0) is not part
of them. Credit: the PropBank project (Palmer et al. 2005; Pradhan et al. 2022), the English Web Treebank (Bies et al.
2012) and its Universal Dependencies (Silveira et al. 2014).

## Quality

{quality}

## Limits

- English. Captions of 3 to 30 words are what it knows; longer prompts are read sentence by sentence.
- Roles that PropBank assigns verb by verb (ARG2 or ARGM-DIR, ARG0 or ARG1 of "turn", "move") are often taken for one
  another; rare roles (ARGM-PRD, ARGM-PRP, ARGM-GOL, ARG4) are weak. In the graph many of those become `OTHERS`.
- Long nested clauses ("so that his hands reach the height of his knees") are cut too short.

## How it was made

    git clone https://github.com/propbank/propbank-release
    git clone https://github.com/UniversalDependencies/UD_English-EWT
    python -m marey.labeller.train --gold srl-kit-dev.json GraphMotion/datasets/kit-ml/new_test_data.json \\
        --propbank propbank-release --words UD_English-EWT -o models/srl-light
"""


def card(result: Validation | None) -> str:
    """The card, with the scores of cross-validation where there are some."""
    return TEXT.format(quality="Not measured." if result is None else _quality(result))


def _quality(result: Validation) -> str:
    columns = {
        "655": result.occurring,
        "431 distinct": result.distinct,
        "with a verb": result.parsed,
        "938 distinct": result.every,
        "with a verb ": result.every_parsed,
    }
    rows = {
        "predicate F1": [f"{scores.predicates.f1:.3f}" for scores in columns.values()],
        "argument F1, labelled": [f"{scores.arguments.f1:.3f}" for scores in columns.values()],
        "argument F1, span alone": [f"{scores.spans.f1:.3f}" for scores in columns.values()],
    }
    lines = [
        f"{result.folds}-fold cross-validation, folds grouped by caption without case and punctuation. An argument",
        "counts when predicate, exact span and role are right. In one caption of twenty the parser overlooked the only",
        'verb ("A person dances."): finding it counts as a false predicate and false arguments, so the scores of',
        f"the other captions are given as well. With predicates given, arguments have {result.given.arguments.f1:.3f}.",
        "",
        f"| | {' | '.join(columns)} |",
        "|---" * (len(columns) + 1) + "|",
        *(f"| {name} | {' | '.join(cells)} |" for name, cells in rows.items()),
        "",
        "| role | F1 | gold | found |",
        "|---|---|---|---|",
    ]
    for role, tally in sorted(result.every.by_role.items(), key=lambda item: -item[1].wanted):
        lines.append(f"| {role} | {tally.f1:.2f} | {tally.wanted} | {tally.said} |")
    confused = ", ".join(f"{a} as {b} ({n})" for (a, b), n in result.confused.most_common(6))
    return "\n".join([*lines, "", f"Most confused on the right span: {confused}."])
