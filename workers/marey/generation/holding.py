"""Climbs, hangs and drivers as their prompts ask for: what the hands hold stays where it is.

Networks know the postures, but their hands slide over rungs and bars, who hangs swings widely, and who drives turns on
the seat.
"""

from __future__ import annotations

import random
import re

from marey.drawing.gesture import Gesture
from marey.drawing.hangs import HangForm, hang
from marey.drawing.ladders import Ascent, climb_ladder
from marey.drawing.wheels import Way, drive
from marey.generation.fine_wish import FineWish
from marey.posing.standing import LEFT, RIGHT
from marey.vocabulary.counts import stated_count
from marey.vocabulary.gazes import without_gaze
from marey.vocabulary.lengths import NUMBERS, TO_TWENTY
from marey.vocabulary.paces import stated_pace

MOST_RUNGS = 14
"""Rungs that are climbed at most."""
LOW_RUNGS = 2, 3
"""Rungs that are climbed before another movement, since all movements begin on one floor."""
_GOES_ON = re.compile(r"\b(?:climb|hang|dangl|clamber|hoist|pull|scal)\w*|\b(?:onto|over) (?:the|a)\b")
"""Words of movements that go on from a ladder, and not from the floor."""
_RUNGS = re.compile(
    rf"\b(\d{{1,2}}|{TO_TWENTY}|couple of|few) (?:more )?(?:rungs?|steps?|holds?)\b(?! (?:at|after|by)\b)"
)
_DOWN = re.compile(r"\b(?:down|downwards?|descend\w*|descent\w*|lowers?|rappel\w*|abseil\w*)\b")
_UP = re.compile(r"\b(?:up|upwards?|ascend\w*|ascent|higher)\b")
_WALLS = re.compile(
    r"\b(?:walls?|cliffs?|rocks?|boulder\w*|mountain\w*|fa[cç]ades?|buildings?|trellis|holds|fences?|nets?)\b"
)
_ROPES = re.compile(r"\b(?:ropes?|vines?|poles?|drain\W?pipes?|pipes?|chains?|masts?|trees?|trunk|palm\w*)\b")
_LADDERS = re.compile(r"\b(?:step)?ladders?\b|\brungs?\b")
_LEDGES = re.compile(
    r"\b(?:ledges?|cliffs?|edges?|roof\w*|window\w*|sill\w*|walls?|rims?|gutters?|balcon\w*|buildings?)\b"
)
_SWINGS = re.compile(r"\b(?:sw[iu]ng\w*|to and fro|back and forth|sway\w*)\b")
_GENTLY = re.compile(r"\b(?:gent\w*|slight\w*|slow\w*|sway\w*|a little|a bit|softly|lazily|easily)\b")
_LEGS, _OWN = r"(?:legs|knees|feet)", r"(?:(?:his|her|their|both|the) )*"
_FEET = re.compile(
    rf"\b{_LEGS} (?:\w+ )?(?:kick|swing|flail|pedal|cycl)\w*|\b(?:kick|swing|flail)\w* {_OWN}{_LEGS}\b"
    r"|\bkick(?:s|ing)?\b"
)
_ASIDE = re.compile(r"\b(?:side to side|sideways|left and right)\b")
_PULLS = re.compile(
    r"\b(?:pull|chin|muscle)[ -]?ups?\b|\b(?:pull|haul|heav)\w* (?:\w+ )?up\b|\bchins? (?:\w+ ){0,2}(?:over|above|to)\b"
)
_RAISES = re.compile(
    rf"\b(?:leg|knee)s?[ -](?:raise|lift|tuck)\w*|\b(?:rais|lift|tuck|bring|draw|pull)\w* {_OWN}{_LEGS}\b"
    r"|\btoes[ -]to[ -]bar\b"
)
_ALONG = re.compile(
    r"\bshimm\w*|\bhand over hand\b|\btravers\w*"
    r"|\b(?:mov|edg|inch|go|travel|work|slid|climb|mak|swing)\w* (?:\w+ ){0,3}(?:along|across|sideways)\b"
)
_AHEAD = re.compile(r"\b(?:monkey bars?|bar to bar|rung to rung|forwards?|ahead|rings)\b")
_STAYS = re.compile(r"\b(?:not going anywhere|without moving|in place|on the spot|still|motionless)\b")
_ONE = re.compile(r"\b(?:one|single|left|right)[ -](?:hand|arm)(?:ed)?\b")
_SIDE = re.compile(r"\b(left|right)\b")
_TRUCKS = re.compile(r"\b(?:truck\w*|lorr\w*|bus\w*|coach|vans?|tractors?|trams?|fire engine)\b")
_RACES = r"rac(?:e|es|ing|er|ers)|rally\w*"
_LOW = re.compile(rf"\b(?:{_RACES}|sports? cars?|(?:go-?)?karts?|formula|f1)\b")
_FAR = r"hard|sharp\w*|swerv\w*|abrupt\w*|yank\w*|jerk\w*|u-?turn|hairpin\w*|full lock"
_SHARP = re.compile(rf"\b(?:{_FAR})\b")
_HARD = re.compile(rf"\b(?:{_FAR}|{_RACES}|wild\w*|frantic\w*|chase\w*|sudden\w*|fast|quick\w*|furious\w*)\b")
_CALM = re.compile(
    r"\b(?:calm\w*|relax\w*|slow\w*|weary|tired|cruis\w*|gent\w*|slight\w*|careful\w*|leisure\w*|straight)\b"
)
_SHIFTS = re.compile(r"\b(?:shift\w*|gears?|stick|radio|handbrake)\b")
_LEFT_OFF = re.compile(r"\bright hand on the wheel\b|\bleft hand off\b")
_ONE_ON_WHEEL = re.compile(r"\b(?:one|single)[ -]hand(?:ed(?:ly)?)?\b|\b(?:left|right) hand (?:on|off) the wheel\b")


