"""Compose clips: sequences of two and three actions, and longer and shorter versions of single ones.

Captured takes show 1 to 6 s of one action. Composition extends walks, changes the length of waves, repeats bows and
joins actions, so that training has every action at many lengths up to 9.8 s and graphs with two and three verbs. All
draws are seeded and use clips of one split; facts are measured again on the result.
"""

from __future__ import annotations

import random
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import cast, get_args

import numpy as np
from numpy.typing import NDArray

from marey.checks.judge import Act, Expectation, Side, judge
from marey.data.captions import seeded
from marey.data.cuts import WORST_SEAM, best_cut, core
from marey.data.describe import CYCLIC, Facts, describe
from marey.data.part import FPS, MIN_FRAMES, Part
from marey.data.retime import LIMIT, Made, crop, loop, on_a_way, stretch
from marey.data.splice import join_clips

Array = NDArray[np.floating]

COMPOSED = "bandai-namco"
"""Data set whose clips are composed here; its captions come from the grammar."""

# Weights of actions in sequences. Prompts mostly ask for travel and greetings; actions with only one or two clips stay
# rare, since the model would memorise those clips.
SEQUENCE_WEIGHTS: dict[str, float] = {
    "walk": 3.0,
    "run": 2.0,
    "walk_back": 1.6,
    "turn": 2.6,
    "dash": 0.5,
    "walk_diagonal": 0.5,
    "wave": 4.0,
    "raise": 3.0,
    "bow": 2.2,
    "guide": 0.4,
    "kick": 0.3,
    "punch": 0.4,
    "slash": 0.3,
    "call": 0.2,
    "dance": 0.2,
}
SIDED = ("wave", "raise", "turn")
OTHER_SIDE_SHARE = 0.15  # share of these that are followed by the same action on another side
# Changes of direction, which prompts ask for more often than the weights give them.
REVERSALS = {"walk": "walk_back", "walk_back": "walk", "run": "walk"}
REVERSAL_SHARE = 0.2
# Lengths, in frames, at which gestures were not captured (raises take 1 to 5 s, waves 5 to 8). Without them a model
# infers the action from the length, and a raise of 6 s becomes a wave.
SLOW_RAISES = range(100, LIMIT + 1)
QUICK_WAVES = range(36, 91)
LONG_TURNS = range(140, LIMIT + 1)
"""Captured turns take 3 to 7 s. A model trained with few longer ones turned twice or not at all in 8 s."""
_STRAIGHT = ("walk", "run", "walk_back")
TRIES = 8  # attempts for each requested clip
_CANDIDATES = 8  # number of clips to search for the best seam


@dataclass(frozen=True)
class Counts:
    """Number of composed clips of one split."""

    pairs: int
    triples: int
    retimed: int
    slow_raises: int = 0
    quick_waves: int = 0
    long_turns: int = 0
    brief_waves: int = 0


COUNTS: dict[str, Counts] = {
    "train": Counts(
        pairs=3400, triples=500, retimed=2200, slow_raises=700, quick_waves=350, long_turns=350, brief_waves=700
    ),
    "val": Counts(pairs=60, triples=10, retimed=0),
    "test": Counts(pairs=200, triples=40, retimed=0),
}


@dataclass(frozen=True)
class Composed:
    """A composed clip.

    Attributes:
        parts: its source clips, in order.
        joints: (T, 22, 3).
        facts: one per action.
        seams: first frame of each action except the first.
    """

    name: str
    parts: tuple[Part, ...]
    joints: Array
    facts: tuple[Facts, ...]
    seams: tuple[int, ...] = ()


