"""Turns that are told in words of which models read another action: "hangs a sharp left", "wheels about"."""

from __future__ import annotations

import re

from marey.vocabulary.inflection import in_form_of
from marey.vocabulary.lengths import TO_TWENTY

_TAKES_A_LEFT = re.compile(
    r"""\b(?:take|make|hang|do)(?P<s>s)?\ (?P<how>an?\ (?:[\w-]+\ )?)(?P<side>left|right)
    (?=\W*$|[.,;]|\ (?:at|into|onto|around|round|down|up|along|past|towards?
    |and|then|while|before|after|behind)\b)""",
    re.IGNORECASE | re.VERBOSE,
)
"""A turn of which the side alone is named."""
_WHEELS = re.compile(
    r"""(?<!cart)(?<!\ba\ )(?<!\bthe\ )\bwheel(?P<s>s|ing)?\ (?:around|about|round)\b(?!\ (?:the|a|an|his|her|in)\b)""",
    re.IGNORECASE | re.VERBOSE,
)
_WHIRLS = re.compile(
    r"""\b(?:whirl|spin|twirl|swing)(?P<s>s|n?ing)?\ (?:around|about|round)\b
    (?=,?\ (?:to|and)\ (?:faces?|looks?|confronts?|meets?|sees?|stares?|glances?|checks?)\b)""",
    re.IGNORECASE | re.VERBOSE,
)
"""A turn to face what is behind, of which models read whole turns."""
_FACES = re.compile(r"\b(?:execute|do|perform|make|snap)(?P<s>e?s)? an? (?P<side>left|right)[ -]face\b", re.IGNORECASE)
"""A turn on the spot of a drill."""
_ABOUT_FACES = re.compile(
    r"""(?<!\ban\ )(?<!\bthe\ )(?<!\bhis\ )(?<!\bher\ )\b(?:(?P<turns>turn)(?:s|ing)?\ )?
    about[ -](?:face|turn)(?P<s>s|ing)?(?=\W*$|[,.;]|\ (?:and|then|before)\b)""",
    re.IGNORECASE | re.VERBOSE,
)
"""The same by its command as a verb: "about-faces and marches off"."""
_RUNS_AND_TURNS = re.compile(
    r"""\b(?P<way>(?:run|jog|trot|sprint)(?:s|(?:n|g|t)?ing)?)(?P<how>\ \w+ly)?\ and
    \ (?:turn|curve|bear|veer|swerve|bend)(?P<s>s)?(?P<far>\ \w+ly|\ hard)?\ (?:to\ (?:the|his|her|their)\ )?
    (?P<side>left|right)(?=\W*$|[.;])""",
    re.IGNORECASE | re.VERBOSE,
)
"""A run with a turn to a side, of which models read a run ahead."""
_STEPS_ON = re.compile(
    rf"""\b(?P<turn>turn(?:s|ing)?(?:\ (?!and\b|then\b)[\w-]+){{1,6}}?),?\ and
    \ (?=(?:takes?|taking|walks?|walking)\ (?:another\ )?(?:{TO_TWENTY}|\d+|a\ few|several)
    (?:\ [\w-]+){{0,2}}?\ (?:steps?|strides?|paces?|met(?:er|re)s)\b)""",
    re.IGNORECASE | re.VERBOSE,
)
"""A turn with counted steps behind it, which together would be read as one turn."""


def with_turns_told(prompt: str) -> str:
    """Return a prompt in which such turns are told as the vocabulary does."""
    text = _TAKES_A_LEFT.sub(r"take\g<s> \g<how>\g<side> turn", prompt)
    text = _WHIRLS.sub(_turns, _WHEELS.sub(_turns, text))
    text = _STEPS_ON.sub(r"\g<turn>, then ", text)
    text = _FACES.sub(lambda found: f"turn{_s(found)} {found['side']} 90 degrees in place", text)
    text = _ABOUT_FACES.sub(_faces_about, text)
    return _RUNS_AND_TURNS.sub(_takes_a_turn, text)


def _s(found: re.Match[str]) -> str:
    return "s" if found["s"] else ""


def _turns(found: re.Match[str]) -> str:
    """Return a quick turn to face back, in the form of the verb that is found."""
    return f"{in_form_of(found['s'] or '', 'turn')} around quickly"


def _faces_about(found: re.Match[str]) -> str:
    """Return a turn to face back; as it is where it is no verb."""
    said = found[0].lower()
    if not (found["turns"] or found["s"]):
        return found[0]
    return f"turn{'ing' if 'ing' in said else 's'} around"


def _takes_a_turn(found: re.Match[str]) -> str:
    """Return a way that takes a turn."""
    return f"{found['way']}{found['how'] or ''} and take{_s(found)} a {found['side']} turn{found['far'] or ''}"
