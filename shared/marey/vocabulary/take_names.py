"""Names of takes in shot lists, such as "LOCO_walk_limp_L" or "DEATH_BACKWARD_01", as the words that they stand for."""

from __future__ import annotations

import itertools
import re

from marey.vocabulary.inflection import third_person
from marey.vocabulary.lengths import known_verb_forms
from marey.vocabulary.word_lists import load_word_lists

_NAME = re.compile(r"(?<![\w/.@])\w*[^\W_]_[^\W_]\w*(?![\w/@])")
"""A word with an underscore inside."""
_PARTS = re.compile(r"\d+deg|[A-Z]{2,}(?=[A-Z][a-z])|[A-Z]?[a-z']+|[A-Z]+|\d+")
_ABBREVIATED = {
    "l": "left",
    "lt": "left",
    "lft": "left",
    "r": "right",
    "rt": "right",
    "rgt": "right",
    "f": "forward",
    "fw": "forward",
    "fwd": "forward",
    "b": "backward",
    "bw": "backward",
    "bwd": "backward",
    "bk": "backward",
    "bck": "backward",
    "cw": "clockwise",
    "ccw": "counterclockwise",
    "atk": "attack",
    "crch": "crouch",
}
_SAID_NOTHING = frozenset(
    """anim animation anims char character clip cine cinematic cycle enemy final fullbody generic hero inplace ip
    loco locomotion loop lp mc mixamo mocap mvmt mvt new npc pc player ref rm root rootmotion sc scene seq temp
    test tk unarmed v var variant variation ver wip""".split()  # noqa: SIM905 - a list of words
)
"""Parts that say who, which or how it is kept, but not what is done."""
_CATEGORIES = frozenset(
    "emote emotes emt trv trav traversal gesture gestures gest interact interaction act action".split()  # noqa: SIM905
)
"""First parts that say what kind of take it is, where others say what is done: "EMOTE_facepalm"."""
_HITS = frozenset({"hit", "hitreact", "hitreaction", "hr"})
"""First parts of takes of who is hit."""
_REACTS = frozenset({"react", "reaction", "reacts"})
_STRUCK_PARTS = frozenset(
    "head face chest stomach belly gut torso shoulder arm leg knee back side".split()  # noqa: SIM905
)
"""Parts of the body that are hit."""
_DEATHS = frozenset({"death", "deaths", "die", "dies", "dying", "dead"})
"""First parts of takes of who dies; what such a body did before is no movement behind it: "DEATH_walk_forward"."""
_WAYS = frozenset("walk walking run running sprint sprinting jog jogging".split())  # noqa: SIM905
_RESTS = frozenset({"idle", "stand", "sit", "wait", "sneak", "crawl", "dance", "talk"})
_BREATHS = frozenset({"breathe", "breathes", "breathing", "breath"})
_HARD = frozenset({"heavy", "heavily", "hard", "deep", "deeply", "fast", "exhausted", "out", "after"})
"""Words of breaths that show."""
_FIGHTS = frozenset({"combat", "fight", "fighting", "battle"})
_UPRIGHT = frozenset({"standing", "stand", "stood"})
_STANDS = re.compile(
    r"\b(?:stand|standing|stood)(?= (?:up|down|still|guard|around|ready|at|by|on|in|with|off|long|broad|back|split)\b)"
)
"""A posture that is what is done, or part of its name: "stand up", "standing long jump"."""
_OTHER_POSTURE = re.compile(r"^(?:sit|seat|crouch|kneel|squat|l(?:ie|y)|lay|prone|supine|get|rise|to$|from$|up$|down$)")
"""Beginnings of words beside which a body comes to stand, or leaves it: "sit_to_stand"."""
_ORDERED = frozenset({"then", "and", "to"})
"""Parts between those of one fall: "DEATH_knees_then_forward"."""
_SUCH = frozenset({"old", "young", "elderly", "little", "big", "fat", "tall", "small", "heavy"})
"""Words before who does it."""
_STRIKES = "punch(?:es)?|jabs?|hooks?|cross|uppercuts?|elbows?|knees?|kicks?|roundhouse|blocks?|slash(?:es)?|stabs?"
_LETTERED = re.compile(rf"\b(?P<blow>{_STRIKES})[ ](?P<side>[lr])\b(?!['’])", re.IGNORECASE)
"""A blow with the letter of its side: "punch L"."""
_HITS_NUMBERED = re.compile(r"^(\d{1,2})(hits?|x|steps?|times)$")
"""A number with what it counts: "3hit"."""
_TIMES = re.compile(r"^x\d{1,2}$")
_SLASHED = re.compile(r"(?<!\w)w/o?(?=\s|\w)", re.IGNORECASE)
_NUMBERED = re.compile(r"^(?:v|tk|take|sc|shot|var|seq)?\d+[a-z]?$")
_ANGLE = re.compile(r"^(45|90|135|180|270|360)(?:deg)?$")
_COUNTED = frozenset({"take", "shot", "clip", "scene"})
"""Parts that a number comes behind, with which they say nothing: "take_02", but "take_cover"."""


