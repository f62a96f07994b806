"""Words of ways of which models read another action, replaced before a prompt is read (ours)."""

from __future__ import annotations

import re

from marey.vocabulary.inflection import in_form_of

_UP_TO = re.compile(
    r"""\b(?P<way>(?:walk|run|jog|stroll|stride|march|step|go|come|sneak)(?:s|es|ing)?)\ (?:right\ |straight\ )?up\ to
    (?=\ (?:the|a|an|him|her|them|his|their|me|you)\b)
    (?!(?:\ \w+){1,2}\ (?:roof|attic|top|floor|summit|peak|stairs?|tower)\b)""",
    re.IGNORECASE | re.VERBOSE,
)
_DOWN = re.compile(
    r"""\bdown(?=\ (?:the|a|an|his|her|their|this|that)\ (?:[\w-]+\ ){0,2}
    (?:road|street|hall|hallway|corridor|aisle|path|catwalk|runway|alley|lane|sidewalk|pavement|avenue|track|beach
    |boardwalk|river|shore|trail|block|line|row|tunnel)\b)""",
    re.IGNORECASE | re.VERBOSE,
)
_GAITS = r"walk|run|jog|stroll|stride|march|sprint|hurry|hurri|trot|wander|trudge|limp|rush"
_RETURN = re.compile(
    rf"""\b(?P<way>(?:{_GAITS}|go|head|make(?P<his>s?\ (?:his|her|their|its)\ way)?)(?:e?s|ing)?)\ back
    (?=\ (?:to|home|into|in|inside|towards?|again|through|across|along|down|up)\b)(?!\ (?:and|to\ back)\b)""",
    re.IGNORECASE | re.VERBOSE,
)
"""A way to where the person was before: "walks back to his car"."""
_TURNED_BACK = re.compile(
    rf"""(?P<turn>\b(?:turns?|turning|spins?|spinning|whirls?|swings?|wheels?|pivots?|does\ an\ about[ -]face)
    (?:\ (?:around|round|about|back))?(?:\ 180(?:\ degrees|°)?)?
    (?:[,.;]|,?\ (?:and(?:\ then)?|then|to)|\ ?(?:->|→|>))\ )
    (?P<way>(?:{_GAITS}|go)(?:e?s|ing)?)\ back(?!wards?\b|\ (?:and|to|home|into|in|inside)\b)""",
    re.IGNORECASE | re.VERBOSE,
)
"""A way behind a turn: "turns around and walks back"."""
WAYS_TO_AND_FRO = 3
"""Ways of who paces back and forth."""
_STEPS = r"(?:stairs|steps|staircase|stairway|stairwell|flight(?:\ of\ (?:stairs|steps))?)"
_DOWN_AGAIN = re.compile(
    rf"""(?P<up>\b(?:(?:climb|ascend|mount)(?:s|ed|ing)?|[a-z]+\ (?:\w+ly\ )?up)\ (?!down\b|and\b)
    [^.;]{{0,40}}?\b{_STEPS}\b|\b[a-z]+\ upstairs\b)
    (?P<more>[^.;]{{0,60}}?)(?P<joint>,?\ (?:and\ then|and|then|before)\ |,\ )
    (?:(?:he|she|they)\ )?(?:\w+ly\ )?
    (?P<way>(?:{_GAITS}|go|head|com|step|climb)(?:e?s|ies|ing|e|y)?\ )?(?P<back>back\ )?down(?:\ again)?
    (?:\ (?:(?:the|those|these)\ )?(?:{_STEPS}|them))?(?:\ again)?(?=\W*$|[,.;]|\ (?:and|then)\b)""",
    re.IGNORECASE | re.VERBOSE,
)
"""Stairs that are gone down again: "walks up the stairs and then back down"."""
_UP_AND_DOWN = re.compile(
    rf"""\b(?P<way>[a-z]+)(?P<how>\ \w+ly)?\ up\ and\ (?:back\ |then\ )?down
    \ (?P<steps>(?:the|a|some|his|her)\ {_STEPS})\b""",
    re.IGNORECASE | re.VERBOSE,
)
"""The same in one breath: "runs up and down the stairs"."""
_TO_AND_FRO = re.compile(
    r"""\b(?P<way>pac|walk|strid|stride|march|wander|stroll|run|runn|jog|jogg)(?P<end>es|s|ing|e)?[ ]
    (?:(?:nervous|anxious|impatient|restless|angr|slow|quick)\w*\ )?
    (?:back\ and\ forth|to\ and\ fro|up\ and\ down(?!\ (?:the\ )?(?:stairs?|steps|hill)))
    (?:(?:\ (?:nervous|anxious|impatient|restless|angr|slow|quick)\w*)?
    \ (?:for\ (?:a\ (?:while|long\ time|bit)|some\ time)|again\ and\ again|over\ and\ over|repeatedly
    |(?:several|many|a\ few)\ times))?""",
    re.IGNORECASE | re.VERBOSE,
)
"""A way with turns: "paces back and forth"."""
_EXITS = re.compile(
    r"""(?<!\bhis\ )(?<!\bher\ )(?<!\btheir\ )(?<!\bits\ )(?<!\bthe\ )(?<!\bmy\ )(?<!\ba\ )
    \b(?:exit|leave|head|go)(?P<end>e?s|ing)?(?:\ (?:the\ )?(?:stage|scene|screen|frame|off|away|out))*
    (?:\ (?:to|towards?)\ (?:the|his|her|their)|\ stage|\ screen|(?<=exits)|(?<=heads)|(?<=exit)|(?<=head))
    \ (?P<side>left|right)\b(?!\ (?:hand|arm|foot|leg|shoulder|side|elbow|fist))""",
    re.IGNORECASE | re.VERBOSE,
)
"""A way to a side whose verb names no gait: "exits stage left"."""
_LEAVES = re.compile(
    r"""(?P<joint>(?:^|[,;]\ |\b(?:and|then|before)\ )(?:(?:and|then|before)\ )*(?:(?:he|she|they|it)\ )?(?:\w+ly\ )?)
    leav(?P<end>es|ing)(?=\W*$|[,.;]|\ (?:and|then)\b|\ (?:\w+ly|again)\W*$)""",
    re.IGNORECASE | re.VERBOSE,
)
"""The end of a scene whose verb names no gait: "bows and leaves"."""


