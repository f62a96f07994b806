"""The model card of the role labeller."""

from __future__ import annotations

from typing import TYPE_CHECKING

from marey.labeller.recipe import HELD_OUT, KIT, KIT_PARSED

if TYPE_CHECKING:
    from marey.labeller.recipe import Evaluation

TEXT = """# srl-open: semantic roles of prompts

A small tagger on the states of MiniLM (int8): it finds the predicates of a prompt and, for each, its arguments with
their PropBank roles. Marey's semantic graphs are made of them. The network is `shared/marey/text/light_network.py`;
the part `minilm` holds updates of rank 16, which are added to MiniLM's matrices when the labeller is loaded, and scales
of features for int8 (Xiao et al. 2022).

## Data and terms

**Commercial use is allowed.** The weights are under CC BY-SA 4.0, as PropBank and the treebank are: give credit, and
share changed weights under the same terms. Motions that are generated with the labeller do not contain it.

| data | terms |
|---|---|
| roles: PropBank of the English Web Treebank (github.com/propbank/propbank-release) | CC BY-SA 4.0, changed |
| words: UD_English-EWT (github.com/UniversalDependencies/UD_English-EWT) | CC BY-SA 4.0, changed |
| Marey's annotated sentences (`workers/marey/labeller/sentences`) | MIT |

- First, MiniLM's updates and the head learn PropBank: verbs with their roles in 12,114 sentences of at most 30 words,
  annotated by people, changed as `workers/marey/labeller/propbank.py` says. Three variants of each of Marey's
  sentences are among them.
- Then they learn Marey's 501 sentences on human motion, eight variants of each, and a thousand of PropBank's. Variants
  keep the labels: words and phrases exchanged between sentences, clauses joined, typos, punctuation.
- No caption of KIT Motion-Language and no output of AllenNLP's parser was trained on. The file `srl-kit-dev.json`,
  which holds such output, is a test. The generator of sentences of the former labeller, `srl-light`, imitated that
  parser's labels and is not used. What the author of Marey's sentences had seen of both stands beside the sentences.
- MiniLM (`minilm-l6`, all-MiniLM-L6-v2, Apache-2.0) is not part of the weights.

Credit: the PropBank project (Palmer et al. 2005; Pradhan et al. 2022), the English Web Treebank (Bies et al.
2012) and its Universal Dependencies (Silveira et al. 2014).

## Quality

{quality}

## Limits

- English. Prompts of 1 to 30 words are what it knows; longer prompts are read sentence by sentence.
- Roles that PropBank assigns verb by verb (ARG2 or ARGM-DIR, ARG0 or ARG1 of "turn", "move") are often taken for one
  another; rare roles (ARGM-PRD, ARGM-PRP, ARGM-GOL, ARG4) are weak. In the graph many of those become `OTHERS`.
- Long nested clauses ("so that his hands reach the height of his knees") are cut too short.

## How it was made

    git clone https://github.com/propbank/propbank-release
    git clone https://github.com/UniversalDependencies/UD_English-EWT
    python -m marey.labeller.train --propbank propbank-release --words UD_English-EWT \\
        --test srl-kit-dev.json -o models/srl-open
"""
NAMES = {
    HELD_OUT: "Marey's held-out sentences (`test.txt`)",
    KIT: "KIT captions, distinct, against a parser's labels",
    KIT_PARSED: "of these, captions in which the parser found a verb",
}


def card(result: Evaluation | None) -> str:
    """The card, with the scores where there are some."""
    return TEXT.format(quality="Not measured." if result is None else _quality(result))


def _quality(result: Evaluation) -> str:
    lines = [
        "None of these sentences was trained on. An argument counts when predicate, exact span and role are right.",
        "Marey's held-out sentences are by the author of those for training, so other people's prompts will do worse.",
        "The labels of the KIT captions are a parser's, with its mistakes and conventions: agreement with them is no",
        f"target. On the held-out sentences, with predicates given, arguments have {result.given.arguments.f1:.3f}.",
        "",
        "| set | sentences | predicate F1 | argument F1, labelled | argument F1, span alone |",
        "|---|---|---|---|---|",
    ]
    for name, scores in result.scores.items():
        values = (scores.predicates.f1, scores.arguments.f1, scores.spans.f1)
        cells = " | ".join(f"{value:.3f}" for value in values)
        lines.append(f"| {NAMES[name]} | {result.sentences[name]} | {cells} |")
    lines += ["", "Roles of the held-out sentences:", "", "| role | F1 | gold | found |", "|---|---|---|---|"]
    for role, tally in sorted(result.scores[HELD_OUT].by_role.items(), key=lambda item: -item[1].wanted):
        lines.append(f"| {role} | {tally.f1:.2f} | {tally.wanted} | {tally.said} |")
    confused = ", ".join(f"{a} as {b} ({n})" for (a, b), n in result.confused.most_common(6))
    return "\n".join([*lines, "", f"Most confused on the right span: {confused or 'none'}."])
