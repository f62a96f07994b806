"""Ways that wind, in words of which models read a dodge, or no action: "zigzag run", "weaves between the tables"."""

from __future__ import annotations

import re

from marey.vocabulary.inflection import in_form_of

_GAIT = r"(?:walk|jog|run|sprint|stroll|strid|stride|march|mov|move|go|goe|rac|race|dash|hurr|trot|sneak)"
_WINDS = r"(?:weav(?:es?|ing)|slalom(?:s|ing)?|zig[ -]?zag(?:s|ging)?|swerv(?:es?|ing)|snak(?:es?|ing))"
_WHERE = (
    r"(?:(?:through|between|among|amongst|around|past|across|in\ and\ out\ of)\ (?!(?:punch|blow|jab|attack|strike|kick"
    r"|sword|opponent)\w*)(?:(?:the|a|an|some|two|three|several|his|her|their|these|those)\ )?[\w-]+(?=\W|$)"
    r"(?:\ (?:trees?|cones?|tables?|people|poles?|chairs?|cars?|crowds?|traffic|players?|obstacles?))?"
    r"|left\ and\ right|from\ side\ to\ side|back\ and\ forth)"
)
_ON_WAY = re.compile(
    rf"""\b(?P<way>{_GAIT}(?:s|es|n?ing|g?ing|ies)?(?:\ (?:\w+ly|fast|ahead|forwards?))?)
    (?:\ (?:through|along|down|across|over)\ (?:the|a|an)\ [\w-]+)?(?:,|\ while|\ and|,\ and)?
    \ (?:by\ )?(?:his\ way\ |her\ way\ )?{_WINDS}(?:\ {_WHERE})?
    (?!\ (?:line|path|pattern|course|motion|manner|run|walk))""",
    re.IGNORECASE | re.VERBOSE,
)
"""Ways of bodies that go and wind: "runs through the woods weaving around trees"."""
_ALONE = re.compile(
    rf"\b(?P<winds>{_WINDS})(?:\ (?:his|her|their|its)\ way)?(?:\ (?P<fast>quickly|fast|rapidly))?"
    rf"\ (?!left|from|back){_WHERE}",
    re.IGNORECASE | re.VERBOSE,
)
"""Bodies that wind, and are said to go in no other words: "slaloms around the cones"."""
_OBJECT = re.compile(rf"\b(?P<way>{_GAIT}(?:s|es|n?ing|g?ing)?)\ (?:a\ )?(?:slalom|zig[ -]?zag)\b[^,.;]*", re.I | re.X)
_REASON = re.compile(
    r",?\ (?:(?:like|as\ if|as\ though|while|and)\ (?:(?:he|she|they)\ (?:is|are|was|were)\ )?)?(?:to\ )?"
    r"(?:dodg|evad|avoid|elud|escap)(?:e|es|ing)?\ (?!left|right|to)[^,.;]*",
    re.IGNORECASE | re.VERBOSE,
)
"""Whom a winding way is to elude: "like dodging defenders"."""
_WINDING = re.compile(r"\b(?:zig[ -]?zag\w*|slalom\w*|serpentine)\b", re.IGNORECASE)
_PLAIN = re.compile(
    r"\bin (?:a )?zig[ -]?zags?\b(?!(?: \w+)? (?:pattern|line|path|course|manner|motion|fashion))", re.IGNORECASE
)
_ON = r"\g<way> in a zigzag pattern"
_FAST = re.compile(r"\b(?:run|running|runs|sprint\w*|jog\w*|dash\w*|rac(?:es|ing)|soccer|football|ski\w*)\b", re.I)


def with_plain_zigzag(prompt: str) -> str:
    """Return a prompt with plain words of a way that winds: "runs in a zigzag pattern" of "runs, weaving"."""
    if not (_WINDING.search(prompt) or re.search(rf"\b{_WINDS}\b", prompt, re.IGNORECASE)):
        return prompt
    found = _OBJECT.sub(_ON, _ON_WAY.sub(_ON, prompt))
    found = _PLAIN.sub("in a zigzag pattern", _ALONE.sub(_goes, prompt) if found == prompt else found)
    return _REASON.sub("", found) if _WINDING.search(found) else found


def _goes(found: re.Match[str]) -> str:
    """Return words of a way for those of who winds."""
    word, fast = found["winds"].lower(), bool(found["fast"] or _FAST.search(found.string))
    return f"{in_form_of(word, 'run' if fast else 'walk')} in a zigzag pattern"
