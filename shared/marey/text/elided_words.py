"""Words that prompts leave out, written back before they are read (ours): the verb of what is done on one side and then
on the other ("points left, then right"), and the ends of takes that a name says ("walk start", "idle to run")."""

from __future__ import annotations

import re

from marey.vocabulary.inflection import third_person
from marey.vocabulary.lengths import TO_TWELVE

_NUMBER = rf"(?:{TO_TWELVE}|\d{{1,2}})"
_TIMES = rf"(?:once|twice|thrice|{_NUMBER}[ ](?:more[ ])?times)"
_LIMB = r"(?:hand|arm|foot|leg|knee|fist|elbow|palm|side|shoulder|forearm|heel)"
_ON = r"(?:on|with|to|using|from|over)"
_OWN = r"(?:(?:the|his|her|their|its|your|my)[ ])?"
_OTHER_SIDE = re.compile(
    rf"""(?:^|(?<=[,;.]\ )|(?<=\band\ )|(?<=\bthen\ ))
    (?P<who>(?:(?:a|an|the|this|that|one|my)\ (?:[\w-]+\ ){{1,3}}?(?=(?:is\ )?\w+(?:s|ing)\ )
    |he\ |she\ |they\ )?(?:is\ )?)
    (?P<number>{_NUMBER}\ (?:more\ )?)?(?P<verb>(?!(?:left|right|a|an|the|his|her|and|then)\b)[a-z]+)
    (?P<how>(?:\ (?!(?:and|then|left|right|{_TIMES}
    |{_ON}\ (?:(?:the|his|her|their|your|my)\ )?(?:left|right))\b)[\w'-]+){{0,5}})
    (?P<times>\ {_TIMES})?(?P<on>\ {_ON})?\ (?P<own>{_OWN})
    (?P<side>left|right)(?P<limb>\ {_LIMB})?(?P<after>\ {_TIMES})?
    (?P<join>,?\ (?:and\ )?then\ |,\ |,?\ and\ )
    (?P<again>(?:{_TIMES}|{_NUMBER})\ )?
    (?:(?P<verb2>[a-z]+)\ )??(?:{_ON}\ )?{_OWN}
    (?P<other>left|right)(?P<limb2>\ (?:{_LIMB}|one))?
    (?P<last>\ {_TIMES})?
    (?=\W*$|;|\.|,?\ (?:and\ )?then\b|,?\ and\ (?!(?:left|right|the|then)\b)[a-z]+s\b|,\ (?!left\b|right\b))""",
    re.IGNORECASE | re.VERBOSE,
)
_PLACE = (
    r"(?:(?:to|at|toward|towards|over|behind|into)\ (?!(?:and|then)\b)[\w'-]+"
    r"(?:\ (?!(?:and|then|before|while|as)\b)[\w'-]+){0,3}?"
    r"|straight\ (?:up|down|ahead)|up|down|left|right|ahead|forwards?|behind)"
)
"""Places that a hand points to."""
_ALSO = r"(?:,?\ (?:and\ )?then\ |,\ and\ |,\ |\ and\ )"
_PLACES_END = r"(?=\W*$|[,.;]|\ (?:and|then)\b)"
_PLACES = re.compile(
    rf"""\b(?P<verb>point|gesture)(?P<s>s)?
    (?P<how>\ (?:(?:his|her|their|a|the)\ )?(?:left\ |right\ )?(?:finger|hand|arm|thumb))?
    \ (?P<first>{_PLACE})(?P<rest>(?:{_ALSO}{_PLACE})+){_PLACES_END}""",
    re.IGNORECASE | re.VERBOSE,
)
"""Places that a hand points to one after the other: "points left, at the door and up"."""
_NEXT_PLACE = re.compile(rf"{_ALSO}(?={_PLACE}{_PLACES_END})", re.IGNORECASE)
_READ_AS_ONE = re.compile(
    r"^(?:look|glanc|gaz|peer|peek|star|check|scan|watch|punch|jab|hook|cross|uppercut|strik|box|sway|shift|rock|dodg|duck|weav|turn"
    r"|shak|nod|wobbl|block|pac|sling|wag)",
    re.IGNORECASE,
)
"""Verbs whose sides are read together, one after the other."""
_WAYS = {
    **dict.fromkeys(("walk", "run", "jog", "sprint", "sneak", "crawl", "march", "dance", "limp", "swim"), ""),
    "walking": "walk",
    "running": "run",
    "jogging": "jog",
    "sprinting": "sprint",
    "locomotion": "walk",
}
_WAY = (
    rf"(?P<way>{'|'.join(sorted(_WAYS, key=len, reverse=True))})"
    r"(?P<how>\ (?:forwards?|backwards?|left|right|slow|fast))?"
)
_NEXT_WAY = _WAY.replace("<way>", "<next>").replace("<how>", "<next_how>")
_STARTS = re.compile(
    rf"^\W*(?:(?:start|begin)\ (?P<first>{'|'.join(_WAYS)})|{_WAY}\ (?:start|begin|starting)"
    rf"|(?:idle|stand|standing|stop|rest)\ (?:to|into|2)\ {_NEXT_WAY})"
    r"(?P<ends>\ (?:to|and|then)\ (?:stop|idle|end|stand|halt))?\W*$",
    re.IGNORECASE | re.VERBOSE,
)
"""Names of takes in which a body that stands begins to go: "walk start", "idle to run", "run start to stop"."""
_STOPS = re.compile(
    rf"^\W*{_WAY}\ (?:(?:to|into|2)\ (?:an?\ )?)?(?:stop|idle|end|stand|halt|rest)\W*$", re.IGNORECASE | re.VERBOSE
)
"""The same of one that comes to rest: "walk stop", "run to idle"."""
_THEN = ", then "
_COUNTED_AND_MORE = re.compile(
    rf"""\b(?P<verb>[a-z]+)\ {_NUMBER}(?:\ (?!(?:and|then|more)\b)[a-z-]+){{0,2}}?
    \ (?P<noun>(?!(?:times|seconds|minutes|met(?:er|re)s|feet|yards|degrees)\b)[a-z-]+s)\b
    [^.;]*?(?:,|\band|\bthen)(?:\ (?P<again>tak|do|mak|throw|perform|land|execut)(?:e?s|es|ing|e)?)?
    \ (?P<more>(?:another\ )?(?:{_NUMBER}|a\ few)(?:\ more)?)
    (?=\W*$|[,.;]|\ (?:and|then|to|back|forwards?|backwards?|left|right|in|with|on)\b)""",
    re.IGNORECASE | re.VERBOSE,
)
"""A count of something, and another without its name: "takes four steps, turns left and takes two more"."""
_STANDS_UP = re.compile(
    r"""\b(?:kneel(?:s|ing)?|sit(?:s|ting)?|l(?:ies?|ays?|ying)|crouch(?:es|ing)?)\b
    (?:(?!\b(?:stand|get|rise|up|walk|run)\w*)[^.;])*?
    (?:,\ (?:and\ )?(?:then\ )?|\ and\ (?:then\ )?|\ then\ )(?:(?:he|she|they)\ )?(?:(?:slowly|quickly)\ )?
    (?:stands?|standing|ris(?:es?|ing))(?=\W*$|[,;.]|\ (?:and|then|again)\b)
    (?!(?:,|\ and)\ (?:still|there|straight)\b)""",
    re.IGNORECASE | re.VERBOSE,
)
"""A body that sits, kneels or lies, and then "stands"."""
_HEIGHT = r"(?:high|low|middle|mid|overhead)"
_AT_HEIGHTS = re.compile(
    rf"""(?:^|(?<=[,;.:]\ )|(?<=\band\ )|(?<=\bthen\ ))
    (?P<who>(?:(?:a|an|the)\ (?:[\w-]+\ ){{1,2}}?(?=\w+s\ )|he\ |she\ )?)
    (?P<verb>blocks?|parr(?:y|ies)|kicks?|slash(?:es)?|deflects?|guards?)\ (?P<first>{_HEIGHT})
    (?:,?\ and\ then\ |,?\ then\ |,?\ and\ |,\ |\ /\ )(?:(?P=verb)\ )?(?P<second>{_HEIGHT})
    (?=\W*$|[,;.]|\ (?:and|then)\b)
    |(?:^|(?<=[,;.:]\ ))(?P<high>{_HEIGHT})\ (?P<noun>block|parry|kick|slash|guard)
    (?:,?\ and\ then\ |,?\ then\ |,?\ and\ |,\ )(?P<low>{_HEIGHT})\ (?P=noun)(?=\W*$|[,;.])""",
    re.IGNORECASE | re.VERBOSE,
)
"""A deed at one height and then at another: "block high, block low", "blocks high and low"."""
_PLURAL = re.compile(r"(?<=[cs]h)es$|(?<=[sx])es$|s$")
_RESTS = re.compile(
    r"(?:stand|stop|halt|rest|wait|pause)s?(?: (?:still|there|up|straight|upright|again))*\W*$", re.IGNORECASE
)
_SIDES = frozenset(("left", "right"))
_WORD = re.compile(r"[a-z]+")