class Composer:
    """Draws clips of one split and composes them."""

    def __init__(self, parts: Sequence[Part]) -> None:
        self.by_action: dict[str, list[Part]] = defaultdict(list)
        self.by_style: dict[tuple[str, str], list[Part]] = defaultdict(list)
        for part in parts:
            if part.source.dataset == COMPOSED and part.facts.action in SEQUENCE_WEIGHTS:
                self.by_action[part.facts.action].append(part)
                self.by_style[part.facts.action, part.facts.style].append(part)
        self.actions = sorted(self.by_action)

    def sequence(self, name: str, count: int) -> Composed | None:
        """Join two or three different actions; None if the drawn clips do not fit together."""
        rng = seeded("sequence", name)
        actions = self._draw_actions(rng, count)
        same_style = rng.random() < 0.75
        part = self._draw_first(rng, actions[0])
        budget = LIMIT - sum(30 if action in CYCLIC else 45 for action in actions[1:])
        start, stop = _cut_first(part, rng, budget, len(actions))
        if stop.stop <= stop.start:
            return None
        chosen, joints, seams = [part], np.empty((0, 22, 3)), [0]
        current, first = part, start
        for action in actions[1:]:
            found = self._best_next(rng, current, stop, action, part.facts.style if same_style else None)
            if found is None:
                return None
            following, leave, enter = found
            piece = current.joints[first : leave + 1].astype(np.float64)
            joints = piece if not len(joints) else join_clips(joints, piece, FPS)
            seams.append(len(joints))
            chosen.append(following)
            current, first = following, enter
            stop = _leave_range(following, enter, rng, LIMIT - len(joints) - 30 * (count - len(chosen)))
            if stop.stop <= stop.start:
                return None
        last = int(rng.choice(stop)) if current.facts.action in CYCLIC else stop.stop - 1
        joints = join_clips(joints, current.joints[first : last + 1].astype(np.float64), FPS)
        seams.append(len(joints))
        return _checked(name, chosen, joints, seams)

    def _draw_actions(self, rng: random.Random, count: int) -> list[str]:
        actions: list[str] = []
        while len(actions) < count:
            if actions and actions[-1] in SIDED and rng.random() < OTHER_SIDE_SHARE:
                actions.append(actions[-1])
                continue
            if actions and actions[-1] in REVERSALS and rng.random() < REVERSAL_SHARE:
                actions.append(REVERSALS[actions[-1]])
                continue
            action = rng.choices(self.actions, [SEQUENCE_WEIGHTS[a] for a in self.actions])[0]
            if not actions or action != actions[-1] or action in SIDED:
                actions.append(action)
        return actions

    def _draw_first(self, rng: random.Random, action: str) -> Part:
        style = rng.choice(sorted({part.facts.style for part in self.by_action[action]}))
        return rng.choice(self.by_style[action, style])

    def _best_next(
        self, rng: random.Random, current: Part, leave: range, action: str, style: str | None
    ) -> tuple[Part, int, int] | None:
        pool = self.by_style.get((action, style or ""), []) or self.by_action[action]
        best, least = None, WORST_SEAM
        for part in rng.sample(pool, min(_CANDIDATES, len(pool))):
            if (part.facts.action, part.facts.side) == (current.facts.action, current.facts.side):
                continue
            i, j, cost = best_cut(current, leave, part, _enter_range(part))
            if cost < least:
                best, least = (part, i, j), cost
        return best

    # -- one action, another length ------------------------------------------------------------------------------------

    def gesture(self, name: str, action: str, lengths: range) -> Composed | None:
        """A single gesture of one of these lengths."""
        if action not in self.by_action:
            return None
        rng = seeded("retimed", name)
        part = self._draw_first(rng, action)
        return self._measured_again(name, part, stretch(part, rng.choice(lengths), rng, repeat_share=0))

    def retimed(self, name: str) -> Composed | None:
        """One action, longer or shorter than captured."""
        rng = seeded("retimed", name)
        weights = [
            len(self.by_action[a]) ** 0.25 * (0.4 if a in ("dash", "walk_diagonal") else 1.0) for a in self.actions
        ]
        action = rng.choices(self.actions, weights)[0]
        part = self._draw_first(rng, action)
        target = rng.randint(32, LIMIT)
        if action in CYCLIC:
            made = crop(part, target, rng) if target < 0.8 * len(part.joints) else loop(part, target)
        elif action == "turn":
            made = self._on_a_way(rng, part, target, before=1.0)
        elif action in ("wave", "raise", "guide", "bow", "call"):
            made = stretch(part, target, rng)
        else:
            made = crop(part, max(target, 70), rng)
        return self._measured_again(name, part, made)

    def long_turn(self, name: str) -> Composed | None:
        """A turn somewhere in a walk of 7 to 9.8 s."""
        if not self.by_action["turn"]:
            return None
        rng = seeded("retimed", name)
        part = self._draw_first(rng, "turn")
        made = self._on_a_way(rng, part, rng.choice(LONG_TURNS), before=rng.uniform(0.1, 1.0))
        return self._measured_again(name, part, made)

    def _on_a_way(self, rng: random.Random, part: Part, target: int, before: float) -> Made | None:
        pool = self.by_style.get(("walk", part.facts.style), [])
        if not pool:
            return None
        walk = max(rng.sample(pool, min(4, len(pool))), key=lambda p: len(p.joints))
        return on_a_way(part, walk, target, before)

    @staticmethod
    def _measured_again(name: str, part: Part, made: Made | None) -> Composed | None:
        if made is None or len(made[0]) <= MIN_FRAMES:
            return None
        joints, used, repeats = made
        facts = _measured(part, joints)
        if facts is None or not _still_does(facts, joints, repeats):
            return None
        return Composed(name, used, joints, (replace(facts, repeats=repeats),))


