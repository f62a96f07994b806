"""Sequences of two and three actions from clips with their own captions.

Studios ask for "bow, then run", but a capture shows one action. Clips of different actions are joined where their poses
are similar; the caption joins the captions of both in order.
"""

from __future__ import annotations

import random
import re
from collections import defaultdict
from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np

from marey.data.captions import lower_first, seeded
from marey.data.compose import Composed, attempts
from marey.data.cuts import best_cut
from marey.data.describe import FREE_TEXT, Facts, describe_text
from marey.data.part import FPS, MIN_FRAMES, Part
from marey.data.retime import LIMIT
from marey.data.soundness import is_broken
from marey.data.splice import join_clips
from marey.vocabulary.entries import load_vocabulary

PAIRS = {"train": 1.2, "val": 0.2, "test": 0.2}
"""Number of pairs per joinable clip of a split; sequences of three are an eighth as many."""
CANDIDATES = 12
"""Number of clips of an action to search for the best seam."""
WORST_SEAM = 0.35
"""Limit like `cuts.WORST_SEAM`; every seam from lying to standing costs more."""
LEAST_FRAMES = 24
ANYWHERE = ("idle", "walk", "walk-backward", "run", "sprint", "sidestep", "crawl", "sneak", "limp", "fight-stance")
"""Actions that may begin and end at any frame; other clips are used whole."""
ENDS = 8
"""Number of frames that may be cut from each end of a whole action."""
WORDS = 24
"""Largest number of words of a caption that is joined to another."""
THEN = (", then ", ", then ", ", and then ", " and then ", "; then ", ", after that ", ". Then ")
SUBJECT = re.compile(
    r"^(?:(?:an?|the|one|this) (?:\w+ )?(?:person|man|woman|figure|character|dancer|fighter|actor|body|boy|girl|boxer"
    r"|guy|lady|subject|performer|player)|someone|somebody|he|she|it) (?=\w+s\b)",
    re.IGNORECASE,
)


def compose_texts(parts: Sequence[Part], split: str) -> Iterator[Composed]:
    """Compose sequences of a split from parts of that split only."""
    composer = _Composer(parts)
    pairs = round(PAIRS.get(split, 0.0) * composer.size)
    for letter, count, wanted in (("T2", 2, pairs), ("T3", 3, pairs // 8)):
        if len(composer.actions) >= count:
            yield from attempts(f"{letter}-{split}", wanted, partial(composer.sequence, count=count))


def joined_texts(actions: Sequence[Facts], seed: str) -> tuple[tuple[str, ...], ...]:
    """Up to two captions of a sequence by each author with short captions of all its actions."""
    rng = seeded("texts", seed)
    told = []
    for short in _short_texts(actions):
        chosen = (_joined([rng.choice(texts) for texts in short], rng) for _ in range(2))
        told.append(tuple(dict.fromkeys(chosen)))
    return tuple(told)


def _short_texts(actions: Sequence[Facts]) -> list[list[list[str]]]:
    """The captions of each action that are short enough to be joined, by author; of authors who have some of all."""
    authors = range(min(len(facts.text) for facts in actions))
    short = [[[text for text in of.text[author] if len(text.split()) <= WORDS] for of in actions] for author in authors]
    return [of_author for of_author in short if all(of_author)]


def _joined(texts: Sequence[str], rng: random.Random) -> str:
    first, *others = (text.strip().rstrip(".") for text in texts)
    said = first
    for other in others:
        join = rng.choice([words for words in THEN if "." not in words or first[:1].isupper()])
        said += join + lower_first(SUBJECT.sub("", other))
    return f"{said}." if texts[-1].rstrip().endswith(".") else said


class _Composer:
    """Draw clips of one split and join them."""

    def __init__(self, parts: Sequence[Part]) -> None:
        self._by_action: dict[str, list[Part]] = defaultdict(list)
        known = load_vocabulary().actions
        for part in parts:
            if part.facts.action == FREE_TEXT and part.content in known and len(part.joints) >= LEAST_FRAMES:
                self._by_action[part.content].append(part)
        self.actions = sorted(self._by_action)
        self.size = sum(map(len, self._by_action.values()))
        self._weights = [len(self._by_action[action]) ** 0.5 for action in self.actions]

    def sequence(self, name: str, count: int) -> Composed | None:
        """Join different actions that one author captioned; None if the drawn clips do not fit together."""
        rng = seeded("text sequence", name)
        first = rng.choice(self._by_action[self._draw(rng, ())])
        chosen, starts, stops = [first], [0], list[int]()
        frames = 0
        while len(chosen) < count:
            room = LIMIT - frames - LEAST_FRAMES * (count - len(chosen))
            leave = _leaving(chosen[-1], starts[-1], room)
            action = self._draw(rng, [part.content for part in chosen])
            found = self._best(rng, chosen[-1], leave, action) if len(leave) else None
            if found is None:
                return None
            following, left, entered = found
            stops.append(left)
            frames += left + 1 - starts[-1]
            chosen.append(following)
            starts.append(entered)
        last = _leaving(chosen[-1], starts[-1], LIMIT - frames)
        if not len(last):
            return None
        stops.append(last[-1])
        return _join(name, chosen, starts, stops)

    def _draw(self, rng: random.Random, before: Sequence[str]) -> str:
        while True:
            action = rng.choices(self.actions, self._weights)[0]
            if not before or action != before[-1]:
                return action

    def _best(self, rng: random.Random, current: Part, leave: range, action: str) -> tuple[Part, int, int] | None:
        pool = self._by_action[action]
        best, least = None, WORST_SEAM
        for part in rng.sample(pool, min(CANDIDATES, len(pool))):
            last = len(part.joints) - LEAST_FRAMES
            enter = range(last + 1) if part.content in ANYWHERE else range(min(ENDS, last) + 1)
            i, j, cost = best_cut(current, leave, part, enter)
            if cost < least:
                best, least = (part, i, j), cost
        return best


def _leaving(part: Part, start: int, room: int) -> range:
    """Frames after which a clip that begins at `start` may end within `room` frames; empty if it must be used whole and
    is too long."""
    stop = min(len(part.joints), start + room)
    if part.content in ANYWHERE:
        return range(start + LEAST_FRAMES - 1, stop)
    return range(max(len(part.joints) - 1 - ENDS, start + LEAST_FRAMES - 1), stop)


def _join(name: str, parts: Sequence[Part], starts: Sequence[int], stops: Sequence[int]) -> Composed | None:
    """Join the pieces to one motion; None if it has no caption or is broken."""
    joints = np.empty((0, 22, 3))
    seams = [0]
    for part, start, stop in zip(parts, starts, stops, strict=True):
        piece = part.joints[start : stop + 1].astype(np.float64)
        joints = join_clips(joints, piece, FPS) if len(joints) else piece
        seams.append(len(joints))
    facts = tuple(
        describe_text(part.facts.text, joints[a:b], FPS)
        for part, a, b in zip(parts, seams, seams[1:], strict=False)
        if b - a >= MIN_FRAMES
    )
    if len(facts) < len(parts) or len(joints) > LIMIT or is_broken(joints, FPS) or not _short_texts(facts):
        return None
    return Composed(name, tuple(parts), joints, facts, tuple(seams[1:-1]))
