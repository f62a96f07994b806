"""Sentences that tell first what is done last, put in the order of time (ours).

"Stabs and retreats after sneaking up", "claps before standing up", "bows, but first he waves", "the sit-ups follow the
push-ups", "kneels when he has finished waving".
"""

from __future__ import annotations

import re
from collections.abc import Callable

from marey.vocabulary.inflection import in_form_of

WHO = r"(?:he|she|they|it|(?:the|a|an|his|her|their|our|my) (?:[\w-]+ ){0,2}?[\w-]+)"
"""Words of who does something."""
_ENDS = r"(?P<end>[.!]?)$"
_AFTER_BOTH = re.compile(
    rf"^(?P<who>{WHO}) (?P<later>[a-z]+s\b(?:(?!\bthen\b)[^,.;])* and (?:(?!\bthen\b)[^,.;])+?) (?:right |just )?after"
    rf" (?P<first>[a-z]+ing\b[^,.;]*?){_ENDS}",
    re.IGNORECASE,
)
_RIGHT = r"(?<!the )(?<!his )(?<!her )(?<!to )(?<!turn )(?<!turns )right "
_BEFORE_DOING = re.compile(
    rf"^(?P<first>(?:(?!\bnot\b)[^.;])+?),? (?:{_RIGHT}|just |shortly )?before"
    rf" (?P<later>(?!(?:land|train|stopp|com|gett|go|hav|be|mak)ing\b)[a-z]+ing\b[^,.;]*?){_ENDS}",
    re.IGNORECASE,
)
_WHEN_FINISHED = re.compile(
    rf"^(?P<who>{WHO}) (?P<later>[^,.;]+?) (?:when|once|as soon as|after) (?:he|she|they|it)(?:'s| is| has| have)?"
    rf" (?:finish(?:es|ed)?|done|stops|stopped) (?P<first>[a-z]+ing\b[^,.;]*?){_ENDS}",
    re.IGNORECASE,
)
_BUT_FIRST = re.compile(
    rf"^(?P<later>[^.;]+?),? but (?:first(?: of all)?,? (?P<one>[^.;]+?)|(?P<other>[^,.;]+?) first){_ENDS}",
    re.IGNORECASE,
)
_DENIES = re.compile(r"\b(?:not|never|no|without)\b|n't\b", re.IGNORECASE)
_FOLLOWS = re.compile(
    rf"^(?P<later>(?:(?:the|a|an|some) )?[\w-]+(?: [\w-]+)?) (?:follows?|comes? (?:right )?after)"
    rf" (?P<first>(?:(?:the|a|an|some) )?[\w-]+(?: [\w-]+)?){_ENDS}",
    re.IGNORECASE,
)
_MOVES = re.compile(
    r"\b(?:he|she|they|man|woman|person|boy|girl|someone|dog|path|road|trail|track|him|her|them|line)\b", re.IGNORECASE
)
"""Words of who follows, or what is followed on the way."""
_AFTERWARDS = re.compile(
    rf"^before (?P<later>[a-z]+ing\b(?: (?!(?:he|she|they)\b)[\w'-]+)*),? (?P<first>(?:he|she|they)\b[^,.;]+?),?"
    rf" and (?:afterwards|after that|then) (?P<last>[^.;]+?){_ENDS}",
    re.IGNORECASE,
)
_DOWN_TO = re.compile(
    r"\b(?P<sits>(?P<verb>sits?|lies?) down(?: (?:on|in|at|by) (?:(?!to\b)[\w-]+ ){0,3}?[\w-]+)?) to"
    r" (?P<does>drink|eat|read|write|clap|talk|think|sleep|rest|type|pray|meditate|wave|sing|knit|sew|phone|smoke)\b",
    re.IGNORECASE,
)


def told_in_order(prompt: str, does: Callable[[str], str | None]) -> str:
    """Return a prompt with what is done first told first; any other prompt as it is.

    Args:
        prompt: of one sentence or several; those of several are returned as they are.
        does: returns a phrase that begins with a verb in -ing in the third person, None if the verb is not known.
    """
    if (found := _AFTERWARDS.match(prompt)) and (later := does(found["later"])):
        return f"{found['first']}, then {later}, then {found['last']}{found['end']}"
    for pattern in (_AFTER_BOTH, _WHEN_FINISHED):
        found = pattern.match(prompt)
        first = does(found["first"]) if found else None
        if found and first:
            return f"{found['who']} {first}, then {found['later']}{found['end']}"
    if (found := _BUT_FIRST.match(prompt)) and _DENIES.search(prompt) is None:
        return f"{found['one'] or found['other']}, then {found['later'][:1].lower()}{found['later'][1:]}{found['end']}"
    if (found := _FOLLOWS.match(prompt)) and _MOVES.search(prompt) is None:
        return f"{found['first']}, then {found['later'][:1].lower()}{found['later'][1:]}{found['end']}"
    if (found := _BEFORE_DOING.match(prompt)) and (later := does(found["later"])):
        return f"{found['first']}, then {later}{found['end']}"
    return _DOWN_TO.sub(_sits_and, prompt)


def _sits_and(found: re.Match[str]) -> str:
    return f"{found['sits']}, then {in_form_of(found['verb'], found['does'])}"