def parts_by_sides(prompt: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the parts of a prompt that has one movement done on one side and then on the other, such as "points left,
    then points right", and, apart, the words behind them that have the body stand; none of any other."""
    parts = tuple(prompt.split(_THEN))
    rests = parts[2:]
    parts = parts[:2]
    if len(parts) != 2 or len(rests) > 1 or not all(map(_RESTS.match, rests)) or re.search(r"[;,]|\band\b", parts[1]):
        return (), ()
    first, second = (_WORD.findall(part.lower()) for part in parts)
    verb = next((word for word in second if not re.fullmatch(_NUMBER, word)), "")
    sides = [_SIDES.intersection(words) for words in (first, second)]
    in_turn = len(sides[0]) == 1 == len(sides[1]) and sides[0] != sides[1]
    if not in_turn or verb not in first or "and" in first or _READ_AS_ONE.match(verb):
        return (), ()
    return parts, rests


def with_elided(prompt: str) -> str:
    """Return a prompt with the words that it leaves out: "points left, then points right" of "points left, then right",
    "stands still, then walks" of "walk start". Any other prompt is returned as it is."""
    prompt = _STANDS_UP.sub(r"\g<0> up", prompt)
    prompt = _COUNTED_AND_MORE.sub(_counted_again, _PLACES.sub(_pointed_again, prompt))
    prompt = _AT_HEIGHTS.sub(_at_each_height, prompt)
    return _OTHER_SIDE.sub(_said_again, _STOPS.sub(_stopping, _STARTS.sub(_starting, prompt)))


def _at_each_height(found: re.Match[str]) -> str:
    """Return what is done at one height, and again with its verb at the other."""
    first, second = found["first"] or found["high"], found["second"] or found["low"]
    verb = found["verb"] or third_person(found["noun"].lower())
    if first.lower() == second.lower():
        return found[0]
    return f"{found['who'] or ''}{verb} {first}, then {verb} {second}"


def _counted_again(found: re.Match[str]) -> str:
    """Return what is counted, with its name where it is counted again."""
    more = found["more"].lower()
    if "more" not in more and "another" not in more:
        return found[0]
    verb = "" if found["again"] else f"{found['verb'].lower()} "
    noun = found["noun"].lower()
    if re.match(r"(?:another )?(?:one|1)\b", more):
        noun = _PLURAL.sub("", noun)
    return f"{found[0][: found.start('more') - found.start()]}{verb}{more} {noun}"


def _pointed_again(found: re.Match[str]) -> str:
    """Return what a hand does, with its verb before each place."""
    act = f"{found['verb'].lower()}{found['s'] or ''}{found['how'] or ''}"
    first = found[0][: found.start("rest") - found.start()]
    return first + _NEXT_PLACE.sub(f", then {act} ", found["rest"])


def _said_again(found: re.Match[str]) -> str:
    """Return what is done on one side, and again with its verb on the other."""
    counted = bool(found["again"] or found["last"])
    one_of_both = "then" not in found["join"] and not counted
    other_verb = found["verb2"] is not None and found["verb2"].lower() != found["verb"].lower()
    as_one = _READ_AS_ONE.match(found["verb"]) is not None and not counted
    if found["side"].lower() == found["other"].lower() or one_of_both or other_verb or as_one:
        return found[0]
    again = (found["again"] or "").strip()
    is_number = bool(again) and "times" not in again and again not in ("once", "twice", "thrice")
    verb = found["verb"].lower()
    if found["number"]:
        act = f"{again or found['number'].strip()} {verb}{found['how']}"
        times = ""
    else:
        act = f"{verb}{found['how']}"
        times = (
            f"{again} times"
            if is_number
            else again or (found["last"] or found["times"] or found["after"] or "").strip()
        )
    limb = (found["limb2"] if found["limb2"] not in (None, " one") else found["limb"]) or ""
    on = f"{found['on'] or ''} {found['own'] or ''}{found['other']}{limb}"
    first = found[0][: found.start("join") - found.start()]
    return f"{first}, then {act}{f' {times}' if times else ''}{on}"


def _third(way: str, how: str | None) -> str:
    """Return a way in the third person: "walks forward"."""
    return third_person(_WAYS[way.lower()] or way.lower()) + (how or "")


def _starting(found: re.Match[str]) -> str:
    """Return a body that stands, and then goes."""
    way = found["first"] or found["way"] or found["next"]
    goes = _third(way, found["how"] or found["next_how"])
    return f"stands still, then {goes}{', then stops' if found['ends'] else ''}"


def _stopping(found: re.Match[str]) -> str:
    """Return a way, and a body that stops."""
    return f"{_third(found['way'], found['how'])} and stops"
