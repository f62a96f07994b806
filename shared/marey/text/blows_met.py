"""Blows that a body takes or evades, told by the verbs of the vocabulary: models read the blow as a movement of its own
("staggers when punched", "leans away from a sword swing")."""

from __future__ import annotations

import re
from collections.abc import Iterable

from marey.vocabulary.inflection import gerund, in_form_of, third_person

_DET = r"(?:(?:an?|the|his|her|their|its|another|some)\ (?:[\w-]+'s\ )?)"
_SUCH = r"(?:(?!and\b|then\b|to\b|from\b|of\b|as\b)[\w-]+\ ){0,2}?"
_WHERE = r"(?:(?:to|in|on|against|across|into|from|by|at)\ (?:the|his|her|their|its)\ (?:\w+\ )?\w+|from\ behind)"
_PUNCH = r"(?:punch(?:es)?|jabs?|hooks?|cross|uppercuts?|haymakers?|right\ hand|left\ hand|fists?)"
_BLOW = rf"(?:{_PUNCH}|blows?|hits?|strikes?|kicks?|slaps?|elbows?|knees?|shots?|impacts?|bullets?)"
_WEAPON = r"(?:spears?|swords?|blades?|kni(?:fe|ves)|axes?|arrows?|bullets?|projectiles?|fireballs?|missiles?)"
_ATTACK = rf"""(?:(?:{_WEAPON}\ )?(?:{_PUNCH}|blows?|strikes?|kicks?|swings?|slash(?:es)?|stabs?|thrusts?|swipes?
    |attacks?|attackers?|lunges?|tackles?)|{_WEAPON})"""
_STRUCK = r"""(?:punched|hit|struck|kicked|slapped|shot|shoved|pushed|elbowed|kneed|headbutted|clubbed|slashed|stabbed
    |whacked|smacked)"""
_STAGGERS = ("stagger", "stumble", "reel", "lurch", "rock", "wobble", "totter", "jerk", "jolt", "double", "buckle")
_TAKES = ("take", "receive", "absorb", "suffer", "eat", "get")
_EVADES = (
    "lean", "sway", "twist", "pull", "jerk", "skip", "step", "swerve", "move", "dart", "lunge", "bend", "turn", "shift"
)  # fmt: skip


def _forms(verbs: Iterable[str]) -> str:
    """Return a pattern of the forms of some verbs, but for those of the past."""
    forms = {form for verb in verbs for form in (verb, third_person(verb), gerund(verb))}
    return rf"(?:{'|'.join(sorted(forms, key=len, reverse=True))})"


_ASIDE = r"""(?:\ (?:\w+ly|back(?:wards?)?|away|off|aside|sideways|out|over
    |(?:to\ (?:the|his|her|one)\ )?(?:left|right|side)))"""
