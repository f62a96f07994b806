"""Movements of the whole body that are asked for by name and are no action of the vocabulary: burpees, lunges,
knee strikes, moonwalks, stumbles, dives to a side, slides, serves and throws of sports, loads lifted onto shelves.

Readers and networks know nothing of them. Their words are those of bearings that move (`moves` in `bearings.toml`), so
that they are read as what is done by a body that stands, and the movement is drawn in its place.
"""

from __future__ import annotations

import random
import re
from collections.abc import Callable, Mapping

from marey.drawing.bat_swings import bat_swing
from marey.drawing.blade_spins import spun_slash
from marey.drawing.bounces import toe_bounces
from marey.drawing.burpees import burpees
from marey.drawing.close_blows import headbutt, slap, spun_backfist
from marey.drawing.cricket import cricket_ball
from marey.drawing.dives import cover_dive, ground_slide, side_dive
from marey.drawing.doors import pulled_door, pushed_door
from marey.drawing.errands import cower, curtsy, rowing, shelf_lift, shoe_tied
from marey.drawing.field_throws import field_throw
from marey.drawing.floor_ways import ground_pounded
from marey.drawing.gesture import SIDES, Gesture
from marey.drawing.handstands import handstand
from marey.drawing.knee_raises import knee_raise
from marey.drawing.knee_strikes import knee_strike
from marey.drawing.lunges import lunges
from marey.drawing.moonwalks import moonwalk
from marey.drawing.paddling import paddling
from marey.drawing.peeks import catch, peek
from marey.drawing.pitches import pitch
from marey.drawing.planks import plank
from marey.drawing.punches import elbow_strike
from marey.drawing.rides import bicycle_ride, horse_ride
from marey.drawing.sidesteps import sidestep
from marey.drawing.slips import slip_caught
from marey.drawing.sports import bowling, fencing_lunge, jump_shot, spike, tennis_serve
from marey.drawing.staggers import stagger
from marey.drawing.step_overs import FLAT, LOG, WALL, WIDE, step_over
from marey.drawing.stumbles import stumble
from marey.drawing.vacuuming import vacuuming
from marey.drawing.wide_stances import sumo_stomps, tai_chi
from marey.drawing.yoga import yoga_pose
from marey.generation.dancing import named_dance
from marey.generation.fine_wish import FineWish
from marey.generation.stepping_aside import goes_diagonally
from marey.generation.whole_body import lies_and_rolls
from marey.posing.standing import OTHER_SIDE
from marey.vocabulary.bearing_words import stated_bearings
from marey.vocabulary.bearings import StatedBearing
from marey.vocabulary.counts import stated_number, stated_things
from marey.vocabulary.held_poses import held_pose, stated_hold, without_held_pose
from marey.vocabulary.in_place import goes_in_place

