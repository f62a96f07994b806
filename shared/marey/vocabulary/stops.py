"""Ways that end in a stop: "walks up to the door and stops", "skids to a halt".

Four questions, each with a pattern of its own: where the way before a stop ends (`way_to_a_stop`), if a clause says
that its body comes to a stop (`comes_to_a_stop`) or does nothing else (`only_stops`), and in what manner a run ends
(`stated_skid`). A pattern of one would answer the others wrongly: who "slows to a stop" does not skid, and behind
"skids into a sudden halt" no way is told that could be read alone.
"""

from __future__ import annotations

import re
from typing import Literal

from marey.vocabulary.courses import RUNS

_STOP = r"(?:stop|halt|standstill)"
_STOP_OR_REST = r"(?:stop|halt|standstill|rest)"
_WAY_TO_STOP = re.compile(
    r"""(?:,|\s(?:and|then|before|until\s(?:he|she|they|it)|to|,))(?:\s(?:and|then|to)){0,2}\s
    (?:(?:com|slow|grind|skid|roll|draw)\w*\s(?:down\s)?to\s)?(?:an?\s)?
    (?:sudden(?:ly)?\s|abrupt(?:ly)?\s|complete\s|full\s|dead\s)?
    (?:stops?|halts?|standstill|stands?\sstill|idle)(?:\s(?:dead|short|there|abruptly|suddenly|completely))?\W*$""",
    re.IGNORECASE | re.VERBOSE,
)
_COMES_TO_STOP = re.compile(
    rf"(?:skid|slid|slow|com|grind|screech)\w*\s(?:down\s)?(?:to|into)\s(?:an?\s)?(?:\w+\s)?{_STOP}\b", re.IGNORECASE
)
_ONLY_STOPS = re.compile(
    rf"(?:(?:he|she|they|it) )?(?:then )?(?:\w+ly )?(?:(?:com\w+|slow\w*|skid\w*) to an? (?:\w+ )?{_STOP}"
    r"|(?:stop|halt|freez|paus)\w*)(?: (?:dead|short|there|still|\w+ly))*"
    r"(?: (?:at|by|before|in front of|on|in) (?:the|a|an|his|her|their|its|place)(?: [\w-]+){0,3})?"
    r"(?: for an? (?:\w+ )?(?:moment|second|beat|instant))?"
)
_SKIDS = re.compile(
    rf"\b(?:skid(?:s|ding|ded)?|slid(?:es?|ing)) (?:\w+ )?(?:to|into) (?:a|an) (?:\w+ )?{_STOP_OR_REST}\b|\bskids?\b"
    rf"|\b(?:skidding|screeching|sliding) {_STOP_OR_REST}\b|\bscreech(?:es|ing)? to\b|\bslides?\W*$"
)
_STOPS_ABRUPTLY = re.compile(
    rf"\b(?:stop|halt)(?:s|ping|ing)? (?:abruptly|suddenly|short|dead|sharply|instantly|at once)\b"
    rf"|\b(?:abrupt|sudden|sharp|dead|emergency) {_STOP_OR_REST}\b|\b(?:abruptly|suddenly|sharply) (?:stop|halt)s?\b"
    rf"|\b(?:slams?|hits?) (?:on )?the brakes\b|\bbrakes? (?:hard|sharply|abruptly)\b"
)
_NO_RUN = re.compile(r"\b(?:knees?|base|board|ice|slides? (?:under|down|across))\b")
"""Words of slides that are no end of a run."""


def way_to_a_stop(text: str) -> str:
    """Return the words before the stop that a text ends with: "walks up to the door" of "walks up to the door and
    stops"; empty if it ends with none."""
    match = _WAY_TO_STOP.search(text)
    return text[: match.start()].strip(" ,;") if match is not None else ""


def comes_to_a_stop(clause: str) -> bool:
    """Return True if a clause begins with the way in which a run ends: "slides to a stop"."""
    return _COMES_TO_STOP.match(clause) is not None


def only_stops(clause: str) -> bool:
    """Return True if all words of a clause, in lower case and without signs around them, are those of a body that stops
    and does nothing else."""
    return _ONLY_STOPS.fullmatch(clause) is not None


def stated_skid(prompt: str, action: str) -> Literal["skid", "stop", ""]:
    """Return `skid` or `stop`, with which a prompt of a run says that it ends abruptly; empty for others.

    Args:
        prompt: in any case.
        action: its id.
    """
    text = prompt.lower()
    if action not in RUNS or _NO_RUN.search(text):
        return ""
    return "skid" if _SKIDS.search(text) else "stop" if _STOPS_ABRUPTLY.search(text) else ""
