"""Which clips are joined: sequences of two and three acts, longer and shorter versions of single ones.

Captured takes are 1 to 6 s of one act. Here walks go on, waves last longer or shorter, bows come twice, and acts follow
each other, so that every act is seen at many lengths up to 9.8 s and graphs with two and three verbs occur in training.
Everything is drawn by seeds from clips of one split; facts are measured again on what came out.
"""

from __future__ import annotations

import random
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import cast, get_args

import numpy as np
from numpy.typing import NDArray

from workers.training.checks.judge import Act, Expectation, Side, judge
from workers.training.checks.kinematics import heading, lean, smooth, trunk_up
from workers.training.data.captions import seeded
from workers.training.data.describe import CYCLIC, Facts, describe
from workers.training.data.part import FPS, MAX_FRAMES, MIN_FRAMES, Part
from workers.training.data.splice import join_clips, seam_costs, seam_features

Array = NDArray[np.floating]
LIMIT = MAX_FRAMES + 1  # poses

# How often an act is drawn for a sequence. Travel and greetings are what prompts ask for; the acts of one or two clips
# stay rare, or the model would learn those clips by heart.
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
OTHER_SIDE_SHARE = 0.15  # how often one of these is followed by itself with another side
# Ways that prompts ask for more often than drawing by weight gives them.
REVERSALS = {"walk": "walk_back", "walk_back": "walk", "run": "walk"}
REVERSAL_SHARE = 0.2
# Gestures at lengths at which they were not captured (raises take 1 to 5 s, waves 5 to 8): without them a
# model takes the length for the act, and a raise of 6 s becomes a wave. Frames.
SLOW_RAISES = range(100, LIMIT + 1)
QUICK_WAVES = range(36, 91)
_STRAIGHT = ("walk", "run", "walk_back")
_CANDIDATES = 8  # clips among which the best seam is taken
_WORST_SEAM = 0.6  # mean squared metres, see splice.seam_costs; a bow into a run has 0.4 and looks well
_ARMS = {"left": (0,), "right": (1,), "both": (0, 1)}


@dataclass(frozen=True)
class Counts:
    """How many clips are made for one split."""

    pairs: int
    triples: int
    retimed: int
    slow_raises: int = 0
    quick_waves: int = 0


COUNTS: dict[str, Counts] = {
    "train": Counts(pairs=3400, triples=500, retimed=2200, slow_raises=700, quick_waves=350),
    "val": Counts(pairs=60, triples=10, retimed=0),
    "test": Counts(pairs=200, triples=40, retimed=0),
}


@dataclass(frozen=True)
class Composed:
    """A clip that was put together.

    Attributes:
        parts: the clips it was made of, in order.
        joints: (T, 22, 3).
        facts: one an act.
        seams: first frame of each act but the first.
    """

    name: str
    parts: tuple[Part, ...]
    joints: Array
    facts: tuple[Facts, ...]
    seams: tuple[int, ...] = ()


def core(part: Part) -> tuple[int, int]:
    """First and last frame between which the act is done; a clip may be cut before and after, not within.

    Travel has none: it may be cut anywhere (0, 0).
    """
    joints = part.joints.astype(np.float64)
    last = len(joints) - 1
    act, side = part.facts.act, part.facts.side
    if act in CYCLIC:
        return 0, 0
    if act == "turn":
        angle = heading(joints, FPS)
        done = (angle - angle[0]) / (angle[-1] - angle[0])
        inside = np.flatnonzero((done > 0.06) & (done < 0.94))
        return (max(int(inside[0]) - 5, 0), min(int(inside[-1]) + 5, last)) if len(inside) else (0, last)
    if act in ("wave", "raise", "guide") and side in _ARMS:
        level = arm_level(joints, side)
        inside = np.flatnonzero(level > 0.12)
    elif act in ("bow", "call"):
        bend = lean(joints, FPS)
        bend = bend - np.percentile(bend, 10)
        inside = np.flatnonzero(bend > 0.15 * bend.max())
    else:
        return 0, last
    return (int(inside[0]), int(inside[-1])) if len(inside) else (0, last)


def arm_level(joints: Array, side: str) -> Array:
    """(T,) how far the raising hand is up: 0 at its lowest in the clip, 1 at its highest."""
    wrists = [20 + k for k in _ARMS[side]]
    over = np.einsum("tki,ti->tk", joints[:, wrists] - joints[:, :1], trunk_up(joints)).mean(axis=1)
    over = smooth(over, 0.05, FPS)
    return (over - over.min()) / max(float(np.ptp(over)), 1e-6)