MOST = 8
"""Times that a movement is done at most."""
MOST_OVER = 4
"""Things that a body steps over at most."""
BURPEE_S = 3.6
"""Seconds of one of several burpees."""
LUNGE_S = 1.9
"""Seconds of one of several lunges."""
HANDSTAND_S = 5.0
"""Seconds of the way into a handstand and out of it."""
MOST_HANDSTANDS = 3
_FEW_HAND_STEPS, _HAND_STEPS_MOST = 4, 6
"""Steps on the hands, beside other things and alone."""
_WALKING = re.compile(r"\bwalking\b|\b(?:across|along|down) the\b")
_REVERSE = re.compile(r"\b(?:reverse|backwards?)\b|\blung\w+ back\b")
_SIDE_LUNGE = re.compile(r"\b(?:side|lateral|sideways)\b|\bto (?:the|his|her) (?:left|right)\b")
_ONE_LUNGE = re.compile(
    r"\blunge\b(?! exercises?)|^lung(?:es|ing|ed)\b(?! (?:\w+ )?(?:with|on) (?:alternat\w+|each)| exercises?)"
)
"""Words of a single lunge: of a noun, or of a verb."""
_BY_TURNS = re.compile(
    r"\b(?:alternat|switch|swapp|chang)\w+|\b(?:each|both|either)\b|\bturns?\b|\bthe other\b|\bleft\b.*\bright\b"
)
"""Words of lunges of both legs, however their verb stands."""
_EXERCISE = re.compile(r"\W*lunges\W*")
_REAR_LEG = re.compile(r"\b(left|right) (?:leg|foot|knee) (?:back|behind)\b")
_TO_CHEST = re.compile(r"\b(?:chest|chin|belly|stomach|high)\b")
_PULLS = re.compile(r"^(?:pull|draw|hug)")
_OBSTACLES = {
    WIDE: re.compile(
        r"\b(?:puddles?|gaps?|ditch\w*|trench\w*|streams?|brooks?|creeks?|holes?|pits?|water|mud|ice|snow)\b"
    ),
    WALL: re.compile(r"\b(?:walls?|fences?|hurdles?|barriers?|barricades?|rail(?:ing)?s?|box\w*|crates?|bench\w*)\b"),
    FLAT: re.compile(
        r"\b(?:cracks?|gutters?|ropes?|cables?|cords?|hoses?|lines?|thresholds?|sills?|kerbs?|curbs?|planks?|toys?"
        r"|chain|(?:trip)?wires?)\b"
    ),
}
"""Words of what is stepped over; anything else is as high as a log."""
_STEPS = frozenset({"step", "steps", "paces"})
_LASTS = re.compile(r" for [\w -]+ sec\w*| \w+[- ]second\b")
_WALKS_ON = re.compile(r"\bwalk\w*\b")
_BACK = re.compile(r"\bback(?:wards?)?\b")
_SLIPS = re.compile(r"\bslip|\bfooting\b")
_CROUCHED = re.compile(r"\b(?:crouch|kneel|squat)\w*")
_LEANS = re.compile(r"lean\w* (?:over |far |way )?(?:to|left|right|sideways)")
_NEARLY = re.compile(r"\b(?:almost|nearly)\b")
_SIDES = {"l": "left", "r": "right"}
_SIDE_LETTER = re.compile(r"\bknee(?: \w+)? ([lr])$")
_RISES = re.compile(
    r"\b(?:gets?|getting|stands?|rises?|jumps?|springs?|picks?|scrambles?)\b.*\bup\b|\brises?\b"
    r"|\bto (?:his|her) feet\b"
)
_LEFT_HANDED = re.compile(r"\bleft[- ]hand(?:ed)?\b|\bleft arm\b|\bsouthpaw\b|\blefty\b")
_ADVANCES = re.compile(r"\badvanc\w+|\bsteps? (?:forward|in)\b|\bapproach\w*")
_HIGH = re.compile(r"\b(?:high|top|upper|overhead|tall)\b|\babove (?:his|her|their) head\b")
_LOW = re.compile(r"\b(?:tables?|desks?|counters?|workbench|bench|low(?:er)?|truck|trunk|cart|trolley|conveyor)\b")
_LIGHT = re.compile(r"\b(?:light|small|little|empty|quickly)\b")
_POINTS = re.compile(r"\bthree[- ]point\w*")
_FIGHTS = re.compile(r"\b(?:(?:kick)?box(?:er|ing)s?|fight\w*|spar(?:s|ring)|guard|mma|martial|muay|ring|karate)\b")
_GALLOPS = re.compile(r"\b(?:gallop\w*|charg\w+|rac(?:es?|ing)|full speed|at speed|fast|hard|flees?|fleeing)\b")
_TROTS = re.compile(r"\b(?:trot\w*|canter\w*)\b")
_HURRIES = re.compile(r"\b(?:fast|hard|furiously|quick\w*|rac(?:es?|ing)|sprint\w*|speed\w*)\b")
_ONE_HAND = re.compile(r"\b(?:one|a|his|her|their) (?:hand|arm|shoulder|elbow|finger)\b")
_TO_FEET = re.compile(r"\bfrom (?:one )?foot to\b")
_HEAVY = re.compile(r"\b(?:heavy|heavily|massive|stuck|jammed|hard|huge|iron|shov\w+|strain\w*|struggl\w*)\b")
_BOUNCES_S, _BRIEF_BOUNCES_S = (4.0, 5.0), (2.2, 2.8)
"""Seconds of bounces on the toes alone, and beside other things."""
SHOWN_ONCE = frozenset(
    {"tennis-serve", "javelin-throw", "discus-throw", "shot-put", "frisbee-throw", "bowling", "pitch", "bat-swing"}
    | {"backfist-spun", "catch", "shelf-lift", "stumble"}
)
"""Movements that begin and end standing, and are drawn as often as is asked for, one after the other."""
_POSES = {
    "warrior-three": re.compile(r"\bwarrior (?:three|3|iii|pose (?:three|3|iii))\b"),
    "warrior-one": re.compile(r"\bwarrior (?:one|1|i|pose (?:one|1|i))\b"),
    "warrior-two": re.compile(r"\bwarrior\b|\bvirabhadrasana\b"),
    "tree": re.compile(r"\btree\b|\bvrksasana\b"),
    "mountain": re.compile(r"\bmountain\b|\btadasana\b"),
    "chair": re.compile(r"\bchair\b|\butkatasana\b"),
    "triangle": re.compile(r"\btriangle\b|\btrikonasana\b"),
    "downward-dog": re.compile(r"\bdog\b"),
}
"""Poses of yoga by their words."""
_RUNS_UP = re.compile(r"\b(?:run|jog|sprint|charg)\w*\b")
_ONE_BLADE = re.compile(
    r"\b(?:canoes?|canoeing|paddle ?board\w*|sup|rafts?|dinghy|dugout|outrigger|gondola|boats?|pirogue)\b"
)
_TWO_HANDED = re.compile(
    r"\b(?:two|both)[- ]hand(?:ed|s)|\b(?:great ?sword|axe|katana|claymore|staff|halberd|hammer|scythe)\b"
)
_TURNS = {"720": 2, "double": 2, "twice": 2, "two": 2, "1080": 3, "triple": 3, "three": 3}
_ROUNDS = re.compile(r"\b(720|1080|double|triple|twice|two|three)\b")
_ON_HANDS = re.compile(r"\bhigh\b|\b(?:straight|extended)[- ]arm|\bhands\b|\bpalms\b|\bfull\b")
_GETS_DOWN = re.compile(
    r"^(?:gets?|getting|goes|go|going|drops?|dropping|moves?|comes?|lowers?|lowering|takes?|assum\w+)\b"
)
_BOTH_SHOES = re.compile(r"\bboth\b|\beach shoe\b")