def as_words(text: str) -> str:
    """Return a prompt with names of takes in it as words: "idle injured" for "idle_injured", "walk limp left" for
    "LOCO_walk_limp_L", "with" for "w/", "punch left" for "punch L". Any other text is returned as it is.

    Numbers of takes, and parts that say who it is or how it is kept (`NPC`, `loop`), are left out; angles stay.
    """
    said = _SLASHED.sub(lambda found: "without " if found[0][-1] in "oO" else "with ", text)
    said = _LETTERED.sub(lambda found: f"{found['blow']} {_ABBREVIATED[found['side'].lower()]}", said)
    said = _NAME.sub(_words_of, said)
    return text if said == text else " ".join(said.split()).lstrip(" -,:;") or text


def _words_of(name: re.Match[str]) -> str:
    parts = [part for piece in name[0].split("_") for part in _pieces(piece)]
    said = [word for part, after in itertools.pairwise([*parts, ""]) if (word := _word(part, after))]
    if len(said) > 1 and said[0] in _CATEGORIES:
        said = said[1:]
    if said and said[0] in _DEATHS:
        said = [word for word in said if word not in _ORDERED | _WAYS]  # one fall
    said = _without_rest(_of_hit(_person_first(said)))
    return " ".join(_with_verb(said)) or name[0].replace("_", " ")


def _without_rest(said: list[str]) -> list[str]:
    """Return the words of a take without those of a body that stands and breathes, where others say what it does:
    "combat idle" of "idle combat breathing", "soldier reload" of "soldier reload standing"."""
    if "idle" in said and not _HARD & set(said):
        said = [word for word in said if word not in _BREATHS]
        if fights := [word for word in said if word in _FIGHTS]:
            said = [*fights, "idle", *(word for word in said if word not in _FIGHTS | {"idle"})]
    if _STANDS.search(" ".join(said)) or any(_OTHER_POSTURE.match(word) for word in said):
        return said
    acts = [word for word in said if word not in _UPRIGHT]
    people = load_word_lists().people
    return acts if any(word in known_verb_forms() and word not in people for word in acts) else said


def _with_verb(said: list[str]) -> list[str]:
    """Return the words of a take that begins with who does it as a sentence: "soldier reloads" of "soldier reload"."""
    at = 2 if said and said[0] in _SUCH else 1
    names_take = _WAYS | _RESTS | _DEATHS | _HITS | _REACTS
    if len(said) <= at or said[at - 1] not in load_word_lists().people or said[at] in names_take:
        return said
    verb = said[at]
    if verb not in known_verb_forms() or third_person(verb) not in known_verb_forms():
        return said
    return [*said[:at], third_person(verb), *said[at + 1 :]]


def _person_first(said: list[str]) -> list[str]:
    """Return the words of a take with who does it before what is done: "old man walk" of "walk old man"."""
    people = load_word_lists().people
    if len(said) < 2 or said[-1] not in people or said[0] not in _WAYS | _RESTS:
        return said
    at = -2 if len(said) > 2 and said[-2] in _SUCH else -1
    return [*said[at:], *said[:at]]


def _of_hit(said: list[str]) -> list[str]:
    """Return the words of a take of who is hit as a sentence: "gets hit in the left shoulder" of "hit shoulder left";
    any others as they are."""
    rest = [word for word in said[1:] if word not in _REACTS]
    struck = [word for word in rest if word in _STRUCK_PARTS]
    if not said or said[0] not in _HITS or not struck or len(said) < 2:
        return said
    sides = [word for word in rest if word in ("left", "right")]
    others = [word for word in rest if word not in (*struck, *sides)]
    if struck == ["back"]:
        return ["gets hit from behind", *sides, *others]
    return ["gets hit in the", *sides[:1], struck[0], *others]


def _pieces(piece: str) -> list[str]:
    """Return the words of a part between underscores, in lower case: "walk" and "fwd" of "WalkFwd"."""
    lowered = piece.lower()
    if _TIMES.match(lowered):
        return [lowered]
    if counted := _HITS_NUMBERED.match(lowered):
        return [f"{counted[1]} {counted[2]}"]
    return [lowered] if _NUMBERED.match(lowered) else [found.lower() for found in _PARTS.findall(piece)]


def _word(part: str, after: str) -> str:
    """Return what a part says; `after`: the part behind it, empty behind the last."""
    if angle := _ANGLE.match(part):
        return f"{angle[1]} degrees"
    if _NUMBERED.match(part) or (part in _COUNTED and _NUMBERED.match(after)):
        return ""
    if not after and part in "abc":
        return ""
    return "" if part in _SAID_NOTHING else _ABBREVIATED.get(part, part)
