"""Gaits that go nowhere: "jogs in place", "marches on the spot", "runs on a treadmill"."""

from __future__ import annotations

import re

GAITS = frozenset({"walk", "run", "sprint"})
"""Actions that may be done in place."""
_GAIT = (
    r"(?:walk(?:s|ing)?|runs?|running|jog(?:s|ging)?|march(?:es|ing)?|sprint(?:s|ing)?|steps?|stepping|trot(?:s|ting)?"
    r"|strid(?:es?|ing)|pac(?:es?|ing)|tread(?:s|ing)?)"
)
_HERE = r"(?:(?:in|on) (?:(?:the|one|a|that|this|his|her|their|its|same|single) ){0,3}(?:place|spot)|on a treadmill)"
_OTHER = (
    r"turn\w*|spin\w*|stop\w*|stand\w*|freez\w*|froze\w*|jump\w*|hop\w*|wait\w*|danc\w*|puts?|sets?|lock\w*|held|holds?"
    r"|falls?|then|before|after|until|halt\w*|bounc\w*|shift\w*|circl\w*|towards?|to|into|up|over|past|across"
)
"""Words between a gait and a place that belongs to something else."""
_IN_PLACE = re.compile(
    rf"\b{_GAIT}\b(?: (?!(?:{_OTHER})\b)[\w'-]+){{0,5}}? {_HERE}\b(?! of\b)"
    rf"|\bhigh[ -]knees? {_HERE}\b"
    r"|(?:^|[,;.] |\bthen |\band )(?:does |do )?high[ -]knees?(?!\w)"
    r"(?! (?:walk|march|run|jog|skip|kick|step|forward|across|to\b|up\b|down\b))"
    rf"|\b{_HERE},? (?:\w+ ){{0,2}}?{_GAIT}\b"
    rf"|\b(?:in[ -]place|stationary|on[ -]the[ -]spot|treadmill) {_GAIT}\b"
    rf"|\b{_GAIT}\b[^.;]*\b(?:without (?:moving|going|getting|travell?ing|advancing) (?:forwards?|ahead|anywhere)"
    r"|stay(?:s|ing) (?:in|on) (?:(?:the|one|same) ){0,2}(?:place|spot))\b"
)


def goes_in_place(prompt: str, action: str) -> bool:
    """Return True if the gait that a prompt asks for is done in place.

    Args:
        prompt: of one action, as a user typed it.
        action: its id.
    """
    text = " ".join(prompt.lower().replace("’", "'").split())
    return action in GAITS and _IN_PLACE.search(text) is not None