def _still_does(facts: Facts, joints: Array, repeats: int) -> bool:
    """Return True if the action is still recognisable: looping must not make a held hand wave or a straight path
    curve."""
    action = "run" if facts.action == "dash" else facts.action
    if repeats > 1 or action not in get_args(Act):
        return True
    side = facts.side if action in ("turn", "wave", "raise") else ""
    expected = Expectation(cast("Act", action), cast("Side", side), straight=action in _STRAIGHT)
    return judge(joints, FPS, [expected]).passed


def _cut_first(part: Part, rng: random.Random, budget: int, count: int) -> tuple[int, range]:
    """Start frame of the first clip, and the frames after which it may end."""
    if part.facts.action in CYCLIC:
        room = len(part.joints) - 1
        start = rng.randint(0, max(room - 60, 0))
        longest = min(room, start + min(budget, 110 if count == 2 else 65))
        return start, range(min(start + 28, longest), longest + 1)
    return 0, _leave_range(part, 0, rng, budget)


def _enter_range(part: Part) -> range:
    if part.facts.action in CYCLIC:
        return range(max(len(part.joints) - 40, 1))
    return range(core(part)[0] + 1)


def _leave_range(part: Part, start: int, rng: random.Random, budget: int) -> range:
    """Frames after which a clip may end if it begins at `start` and `budget` frames are available."""
    end = min(len(part.joints), start + budget)
    if part.facts.action in CYCLIC:
        return range(min(start + 28, end), end)
    first = core(part)[1]
    return range(max(first, start + 1), end)


def with_brief_waves(parts: Sequence[Part]) -> list[Part]:
    """Shorten the waves among the clips: a captured wave of 5 to 8 s leaves no time for a second action in 9.8 s."""
    out: list[Part] = []
    for part in parts:
        if part.facts.action != "wave":
            out.append(part)
            continue
        rng = seeded("brief", part.id)
        made = stretch(part, rng.choice(QUICK_WAVES), rng, repeat_share=0)
        facts = None if made is None else _measured(part, made[0])
        if made is not None and facts is not None and _still_does(facts, made[0], 1):
            out.append(replace(part, joints=made[0].astype(np.float32), facts=facts))
    return out


def _with_wave(composed: Composed | None) -> Composed | None:
    return composed if composed is not None and any(f.action == "wave" for f in composed.facts) else None


def _measured(part: Part, joints: Array) -> Facts | None:
    facts = describe(part.content, part.source.style, joints, FPS)
    return facts if facts is not None and facts.side == part.facts.side else None


def _checked(name: str, parts: list[Part], joints: Array, seams: list[int]) -> Composed | None:
    """Measure each action again in its section of the result."""
    if len(joints) > LIMIT:
        return None
    facts = []
    for part, a, b in zip(parts, seams, seams[1:], strict=False):
        measured = _measured(part, joints[a:b]) if b - a >= 16 else None
        if measured is None:
            return None
        facts.append(measured)
    return Composed(name, tuple(parts), joints, tuple(facts), tuple(seams[1:-1]))


def compose(parts: Sequence[Part], split: str) -> Iterator[Composed]:
    """Compose all clips of a split from parts of that split only."""
    counts = COUNTS.get(split)
    if counts is None or not parts:
        return
    composer = Composer(parts)
    brief = Composer(with_brief_waves(parts)) if counts.brief_waves else composer
    makers = (
        ("S2", 2, counts.pairs, lambda name: composer.sequence(name, 2)),
        ("S3", 3, counts.triples, lambda name: composer.sequence(name, 3)),
        ("R", 1, counts.retimed, composer.retimed),
        ("RR", 1, counts.slow_raises, lambda name: composer.gesture(name, "raise", SLOW_RAISES)),
        ("RT", 1, counts.long_turns, composer.long_turn),
        ("SW", 2, counts.brief_waves, lambda name: _with_wave(brief.sequence(name, 2))),
        ("RW", 1, counts.quick_waves, lambda name: composer.gesture(name, "wave", QUICK_WAVES)),
    )
    for letter, actions, wanted, make in makers:
        if len(composer.actions) < actions:
            continue
        yield from attempts(f"{letter}-{split}", wanted, make)


def attempts(name: str, wanted: int, make: Callable[[str], Composed | None]) -> Iterator[Composed]:
    """Compose `wanted` clips with unique names, in at most `TRIES` attempts each."""
    made = (make(f"{name}-{attempt:05}") for attempt in range(TRIES * wanted))
    return islice((composed for composed in made if composed is not None), wanted)
