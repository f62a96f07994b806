"""Statements of a bundle about its actions, measured: lists in the manifest, a table in the card."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from marey.bundles import Bundle
from marey.bundles.manifest import MANIFEST_NAME
from marey.data.manifest import Clip
from marey.data.splits import actions_of
from marey.evaluator.copies import COPY_MM
from marey.motion.files import write_atomically
from marey.referee.adherence import ActionRate
from marey.vocabulary.entries import load_vocabulary
from marey.vocabulary.scope import ActionLists

FEW_TAKES = 4
"""Fewer takes than these make a supported action one of `single_take`."""
CARD = "README.md"
BEGIN, END = "<!-- actions -->", "<!-- end of actions -->"


@dataclass(frozen=True)
class Learned:
    """Sources of a bundle's actions.

    Attributes:
        takes: captured takes of each action in the training split.
        copies: share of the motions of each action that are nearer than `COPY_MM` to a training clip.
    """

    takes: Mapping[str, int]
    copies: Mapping[str, float]


def share_of_copies(distances: Iterable[tuple[str, float]]) -> dict[str, float]:
    """Return the share of copies among the motions of each action, given as (action, millimetres)."""
    found = defaultdict[str, list[bool]](list)
    for action, distance in distances:
        found[action].append(distance < COPY_MM)
    return {action: sum(copies) / len(copies) for action, copies in found.items()}


def training_takes(clips: Iterable[Clip]) -> dict[str, int]:
    """Return the number of captured takes of each action in the training split; made gestures count as one take."""
    takes = defaultdict[str, set[str]](set)
    for clip in clips:
        if clip.split == "train" and len(clip.acts) == 1 and (clip.captured or clip.made):
            for action in actions_of(clip.content.split(" - ")[0]):
                takes[action].add("made" if clip.made else f"{clip.dataset}/{clip.id.split('@')[0]}")
    return {action: len(found) for action, found in takes.items()}


def lists_of(rates: Sequence[ActionRate], takes: Mapping[str, int]) -> ActionLists:
    """Return the lists of a manifest.

    An action of the vocabulary that was trained on and is not supported is `tried`, whether it was measured or not.
    """
    supported = sorted(rate.action for rate in rates if rate.standing == "supported" and ";" not in rate.action)
    few = {action for action in supported if takes.get(action, 0) < FEW_TAKES}
    known = load_vocabulary().actions
    tried = sorted(action for action in takes if action in known and action not in supported)
    return ActionLists(
        supported=tuple(action for action in supported if action not in few),
        single_take=tuple(sorted(few)),
        tried=tuple(tried),
    )


def card_table(rates: Sequence[ActionRate], learned: Learned) -> str:
    """Return the card's section: takes, adherence and interval, and copies of each action, the best first."""
    lines = [
        BEGIN,
        "| action | takes | adherence | 95 % interval | prompts | motions | copies | |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for rate in sorted(rates, key=lambda rate: (-rate.share, rate.action)):
        count = learned.takes.get(rate.action, 0)
        takes = "" if ";" in rate.action else str(count) if count else "none"
        lines.append(
            f"| {rate.action} | {takes} | {rate.share:.0%} | {rate.low:.0%} to {rate.high:.0%} "
            f"| {rate.phrasings} | {rate.motions} | {learned.copies[rate.action]:.0%} | {rate.standing} |"
        )
    return "\n".join([*lines, END])


def record(bundle: Bundle, rates: Sequence[ActionRate], learned: Learned) -> ActionLists:
    """Write the lists into the manifest of a bundle and the table into its card; the weights' hash stays.

    Raises:
        InvalidInput: the folder cannot be written.
    """
    lists = lists_of(rates, learned.takes)
    manifest = bundle.manifest.model_copy(update={"actions": lists})
    write_atomically(
        bundle.path / MANIFEST_NAME, f"{manifest.model_dump_json(indent=1, exclude_unset=True)}\n".encode()
    )
    card = bundle.path / CARD
    text = card.read_text(encoding="utf-8") if card.exists() else f"# {manifest.name}\n"
    write_atomically(card, _with_table(text, card_table(rates, learned)).encode())
    return lists


def _with_table(card: str, table: str) -> str:
    """Return a card with its table replaced, or added at the end."""
    before, begin, rest = card.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        return f"{card.rstrip()}\n\n## Actions\n\n{table}\n"
    return before + table + after