def climb(wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    """Return a climb of a ladder, wall or rope, up or down, over as many rungs as are named; at the pace of the wish a
    motion is played afterwards."""
    text = wish.prompt.lower()
    form = "ladder"
    if not _LADDERS.search(text):
        form = "wall" if _WALLS.search(text) else "rope" if _ROPES.search(text) else "ladder"
    down = bool(_DOWN.search(text)) and not _UP.search(text)
    rungs, after = _rungs(text), wish.beside[1].lower()
    if rungs is None and after and not down and not _GOES_ON.search(after):
        rungs = rng.choice(LOW_RUNGS)
    tempo = "" if stated_pace(wish.prompt) else None
    return climb_ladder(rng, Ascent(form, down, rungs, tempo), seconds)


def _rungs(text: str) -> int | None:
    """Return the number of rungs that a text names; None if it names none, or several numbers."""
    some = {**NUMBERS, "couple of": 2, "few": 3}
    found = {some.get(match[1]) or int(match[1]) for match in _RUNGS.finditer(text)}
    return min(max(found.pop(), 1), MOST_RUNGS) if len(found) == 1 else None


def hangs(wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    """Return a body that hangs: nearly still unless the prompt says how it moves."""
    text = wish.prompt.lower()
    form, named = _form_of_hang(text), _SIDE.search(text)
    gentle = _GENTLY.search(text) is not None
    swing = (0.6, 2.2)
    if _SWINGS.search(text) and not _STAYS.search(text) and form in ("hang-still", "hang-swing", "hang-side"):
        swing = (3.0, 6.0) if gentle or form == "hang-side" else (9.0, 18.0)
    counted = form in ("hang-pull", "hang-raise")
    count = stated_count(_PULLS.sub("pull up", text), "hang") if counted else None
    side = named[1] if named else ""
    lasts = seconds or rng.uniform(4.0, 6.5)
    return hang(rng, HangForm(form, bool(_LEDGES.search(text)), swing, count, side, lasts))


def _form_of_hang(text: str) -> str:
    """Return how a body hangs, as the words say."""
    moves = not _STAYS.search(text)
    if _PULLS.search(text):
        return "hang-pull"
    if _RAISES.search(text):
        return "hang-raise"
    if moves and _ALONG.search(text):
        return "hang-ahead" if _AHEAD.search(text) and not _LEDGES.search(text) else "hang-shimmy"
    if _ONE.search(text):
        return "hang-one"
    if _FEET.search(text):
        return "hang-kick"
    if moves and _SWINGS.search(text):
        return "hang-side" if _ASIDE.search(text) else "hang-still" if _GENTLY.search(text) else "hang-swing"
    return "hang-still"


def drives(wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture:
    """Return a driver who steers and shifts as the prompt says; glances are drawn on the finished motion."""
    text = wish.prompt.lower()
    sides = tuple(_SIDE.findall(without_gaze(text)))
    if _ONE_ON_WHEEL.search(text):
        lets_go, sides = "rest", ()
    else:
        lets_go = "shift" if _SHIFTS.search(text) else ""
    car = "drive-truck" if _TRUCKS.search(text) else "drive-low" if _LOW.search(text) else "drive-car"
    way = Way(
        car=car,
        manner="hard" if _HARD.search(text) else "calm" if _CALM.search(text) else "",
        turns=sides,
        sharp=_SHARP.search(text) is not None,
        looks=False,
        lets_go=lets_go,
        side=LEFT if _LEFT_OFF.search(text) else RIGHT,
        seconds=seconds or rng.uniform(4.5, 7.0),
    )
    return drive(rng, way)
