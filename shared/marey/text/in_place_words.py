"""Gaits in place, in words of which models read a turn or no action: "trots on the spot", "high knees in place"."""

from __future__ import annotations

import re

from marey.vocabulary.in_place import goes_in_place
from marey.vocabulary.inflection import in_form_of

_PLAINER = (
    (re.compile(r"\btrot(?P<s>s)?(?P<ing>ting)?\b", re.IGNORECASE), "jog"),
    (re.compile(r"\b(?:stride|strid(?=ing)|pace|pac(?=ing))(?P<s>s)?(?P<ing>ing)?\b", re.IGNORECASE), "march"),
    (re.compile(r"\btread(?P<s>s)?(?P<ing>ing)?\b", re.IGNORECASE), "walk"),
)
"""Verbs, and those that models know."""
_HIGH_KNEES = re.compile(
    r"^(?P<who>\W*(?:(?:a|an|the) (?:\w+ )?\w+ )?)(?:(?:does|do|doing|performs?|performing) )?high[ -]knees?"
    r"(?P<here> (?:in place|on the spot))",
    re.IGNORECASE,
)


def with_plain_gait_in_place(prompt: str) -> str:
    """Return a prompt with a plain verb of a gait in place: "jogs on the spot" of "trots on the spot"."""
    prompt = _HIGH_KNEES.sub(r"\g<who>runs\g<here> with high knees", prompt)
    if not goes_in_place(prompt, "walk"):
        return prompt
    for pattern, verb in _PLAINER:
        prompt = pattern.sub(lambda found, verb=verb: in_form_of(found["ing"] or found["s"] or "", verb), prompt)
    return prompt
