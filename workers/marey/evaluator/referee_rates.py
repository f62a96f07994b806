"""Measure the rules of the referee on real clips: `python -m marey.evaluator.referee_rates SET PATH … -o PAGE`.

Writes the page and, with `--accepted`, the list of rules that are precise enough (`referee/accepted.toml`).

Clips are judged as they were captured: retargeted, put on their floor and cut by the index of their set, but neither
mirrored nor lengthened. A rule *passes* a clip of its own action; it *falsely passes* a clip of another action, where
neither of the two implies the other. Rules are accepted by what they say of clips other than dances and forms of
karate, which hold other movements that their label does not name.
"""

from __future__ import annotations

import argparse
import hashlib
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from marey.core.errors import InvalidInput
from marey.data.part import FPS
from marey.data.prepare import CaptureSet, pack_set
from marey.motion.files import write_atomically
from marey.referee import RULES, Body, shows
from marey.vocabulary.entries import load_vocabulary

FOLDS = 5
LEAST_PASSING = 0.95
MOST_FALSE = 0.05
PASSAGES = ("dance", "karate")
"""Actions that hold other movements: a kick in a form of karate is shown, though its clip is not labelled so."""


@dataclass(frozen=True)
class Verdicts:
    """A real clip of one action, and the actions that the referee sees in it."""

    id: str
    action: str
    source: str
    seen: frozenset[str]

    @property
    def fold(self) -> int:
        """Fold of the clip's source."""
        return int(hashlib.sha256(self.source.encode()).hexdigest(), 16) % FOLDS

    @property
    def half(self) -> int:
        """Half of the sources that the clip's is in; a rule that does well on one half alone was fitted to it."""
        return int(hashlib.sha256(f"half{self.source}".encode()).hexdigest(), 16) % 2


@dataclass(frozen=True)
class RuleRate:
    """How a rule does: passes of its own clips, false passes of those of other actions."""

    action: str
    clips: int
    passed: int
    others: int
    falsely: int
    single_others: int
    single_falsely: int
    of: tuple[tuple[str, int], ...]
    """The actions whose clips are falsely passed most often. `single`: without dances and karate."""

    @property
    def accepted(self) -> bool:
        """Return True if it misses at most one clip or 5 %, and falsely passes at most 5 % of the single others."""
        missed = self.clips - self.passed
        allowed = max(1.0, (1 - LEAST_PASSING) * self.clips)
        return self.passed > 0 and missed <= allowed and self.single_falsely <= MOST_FALSE * self.single_others


def judge(captures: CaptureSet, *, processes: int) -> list[Verdicts]:
    """Judge every clip of a set that shows one action of the vocabulary."""
    pack = pack_set(captures, processes=processes)
    found = []
    for clip in pack.clips:
        if clip.content in RULES:
            body = Body(pack.joints(clip), FPS)
            seen = frozenset(action for action in RULES if shows(action, body))
            found.append(Verdicts(clip.id, clip.content, clip.source or clip.id, seen))
    return found


def rates(clips: Sequence[Verdicts]) -> list[RuleRate]:
    """Return the rate of each rule."""
    vocabulary = load_vocabulary()
    implications = {action: vocabulary.implied(action) | {action} for action in RULES}
    found = []
    for action in sorted(RULES):
        own = [clip for clip in clips if clip.action == action]
        others = [
            clip
            for clip in clips
            if action not in implications[clip.action] and clip.action not in implications[action]
        ]
        falsely = Counter(clip.action for clip in others if action in clip.seen)
        passed = sum(action in clip.seen for clip in own)
        single = Counter(clip.action for clip in others if clip.action not in PASSAGES)
        found.append(
            RuleRate(
                action,
                clips=len(own),
                passed=passed,
                others=len(others),
                falsely=falsely.total(),
                single_others=single.total(),
                single_falsely=sum(falsely[other] for other in single),
                of=tuple(falsely.most_common(3)),
            )
        )
    return found


def _share(part: int, whole: int) -> str:
    return f"{part / whole:.1%}" if whole else "—"


def _totals(name: str, clips: Sequence[Verdicts]) -> str:
    found = rates(clips)
    cells = [
        name,
        f"{sum(rate.clips for rate in found):,}",
        _share(sum(rate.passed for rate in found), sum(rate.clips for rate in found)),
        _share(sum(rate.falsely for rate in found), sum(rate.others for rate in found)),
        _share(sum(rate.single_falsely for rate in found), sum(rate.single_others for rate in found)),
    ]
    return f"| {' | '.join(cells)} |"


def _halves(halves: Sequence[dict[str, RuleRate]], action: str) -> str:
    """Return clips passed and false passes without dances and karate of each half of the sources."""
    parts = [
        f"{half[action].passed}/{half[action].clips} {_share(half[action].single_falsely, half[action].single_others)}"
        for half in halves
    ]
    return ", ".join(parts)


