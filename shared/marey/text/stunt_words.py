"""Stunts in the words of movements that readers know (ours): drops from ledges, ropes to
balance on, ledges to edge along, the recoil of a shot, feet that slip on landing, steps back after a shove."""

from __future__ import annotations

import re

from marey.text.lost_footing import DET, MOVEMENT_ENDS, with_thrown_bodies
from marey.vocabulary.inflection import in_form_of

_WHO = r"(?:he|she|they|it)"
_HEIGHT = r"""(?:ledges?|roofs?|rooftops?|balcon(?:y|ies)|walls?|crates?|box|platforms?|window(?:\ ?sill)?s?|fences?
    |trucks?    |cliffs?|rocks?
    |boulders?|branch|tree|bridge|stage|scaffold(?:ing)?|loft|horse|wagon|car|vehicle|table|chair|bench
    |container|stairs|step|height|ladder|beam|rafters?|ceiling|tower|parapet|catwalk|edge|porch|dock|pier|counter|above)"""
_DROPS = re.compile(
    rf"""\b(?P<verb>drop|jump|hop|leap|spring)(?P<end>s|ping|ing)?(?:\ lightly|\ quietly|\ silently|\ quickly)?
    (?:(?<=drop)|(?<=drops)|\ (?:down|off|from))(?:\ down)?(?:\ (?:from|off|out)(?:\ of)?)?
    \ (?P<place>(?:(?:a|an|the|his|her|some)\ )?(?:(?!and\b|then\b)[\w-]+\ ){{0,3}}?{_HEIGHT}(?:\ edge)?)\b""",
    re.IGNORECASE | re.VERBOSE,
)
"""A drop to the floor from something high."""
_FROM = re.compile(r"\b(?:from|off|out)\b", re.IGNORECASE)
_ROPE = r"""(?:tight\ ?ropes?|slack\ ?lines?|(?:balance\ )?beams?|wires?
    |(?:narrow|thin|fallen|single)\ (?:plank|wall|log|rail|bridge|board|tree|trunk|pole|ledge|beam))"""
_BALANCES = re.compile(
    rf"""\b(?P<verb>balanc(?:e(?P<s>s)?|ing)|cross(?P<s2>es|ing)?|teeters?|totters?)(?P<how>(?:\ \w+ly){{0,2}})
    (?:\ (?:his|her|their)\ way)?(?:\ (?:across|along|over))?\ (?P<rope>{DET}(?:[\w-]+\ ){{0,2}}?{_ROPE})\b""",
    re.IGNORECASE | re.VERBOSE,
)
"""A walk over a rope or a beam, of which readers make who stands on one leg."""
_ROPE_WALK = re.compile(
    r"\b(?:a )?(?P<rope>tight ?rope|slack ?line|balance beam|beam|high wire)[ -]walk(?P<end>s|ing)?\b", re.IGNORECASE
)
_SIDLES = re.compile(
    rf"""\b(?:shimm(?:y|ies|ying)|inch(?:es|ing)?|edg(?:es?|ing)|sidl(?:es?|ing)|shuffl(?:es?|ing)|travers(?:es?|ing)
    |creep(?:s|ing)?)(?:\ (?:{DET}way|slowly|carefully|cautiously|sideways|nervously))*
    \ (?:(?:over\ |off\ )?to\ (?:the|his|her)\ )?(?P<side>left|right)(?:wards?)?(?:\ (?:sideways|slowly|carefully))?
    \ (?P<where>(?:along|across|on|over)\ {DET}(?:[\w-]+\ ){{0,3}}?
    (?:ledge|wall|cliff|edge|sill|windowsill|parapet|beam|cornice|rim|shelf|roof|rooftop|catwalk|precipice))\b""",
    re.IGNORECASE | re.VERBOSE,
)
"""Steps to a side along a ledge."""
_HANGS = re.compile(
    r"\b(?:hang\w*|hung|dangl\w*|grip\w*|by (?:his|her|their|the|both) (?:hands|fingers\w*|arms))\b", re.I
)
_SHOT = re.compile(
    r"\b(?:fir(?:es?|ed|ing)|shoot\w*|shots?|guns?|pistols?|rifles?|shotguns?|revolvers?|handguns?|weapon)\b", re.I
)
_RECOIL = re.compile(
    r"""(?:,?\ (?:and\ then|and|then|with|from|as)|,)?
    (?:\ (?:absorb|feel|tak|handl|ride?|brac|manag|control|show|flinch)\w*(?:\ (?:for|against|from|out|with))?)?
    (?:\ (?:the|a|an|his|her|its|some|gun|heavy|strong|slight|big|small|visible|hard|little|realistic|weapon|muzzle))*
    \ (?:recoil(?:s|ing)?|kick ?back)\b(?!\ (?:in|from|at|with|back\ (?:in|from))\b)
    (?:\ (?:kick|push|jerk|throw|knock|snap|driv|jolt|rock|hit|rais|lift|send|mov)\w*(?:\ (?!and\b|then\b)[\w-]+){0,6}
    |\ back|\ after\ (?:each|every)\ shot)?(?=\W*$|[,.;]|\ (?:and|then|while|before|but)\b)""",
    re.IGNORECASE | re.VERBOSE,
)
"""The recoil, which belongs to the shot and is drawn with it."""
_ON_LANDING = re.compile(
    rf"""(?P<joint>,?\ (?:and\ then|and|then|but)|,)\ (?:{_WHO}\ )?(?P<verb>slip|stumble|trip|stagger)(?P<s>s)?
    (?P<falls>\ and\ falls?(?:\ (?:over|down))?)?
    \ (?:on|upon|when|after|while|as)\ (?:{_WHO}\ |the\ )?land(?:ing|s)?\b""",
    re.IGNORECASE | re.VERBOSE,
)
_STAGGERS = re.compile(
    rf"""\b(?P<verb>stumble|stagger|reel|lurch|totter)(?P<s>s)?\ back(?:wards?)?
    (?P<steps>\ (?:\w+|a\ few|a\ couple\ of)\ (?:steps?|paces?))?
    \ (?:after|from|when|as|because\ of|following)\ (?:{_WHO}\ (?:is\ )?)?(?:being\ |getting\ )?
    (?:shoved|pushed|hit|punched|struck|kicked
    |{DET}(?:\w+\ )?(?:shove|push|hit|punch|blow|kick|strike|impact|slap)){MOVEMENT_ENDS}""",
    re.IGNORECASE | re.VERBOSE,
)
"""Steps back that a blow causes."""
_JUMP = r"(?:jump|leap|hop|spring)(?:s|ing)?"
_BOTH_SIDES = re.compile(
    rf"\b(?P<first>{_JUMP} (?:to (?:the|his|her) )?(?P<side>left|right))(?:, and |, (?:then )?| and (?:then )?)"
    rf"(?P<second>(?:{_JUMP} )(?:to (?:the|his|her) )?(?!(?P=side))(?:left|right))\b",
    re.IGNORECASE,
)
_ASIDE = re.compile(
    r"\b(?P<jump>(?:jump|leap|spring)(?:s|ing)?(?: \w+ly| far| once| twice| \w+ times)?)"
    r" (?:to (?:the|his|her) )?(?P<side>left|right)"
    r"(?=\W*$|[,.;]| (?:and|then|landing|before|while)\b(?! (?:left|right|turn)))",
    re.IGNORECASE,
)
"""A jump to a side, of which readers make a turn in the air."""
_LANDS_LOW = re.compile(
    rf"\b(?P<jump>(?:{_JUMP}|drops?|dropping)\b(?:(?!,|;|\.|\b(?:and|then)\b).)*?)(?:,? and then |,? and |,? then |, )"
    r"(?:(?:he|she|they) )?land(?:s|ing)? (?:(?:softly|low|down) )?(?:in|into) (?:a |an )?(?:\w+ )?(?:crouch|squat)\b",
    re.IGNORECASE,
)
"""A jump that ends in a crouch, of which readers make a jump, a stand and a crouch."""