def named_movement(wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture | None:
    """Return the movement that a prompt asks for by name; None if it names none. See `marey.generation.stated`."""
    for stated in stated_bearings(wish.prompt):
        if stated.bearing.moves:
            return NAMED[stated.name](stated, wish, rng, seconds)
    return None


def times_again(prompt: str) -> int:
    """Return how often a movement is done again that its drawing shows once, as the prompt says."""
    named = (each for each in stated_bearings(prompt) if each.bearing.moves)
    first = next(named, None)
    return min(first.times or 1, MOST) if first is not None and first.name in SHOWN_ONCE else 1


def names_movement(prompt: str) -> bool:
    """Return True if a prompt asks for a movement or a dance by name, for a roll of who lies, for a gait in place or
    for diagonal steps: no rule of an action is for it."""
    moves = any(each.bearing.moves for each in stated_bearings(prompt))
    rolls = lies_and_rolls(prompt.lower())
    return moves or rolls or bool(named_dance(prompt)) or goes_in_place(prompt, "walk") or goes_diagonally(prompt)


def _times(stated: StatedBearing) -> int | None:
    number = stated.times or stated_number(without_held_pose(stated.words))
    return None if number is None else min(number, MOST)


def _burpees(stated: StatedBearing, wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    del wish
    single = re.search(r"\ba (?:\w+ )?burpee\b", stated.words)
    room = None if seconds is None else min(max(int(seconds / BURPEE_S), 1), MOST)
    return burpees(rng, _times(stated) or (1 if single else room))


def _lunges(stated: StatedBearing, wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    words, hold = stated.words, stated_hold(wish.prompt)
    form = "walking" if _WALKING.search(words) else "back" if _REVERSE.search(words) else "ahead"
    form = "aside" if _SIDE_LUNGE.search(words) else form
    room = None if seconds is None else min(max(int((seconds - 1.5) / LUNGE_S), 1), MOST)
    rear = _REAR_LEG.search(words)
    side = OTHER_SIDE[rear[1]] if rear and form == "ahead" else stated.side
    turns = _BY_TURNS.search(words) is not None
    one = _ONE_LUNGE.search(words) and not (turns or _EXERCISE.fullmatch(wish.prompt.lower()))
    single, side = hold is not None or one, "" if turns and form != "aside" else side
    times = _times(stated) or (1 if single else room)
    return lunges(rng, form, times, side, hold)


def _knee_raise(stated: StatedBearing, wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    del seconds
    height, pulled = "chest" if _TO_CHEST.search(stated.words) else "hip", bool(_PULLS.search(stated.words))
    return knee_raise(rng, stated.side, _times(stated), height=height, pulled=pulled, hold=held_pose(wish.prompt))


def _side_gallop(stated: StatedBearing, wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    del wish
    side, lasts = stated.side or rng.choice(SIDES), seconds or rng.uniform(3.0, 3.8)
    count = _times(stated) or stated_things(stated.words, _STEPS)
    return sidestep(rng, side, count=count, pace="gallop", seconds=lasts)


def _knee_strike(stated: StatedBearing, wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    del wish, seconds
    letter = _SIDE_LETTER.search(stated.words)
    return knee_strike(rng, _SIDES[letter[1]] if letter else stated.side, _times(stated))


def _elbow_strike(stated: StatedBearing, wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    del wish, seconds
    return elbow_strike(rng, stated.side, _times(stated) or 1)


def _headbutt(stated: StatedBearing, wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    del wish, seconds
    return headbutt(rng, _times(stated) or 1)


def _slap(stated: StatedBearing, wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    del seconds
    back = re.search(r"\bback[- ]?hand", stated.words) is not None
    return slap(rng, stated.side or wish.side, _times(stated) or 1, back=back)


def _spun_backfist(stated: StatedBearing, wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    del wish, seconds
    return spun_backfist(rng, stated.side)


def _step_over(stated: StatedBearing, wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    del wish, seconds
    what = next((what for what, words in _OBSTACLES.items() if words.search(stated.words)), LOG)
    several = 2 if re.search(r"\b(?:some|several|the|few|many)? ?(?:obstacles|things)\b", stated.words) else 1
    return step_over(rng, what, stated.side, min(_times(stated) or several, MOST_OVER))


def _moonwalk(stated: StatedBearing, wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    del stated, wish
    return moonwalk(rng, seconds=seconds)


def _stumble(stated: StatedBearing, wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    del wish, seconds
    return slip_caught(rng) if _SLIPS.search(stated.words) else stumble(rng)


def _stagger(stated: StatedBearing, wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    del seconds
    back = "back" if _BACK.search(stated.words) else ""
    steps, brief = stated_things(stated.words, _STEPS), any(wish.beside)
    near = bool(_NEARLY.search(stated.words))
    return stagger(rng, stated.side or back, nearly_falls=near, steps=steps, brief=brief)


def _side_dive(stated: StatedBearing, wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    del seconds
    rises = any(wish.beside[1:])  # from the side that is known
    return side_dive(rng, stated.side or ("right" if rises else ""))


def _cover_dive(stated: StatedBearing, wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    del stated, seconds
    return cover_dive(rng, runs=not wish.beside[0])


def _pound_ground(stated: StatedBearing, wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    del wish, seconds
    return ground_pounded(rng, stated.side, _times(stated))


def _ground_slide(stated: StatedBearing, wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    del stated, seconds
    return ground_slide(rng, rises=not _RISES.search(wish.beside[1].lower()))


def _hand(stated: StatedBearing, wish: FineWish) -> str:
    """Return the side of the hand that acts: the one that is named, and the left one of who is left-handed."""
    return stated.side or wish.side or ("left" if _LEFT_HANDED.search(wish.prompt.lower()) else "")


def _tennis_serve(stated: StatedBearing, wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    del seconds
    return tennis_serve(rng, _hand(stated, wish))


def _field_throw(stated: StatedBearing, wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    del seconds
    return field_throw(rng, stated.name.partition("-")[0], _hand(stated, wish))


def _bowling(stated: StatedBearing, wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    del seconds
    return bowling(rng, _hand(stated, wish))


def _pitch(stated: StatedBearing, wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    del seconds
    return pitch(rng, _hand(stated, wish))


def _peek(stated: StatedBearing, wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    del seconds
    text = stated.words
    low = bool(_CROUCHED.search(text))
    return peek(rng, stated.side, low=low, looks=not _LEANS.match(text))


def _catch(stated: StatedBearing, wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    del wish, seconds
    return catch(rng, stated.side, high=bool(_HIGH.search(stated.words)))


def _jump_shot(stated: StatedBearing, wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    del seconds
    number = stated.times or stated_number(_POINTS.sub("", stated.words))
    return jump_shot(rng, _hand(stated, wish), None if number is None else min(number, MOST))


def _spike(stated: StatedBearing, wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    del seconds
    return spike(rng, _hand(stated, wish), _times(stated))


def _fencing_lunge(stated: StatedBearing, wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    del seconds
    advances = bool(_ADVANCES.search(wish.prompt.lower())) or None
    return fencing_lunge(rng, _hand(stated, wish), _times(stated), advances=advances)


def _shelf_lift(stated: StatedBearing, wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    del wish, seconds
    height = "high" if _HIGH.search(stated.words) else "low" if _LOW.search(stated.words) else ""
    return shelf_lift(rng, height, heavy=not _LIGHT.search(stated.words))


def _shoe_tied(stated: StatedBearing, wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    del wish, seconds
    return shoe_tied(rng, stated.side, both_shoes=bool(_BOTH_SHOES.search(stated.words)))


def _curtsy(stated: StatedBearing, wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    del wish, seconds
    return curtsy(rng, stated.side, _times(stated))


def _cower(stated: StatedBearing, wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    del stated, wish
    return cower(rng, seconds)


def _rowing(stated: StatedBearing, wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    del wish
    return rowing(rng, _times(stated), seconds)


def _horse_ride(stated: StatedBearing, wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    said = f"{stated.words} {wish.prompt}".lower()
    pace = "gallop" if _GALLOPS.search(said) else "trot" if _TROTS.search(said) else "walk"
    return horse_ride(rng, pace, seconds)


def _bicycle_ride(stated: StatedBearing, wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    return bicycle_ride(rng, fast=bool(_HURRIES.search(f"{stated.words} {wish.prompt}".lower())), seconds=seconds)


def _toe_bounce(stated: StatedBearing, wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    lasts = seconds or rng.uniform(*(_BRIEF_BOUNCES_S if any(wish.beside) else _BOUNCES_S))
    text = " ".join((wish.prompt, *wish.beside)).lower()
    return toe_bounces(rng, seconds=lasts, guard=bool(_FIGHTS.search(text)), sways=bool(_TO_FEET.search(stated.words)))


def _vacuuming(stated: StatedBearing, wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    return vacuuming(rng, _hand(stated, wish), seconds=seconds or (4.8 if any(wish.beside) else None))


def _door(stated: StatedBearing, wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    del seconds
    hand, heavy, brief = _hand(stated, wish), bool(_HEAVY.search(wish.prompt.lower())), any(wish.beside)
    if stated.name == "door-pulled":
        return pulled_door(rng, hand, heavy=heavy, brief=brief)
    both = not hand and _ONE_HAND.search(wish.prompt.lower()) is None
    return pushed_door(rng, hand, both=both, heavy=heavy, brief=brief)


def _bat_swing(stated: StatedBearing, wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    del seconds
    return bat_swing(rng, _hand(stated, wish))


def _plank(stated: StatedBearing, wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    words = stated.words
    form = "side" if re.search(r"\bside\b(?! by)", words) else "hands" if _ON_HANDS.search(words) else ""
    enters = bool(wish.beside[0]) or _GETS_DOWN.search(words) is not None
    leaves = bool(wish.beside[1])
    lasts = seconds or stated_hold(wish.prompt) or rng.uniform(4.0, 5.5) + 1.5 * enters + 1.5 * leaves
    return plank(rng, form, stated.side, seconds=lasts, enters=enters, leaves=leaves)


def _handstand(stated: StatedBearing, wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    hold, words = stated_hold(wish.prompt), _LASTS.sub("", stated.words)
    if _WALKS_ON.search(stated.words):
        steps = stated_things(stated.words, _STEPS) or (_FEW_HAND_STEPS if any(wish.beside) else _HAND_STEPS_MOST)
        return handstand(rng, steps=min(steps, _HAND_STEPS_MOST))
    number = stated_number(words)
    times = None if number is None else min(number, MOST_HANDSTANDS)
    room = None if seconds is None or times else max(seconds - HANDSTAND_S, 0.6)
    return handstand(rng, stated.side, times=times, hold=hold or room)


def _yoga(stated: StatedBearing, wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    text = stated.words
    pose = next(pose for pose, words in _POSES.items() if words.search(text))
    room = None if seconds is None else max(seconds - 4.6, 1.0)
    return yoga_pose(rng, pose, stated.side or wish.side, stated_hold(wish.prompt) or room)


def _cricket(stated: StatedBearing, wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    del seconds
    return cricket_ball(rng, _hand(stated, wish), brief=bool(_RUNS_UP.search(wish.beside[0].lower())))


def _paddling(stated: StatedBearing, wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    one = _ONE_BLADE.search(stated.words) is not None
    return paddling(rng, _times(stated), seconds, one_sided=one, side=stated.side or wish.side)


def _spun_slash(stated: StatedBearing, wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    del seconds
    text = wish.prompt.lower()
    rounds = _ROUNDS.search(stated.words)
    both = _TWO_HANDED.search(text) is not None
    return spun_slash(rng, _hand(stated, wish), _TURNS[rounds[1]] if rounds else None, two_handed=both)


def _sumo(stated: StatedBearing, wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    del wish, seconds
    both = re.search(r"\bleft\b.*\bright\b|\bright\b.*\bleft\b", stated.words)
    times = _times(stated) or (1 if stated.side and not both else 2)
    return sumo_stomps(rng, stated.side, times)


def _tai_chi(stated: StatedBearing, wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    del stated
    return tai_chi(rng, seconds or (9.0 if any(wish.beside) else None))


NAMED: Mapping[str, Callable[[StatedBearing, FineWish, random.Random, float | None], Gesture]] = {
    "burpee": _burpees,
    "lunges": _lunges,
    "knee-raise": _knee_raise,
    "knee-strike": _knee_strike,
    "elbow-strike": _elbow_strike,
    "headbutt": _headbutt,
    "slap": _slap,
    "backfist-spun": _spun_backfist,
    "step-over": _step_over,
    "moonwalk": _moonwalk,
    "stumble": _stumble,
    "side-gallop": _side_gallop,
    "stagger": _stagger,
    "side-dive": _side_dive,
    "cover-dive": _cover_dive,
    "pound-ground": _pound_ground,
    "ground-slide": _ground_slide,
    "tennis-serve": _tennis_serve,
    "javelin-throw": _field_throw,
    "discus-throw": _field_throw,
    "shot-put": _field_throw,
    "frisbee-throw": _field_throw,
    "bowling": _bowling,
    "pitch": _pitch,
    "peek": _peek,
    "catch": _catch,
    "jump-shot": _jump_shot,
    "volleyball-spike": _spike,
    "fencing-lunge": _fencing_lunge,
    "shelf-lift": _shelf_lift,
    "shoe-tied": _shoe_tied,
    "curtsy": _curtsy,
    "cower": _cower,
    "rowing": _rowing,
    "horse-ride": _horse_ride,
    "bicycle-ride": _bicycle_ride,
    "toe-bounce": _toe_bounce,
    "vacuuming": _vacuuming,
    "door-pulled": _door,
    "door-pushed": _door,
    "plank": _plank,
    "handstand": _handstand,
    "bat-swing": _bat_swing,
    "yoga-pose": _yoga,
    "cricket-ball": _cricket,
    "paddling": _paddling,
    "spun-slash": _spun_slash,
    "sumo-stomp": _sumo,
    "tai-chi": _tai_chi,
}
"""Movements by the bearing that names them."""