def with_stairs_down(prompt: str) -> str:
    """Return a prompt in which who goes up the stairs and "back down" turns around at their end."""
    return _DOWN_AGAIN.sub(_down_again, _UP_AND_DOWN.sub(_up_and_down, prompt))


def with_ways_ahead(prompt: str) -> str:
    """Return a prompt in which who "walks up to the door" goes there, and who "walks down the street" along it: of "up"
    and "down" models read a climb. Who "walks back to his car" or "turns around and walks back" walks ahead."""
    text = _DOWN.sub("along", _UP_TO.sub(r"\g<way> to", prompt))
    return _RETURN.sub(r"\g<way>", _TURNED_BACK.sub(r"\g<turn>\g<way> forward", text))


def with_turns_between(prompt: str) -> str:
    """Return a prompt in which who "paces back and forth" turns on the way."""
    return _TO_AND_FRO.sub(_with_turns, prompt)


def with_exits(prompt: str) -> str:
    """Return a prompt in which who "exits stage left" or "leaves" walks off."""
    return _LEAVES.sub(_walks_away, _EXITS.sub(_walks_off, prompt))


def _up_and_down(found: re.Match[str]) -> str:
    """Return a way up stairs and down, told one after the other."""
    way, how, steps = found["way"], found["how"] or "", found["steps"]
    return f"{way}{how} up {steps}, {in_form_of(way, 'turn')} around and {way}{how} down {steps}"


def _down_again(found: re.Match[str]) -> str:
    """Return a way up stairs, the turn at their end, and the way down."""
    if not (found["way"] or found["back"]):
        return found[0]
    verb = found["up"].split()[0]
    way = (found["way"] or in_form_of(verb, "walk")).strip()
    turned = re.search(r"\b(?:turn|spin|pivot)\w*", found["more"], re.IGNORECASE)
    joint = found["joint"] if turned else f", {in_form_of(verb, 'turn')} around and "
    return f"{found['up']}{found['more']}{joint}{way} down the stairs"


def _with_turns(found: re.Match[str]) -> str:
    """Return a way to and fro, told as ways and turns."""
    end, way = (found["end"] or "").removesuffix("e"), found["way"].lower()
    way = "jog" if way.startswith("jog") else "run" if way.startswith("run") else "walk"
    if end.endswith("ing"):
        goes, turns = f"{way}{way[-1] if way != 'walk' else ''}ing forward", "turning around"
        return ", ".join([goes, *[f"{turns} and {goes}"] * (WAYS_TO_AND_FRO - 1)])
    goes, turns = (f"{way}s forward", "turns around") if end else (f"{way} forward", "turn around")
    between = f", {turns}, {goes}" * (WAYS_TO_AND_FRO - 2)
    return f"{goes}{between}, {turns} and {goes}"


def _walks_off(found: re.Match[str]) -> str:
    """Return a way to a side as a walk."""
    return f"{in_form_of(found['end'] or '', 'walk')} off to the {found['side']}"


def _walks_away(found: re.Match[str]) -> str:
    """Return who goes away as who walks, in the form of the verb that is found."""
    return f"{found['joint']}{in_form_of(found['end'], 'walk')} away"
