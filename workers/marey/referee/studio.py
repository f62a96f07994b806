"""A studio's list: how many motions do what was asked, and how many of the others are said to be doubtful.

A motion is *flagged* if a user is told that it may not be what was asked for: its quality record has flags, or its
prompt is not in the scope of the bundle. That the bundle tries an action is a forecast, and no doubt is left once a
motion has a match: a low one is a flag of the record.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from marey.referee.body import Body
from marey.referee.prompts import ActionPrompt
from marey.referee.sequences import shows_in_order

SETTLED = ("close", "tried")
"""Verdicts of the scope that a match settles."""


@dataclass(frozen=True)
class StudioTrial:
    """One motion.

    Attributes:
        passed: it shows the actions of the prompt in order; None where the vocabulary does not cover the prompt.
        flagged: the user is told of a doubt.
        reasons: what is told: a verdict of the scope that is not settled, flags of scope and quality.
    """

    prompt: ActionPrompt
    seed: int
    passed: bool | None
    flagged: bool
    reasons: tuple[str, ...]


@dataclass(frozen=True)
class StudioRates:
    """Counts of motions: those that do what was asked, those that do not, those that cannot be judged."""

    passed: int
    passed_flagged: int
    failed: int
    failed_flagged: int
    uncovered: int
    uncovered_flagged: int


def judge_studio(prompt: ActionPrompt, seed: int, body: Body, manifest: Mapping[str, Any]) -> StudioTrial:
    """Judge one motion.

    Args:
        manifest: of the motion, with its `scope` and `quality`.
    """
    scope, quality = manifest.get("scope") or {}, manifest.get("quality") or {}
    has_match = (quality.get("match") or {}).get("value") is not None
    settled = ("known", *SETTLED) if has_match else ("known",)
    told = [verdict] if (verdict := scope.get("verdict", "known")) not in settled else []
    reasons = (*told, *scope.get("flags", ()), *quality.get("flags", ()))
    passed = shows_in_order(prompt.actions, body) if prompt.actions else None
    return StudioTrial(prompt, seed, passed, bool(reasons), reasons)


def studio_rates(trials: Sequence[StudioTrial]) -> StudioRates:
    """Count motions by verdict."""
    groups = {passed: [trial for trial in trials if trial.passed is passed] for passed in (True, False, None)}
    counts = [(len(group), sum(trial.flagged for trial in group)) for group in groups.values()]
    return StudioRates(*(number for pair in counts for number in pair))


def studio_markdown(bundle: str, rates: StudioRates) -> str:
    """Return a report with a table."""
    rows = (
        ("show what was asked for", rates.passed, rates.passed_flagged),
        ("do not", rates.failed, rates.failed_flagged),
        ("asked for what the vocabulary does not cover", rates.uncovered, rates.uncovered_flagged),
    )
    lines = [f"Bundle `{bundle}`, a studio's list.", "", "| motions | number | flagged |", "|---|---|---|"]
    lines += [f"| {name} | {count} | {flagged / count:.0%} |" for name, count, flagged in rows if count]
    return "\n".join(lines) + "\n"


def studio_document(bundle: str, settings: Mapping[str, object], trials: Sequence[StudioTrial]) -> dict[str, object]:
    """Return all data as JSON values, each trial included."""
    return {
        "bundle": bundle,
        "settings": dict(settings),
        "rates": asdict(studio_rates(trials)),
        "trials": [asdict(trial) for trial in trials],
    }