_TAKEN = re.compile(
    rf"""\b(?P<verb>{_forms(_TAKES)})\ {_DET}{_SUCH}
    (?:{_BLOW}|arrows?|darts?|spears?|rocks?|stones?)\ (?:to|in|on|across|against)
    \ (?=(?:(?:his|her|their)\ (?:\w+\ )?side|(?:the|his|her|their)\ (?:\w+\ )?
    (?:head|face|jaw|chin|temple|nose|cheek|ear|neck|throat|shoulder|chest|ribs?|stomach|belly|gut|back|body|torso
    |abdomen|kidneys?|liver|hip|arm|leg|thigh|knee|shin))\b)""",
    re.IGNORECASE | re.VERBOSE,
)
"""A blow to a part of the body: "takes an arrow to the knee"."""
_STAGGERED = re.compile(
    rf"""\b(?P<verb>{_forms(_STAGGERS)})(?:{_ASIDE}*
    ,?\ (?:when|as|after|once|while|from)\ (?:(?:he|she|they)\ )?(?:(?:is|are|being|gets?|getting|having\ been)\ )?
    {_STRUCK}|(?!\ back){_ASIDE}*\ (?:from|after|under)\ (?:an?|the|another)\ {_SUCH}{_BLOW})\b
    (?!,?\ (?:(?:and|then|before)\ )*(?:(?:he|she|they)\ )?(?:\w+ly\ )?
    (?:fall|collaps|drop|crumpl|toppl|go(?:es)?\ down|die))
    (?:\ to(?=\ (?:the|his|her|their)\b))?""",
    re.IGNORECASE | re.VERBOSE,
)
"""A body that a blow moves: "staggers when punched", "reels from a hook"; "staggers back" is known. Who
falls then does both."""
_SENDS = re.compile(
    rf"""(?:^|(?<=[.;,]\ )){_DET}{_SUCH}{_BLOW}(?:\ {_WHERE})?
    \ (?:(?:makes|has|lets)\ (?P<who>him|her|them|{_DET}[\w-]+)\ (?:{"|".join(_STAGGERS)}|flinch|recoil|wince)
    |(?:sends|leaves|knocks)\ (?P<whom>him|her|them|{_DET}[\w-]+)\ (?:staggering|stumbling|reeling|lurching|rocking
    |wobbling))
    \b{_ASIDE}*(?!\ (?:to|onto|into|off|down|through)\b)""",
    re.IGNORECASE | re.VERBOSE,
)
"""The same said of the blow: "a heavy hit makes him stagger"."""
_SNAPS = re.compile(
    rf"""(?:(?P<whose>(?:the|an?)\ (?:[\w-]+\ )?[\w-]+)'s|\b(?:his|her|their|the))
    \ (?:head|body|torso|trunk|chest|shoulder)
    \ (?:snap|jerk|rock|whip|jolt|twist)s?{_ASIDE}*\ (?:as|when|after|from)\ {_DET}{_SUCH}{_BLOW}
    (?:\ (?:connects|lands|hits|strikes|comes\ in)(?:\ (?:him|her|them|it))?)?\b""",
    re.IGNORECASE | re.VERBOSE,
)
"""The same said of a part of the body: "his head snaps back as a fist connects"."""
_SIDESTEPS = re.compile(
    rf"\b(?P<verb>side[ -]?step(?:s|ping)?)(?P<how>)(?P<as>)(?P<what>\ {_DET}{_SUCH}{_ATTACK})\b",
    re.IGNORECASE | re.VERBOSE,
)
_EVASIVE = re.compile(
    r"\b(?:evasive|defensive) (?:side[ -]?step|hop|step|lean|sway|move|manoeuvre|maneuver)\b", re.IGNORECASE
)
_AVERTS = re.compile(
    rf"""(?<!\bthe\ )(?<!\ba\ )\b(?P<verb>{_forms(_EVADES)}|backs?(?=\ (?:away|off)))(?P<how>{_ASIDE}*)
    ,?\ (?:(?:just|right)\ in\ time\ )?
    (?:(?:from|out\ of\ (?:the\ )?(?:way|path|reach|range)\ of|to\ (?:avoid|evade|dodge|escape))
    (?P<what>\ {_DET}{_SUCH}{_ATTACK})
    |to\ (?:avoid|evade|dodge|escape)\ (?:being|getting)\ {_STRUCK}
    |(?:to\ let|letting|and\ lets|(?P<as>as|when|while))\ {_DET}{_SUCH}{_ATTACK}
    \ (?:pass|fly|flie|miss|swing|whistle|sail|go)(?:e?s)?
    (?:\ (?:past|by|over|overhead|wide)(?:\ (?:him|her|them|it))?)?)\b""",
    re.IGNORECASE | re.VERBOSE,
)
"""A movement out of the way of an attack: "leans away from a sword swing", "twists aside to let the spear pass"."""
_ARMED = re.compile(
    rf"""\b(?P<verb>{_forms(("dodge", "evade", "avoid"))})(?P<where>\ (?:back|(?:to\ the\ )?(?:left|right)))?
    \ {_DET}{_SUCH}(?:{_WEAPON}(?:\ (?:blows?|strikes?|cuts?))?
    |(?:{_WEAPON}\ )?(?:swings?|slash(?:es)?|stabs?|thrusts?|swipes?))
    (?=\W*$|[,.;]|\ (?:and|then|by|with|from|to|while|at|that)\b)""",
    re.IGNORECASE | re.VERBOSE,
)
"""A weapon that is evaded, of which models read a blow of the weapon: "dodges a sword swing"."""
_ROLLS_UNDER = re.compile(
    rf"\broll(?P<end>s|ing)?(?=\ under\ {_DET}{_SUCH}(?:{_PUNCH}|swings?)\b)", re.IGNORECASE | re.VERBOSE
)
"""A duck of a boxer, of which models read a roll on the floor."""


def with_blows_met(prompt: str) -> str:
    """Return a prompt in which who takes a blow gets hit, and who evades one dodges, to the side that is named."""
    text = _SENDS.sub(_sent, _SNAPS.sub(_snapped, prompt))
    text = _STAGGERED.sub(_hit, _TAKEN.sub(lambda found: f"{_hit(found)} in ", text))
    text = _EVASIVE.sub("dodge", _ROLLS_UNDER.sub(r"duck\g<end>", text))
    text = _AVERTS.sub(_dodges, _SIDESTEPS.sub(_dodges, text))
    return _ARMED.sub(lambda found: f"{found['verb']}{found['where'] or ''} an attack", text)


def _hit(found: re.Match[str]) -> str:
    return f"{in_form_of(found['verb'], 'get')} hit{' in' if found[0].endswith(' to') else ''}"


def _sent(found: re.Match[str]) -> str:
    who = (found["who"] or found["whom"]).lower()
    subject = {"him": "he", "her": "she", "them": "a person"}.get(who, who)
    return f"{subject} gets hit"


def _snapped(found: re.Match[str]) -> str:
    return f"{found['whose'] or 'a person'} gets hit"


def _dodges(found: re.Match[str]) -> str:
    """Return a dodge in the form of the verb that is found; its side and its object stay.

    Who turns "as an arrow flies past" may do so for another reason, unless the words say that it is away.
    """
    if found["as"] and not found["how"]:
        return found[0]
    side = re.search(r"\b(?:left|right)\b", found["how"], re.IGNORECASE)
    to = f" to the {side[0].lower()}" if side else " back" if re.search(r"\bback", found["how"]) else ""
    return f"{in_form_of(found['verb'], 'dodge')}{to}{'' if to else found['what'] or ''}"
