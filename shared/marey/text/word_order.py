"""Words in the order and form in which the vocabulary has them (ours): the foot that is hopped on before how often
("hops forward on the left foot three times"), and numbers of times behind a side ("hop left 3")."""

from __future__ import annotations

import re

from marey.vocabulary.lengths import TO_TWENTY

_HOPS = re.compile(
    rf"""(?P<hops>\b(?:hop|jump|bounce)(?:s|p?ing|p?ed)?(?:\ \w+ly)?(?:\ (?:forwards?|ahead|across|along))?),?
    \ (?P<often>once|twice|thrice|(?:{TO_TWENTY}|\d{{1,2}}|several|a\ few)\ times),?
    \ (?P<foot>on\ (?:only\ |just\ )?(?:one|(?:(?:the|his|her|their|your|my|its)\ )?(?:left|right))\ (?:foot|leg))\b""",
    re.IGNORECASE | re.VERBOSE,
)
_SIDE_BY_NUMBER = re.compile(
    r"""(?P<steps>\b(?:side[ -]?step|hop|jump|step|strafe|shuffle|lunge|kick|bounce)(?:s|p?ing|p?ed)?
    (?:\ to)?(?:\ the)?\ (?:left|right)),?\ (?P<number>[2-9]|1\d)(?=\s*(?:$|[,;.]|\bthen\b|\band\b))""",
    re.IGNORECASE | re.VERBOSE,
)
_WAY_OF_STEPS = re.compile(
    r"""\b(?P<goes>(?:walk|mov(?=ing)|move|go|back|step)(?P<end>e?s|p?ing|p?e?d)?)
    \ (?P<way>back(?:wards?)?|forwards?|ahead)
    \ (?:for\ |by\ )?(?P<steps>(?:a\ few|some|several|a\ couple\ of)\ (?:\w+\ )?(?:steps|paces|strides))\b""",
    re.IGNORECASE | re.VERBOSE,
)


def in_usual_order(prompt: str) -> str:
    """Return a prompt with the foot that is hopped on before the number of hops, and with "three times" of a number
    alone behind a side; a way of some steps is one on which these are taken."""
    prompt = _WAY_OF_STEPS.sub(_taken, prompt)
    return _SIDE_BY_NUMBER.sub(r"\g<steps> \g<number> times", _HOPS.sub(r"\g<hops> \g<foot> \g<often>", prompt))


def _taken(found: re.Match[str]) -> str:
    """Return a way of some steps as steps that are taken."""
    end = (found["end"] or "").lower()
    takes = "taking" if end.endswith("ing") else "takes" if end else "take"
    return f"{takes} {found['steps']} {found['way']}"
