"""Movements of the whole body, drawn in place of what a network makes: falls, rolls, flips, cartwheels, leaps, crawls,
ways to the floor and back, strokes of swimmers.

Networks know how such a movement begins; then they roll on, fall twice, turn the other way over, or crawl in place. The
movements are those of the made clips of the training data, with the direction and the number that the prompt names.
"""

from __future__ import annotations

import random
import re
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from marey.drawing.cartwheels import cartwheel
from marey.drawing.crawls import crawl, low_crawl
from marey.drawing.falls import FORMS, die
from marey.drawing.floor import get_up, lie, lie_down
from marey.drawing.floor_ways import roll_over
from marey.drawing.gesture import Gesture
from marey.drawing.hops import jump_turned
from marey.drawing.leaps import leap
from marey.drawing.rolls import flip, roll
from marey.drawing.slips import slip
from marey.drawing.stunts import blown_back, climb_over_edge, dodge_roll
from marey.drawing.swims import swim
from marey.drawing.vaults import vault
from marey.generation.fine_wish import FineWish
from marey.generation.holding import climb, drives, hangs
from marey.posing.limbs import FPS
from marey.posing.standing import LEFT, OTHER_SIDE, RIGHT, SIGN, StandingBody, poses_at
from marey.posing.still import standing_still
from marey.vocabulary.distances import stated_distance
from marey.vocabulary.turns import stated_turn

Array = NDArray[np.floating]
Choice = Callable[[FineWish, random.Random, float | None], Gesture]
"""`(wish, rng, seconds)`: a movement as the prompt asks for; seconds that it has to fill, or None."""