@lru_cache(maxsize=4096)
def _seams(part: Part) -> NDArray[np.float32]:
    return seam_features(part.joints.astype(np.float64), FPS).astype(np.float32)


def best_cut(first: Part, leave: range, second: Part, enter: range) -> tuple[int, int, float]:
    """Last frame kept of one clip, first frame of the other, and the cost of that seam."""
    costs = seam_costs(
        _seams(first)[leave.start : leave.stop].astype(np.float64),
        _seams(second)[enter.start : enter.stop].astype(np.float64),
    )
    i, j = np.unravel_index(int(costs.argmin()), costs.shape)
    return leave.start + int(i), enter.start + int(j), float(costs[i, j])


class Composer:
    """Draws clips of one split and puts them together."""

    def __init__(self, parts: Sequence[Part]) -> None:
        self.by_act: dict[str, list[Part]] = defaultdict(list)
        self.by_style: dict[tuple[str, str], list[Part]] = defaultdict(list)
        for part in parts:
            if part.source.dataset == "bandai-namco" and part.facts.act in SEQUENCE_WEIGHTS:
                self.by_act[part.facts.act].append(part)
                self.by_style[part.facts.act, part.facts.style].append(part)
        self.acts = sorted(self.by_act)

    def sequence(self, name: str, count: int) -> Composed | None:
        """Two or three different acts, or None when what was drawn does not fit."""
        rng = seeded("sequence", name)
        acts = self._draw_acts(rng, count)
        same_style = rng.random() < 0.75
        part = self._draw_first(rng, acts[0])
        budget = LIMIT - sum(30 if act in CYCLIC else 45 for act in acts[1:])
        start, stop = _cut_first(part, rng, budget, len(acts))
        if stop.stop <= stop.start:
            return None
        chosen, joints, seams = [part], np.empty((0, 22, 3)), [0]
        current, first = part, start
        for act in acts[1:]:
            found = self._best_next(rng, current, stop, act, part.facts.style if same_style else None)
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
        last = int(rng.choice(stop)) if current.facts.act in CYCLIC else stop.stop - 1
        joints = join_clips(joints, current.joints[first : last + 1].astype(np.float64), FPS)
        seams.append(len(joints))
        return _checked(name, chosen, joints, seams)

    def _draw_acts(self, rng: random.Random, count: int) -> list[str]:
        acts: list[str] = []
        while len(acts) < count:
            if acts and acts[-1] in SIDED and rng.random() < OTHER_SIDE_SHARE:
                acts.append(acts[-1])
                continue
            if acts and acts[-1] in REVERSALS and rng.random() < REVERSAL_SHARE:
                acts.append(REVERSALS[acts[-1]])
                continue
            act = rng.choices(self.acts, [SEQUENCE_WEIGHTS[a] for a in self.acts])[0]
            if not acts or act != acts[-1] or act in SIDED:
                acts.append(act)
        return acts

    def _draw_first(self, rng: random.Random, act: str) -> Part:
        style = rng.choice(sorted({part.facts.style for part in self.by_act[act]}))
        return rng.choice(self.by_style[act, style])

    def _best_next(
        self, rng: random.Random, current: Part, leave: range, act: str, style: str | None
    ) -> tuple[Part, int, int] | None:
        pool = self.by_style.get((act, style or ""), []) or self.by_act[act]
        best, least = None, _WORST_SEAM
        for part in rng.sample(pool, min(_CANDIDATES, len(pool))):
            if (part.facts.act, part.facts.side) == (current.facts.act, current.facts.side):
                continue
            i, j, cost = best_cut(current, leave, part, _enter_range(part))
            if cost < least:
                best, least = (part, i, j), cost
        return best

    # -- one act, another length ------------------------------------------------------------------------------------

    def gesture(self, name: str, act: str, lengths: range) -> Composed | None:
        """A gesture of one of these lengths, done once."""
        if act not in self.by_act:
            return None
        rng = seeded("retimed", name)
        part = self._draw_first(rng, act)
        return self._measured_again(name, part, _stretch(part, rng.choice(lengths), rng, repeat_share=0))

    def retimed(self, name: str) -> Composed | None:
        """One act, longer or shorter than it was captured."""
        rng = seeded("retimed", name)
        weights = [len(self.by_act[a]) ** 0.25 * (0.4 if a in ("dash", "walk_diagonal") else 1.0) for a in self.acts]
        act = rng.choices(self.acts, weights)[0]
        part = self._draw_first(rng, act)
        target = rng.randint(32, LIMIT)
        if act in CYCLIC:
            made = _crop(part, target, rng) if target < 0.8 * len(part.joints) else _loop(part, target)
        elif act == "turn":
            made = self._with_run_up(rng, part, target)
        elif act in ("wave", "raise", "guide", "bow", "call"):
            made = _stretch(part, target, rng)
        else:
            made = _crop(part, max(target, 70), rng)
        return self._measured_again(name, part, made)

    @staticmethod
    def _measured_again(name: str, part: Part, made: tuple[Array, tuple[Part, ...], int] | None) -> Composed | None:
        if made is None or len(made[0]) <= MIN_FRAMES:
            return None
        joints, used, repeats = made
        facts = _measured(part, joints)
        if facts is None or not _still_does(facts, joints, repeats):
            return None
        return Composed(name, used, joints, (replace(facts, repeats=repeats),))

    def _with_run_up(self, rng: random.Random, part: Part, target: int) -> tuple[Array, tuple[Part, ...], int] | None:
        """A turn after a longer straight walk in the same style."""
        pool = self.by_style.get(("walk", part.facts.style), [])
        room = min(target, LIMIT) - len(part.joints)
        if not pool or room < 15:
            return None
        walk = max(rng.sample(pool, min(4, len(pool))), key=lambda p: len(p.joints))
        leave = range(max(10, min(room, len(walk.joints)) - 20), min(room, len(walk.joints)))
        if not leave:
            return None
        i, j, cost = best_cut(walk, leave, part, range(max(1, core(part)[0])))
        if cost > _WORST_SEAM / 4:
            return None
        joints = join_clips(walk.joints[: i + 1].astype(np.float64), part.joints[j:].astype(np.float64), FPS)
        return joints[:LIMIT], (walk, part), 1


