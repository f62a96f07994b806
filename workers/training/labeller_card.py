"""The model card of the role labeller."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from workers.training.labeller import Validation

TEXT = """# srl-light: semantic roles of motion captions

A small tagger on frozen MiniLM states (int8): it finds the predicates of a caption and, for each, its arguments with
their PropBank roles. Marey's semantic graphs are made of them. The network is `shared/text/light_network.py`.

## Data and terms

- Gold: 655 captions of KIT Motion-Language (431 distinct) with the output of AllenNLP's
  `structured-prediction-srl-bert.2020.12.15` (Shi & Lin 2019), from jpthu17/GraphMotion (Jin et al. 2023), Apache-2.0.
  Argument-less auxiliaries ("is" beside "walking") are dropped first. For training (not for the scores below) so are
  the verb "left" (five captions where it is the side) and 20 captions in which the parser found no verb ("A person is
  waving."). The "gold" is a parser's output, and who agrees with it makes its mistakes.
- Augmentation keeps the labels: words and phrases exchanged between captions, clauses joined, typos, punctuation.
- Silver: sentences of a small grammar (`workers/training/labeller_grammar.py`) for what the captions hardly have:
  bows, waves, raised hands, punches, slashes, dances, styles, imperatives. It was written with the whole gold in
  sight, so the numbers below are a little kind to it.

The weights are under Apache-2.0; MiniLM (all-MiniLM-L6-v2, Apache-2.0) is not part of them.

## Quality

{quality}

## Limits

- English. Captions of 3 to 30 words are what it knows; longer prompts are read sentence by sentence.
- Roles that PropBank assigns verb by verb (ARG2 or ARGM-DIR, ARG0 or ARG1 of "turn", "move") are often taken for one
  another; rare roles (ARGM-PRD, ARGM-PRP, ARGM-GOL, ARG4) are weak. In the graph many of those become `OTHERS`.
- Long nested clauses ("so that his hands reach the height of his knees") are cut too short.

## How it was made

    python -m workers.training.labeller --gold srl-kit-dev.json -o models/srl-light
"""


def card(result: Validation | None) -> str:
    """The card, with the scores of cross-validation where there are some."""
    return TEXT.format(quality="Not measured." if result is None else _quality(result))


def _quality(result: Validation) -> str:
    all_, given, single = result.scores, result.given, result.distinct
    lines = [
        f"{result.folds}-fold cross-validation, folds grouped by caption without case and punctuation. An argument",
        "counts when predicate, exact span and role are right.",
        "",
        "| | all 655 | distinct captions | predicates given |",
        "|---|---|---|---|",
        f"| predicate F1 | {all_.predicates.f1:.3f} | {single.predicates.f1:.3f} | |",
        f"| argument F1, labelled | {all_.arguments.f1:.3f} | {single.arguments.f1:.3f} | {given.arguments.f1:.3f} |",
        f"| argument F1, span alone | {all_.spans.f1:.3f} | {single.spans.f1:.3f} | {given.spans.f1:.3f} |",
        "",
        "| role | F1 | gold | found |",
        "|---|---|---|---|",
    ]
    for role, tally in sorted(all_.by_role.items(), key=lambda item: -item[1].wanted):
        lines.append(f"| {role} | {tally.f1:.2f} | {tally.wanted} | {tally.said} |")
    confused = ", ".join(f"{a} as {b} ({n})" for (a, b), n in result.confused.most_common(6))
    return "\n".join([*lines, "", f"Most confused on the right span: {confused}."])
