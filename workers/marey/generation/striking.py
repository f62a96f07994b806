"""Punches, drawn on the body that a network made.

The network gives the footwork, the stance and the turns of a fight, but its fists seldom go out: a punch lasts three of
its tokens. The guard and the ways of the fists are drawn with a turn of the trunk; the legs stay. Punches of which the
number or the order is stated are drawn on a body that stands in guard, whose feet stay where they are, unless the
prompt has them move; it ends soon after the last one.
"""

from __future__ import annotations

import random
import re
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from marey.drawing.punches import KINDS, STRAIGHT, Strike, in_stance, strike
from marey.generation.fine_wish import FineWish
from marey.posing.standing import LEFT, OTHER_SIDE, RIGHT, StandingBody
from marey.vocabulary.blows import KINDS as KIND_WORDS
from marey.vocabulary.blows import stated_blows

Array = NDArray[np.floating]

FIRST_S, LAST_S = 0.5, 0.35
"""Seconds in guard before the first strike and after the last one, at least."""
SOON_S = 0.15, 0.3
"""Seconds before the first strike behind another movement."""
PAUSE_S, BETWEEN_S = (0.7, 1.2), (0.02, 0.12)
"""Seconds between rows of strikes, and between the strikes of a row, where no number is asked for."""
ROW = (2, 3)
"""Strikes of a row."""
_FOOTWORK = re.compile(
    r"\b(?:step|walk|advanc|retreat|circl|footwork|bounc|hop|jump|lung|run|dash|mov|charg|danc|spin|turn|shuffl|kick"
    r"|shadow|spar(?:s|ring)\b|boxes\b)"
)
"""Words of feet that move."""
AFTER_S = (0.6, 0.9)
"""Seconds in guard after the last one of a stated number."""
_BLOW = "|".join(KIND_WORDS.values())
_ONE = re.compile(
    rf"\b(?:a|an|one|single)\b(?: [\w-]+){{0,3}} (?:punch|blow|{_BLOW})\b(?! (?:combo|combination))"
    rf"|^(?:(?:left|right|lead|rear)[ -](?:hand )?)?(?:punch|{_BLOW})\b"
)
_NAMED_ONCE = re.compile(rf"\b(?:{_BLOW})\b")
_GOES_ON = re.compile(r"\b(?:practi[sc]|train|work|drill|repeat|again|combo|series|flurry|bag)\w*")
"""Words of a single punch, and of blows that go on and on."""


def punched(joints: Array, fps: float, wish: FineWish, rng: np.random.Generator) -> Array | None:
    """Return joints (T, 22, 3) of a body in guard that punches, `count` times or in rows of a few; None if there is no
    time for a punch."""
    kinds, count = _row(wish, rng)
    on_spot = stands(wish)
    own_end = on_spot and count is not None and not wish.fixed
    seconds = None if own_end else len(joints) / fps
    strikes = list(_timed(seconds, kinds, count, rng, at_once=bool(wish.beside[0])))
    if not strikes:
        return None
    if on_spot:
        ends = strikes[-1][0] + strikes[-1][1].seconds + float(rng.uniform(*AFTER_S))
        frames = round(ends * fps) if own_end else len(joints)
        body = in_stance(frames, random.Random(int(rng.integers(2**62))))  # noqa: S311
    else:
        body = StandingBody(joints)
    strike(body, fps, strikes, drives=on_spot)
    return body.solved()


def stands(wish: FineWish) -> bool:
    """Return True if the punches are those of a body that stays in guard, which is drawn as a whole."""
    return not _FOOTWORK.search(wish.prompt.lower())


def _timed(
    seconds: float | None,
    kinds: list[tuple[Strike, str]],
    count: int | None,
    rng: np.random.Generator,
    *,
    at_once: bool = False,
) -> Iterator[tuple[float, Strike, str]]:
    """Yield start, way and hand of each strike, as many as there is time for; without `seconds`, for all of `count`;
    `at_once`: soon, out of another movement."""
    at, number, row = (
        float(rng.uniform(*SOON_S)) if at_once else FIRST_S + float(rng.uniform(0.0, 0.4)),
        0,
        int(rng.integers(*ROW, endpoint=True)),
    )
    if count is not None and seconds is not None:
        taken = sum(kinds[k % len(kinds)][0].seconds + BETWEEN_S[1] for k in range(count))
        at = max(0.15, min(at, (seconds - taken) / 2))
    ends = np.inf if seconds is None else seconds - LAST_S
    while (count is None or number < count) and at + kinds[number % len(kinds)][0].seconds <= ends:
        blow, side = kinds[number % len(kinds)]
        yield at, blow, side
        number, row, at = number + 1, row - 1, at + blow.seconds + float(rng.uniform(*BETWEEN_S))
        if not row and count is None:
            at, row = at + float(rng.uniform(*PAUSE_S)), int(rng.integers(*ROW, endpoint=True))


def _row(wish: FineWish, rng: np.random.Generator) -> tuple[list[tuple[Strike, str]], int | None]:
    """Return ways and hands in the order of the prompt, a jab and a cross where it names no kind, and the number of
    strikes; None = any number."""
    last, found = str(rng.choice([LEFT, RIGHT])), list[tuple[Strike, str]]()
    blows = stated_blows(wish.prompt)
    side = "" if any(each.side for each in blows) else wish.side  # of "jab, cross, left hook" only the hook is left
    for each in blows:
        blow, usual = KINDS[each.kind]
        last = each.side or side or usual or OTHER_SIDE[last]
        found.append((blow.weighted(each.weight), last))
    if len(found) > 1:
        return found, len(found)
    text = wish.prompt.lower()
    once = _ONE.search(text) or (len(found) == 1 and _NAMED_ONCE.search(text) and not _GOES_ON.search(text))
    count = wish.count or (1 if once else None)
    return found or [(STRAIGHT, each) for each in ([wish.side] if wish.side else [LEFT, RIGHT])], count