def _still_does(facts: Facts, joints: Array, repeats: int) -> bool:
    """Whether the act can still be told from others: a hand held by loops must not seem to wave, a loop not bend the
    way."""
    act = "run" if facts.act == "dash" else facts.act
    if repeats > 1 or act not in get_args(Act):
        return True
    side = facts.side if act in ("turn", "wave", "raise") else ""
    expected = Expectation(cast("Act", act), cast("Side", side), straight=act in _STRAIGHT)
    return judge(joints, FPS, [expected]).passed


def _crop(part: Part, target: int, rng: random.Random) -> tuple[Array, tuple[Part, ...], int]:
    length = min(target, len(part.joints))
    first = rng.randint(0, len(part.joints) - length)
    return part.joints[first : first + length].astype(np.float64), (part,), 1


def _loop(part: Part, target: int) -> tuple[Array, tuple[Part, ...], int] | None:
    """A gait that goes on: jump back to the frame that fits best, as often as it takes."""
    frames = len(part.joints)
    half = max(frames // 2, 8)
    i, j, cost = best_cut(part, range(max(half, frames - 30), frames), part, range(min(half, 30)))
    if cost > 0.15 or i - j < 10:
        return None
    whole = part.joints.astype(np.float64)
    joints = whole[: i + 1]
    while len(joints) < target:
        joints = join_clips(joints, whole[j : i + 1], FPS)
    return joints[:target], (part,) * 2, 1


def _stretch(
    part: Part, target: int, rng: random.Random, *, repeat_share: float = 0.35
) -> tuple[Array, tuple[Part, ...], int] | None:
    """A gesture at another length: held or waved longer or shorter, done again, or with more standing around it."""
    a, b = core(part)
    whole = part.joints.astype(np.float64)
    last = len(whole) - 1
    if last - b >= 4 and a >= 1 and rng.random() < repeat_share and target > 1.4 * (b - a):
        joints, repeats = whole, 1
        while len(joints) + (b - a) < target and repeats < 4:
            i, j, cost = best_cut(part, range(b, last + 1), part, range(a + 1))
            if cost > 0.1:
                return None
            joints = join_clips(joints[: len(joints) - (last - i)], whole[j:], FPS)
            repeats += 1
        return (joints[:LIMIT], (part,) * repeats, repeats) if repeats > 1 and len(joints) <= LIMIT else None
    hold = _hold(part, a, b)
    if hold is None:
        return None
    x, y = hold
    joints = whole[: y + 1]
    if part.facts.act == "raise" and target > len(whole):
        return held_longer(whole, x, y, target - len(whole)), (part,) * 2, 1
    if target < len(whole):  # skip a piece of the hold
        third = max((y - x) // 3, 1)
        leave, enter = range(max(x, 1), x + third + 1), range(max(x, y - third), min(y + 1, last))
        i, j, cost = best_cut(part, leave, part, enter)
        joints = whole[: i + 1]
        return (join_clips(joints, whole[j:], FPS), (part,) * 2, 1) if cost < 0.1 and j - i > 8 else None
    third = max((y - x) // 3, 2)
    i, j, cost = best_cut(part, range(y - third, y + 1), part, range(x, x + third))
    if cost > 0.05 or i - j < 5:
        return None
    joints = whole[: i + 1]
    while len(joints) + (last - i) < target:
        joints = join_clips(joints, whole[j : i + 1], FPS)
    joints = np.concatenate([joints[:-1], join_clips(joints[-2:], whole[i:], FPS)[1:]])
    return joints[:LIMIT], (part,) * 2, 1


def held_longer(joints: Array, first: int, last: int, more: int) -> Array:
    """Slow down the frames first..last of (T, 22, 3) so that they take `more` frames longer; gives (T + more, 22, 3).

    Loops of a held hand would swing it to and fro, which is a wave. Time runs at its own speed at both ends and slows
    down within some frames, so that the rise before and the fall after are as captured.
    """
    steps = last - first + more
    ends = np.minimum(np.arange(steps), np.arange(steps)[::-1])
    near = np.clip(1 - ends / 5, 0, 1)
    slow = (last - first - near.sum()) / (steps - near.sum())
    at = first + np.concatenate([[0.0], np.cumsum(slow + (1 - slow) * near)])
    below = np.clip(at.astype(int), first, last - 1)
    part = (at - below)[:, None, None]
    held = (1 - part) * joints[below] + part * joints[below + 1]
    return np.concatenate([joints[:first], held, joints[last + 1 :]])


def _hold(part: Part, a: int, b: int) -> tuple[int, int] | None:
    """The frames within the core in which the pose is held or the wave goes on; None when there are too few."""
    joints = part.joints.astype(np.float64)
    if part.facts.side in _ARMS:
        held = arm_level(joints, part.facts.side) > 0.7
    else:
        bend = lean(joints, FPS)
        held = bend - np.percentile(bend, 10) > 0.75 * (bend.max() - np.percentile(bend, 10))
    inside = np.flatnonzero(held[a : b + 1])
    if not len(inside) or inside[-1] - inside[0] < 12:
        return None
    return a + int(inside[0]), a + int(inside[-1])


def _cut_first(part: Part, rng: random.Random, budget: int, count: int) -> tuple[int, range]:
    """Where the first clip begins, and the frames after which it may be left."""
    if part.facts.act in CYCLIC:
        room = len(part.joints) - 1
        start = rng.randint(0, max(room - 60, 0))
        longest = min(room, start + min(budget, 110 if count == 2 else 65))
        return start, range(min(start + 28, longest), longest + 1)
    return 0, _leave_range(part, 0, rng, budget)


def _enter_range(part: Part) -> range:
    if part.facts.act in CYCLIC:
        return range(max(len(part.joints) - 40, 1))
    return range(core(part)[0] + 1)


def _leave_range(part: Part, start: int, rng: random.Random, budget: int) -> range:
    """Frames after which the clip may be left when it was entered at `start` and `budget` frames are free."""
    end = min(len(part.joints), start + budget)
    if part.facts.act in CYCLIC:
        return range(min(start + 28, end), end)
    first = core(part)[1]
    return range(max(first, start + 1), end)


def _measured(part: Part, joints: Array) -> Facts | None:
    facts = describe(part.content, part.source.style, joints, FPS)
    return facts if facts is not None and facts.side == part.facts.side else None


def _checked(name: str, parts: list[Part], joints: Array, seams: list[int]) -> Composed | None:
    """Measure each act again in its stretch of the result."""
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
    """All clips that are put together for a split, from parts of that split alone."""
    counts = COUNTS.get(split)
    if counts is None or not parts:
        return
    composer = Composer(parts)
    makers = (
        ("S2", 2, counts.pairs, lambda name: composer.sequence(name, 2)),
        ("S3", 3, counts.triples, lambda name: composer.sequence(name, 3)),
        ("R", 1, counts.retimed, composer.retimed),
        ("RR", 1, counts.slow_raises, lambda name: composer.gesture(name, "raise", SLOW_RAISES)),
        ("RW", 1, counts.quick_waves, lambda name: composer.gesture(name, "wave", QUICK_WAVES)),
    )
    for letter, acts, wanted, make in makers:
        if len(composer.acts) < acts:
            continue
        made = 0
        for attempt in range(6 * wanted):
            if made >= wanted:
                break
            composed = make(f"{letter}-{split}-{attempt:05}")
            if composed is not None:
                made += 1
                yield composed