TRIES = 12
"""Movements of random length, of which the longest is taken that is not too long."""
QUICKER = 0.65
"""Share of its length to which a movement is shortened at most."""
IN_AIR = 95.0, 540.0
"""Degrees by which a body turns in one jump, at least and at most."""
MOST_WHEELS = 6
"""Cartwheels at most, one out of the other."""
MOST = 4
"""Times that a movement is done at most, one after the other."""
_BACK = re.compile(r"\b(?:back|backwards?|supine|face[ -]?up|slip\w*|heels)\b")
_FRONT = re.compile(r"\b(?:forwards?|face|face[ -]?(?:first|down)|front|prone|stomach|belly|chest|trip\w*|stumbl\w*)\b")
_SLIPS = re.compile(r"\bslip(?:s|ping|ped)?\b|\blos(?:es?|ing|t) (?:his |her |their |the )?(?:footing|foothold)\b")
_ON_SEAT = re.compile(r"\b(?:butt|bum|backside|bottom|behind|rear|seat|tailbone|arse|ass)\b")
_SIDE = re.compile(r"\b(?:side|sides|sideways|left|right|over to (?:one|his|her|the) side)\b")
_BACKWARD = re.compile(r"\bbackwards?\b|\bback(?:s|ing) (?:up|away|off)\b")
_DANCES = re.compile(
    r"\b(?:ballet\w*|ballerinas?|danc\w+|grand jet[eé]s?|jet[eé]s?|arms? (?:\w+ )?(?:out|wide|spread))\b"
)
_SPLIT = re.compile(r"\b(?:split\w*|legs? (?:\w+ ){0,3}(?:apart|wide|open|stretched|extended|straight))\b")
_FAR = re.compile(r"\b(?:far|long|big|huge|great|wide|large|gap|chasm|river|stream|ditch|rooftops?)\b")
_JUMPS, _LEAPS = re.compile(r"\bjump\w*\b"), re.compile(r"\b(?:leap\w*|bound\w*)\b")
"""Words of a jump out of a run, and of a leap, in which the legs are far apart."""
_RUNS_FIRST = re.compile(r"\b(?:runs?|sprints?|jogs?|races?)\b[^.;]*\b(?:and|then|before)\b")
"""Words of a run that is as much of a motion as the leap behind it."""
_VAULTS = re.compile(
    r"\bvault(?:s|ed|ing)?\b(?! (?:up )?(?:onto|on top|door|into the saddle)| up\b)"
    r"|\b(?:jump|spring|leap|hop|swing)\w* over .*\b(?:using|with|on) (?:his|her|their|one|both|a) (?:hands?|arms?)\b"
)
_POLE = re.compile(r"\bpole\b|\bgymnast\w*|\bvaulting (?:horse|table)\b")
"""Words of what is passed over with the hands on it, and of vaults of other kinds."""
_LOW_VAULT = re.compile(r"\b(?:low|tables?|desks?|bench|counter|crate|box|bonnet|hood|car)\b")
_LEGS_SIDE = re.compile(r"\b(?:legs?|feet) (?:\w+ ){0,4}(left|right)\b|\bto (?:the|his|her) (left|right)\b")
_KNEES = re.compile(r"\bknees?\b")
_SPINS = re.compile(r"\b(?:spins?|spinning|whirls?|twists?)\b")
_HIT = re.compile(
    r"\b(?:shot|shots|gunned|hit|struck|stabbed|punched|killed|slain|bullets?|arrow|blow|wound\w*|knocked|headshot|sniper)\b"
)
_SLOWLY = re.compile(r"\b(?:slow\w*|gradual\w*|sinks?|slump\w*|crumples?)\b")
_LOG = re.compile(r"\b(?:side|sideways|log|barrel|pencil|over onto|lateral\w*)\b")
_SIDE_NAMED = re.compile(r"\b(left|right)\b")
_OVER_SHOULDER = re.compile(r"\b(?:left|right) shoulder\b")
_BLAST = re.compile(r"\b(?:explo\w+|blasts?|bombs?|grenades?|shock ?waves?|detonat\w+)\b")
_DODGES = re.compile(r"\b(?:dodg\w*|evad\w*|evasive|combat|tactical|roll(?:s|ing)? out of the way|escape)\b")
_EDGE = re.compile(
    r"\b(?:pull|haul|hoist|heav|climb|clamber|scrambl|mantl)\w*(?: (?:him|her|it|them)sel(?:f|ves))?(?: \w+ly)? "
    r"(?:up )?(?:and )?(?:over|onto|up to|on)(?: to)? (?:\w+ ){0,3}?"
    r"(?:edge|ledge|roof|rooftop|cliff|rim|lip|balcony|parapet|brink|platform)s?\b"
)
"""Words of a way up over an edge higher than the head."""
_FROM = re.compile(
    r"\bfrom (?:the |his |her |its |their )?(?:(front|ahead)|(back|behind|rear)|(left|right))\b(?! foot| leg| hand)"
)
"""Words of where a blow comes from that a body falls away of."""
_CROUCHES = re.compile(r"\b(?:crouch\w*|kneel\w*|knee|squat\w*|stays? low)\b")
_SHOULDER = re.compile(r"\b(?:shoulder|combat|dodge|tactical|parkour|judo|evad\w*|evasive)\b")
_OVER_ON_FLOOR = re.compile(
    r"\broll(?:s|ing)? (?:\w+ly )?(?:over(?! (?:his|her|their|one|the|a|an|it)\b)|around|about|back and forth"
    r"|(?:from )?side to side)\b"
)
_SOMERSAULT = re.compile(
    r"\b(?:somersaults?|forwards?|shoulder|dives?|dodges?|backwards?|combat|tuck\w*"
    r"|(?:to|onto) (?:his|her|their) (?:feet|knees?))\b"
)
"""Words of rolls that a body makes which lies on the floor, and of those over the head."""
_HALVES: Mapping[str, int] = {"twice": 2, "two": 2, "three": 3, "thrice": 3, "four": 4, "several": 4, "around": 4}
"""Half turns by the words of their number."""
_IN_BED = re.compile(r"\b(?:bed|sleep\w*|asleep|lying|lies)\b")
_ON_SIDE = re.compile(r"\b(?:(?:his|her|their|the|its|one|left|right) side|foetal|fetal|curl\w*|sideways)\b")
_RISES = re.compile(
    r"\b(?:gets?|getting|stands?|standing|rises?|rising|picks? (?:him|her|them|it)sel\w+) (?:back )?up\b|\brises?\b"
)
_CRAWLS = re.compile(r"\bcrawl\w*\b|\bon all fours\b|\bhands and knees\b")
_LOW = re.compile(
    r"\b(?:belly|bellies|stomach|tummy|chest|army|armies|military|soldiers?|marines?|troops?|infantry\w*|commandos?|prone"
    r"|low|flat|barbed|wires?|elbows?|forearms?|leopard|tiger|snakes?|worms?|lizard|slither\w*|face[ -]?down"
    r"|under (?:enemy |heavy )?(?:fire|bullets))\b"
)
"""Words of crawls on the belly."""
_ON_KNEES = re.compile(r"\b(?:all fours|hands and knees|knees and hands)\b")
_ON_FOURS = re.compile(r"\b(?:all fours|hands and knees|a crawl|crawling)\b")
_ONTO_FRONT = re.compile(r"\b(?:face[ -]?down|stomach|belly|front|prone|tummy|chest)\b")


