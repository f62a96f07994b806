"""Scope of prompts with and without the encoder's verdict, and the curve over the limit of nouns."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from marey.bundles import find_bundle
from marey.checks.scope_prompts import DRAWN, IN_SCOPE, Matcher, ScopeRate, ScopeSet, scope_prompts, scope_rates
from marey.text import meaning
from marey.text.loading import load_encoder
from marey.text.meaning import MeaningJudge
from marey.vocabulary.scope import every_action, match_scope

SETS: tuple[ScopeSet, ...] = ("development", "meaning", "test")
LIMITS = (0.0, 0.4, 0.45, 0.5, 0.54, 0.57, 0.6, 0.64, 0.7)
"""Limits of nouns on the curve; 0 = nouns always name actions."""


class Vectors:
    """Sentence vectors, each made once."""

    def __init__(self) -> None:
        self._encoder = load_encoder("minilm")
        self._found: dict[str, NDArray[np.float32]] = {}

    def __call__(self, texts: Sequence[str]) -> list[NDArray[np.float32]]:
        missing = [text for text in dict.fromkeys(texts) if text not in self._found]
        if missing:
            self._found.update(zip(missing, self._encoder.pooled(missing), strict=True))
        return [self._found[text] for text in texts]


def shares(rates: Sequence[ScopeRate]) -> tuple[float, float]:
    """Return the percentage of in-scope prompts called unknown, and of others flagged."""
    inside = [rate for rate in rates if rate.group == IN_SCOPE]
    outside = [rate for rate in rates if rate.group not in (IN_SCOPE, DRAWN)]
    right, total = (sum(getattr(rate, name) for rate in outside) for name in ("right", "prompts"))
    return 100 * (1 - inside[0].share), 100 * right / total


def report(which: ScopeSet, match: Matcher) -> None:
    """Print the tables of one set."""
    prompts = scope_prompts(which)
    all_actions = every_action()
    few = find_bundle("hgm3-starter", verify=False).manifest.actions
    assert few is not None
    print(f"{which}: {len(prompts)} prompts\n| class | prompts | words | encoder | starter, words | starter, encoder |")
    columns = [scope_rates(prompts, lists, judge) for lists in (all_actions, few) for judge in (match_scope, match)]
    for rates in zip(*columns, strict=True):
        print(f"| {rates[0].group} | {rates[0].prompts} | {' | '.join(str(rate.right) for rate in rates)} |")
    for rates in columns:
        print("in scope unknown {:.1f} %, others flagged {:.1f} %".format(*shares(rates)))
    chosen = meaning.NOUN_LIMIT
    for limit in LIMITS:
        meaning.NOUN_LIMIT = limit
        inside, outside = shares(scope_rates(prompts, all_actions, match))
        print(f"| {limit:.2f} | {inside:.1f} | {outside:.1f} |")
    meaning.NOUN_LIMIT = chosen


def main() -> None:
    """Print the tables of all sets."""
    judge = MeaningJudge(Vectors())
    for which in SETS:
        report(which, judge.judge)


if __name__ == "__main__":
    main()