def page(clips: Sequence[Verdicts], sets: Iterable[str]) -> str:
    """Return the page of rates."""
    found = rates(clips)
    halves = [{rate.action: rate for rate in rates([clip for clip in clips if clip.half == n])} for n in range(2)]
    lines = [
        *_introduction(sets),
        "| clips | number | passed | falsely passed | without dances and karate |",
        "|---|---|---|---|---|",
        _totals("all", clips),
        *(_totals(f"fold {n + 1}", [c for c in clips if c.fold == n]) for n in range(FOLDS)),
        "",
        *_how_to_read(found),
        "| action | clips | passed | falsely passed | without dances and karate | halves | mostly of | accepted |",
        "|---|---|---|---|---|---|---|---|",
        *(_rule_row(rate, halves) for rate in found),
    ]
    return "\n".join(lines) + "\n"


def _introduction(sets: Iterable[str]) -> Sequence[str]:
    return (
        "# The referee on real clips",
        "",
        "How far to trust the adherence of an action that model cards and `marey eval actions` state: how often its",
        "rule passes real clips of the action, and clips of others. The *referee* is the set of rules on joints by",
        "which adherence is published ([how models are evaluated](../explanation/evaluation.md)).",
        "",
        "Written by `python -m marey.evaluator.referee_rates`; do not edit. Clips are as captured and show one action",
        "by their label, of the sets",
        f"{', '.join(sets)}.",
        "A rule *misses* a clip of its own action; it *falsely passes* a clip of another action, where neither",
        "implies the other. Labels name what a clip is for, not everything in it: a dance may hold a kick. So false",
        "passes are given without clips of dances and karate as well.",
        "",
    )


def _how_to_read(found: Sequence[RuleRate]) -> Sequence[str]:
    """Return the paragraph between the rates of all rules together and those of each."""
    accepted = sum(rate.accepted for rate in found)
    return (
        "Folds are by source. Rules and thresholds were written with clips of all folds in view: the folds show how",
        "the rates vary, they are no test on unseen clips.",
        f"{accepted} of {len(found)} rules are accepted: they miss at most one clip or 5 %, but not all, and",
        "falsely pass at most 5 % without dances and karate. Figures of the other actions tell bundles apart, but are",
        "not precise. `halves` has clips passed, and false passes without dances and karate, for each half of the",
        "sources. Of an action with one or two clips, recall is hardly known.",
        "",
    )


def _rule_row(rate: RuleRate, halves: Sequence[dict[str, RuleRate]]) -> str:
    of = ", ".join(f"{name} {count}" for name, count in rate.of)
    verdict = "yes" if rate.accepted else "no clips" if not rate.clips else "no"
    return (
        f"| {rate.action} | {rate.clips} | {_share(rate.passed, rate.clips)} "
        f"| {_share(rate.falsely, rate.others)} | {_share(rate.single_falsely, rate.single_others)} "
        f"| {_halves(halves, rate.action)} | {of} | {verdict} |"
    )


def accepted_list(clips: Sequence[Verdicts]) -> str:
    """Return the list of accepted rules as TOML."""
    names = [rate.action for rate in rates(clips) if rate.accepted]
    lines = [
        "# Rules that miss at most one real clip or 5 %, and falsely pass at most 5 % of those of other actions.",
        "# Written by marey.evaluator.referee_rates.",
        "accepted = [",
        *(f'  "{name}",' for name in names),
        "]",
    ]
    return "\n".join(lines) + "\n"


def main(arguments: Sequence[str] | None = None) -> None:
    """Write the page of rates of the sets given."""
    parser = argparse.ArgumentParser(description="Measure the rules of the referee on real clips.")
    parser.add_argument("sources", nargs="+", metavar="SET PATH", help="Known sets, each with its archive or folder.")
    parser.add_argument("-o", "--output", type=Path, required=True, help="Page to write.")
    parser.add_argument("--accepted", type=Path, help="List of accepted rules to write.")
    parser.add_argument("--processes", type=int, default=2, help="Processes that retarget (default: 2).")
    chosen = parser.parse_args(arguments)
    if len(chosen.sources) % 2:
        raise InvalidInput("each set needs a path", where="sources")
    pairs = list(zip(chosen.sources[::2], chosen.sources[1::2], strict=True))
    clips = [
        clip for name, path in pairs for clip in judge(CaptureSet.known(name, Path(path)), processes=chosen.processes)
    ]
    text = page(clips, [name for name, _ in pairs])
    write_atomically(chosen.output, text.encode())
    if chosen.accepted is not None:
        write_atomically(chosen.accepted, accepted_list(clips).encode())


if __name__ == "__main__":
    main()
