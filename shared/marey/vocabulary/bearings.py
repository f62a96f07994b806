"""How a prompt has the body bear itself beside its action: "like a zombie", "sadly", "with arms crossed", "salutes".

The words and poses are in `bearings.toml`, those of small acts of head and hands in `small_acts.toml`;
`marey.vocabulary.bearing_spans` finds them in a prompt.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from typing import Any, Literal, cast

from marey.core.hashing import sha256_of
from marey.vocabulary.paces import Pace

Gait = Literal[
    "limp",
    "stagger",
    "high-knees",
    "skip",
    "foot-tap",
    "weight-shift",
    "stomp",
    "shuffle",
    "rope",
    "tiptoe",
    "one-line",
    "",
]
FEET: frozenset[Gait] = frozenset({"stomp", "foot-tap", "weight-shift"})
"""Movements of the feet of who stays where they are: one of its own where a verb says so."""
Side = Literal["left", "right", ""]
Vector = tuple[float, float, float]

_FILES = tuple(Path(__file__).with_name(f"{name}.toml") for name in ("bearings", "small_acts"))
_MACROS = Path(__file__).with_name("bearing_macros.toml")

DRAWN_AS: Mapping[str, str] = {"flinch": "flinch"}
"""Actions that are drawn as a gesture on a body that stands, since no network shows them, and that gesture."""
DRAWN_ON: Mapping[str, str] = {"carry": "load"}
"""Actions that are drawn on a walk, and the bearing of which the prompt names none of that kind."""
UPRIGHT = frozenset(
    {"idle", "walk", "walk-backward", "run", "sprint", "turn", "turn-around", "sidestep", *DRAWN_AS, *DRAWN_ON}
)
"""Actions in which the body is upright on its feet, and its arms swing or hang."""
ARMS_FREE = frozenset({"sit", "sit-down", "stand-up", "sit-floor", "kneel", "laugh"})
"""Other actions in which the arms do nothing."""
ARMS_HELD = frozenset({"jump", "jump-forward", "hop", "squat", "crouch", "balance"})
"""Actions beside which arms can be held, and nothing else of a bearing be drawn."""
ARMS_BUSY = frozenset({"wave", "clap", "talk", "nod", "raise-arm", "drink", "guide", "signal", "sneak"})
"""Actions in which trunk and head are free."""
SHOWN_BY: Mapping[tuple[str, str], str] = {
    ("happy", "jump"): "arms-jubilant",
    ("happy", "hop"): "arms-jubilant",
    ("happy", "jump-forward"): "arms-jubilant",
    ("scared", "walk-backward"): "hands-warding",
    ("angry", "stand-up"): "fists-down",
}
"""Arms by which a mood shows beside an action in which nothing else of it does, by the mood and the action."""
MOVES_ON_FEET = ARMS_BUSY | frozenset(
    {"aim", "arm-circles", "bend-over", "block", "bow", "cast-spell", "cheer", "crouch", "dance", "dribble"}
    | {"fight-stance", "hop", "jump", "jump-forward", "jump-turn", "karate", "kick", "kick-ball", "pick-up", "punch"}
    | {"push", "reach-forward", "reach-up", "shiver", "shoot", "shoot-basket", "slash", "spin", "squat", "stab"}
    | {"throw", "twist", "wash", "climb-stairs"}
)
"""Actions of a body on its feet in whose trunk and head a mood shows."""
LOW = ("knee", "foot")
"""Places of hands to which a body comes down where it stands, not on its way."""
Shown = Literal["body", "upper", "trunk", ""]
"""Parts of a bearing that are drawn beside an action: all, all but the legs, trunk and head alone, or none."""
_BRINGS = re.compile(
    r"\b(?:answers?|(?:aim|point|level|raise|shoulder|cross|fold|put|place|clasp|cover|clutch|grab|press|pick|pull|take|slump|sag)s?"
    r"|crosses|clasps|clutches|presses|places)\b"
)
"""Verbs, not in -ing, by which arms come to where they are held."""
_BOWS = re.compile(r"\b(?:lower|bow|hang|drop|bend)s?\b")
"""The same of the head."""
_ENDS = re.compile(r"\b(?:hang\w*|hung) up\b|\bends? the\b|\b(?:puts?|sets?|lowers?|putting|setting|lowering)\b")
OVERHEAD = re.compile(
    r"\boverhead\b(?! (?:lines?|lights?|projector|bin|locker))|\b(?:above|over) (?:(?:his|her|their|the|its) )?head\b"
    r"|\bup above\b"
    r"|\b(?:on|in|into|at|to|against|along) (?:(?:the|a|an) )?(?:\w+ )?(?:ceiling|rafters)\b|\bthe ceiling\b"
)
"""Words of work over the head."""
LEAST_STROKES_HZ = 1.1
"""Strokes a second from which on a number counts these, and not how often the whole gesture is made."""
RETURNS_S, ALIKE = 0.45, 0.06
"""Seconds in which a body returns to the first key for the next round, and metres or degrees up to which the last key
is like the first one."""
WORDS = ("how", "by", "beside", "meanwhile", "gaits", "loads", "read", "adjectives", "beings", "people")
"""Fields of a table of `bearings.toml` that hold words."""
UNLESS = "unless"
"""Field that holds words of prompts that ask for no such bearing."""
ONLY = "only"
"""Field that holds words of which a prompt has to have one in order to ask for the bearing."""


@dataclass(frozen=True)
class ArmPose:
    """Where an arm is.

    Attributes:
        at: what `hand` is measured from; empty = the hand follows from `upper` and `fore`.
        hand: of the wrist, outward, up and forward of it, metres.
        upper, fore: directions of upper arm and forearm, outward, up and forward; None = as it is.
        elbow: where it points.
        share: 0 to 1, of the way from where the motion has the arm.
        shake: metres by which the hand moves to and fro.
        hz: how often it does so in a second.
        path: places of the wrist, as `hand`, at the times of the keys of the bearing.
        plants: the hand goes along with the foot of the other side, and stands while that does, as on a cane.
    """

    at: str = ""
    hand: Vector | None = None
    upper: Vector | None = None
    fore: Vector | None = None
    elbow: Vector = (0.7, -1.0, -0.3)
    share: float = 1.0
    shake: Vector = (0.0, 0.0, 0.0)
    hz: float = 0.0
    path: tuple[Vector, ...] = ()
    plants: bool = False


@dataclass(frozen=True)
class Keys:
    """Poses that a body goes through in a bearing: over and over in work, once in a gesture.

    Attributes:
        times: seconds, from 0 on; the last one ends a round.
        trunk, twist, head, tilt, shrug, sink: at these times, beside what the bearing has throughout; empty = nothing.
            `twist`: degrees of the trunk towards its left.
    """

    times: tuple[float, ...]
    trunk: tuple[float, ...] = ()
    twist: tuple[float, ...] = ()
    head: tuple[float, ...] = ()
    tilt: tuple[float, ...] = ()
    shrug: tuple[float, ...] = ()
    sink: tuple[float, ...] = ()


@dataclass(frozen=True)
class Bearing:
    """One bearing; `bearings.toml` explains the numbers.

    Attributes:
        id: its name.
        gesture: done once, by itself or beside another action.
        fall_s: seconds in which a gesture ends; 0 = a little longer than it takes to begin.
        keys: what the body goes through; None = it stays as it is.
        load: something is carried in it.
        work: something that is done ("saws a plank"), not a way to do something else.
        moves: it is a movement of the whole body (`marey.generation.named`), made in place of a body that stands.
        mood: it shows in trunk and head beside whatever the arms do.
        approximated: it is only like what its words ask for, which no motion shows: scope says so.
        across: the arm that acts is not on the side that the words name: "rubs his left shoulder".
        also: actions beside which all of it is drawn, though the body is not upright in them, or its arms not free.
        arms: by `left` and `right`, those that it moves.
    """

    id: str
    gesture: bool = False
    trunk: float = 0.0
    aside: float = 0.0
    head: float = 0.0
    tilt: float = 0.0
    shrug: float = 0.0
    sink: float = 0.0
    back: float = 0.0
    swing: float = 1.0
    roll: float = 0.0
    roll_hz: float = 0.0
    twists: float = 0.0
    heave: float = 0.0
    heave_hz: float = 0.0
    sob: float = 0.0
    gait: Gait = ""
    pace: Pace = ""
    raise_s: float = 0.5
    fall_s: float = 0.0
    hold_s: tuple[float, float] = (1.0, 2.0)
    load: bool = False
    work: bool = False
    moves: bool = False
    mood: bool = False
    approximated: bool = False
    across: bool = False
    also: tuple[str, ...] = ()
    keys: Keys | None = None
    arms: Mapping[str, ArmPose] = field(default_factory=dict[str, ArmPose])

    @property
    def lasts(self) -> bool:
        """True if it goes on in the movements after its own."""
        return not (self.gesture or self.work)

    @property
    def stroke_hz(self) -> float:
        """Strokes a second of the hand that moves to and fro fastest; 0 if it makes none, or slow ones."""
        fastest = max((pose.hz for pose in self.arms.values()), default=0.0)
        return fastest if fastest >= LEAST_STROKES_HZ and self.keys is None else 0.0

    @property
    def returns_s(self) -> float:
        """Seconds from the last key back to the first; 0 where they are alike."""
        if self.keys is None:
            return 0.0
        ways = [pose.path for pose in self.arms.values() if pose.path]
        ways += [[(each,) for each in way] for way in (self.keys.trunk, self.keys.twist) if way]
        far = [max(abs(a - b) for a, b in zip(way[0], way[-1], strict=True)) for way in ways]
        return RETURNS_S if any(each > ALIKE for each in far) else 0.0

    def strokes_s(self, number: int) -> float:
        """Return the seconds of a number of strokes, or rounds through the keys; 0 if it has neither."""
        if self.keys is not None:
            return number * self.keys.times[-1] + (number - 1) * self.returns_s
        return number / self.stroke_hz if self.stroke_hz else 0.0

    @property
    def is_manner(self) -> bool:
        """True if it is a way to move, of which a body has one at a time."""
        return bool(self.pace or self.gait or self.roll or self.swing != 1.0)


@dataclass(frozen=True)
class StatedBearing:
    """A bearing that a prompt asks for.

    Attributes:
        name: its id.
        side: the one that the prompt names, of the arm that acts or the leg that hurts; empty if it names none.
        whole: it is said of the person, and holds for all that the person does.
        words: that ask for it.
        times: strokes that the prompt asks for, or how often the gesture is made; None = it names no number.
        hold_s: seconds for which the pose of the gesture is held; None = the prompt does not say.
    """

    name: str
    side: Side = ""
    whole: bool = False
    words: str = field(default="", compare=False)
    times: int | None = None
    hold_s: float | None = None

    @property
    def acts(self) -> Side:
        """The side of the arm that acts; empty if the words name none."""
        other: dict[Side, Side] = {"left": "right", "right": "left"}
        return other.get(self.side, "") if self.bearing.across else self.side

    @property
    def is_done(self) -> bool:
        """True if it is begun and ended in its movement: a gesture, or work of a number of strokes."""
        return self.bearing.gesture or (self.bearing.work and self.times is not None and self.bearing.strokes_s(1) > 0)

    @property
    def is_overhead(self) -> bool:
        """True if its words say of work that it is done over the head."""
        return self.bearing.work and OVERHEAD.search(self.words) is not None

    @property
    def first(self) -> str:
        """The first of its words."""
        return self.words.partition(" ")[0]

    @property
    def is_brought(self) -> bool:
        """True if its words say that arms or head come to their place, not that they are there: "answers the phone"."""
        if self.bearing.arms:
            return bool(_BRINGS.search(self.words))
        return bool(self.bearing.head and _BOWS.search(self.words))

    @property
    def ends(self) -> bool:
        """True if its words say that the arms come down again: "answers the phone and hangs up"."""
        return bool(self.bearing.arms and _ENDS.search(self.words))

    @property
    def bearing(self) -> Bearing:
        """The bearing itself."""
        return load_bearings()[self.name]

    def shown_in(self, action: str) -> Shown:
        """Return how much of it can be drawn on an action of the vocabulary.

        Beside what the arms do it is only what is said of the person.
        """
        bearing = self.bearing
        if bearing.moves:
            return "body" if action == "idle" else ""
        if any(pose.at in LOW for pose in bearing.arms.values()):
            return "body" if action == "idle" or action in bearing.also else ""
        if action in UPRIGHT or action in bearing.also:
            return "body"
        leans = bearing.trunk or bearing.head
        if bearing.mood and action in MOVES_ON_FEET:
            return "trunk"
        if action in ARMS_FREE:
            return "upper" if leans or bearing.arms or bearing.shrug else ""
        if action in ARMS_HELD:
            return "upper" if bearing.arms and not (leans or bearing.gesture or bearing.is_manner) else ""
        return "trunk" if action in ARMS_BUSY and self.whole and leans and not bearing.gesture else ""


def each_once(stated: Iterable[StatedBearing]) -> tuple[StatedBearing, ...]:
    """Return each bearing once; one that is said of the person anywhere is said of the person, and one
    whose end is told apart from it ("answers the phone, nods and hangs up") ends."""
    found: dict[str, StatedBearing] = {}
    for each in stated:
        known = found.get(each.name, each)
        words = f"{known.words} {each.words}" if each.ends and not known.ends else known.words
        found[each.name] = replace(
            known,
            side=known.side or each.side,
            whole=known.whole or each.whole,
            words=words,
            times=known.times or each.times,
            hold_s=known.hold_s or each.hold_s,
        )
    return tuple(found.values())


@lru_cache(maxsize=1)
def load_bearings() -> Mapping[str, Bearing]:
    """Return the bearings that this version ships, by id."""
    return {name: _bearing(name, values) for name, values in bearing_table().items()}


@lru_cache(maxsize=1)
def bearing_words() -> Sequence[tuple[str, Mapping[str, Sequence[str]]]]:
    """Return the words of each bearing, by its id and the field that holds them."""
    return [
        (name, {each: values[each] for each in WORDS if each in values}) for name, values in bearing_table().items()
    ]


@lru_cache(maxsize=1)
def bearing_macros() -> Mapping[str, str]:
    """Return the words that stand for others in the patterns of `bearings.toml`, in the order to replace them in."""
    return tomllib.loads(_MACROS.read_text("utf-8"))


@lru_cache(maxsize=1)
def bearing_table() -> Mapping[str, Any]:
    """Return the tables of all bearings, by id."""
    return {name: values for file in _FILES for name, values in tomllib.loads(file.read_text("utf-8")).items()}


@lru_cache(maxsize=1)
def bearings_sha256() -> str:
    """Return a hash of the tables of all bearings and of the words that stand for others in them."""
    return sha256("".join(map(sha256_of, (*_FILES, _MACROS))).encode()).hexdigest()


def _bearing(name: str, values: Mapping[str, Any]) -> Bearing:
    arms = cast("Mapping[str, Any]", values.get("arms", {}))
    sides = {side: arms.get(side) or arms.get("both") for side in ("left", "right")}
    poses = {side: ArmPose(**_tuples(pose)) for side, pose in sides.items() if pose is not None}
    keys = Keys(**_tuples(values["keys"])) if "keys" in values else None
    own = {key: value for key, value in values.items() if key not in ("arms", "keys", UNLESS, ONLY, *WORDS)}
    return Bearing(name, arms=poses, keys=keys, load="loads" in values, **_tuples(own))


def _tuples(values: Mapping[str, Any]) -> dict[str, Any]:
    return {name: _tuple(value) for name, value in values.items()}


def _tuple(value: Any) -> Any:
    return tuple(map(_tuple, cast("list[Any]", value))) if isinstance(value, list) else value
