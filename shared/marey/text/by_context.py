"""Verbs whose meaning other words of a prompt decide, told in full: the shot of a ball, the draw of a bow (ours)."""

from __future__ import annotations

import re

from marey.vocabulary.inflection import in_form_of

_ENDS = r"(?=\W*$|[,.;]| (?:and|then|from|again|twice)\b)"
_BASKETBALL = re.compile(r"\b(?:basketball\w*|dribbl\w+|hoop|three[- ]pointer|free throw|jump shot)\b", re.IGNORECASE)
_SOCCER = re.compile(r"\b(?:soccer|football(?:er)?|striker|penalty|goalkeeper)\b", re.IGNORECASE)
_GUN = re.compile(r"\b(?:gun|pistol|rifle|arrow|bow|shotgun|weapon|soldier|cop)\b", re.IGNORECASE)
_SHOOTS = re.compile(rf"\b(?P<shoots>shoots?|shooting){_ENDS}", re.IGNORECASE)
"""A shot of which the prompt says elsewhere that it is one of a ball."""
_ARCHER = re.compile(r"\b(?:archers?|bowm[ae]n|longbow|bow and arrow|quiver)\b", re.IGNORECASE)
_DRAWS = re.compile(
    r"\b(?P<draws>draws?|drawing)(?P<joint>(?:,? and then|,? and|,? then|,))(?P<aims> (?:aims?|takes aim),?(?: and)?)?"
    r" (?P<looses>fires?|shoots?|looses?|releases?|lets go)\b(?! (?:the|a|his|her) (?!bow|arrow))",
    re.IGNORECASE,
)
"""A draw and a shot whose bow only the archer names."""
_HIGH_PLACE = re.compile(
    r"\b(?:stairs?|staircase|steps|ladder|hill|slope|ramp|mountain|floor|storey|upstairs|escalator|stage)\b",
    re.IGNORECASE,
)
_WALKS_UP = re.compile(
    r"\b(?P<walks>(?:walk|run|jog|stroll|march|rush|step)(?:s|es|ing)?) up(?=\W*$|[,.;]| (?:and|then)\b)", re.IGNORECASE
)
"""A way to a place or a person that is not named, of which models read a climb."""
_DISTANCE = re.compile(
    r"(?P<joint>(?:,|\band|\bthen) (?:then )?(?:he |she |they )?)(?:look|gaz|star|peer|squint)e?(?:s|es)?"
    r"(?: (?:out|off|far|away))* (?:into|to|at|towards?|in) (?:the )?(?:far )?(?:distance|horizon)(?=\W*$|[,.;])",
    re.IGNORECASE,
)
"""A gaze straight ahead behind another movement: the body stands."""

_DUCKS = re.compile(
    r"(?P<blow>\b(?:punch(?:es|ing)?|jabs?|hooks?|uppercuts?|kicks?|strikes?|elbows?|blocks?|cross(?:es)?|combo)"
    r"\b[^.;]*?(?:,? and then|,? and|,? then|,)(?: (?:he|she|they))?(?: (?:quickly|then))*) duck(?P<s>s|ing)?"
    r"(?! (?:down|behind|into|for|low|and cover|his|her|to|walk|out)\b)(?=\W*$|[,.;]| (?:and|then|twice|\w+ times)\b)",
    re.IGNORECASE,
)
"""A duck behind a blow, which evades another one."""


def with_words_by_context(prompt: str) -> str:
    """Return a prompt in which such verbs say themselves what they mean."""
    text = prompt
    if not _GUN.search(text):
        if _BASKETBALL.search(text):
            text = _SHOOTS.sub(r"\g<shoots> the basketball", text)
        elif _SOCCER.search(text):
            text = _SHOOTS.sub(r"\g<shoots> at the goal", text)
    if _ARCHER.search(text):
        text = _DRAWS.sub(_draws_bow, text)
    if not _HIGH_PLACE.search(text):
        text = _WALKS_UP.sub(r"\g<walks> forward", text)
    text = _DUCKS.sub(lambda it: f"{it['blow']} {in_form_of(it['s'] or '', 'dodge')} under it", text)
    return _DISTANCE.sub(r"\g<joint>stands still", text)


def _draws_bow(found: re.Match[str]) -> str:
    """Return the draw with its bow; the shot is part of it."""
    looses = f"{in_form_of(found['looses'], 'shoot')} an arrow"
    return f"{found['draws']} the bow{found['joint']}{found['aims'] or ''} {looses}"
