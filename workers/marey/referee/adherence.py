"""Adherence per action: what share of a bundle's motions shows the action that was asked for, by the referee.

An action is `supported` at 80 % over at least ten held-out phrasings of at least two authors and four seeds, if at most
two phrasings fail with every seed; otherwise `tried`. It is `unjudged` where the referee's rule is not precise enough.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Literal

from marey.referee.body import Body
from marey.referee.prompts import ActionPrompt
from marey.referee.rules import accepted_rules
from marey.referee.sequences import shows_in_order

Standing = Literal["supported", "tried", "unproven", "unjudged"]
LEAST_SHARE = 0.8
LEAST_PHRASINGS = 10
LEAST_AUTHORS = 2
LEAST_SEEDS = 4
MOST_LOST = 2
"""The largest number of phrasings that may fail with every seed."""
Z = 1.96


@dataclass(frozen=True)
class ActionTrial:
    """One motion and the referee's verdict."""

    prompt: ActionPrompt
    seed: int
    passed: bool


@dataclass(frozen=True)
class ActionRate:
    """Adherence of one action.

    Attributes:
        phrasings, authors, seeds, motions: what it was measured on.
        share: motions that show the action, 0 to 1.
        low, high: 95 % interval of the share over phrasings, by Wilson's formula with phrasings as the sample size.
        lost: phrasings that failed with every seed.
        standing: supported; tried (measured, and less); unproven (too few phrasings, authors or seeds); unjudged (the
            rule of one of the actions is not accepted, so the share only tells bundles apart).
    """

    action: str
    phrasings: int
    authors: int
    seeds: int
    motions: int
    share: float
    low: float
    high: float
    lost: int
    standing: Standing


def judge_trial(prompt: ActionPrompt, seed: int, body: Body) -> ActionTrial:
    """Judge one motion; the side of the prompt is not looked at."""
    return ActionTrial(prompt, seed, shows_in_order(prompt.actions, body))


def rates(trials: Sequence[ActionTrial]) -> list[ActionRate]:
    """Return the rate of each action, or sequence of actions, in the order of its first trial."""
    groups = defaultdict[str, list[ActionTrial]](list)
    for trial in trials:
        groups["; ".join(trial.prompt.actions)].append(trial)
    return [_rate(action, group) for action, group in groups.items()]


def sequence_rates(trials: Sequence[ActionTrial]) -> list[ActionRate]:
    """Return the rate of prompts of two actions, of three, and so on; their standing says nothing."""
    groups = defaultdict[int, list[ActionTrial]](list)
    for trial in trials:
        groups[len(trial.prompt.actions)].append(trial)
    return [_rate(f"{count} actions", groups[count]) for count in sorted(groups)]


def sequence_markdown(bundle: str, found: Sequence[ActionRate]) -> str:
    """Return a report with a table."""
    motions = sum(rate.motions for rate in found)
    passed = sum(rate.share * rate.motions for rate in found)
    lines = [
        f"Bundle `{bundle}`: {passed / motions:.1%} of {motions} motions show their actions, in order.",
        "",
        "| prompts | adherence | 95 % interval | prompts | motions | prompts that always failed |",
        "|---|---|---|---|---|---|",
    ]
    lines += [
        f"| {rate.action} | {rate.share:.0%} | {rate.low:.0%} to {rate.high:.0%} | {rate.phrasings} | {rate.motions} "
        f"| {rate.lost} |"
        for rate in found
    ]
    return "\n".join(lines) + "\n"


def _rate(action: str, trials: Sequence[ActionTrial]) -> ActionRate:
    of_prompt = defaultdict[str, list[bool]](list)
    for trial in trials:
        of_prompt[trial.prompt.text].append(trial.passed)
    share = sum(trial.passed for trial in trials) / len(trials)
    low, high = interval(share, len(of_prompt))
    authors = len({trial.prompt.author for trial in trials})
    seeds = min(len(passed) for passed in of_prompt.values())
    lost = sum(not any(passed) for passed in of_prompt.values())
    enough = len(of_prompt) >= LEAST_PHRASINGS and authors >= LEAST_AUTHORS and seeds >= LEAST_SEEDS
    good = share >= LEAST_SHARE and lost <= MOST_LOST
    judged = accepted_rules().issuperset(trials[0].prompt.actions)
    standing: Standing = "unjudged" if not judged else "unproven" if not enough else "supported" if good else "tried"
    return ActionRate(action, len(of_prompt), authors, seeds, len(trials), share, low, high, lost, standing)


def interval(share: float, size: int) -> tuple[float, float]:
    """Return Wilson's 95 % interval of a share of `size` independent draws."""
    centre = (share + Z**2 / (2 * size)) / (1 + Z**2 / size)
    half = Z * math.sqrt(share * (1 - share) / size + Z**2 / (4 * size**2)) / (1 + Z**2 / size)
    return max(0.0, centre - half), min(1.0, centre + half)


def markdown(bundle: str, found: Sequence[ActionRate]) -> str:
    """Return a report with a table, the best actions first."""
    motions = sum(rate.motions for rate in found)
    passed = sum(rate.share * rate.motions for rate in found)
    supported = sum(rate.standing == "supported" for rate in found)
    judged = sum(rate.standing != "unjudged" for rate in found)
    lines = [
        f"Bundle `{bundle}`: {supported} of {judged} actions with a precise rule are supported; {passed / motions:.1%} "
        f"of {motions} motions show the action that was asked for.",
        "",
        "| action | adherence | 95 % interval | phrasings | motions | phrasings that always failed | standing |",
        "|---|---|---|---|---|---|---|",
    ]
    for rate in sorted(found, key=lambda rate: (-rate.share, rate.action)):
        lines.append(
            f"| {rate.action} | {rate.share:.0%} | {rate.low:.0%} to {rate.high:.0%} | {rate.phrasings} "
            f"| {rate.motions} | {rate.lost} | {rate.standing} |"
        )
    return "\n".join(lines) + "\n"


def document(
    bundle: str, settings: Mapping[str, object], trials: Sequence[ActionTrial], found: Sequence[ActionRate]
) -> dict[str, object]:
    """Return all data as JSON values, each trial included."""
    return {
        "bundle": bundle,
        "settings": dict(settings),
        "actions": [asdict(rate) for rate in found],
        "trials": [asdict(trial) for trial in trials],
    }