def with_plain_stunts(prompt: str) -> str:
    """Return a prompt in which such stunts are told in words that readers know."""
    text = with_thrown_bodies(prompt)
    text = _BOTH_SIDES.sub(r"\g<first>, then \g<second>", _DROPS.sub(_drops, text))
    text = _LANDS_LOW.sub(lambda it: f"{it['jump']} landing low", text)
    text = _ASIDE.sub(r"\g<jump> sideways to the \g<side>", text)
    text = _ROPE_WALK.sub(lambda it: f"{'walks' if it['end'] else 'walk'} along a {it['rope']}", text)
    text = _BALANCES.sub(_walks_over, text)
    if not _HANGS.search(text):
        text = _SIDLES.sub(r"slowly sidesteps to the \g<side> \g<where>", text)
    if _SHOT.search(text):
        text = _RECOIL.sub(_without_recoil, text)
    text = _ON_LANDING.sub(_then_slips, text)
    return _STAGGERS.sub(_knocked_back, text)


def _drops(found: re.Match[str]) -> str:
    """Return a jump down; of what is jumped over or at as it is."""
    words = found[0].lower()
    if not _FROM.search(words) and " above" not in words:
        return found[0]
    return f"{in_form_of(found['end'] or '', 'jump')} down from {found['place']}"


def _walks_over(found: re.Match[str]) -> str:
    word = found["verb"].lower()
    return f"{in_form_of('' if word == 'cross' else word, 'walk')}{found['how']} across {found['rope']}"


def _without_recoil(found: re.Match[str]) -> str:
    """Return nothing for the recoil of a shot that is told before it."""
    return "" if _SHOT.search(found.string[: found.start()]) else found[0]


def _then_slips(found: re.Match[str]) -> str:
    verb = found["verb"].lower()
    behind = found["falls"] or ("" if verb == "slip" else " forward")
    return f", then {in_form_of(found['s'] or '', verb)}{behind}"


def _knocked_back(found: re.Match[str]) -> str:
    """Return a blow with the steps that it causes, which are one movement."""
    return f"get{found['s'] or ''} hit hard, knocked back{found['steps'] or ' a few steps'}"