def _fall(wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    del seconds
    text = _FROM.sub(_away, wish.prompt.lower())
    if _BLAST.search(text):
        return blown_back(rng)
    if _SLIPS.search(text) and not (_FRONT.search(text) or _SIDE.search(text)):
        return slip(rng, "sit" if _ON_SEAT.search(text) else "back")
    knees, aside = bool(_KNEES.search(text)), bool(_SIDE.search(text))
    forms = [
        *(["knees-side"] if knees and aside else ["knees"] if knees else []),
        *(["spin"] if _SPINS.search(text) else []),
        *(["back", "back", "sit"] if _BACK.search(text) else []),
        *(["front"] if _FRONT.search(text) else []),
        *(["side"] if aside else []),
    ]
    if wish.beside[1]:  # what follows begins in a posture that is known
        forms = ["front" if falls_on_front(text, wish.beside[0]) else "back"]
    first = forms[:1] if knees else forms  # the knees come first, then what is said beside them
    form = rng.choice(first) if first else rng.choices(list(FORMS), list(FORMS.values()))[0]
    named = _SIDE_NAMED.search(text) if form in ("side", "knees-side") else None
    return die(rng, form, side=named[1] if named else "", hit=bool(_HIT.search(text)), slow=bool(_SLOWLY.search(text)))


def _away(match: re.Match[str]) -> str:
    """Return the direction in which a body falls that is hit from another one."""
    front, _, side = match.groups()
    return f"to the {OTHER_SIDE[side]}" if side else "backward" if front else "forward"


def _roll(wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    del seconds
    text = wish.prompt.lower()
    named = _SIDE_NAMED.search(text)
    if lies_and_rolls(text):
        return roll_over(rng, half_turns(text), named[1] if named else "")
    quick = _DODGES.search(text) is not None and not re.search(r"\bback(?:wards?)?\b|\blog\b|\bshoulder\b", text)
    if quick and (wish.count or 1) == 1:
        side = named[1] if named else wish.side
        return dodge_roll(rng, side, ahead=not side, low=_CROUCHES.search(text) is not None)
    if _LOG.search(text) or (named and not _OVER_SHOULDER.search(text)):
        form = "sideways"
    elif re.search(r"\b(?:back|backwards?)\b", text):
        form = "backward"
    else:
        form = "shoulder" if _SHOULDER.search(text) else "forward"
    again = (wish.count or 1) > 1
    low = not again and _CROUCHES.search(text) is not None
    return roll(rng, form, side=named[1] if named else "", stands=again, crouches=low)


def lies_and_rolls(text: str) -> bool:
    """Return True if a body rolls that lies on the floor, not over its head."""
    return _OVER_ON_FLOOR.search(text) is not None and not tumbles(text)


def tumbles(text: str) -> bool:
    """Return True if words are those of a roll over the head, or onto the feet."""
    return _SOMERSAULT.search(text) is not None


def half_turns(text: str) -> int:
    """Return how often a body that lies turns over, so far as its words say."""
    return next((number for word, number in _HALVES.items() if re.search(rf"\b{word}\b", text)), 1)


def _flip(wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    del seconds
    text = wish.prompt.lower()
    front = re.search(r"\b(?:front|forwards?|front[ -]?flips?|frontflips?)\b", text)
    back = re.search(r"\b(?:back|backwards?|back[ -]?(?:flip|tuck|somersault)\w*|backflips?)\b", text)
    form = rng.choice(["back", "front"]) if bool(front) == bool(back) else "front" if front else "back"
    runs = re.search(r"\b(?:run|runs|running|steps?)\b", text)
    return flip(rng, form, stands=not runs or (wish.count or 1) > 1)


def _cartwheel(wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    named = _SIDE_NAMED.search(wish.prompt.lower())
    return cartwheel(rng, named[1] if named else wish.side, min(wish.count or 1, MOST_WHEELS), seconds)


def _leap(wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    del seconds
    text = wish.prompt.lower()
    form = "dance" if _DANCES.search(text) else "split" if _SPLIT.search(text) else "far" if _FAR.search(text) else ""
    if form in ("", "far") and _JUMPS.search(text) and not _LEAPS.search(text):
        form = "jump"
    return leap(rng, form, wish.side)


def _vault(wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    del seconds
    text = wish.prompt.lower()
    if not _VAULTS.search(text):
        return climb_over_edge(rng)
    high = rng.uniform(0.74, 0.8) if _LOW_VAULT.search(text) else 0.0
    named = _LEGS_SIDE.search(text)
    return vault(rng, (named[1] or named[2]) if named else "", high)


def _crawl(wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    text = wish.prompt.lower()
    back = bool(re.search(r"\b(?:backwards?|in reverse)\b", text))
    form = low_crawl if is_low_crawl(text) else crawl
    metres = None if wish.fixed else stated_distance(text, "crawl")
    return form(rng, back=back, seconds=seconds or rng.uniform(4.0, 6.5), metres=metres)


def is_low_crawl(text: str) -> bool:
    """Return True if a crawl is one on the belly."""
    return bool(_LOW.search(text)) and not _ON_KNEES.search(text)


def _lie_down(wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    del seconds
    return lie_down(rng, "lie-front" if _ONTO_FRONT.search(wish.prompt.lower()) else "lie-back")


def _lie(wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    return lie(rng, "lie-front" if _ONTO_FRONT.search(wish.prompt.lower()) else "lie-back", seconds=seconds)


def _get_up(wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    del seconds
    before, text = wish.beside[0].lower(), wish.prompt.lower()
    crawls = _CRAWLS.search(before) and not is_low_crawl(before)
    if crawls or _ON_FOURS.search(text):
        return get_up(rng, "fours")
    return get_up(
        rng, "lie-front" if ends_on_front(before) or _CRAWLS.search(before) or _ONTO_FRONT.search(text) else "lie-back"
    )


def _jump_turn(wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    del seconds
    text = wish.prompt.lower()
    turn, named = stated_turn(text, "jump-turn"), _SIDE_NAMED.search(text)
    degrees = turn.least if turn is not None and turn.is_exact else rng.choice((180.0, 180.0, 360.0))
    side = (named[1] if named else wish.side) or rng.choice((LEFT, RIGHT))
    return jump_turned(rng, SIGN[side] * float(np.clip(degrees, *IN_AIR)))


def _swim(wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    text = wish.prompt.lower()
    form = next((form for form, words in _STROKES.items() if words.search(text)), "")
    form = form or rng.choice(["freestyle", "freestyle", "breaststroke"])
    return swim(rng, form, seconds=seconds or rng.uniform(4.0, 7.0), moves=form != "tread")


def falls_on_front(text: str, before: str) -> bool:
    """Return True if a body falls onto its front: who walked backward before does not, though it trips."""
    return ends_on_front(text) and not _BACKWARD.search(before.lower())


def ends_on_front(before: str) -> bool:
    """Return True if a movement ends on the front, so far as its words say."""
    return bool(_ONTO_FRONT.search(before) or (_FRONT.search(before) and not _BACK.search(before)))


_STROKES: Mapping[str, re.Pattern[str]] = {
    "backstroke": re.compile(r"\bback[ -]?stroke\b|\bon (?:his|her|their|the) back\b"),
    "breaststroke": re.compile(r"\bbreast|\bfrog\b"),
    "under": re.compile(r"\bunder[ -]?water\b|\bunder\b|\bdiv(?:er?s?|ing)\b|\bbelow\b|\bmermaid\b"),
    "tread": re.compile(r"\btread|\bafloat\b|\bfloat|\bupright\b"),
    "freestyle": re.compile(r"\bfree[ -]?style\b|\bcrawl\b"),
}
"""Words of strokes; the first that fits counts."""
CHOICES: Mapping[str, Choice] = {
    "die": _fall,
    "roll": _roll,
    "flip": _flip,
    "cartwheel": _cartwheel,
    "leap": _leap,
    "climb-onto": _vault,
    "crawl": _crawl,
    "lie-down": _lie_down,
    "lie": _lie,
    "get-up": _get_up,
    "swim": _swim,
    "climb-ladder": climb,
    "hang": hangs,
    "drive": drives,
    "jump-turn": _jump_turn,
}
"""Movements by action."""
AGAIN = frozenset({"roll", "flip", "jump-turn"})
"""Actions that begin and end standing, and are done again."""
OUT_OF_A_RUN = frozenset({"leap"})
"""Actions that are drawn where they stand alone: out of the run before it, the network's goes on at its speed, where it
shows one."""
LEFT_TO_NETWORKS: Mapping[str, re.Pattern[str]] = {
    "roll": _IN_BED,
    "leap": _RUNS_FIRST,
    "lie-down": _ON_SIDE,
    "lie": _ON_SIDE,
}
"""Words of movements that are not drawn."""


def whole_body(action: str) -> Callable[[Array, float, FineWish, np.random.Generator], Array | None]:
    """Return a function that draws an action in place of a motion; None for a kind that is not drawn, and for a motion
    that is too short for it."""

    def drawn(joints: Array, fps: float, wish: FineWish, rng: np.random.Generator) -> Array | None:
        del fps
        if _is_networks(action, wish):
            return None
        chance = random.Random(int(rng.integers(2**62)))  # noqa: S311
        times = min(wish.count or 1, MOST) if action in AGAIN else 1
        frames = len(joints) if wish.fixed else None
        tries = TRIES // 3 if any(wish.beside) else 1
        return drawn_in_place(lambda seconds: CHOICES[action](wish, chance, seconds), times, frames, chance, tries)

    return drawn


def is_drawn(action: str) -> Callable[[FineWish], bool]:
    """Return a function that tells if a movement of an action is drawn as its prompt asks for it."""

    def draws(wish: FineWish) -> bool:
        return not (goes_out_of_a_run(action, wish) or _is_networks(action, wish))

    return draws


def goes_out_of_a_run(action: str, wish: FineWish) -> bool:
    """Return True if a movement is drawn only where a network does not show it, since that keeps the speed of a run."""
    return action in OUT_OF_A_RUN and bool(wish.beside[0])


def _is_networks(action: str, wish: FineWish) -> bool:
    if action == "climb-onto":
        text = wish.prompt.lower()
        ends_up = _EDGE.search(text) and not any(wish.beside)  # other movements begin and end on one floor
        return not (_VAULTS.search(text) or ends_up) or _POLE.search(text) is not None
    others = LEFT_TO_NETWORKS.get(action)
    return others is not None and others.search(wish.prompt.lower()) is not None


def drawn_in_place(
    draw: Callable[[float | None], Gesture], times: int, frames: int | None, rng: random.Random, tries: int = 1
) -> Array | None:
    """Return joints (T, 22, 3) of a body that stands and moves as drawn; None if there is no time for it.

    Args:
        draw: returns a movement; is given the seconds that it has to fill, or None.
        times: that it is done, one after the other.
        frames: of the motion; None = as many as it takes.
        rng: decides how the body stands.
        tries: movements of which the shortest is taken, where no length is given.
    """
    gestures = _fitting(draw, times, frames, tries)
    return None if gestures is None else _joined(gestures, frames, rng)


def _fitting(
    draw: Callable[[float | None], Gesture], times: int, frames: int | None, tries: int
) -> list[Gesture] | None:
    """Return as many movements as are asked for, the longest that have room in so many frames."""
    if frames is None:
        return min(([draw(None) for _ in range(times)] for _ in range(tries)), key=_frames)
    every = [[draw(frames / FPS) for _ in range(times)] for _ in range(TRIES)]
    lengths = [_frames(found) for found in every]
    room = [length for length in lengths if length <= frames]
    best = max(room) if room else min(lengths)
    return every[lengths.index(best)] if QUICKER * best <= frames else None


def _frames(gestures: Sequence[Gesture]) -> int:
    return sum(max(round(each.seconds * FPS), 2) for each in gestures)


def _joined(gestures: Sequence[Gesture], frames: int | None, rng: random.Random) -> Array:
    """Draw movements one after the other, each where the one before it ends; the last posture is held."""
    lengths = [max(round(each.seconds * FPS), 2) for each in gestures]
    if frames is not None:
        lengths[-1] = max(lengths[-1], frames - sum(lengths[:-1]))
    idle = standing_still(sum(lengths), rng)
    parts: list[Array] = []
    start, moved = 0, np.zeros(3)
    for gesture, length in zip(gestures, lengths, strict=True):
        body = StandingBody(idle[start : start + length])
        gesture.change(body)
        part = body.solved() + moved
        parts.append(part)
        moved = (part[-1, 0] - idle[start + length - 1, 0]) * [1.0, 0.0, 1.0]
        start += length
    whole = np.concatenate(parts)
    return whole if frames is None or len(whole) == frames else retimed(whole, frames)


def retimed(joints: Array, frames: int) -> Array:
    """Return as many frames at another pace."""
    return poses_at(joints, np.linspace(0.0, len(joints) - 1.0, frames))
