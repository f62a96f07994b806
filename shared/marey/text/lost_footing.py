"""Feet that slip or trip, and bodies that are knocked down or thrown by a blast, told as the fall that they end in:
"trips over a log", "is knocked to the ground", "the bomb hurls her backwards" (ours)."""

from __future__ import annotations

import re

from marey.vocabulary.inflection import in_present_form_of

DET = r"(?:(?:an?|the|his|her|their|its|some|another)\ )?"
"""Words before a noun, and a blank."""
_BLAST = r"(?:explosions?|explosive|blasts?|bombs?|grenades?|shock\ ?waves?|detonations?|land ?mine|rocket|missile)"
_THROWN = r"(?:knocked|blown|thrown|hurled|flung|blasted|tossed|launched|swept|catapulted|lifted|sent|propelled)"
MOVEMENT_ENDS = r"(?=\W*$|[,.;]|\ (?:and|then|but|before|while)\b)"
"""Behind the words of a movement."""
_BLOWN = re.compile(
    rf"""\b(?:(?:is|are|gets?|getting|being|was|were)\ )?{_THROWN}(?:\ (?!(?:by|and|then|in|from)\b)[\w-]+){{0,8}}?
    \ (?:by|in|from|with)\ {DET}(?:(?:force|power|impact|shock)\ (?:of|from)\ )?{DET}(?:[\w-]+\ ){{0,2}}?{_BLAST}
    (?:\ (?!and\b|then\b|but\b|before\b|while\b)[\w-]+){{0,6}}{MOVEMENT_ENDS}""",
    re.IGNORECASE | re.VERBOSE,
)
"""A body that a blast throws: "knocked flat by an explosion"."""
_OFF_FEET = re.compile(
    rf"\b(?:(?:is|are|gets?|was) )?(?:blown|blasted|hurled|flung|thrown) (?:(?:clean|right|straight) )?"
    rf"(?:off (?:his|her|their|its) feet|backwards? through the air|through the air){MOVEMENT_ENDS}",
    re.IGNORECASE,
)
_BLAST_THROWS = re.compile(
    rf"""\b{DET}(?:[\w-]+\ ){{0,2}}?{_BLAST}(?:\ (?:nearby|behind\ \w+|close\ by|goes\ off\ and))?
    \ (?:knock|throw|hurl|fling|blow|blast|toss|launch|send|sweep|lift)(?:e?s|ing)?\ (?:him|her|them|it
    |(?:the|a)\ [\w-]+)(?:\ (?!and\b|then\b|but\b|before\b|while\b)[\w-]+){{0,8}}{MOVEMENT_ENDS}""",
    re.IGNORECASE | re.VERBOSE,
)
"""The same told of the blast: "the blast hurls her backwards"."""
_KNOCKBACK = re.compile(
    rf"^\W*(?:{_BLAST} (?:knock ?(?:back|down)|reaction|hit|fall|death)"
    rf"|(?:knock(?:ed)? ?(?:back|down)|death|hit|react\w*|blown) (?:by )?{_BLAST})\W*$",
    re.IGNORECASE,
)
THROWN_BACK = "falls backward from an explosion"
"""Words of a body that a blast throws onto its back."""
_OBJECT = r"(?:(?:a|an|the|some|his|her|their|its|that)\ )?(?:[\w-]+\ ){0,2}?"
_UNDERFOOT = r"""(?:ice|icy\ \w+|black\ ice|banana(?:\ (?:peel|skin))?s?|peels?|floor|puddles?|water|oil|soap|mud|snow
    |grass|stairs?|steps?|ground|marbles?|rug|deck|sidewalk|pavement|leaf|leaves|blood|tiles?|path|street|spill|grease|moss|rocks?
    |stones?|wax|slime|slush|patch|spot|surface|carpet|mat|lego|skateboard|roller\ ?skates?|ball|paint|juice)"""
_OBSTACLE = r"""(?:(?!balance\b|side\b|other\b)[a-z-]+)"""
_SO = (
    r"(?:,?\ and\ then|,?\ and|,?\ then|,)\ (?:(?:he|she|they)\ )?(?:(?:then|suddenly|promptly|almost\ immediately)\ )?"
)
_FLAILING = (
    r"(?:,?\ (?:(?:with\ )?(?:(?:his|her|their)\ )?arms?\ [a-z]+(?:\ \w+ly)?|flailing|wobbling|teetering|swaying))?"
)
_CAUGHT = rf"""(?!\ (?:peels?|skins?)\b)
    (?!{_FLAILING}(?:,?\ (?:and\ then|and|but|then|before|without)|,)(?:\ (?:he|she|they))?
    (?:\ \w+ly|\ just|\ soon|\ manages\ to)*\ (?:catch|regain|recover|keep|find|stead|sav|right|stay|almost|nearly
    |does\ not|doesn't|don't|grab|hold))"""
_FALLS = rf"""(?:{_SO}(?:falls?|falling|fell|lands?|landed|landing|goes\ down|went\ down|crash(?:es|ed|ing)
    |hits?\ the|hitting\ the
    |tumble[sd]|collapse[sd]|drops|dropped)\b
    (?!\ (?:off|from|in(?:to)?\ the\ (?:water|pool|river))\b)
    (?:(?!,|\ (?:and|then|before|but)\b)[^.;,])*)?"""
_SLIPS = re.compile(
    rf"""\b(?P<slip>slip)(?P<end>s|ping|ped)?(?:\ (?:up|over|backwards?|badly|suddenly))?
    (?:\ (?:on|in|over|upon|across)\ {_OBJECT}{_UNDERFOOT}\b(?!\ (?:shoes?|slippers?))
    |(?=\W*$)|(?<=\bslips\ over)|(?=,?\ and\ (?:falls?|lands?)\ (?:flat\ )?(?:on|onto)\b)
    |(?=,?\ and\ falls?(?:\W*$|[,.;]|\ (?:and|then|down|over|backwards?|hard|flat)\b))){_CAUGHT}{_FALLS}""",
    re.IGNORECASE | re.VERBOSE,
)
"""Feet that shoot away from under a body. Who slips left, or into a room, does not fall."""
_LOSES = re.compile(
    rf"""\b(?P<lose>los)(?P<end>es?|ing|t)\ (?:(?:his|her|their|its|the)\ )?(?:footing|foothold)
    (?:\ on\ {_OBJECT}{_UNDERFOOT})?{_CAUGHT}{_FALLS}""",
    re.IGNORECASE | re.VERBOSE,
)
_TRIPS = re.compile(
    rf"""\b(?P<trip>trip)(?P<end>s|ping|ped)?\ (?:over|on)\ (?:(?:a|an|the|some|his|her|their|its)\ )
    (?:(?!and\b|but\b|then\b)[a-z-]+\ ){{0,2}}?
    {_OBSTACLE}(?=\W*$|,|\ (?:and|then|while|before)\b){_CAUGHT}{_FALLS}""",
    re.IGNORECASE | re.VERBOSE,
)
"""Feet that are held by what is before them."""
_TO_THE_FLOOR = r"""(?:(?:right|clean|flat|hard)\ )?(?:down|over|flat|flying
    |(?:clear\ |clean\ )?off\ (?:his|her|their|the)\ feet|(?:to|on|onto)\ (?:his|her|their)\ back
    |(?:down\ )?(?:to|on|onto|against)\ the\ (?:ground|floor|mat|deck|canvas|pavement))"""
_FAR = r"(?:\ (?P<far>backwards?|forwards?|sideways|to\ the\ (?:left|right|side)))"
_ENDS = r"(?=\W*$|[,.;]|\ (?:and|then|but|before)\b)"
_BY = rf"(?:\ (?:by|from|in|with)\ (?:(?!(?:and|then|but|before)\b)[\w'-]+\ ?)+?{_ENDS})"
_ELIDED = r"(?:(?<=^)|(?<=[,;.]\ )|(?<=\bthen\ )|(?<=\band\ ))(?!\w+ed\ (?:to|on|over)\ the\ (?:wall|door)\b)"
"""Place of a verb that is left out, as in notes: "knocked down, gets up"."""
_DOWNED = re.compile(
    rf"""(?:\b(?:is|are|was|were|gets?|getting|got|being|be)\ |{_ELIDED})(?:(?:\w+ly|just|then)\ )?
    (?:(?:knocked|pushed|shoved|kicked|punched|struck|blown|bowled|taken|tackled|thrown|flung|hurled|slammed|swept
    |pulled|dragged|brought){_FAR}?\ {_TO_THE_FLOOR}
    |(?:thrown|flung|hurled|blown|blasted)(?P<away>\ (?:backwards?|forwards?))
    (?=\W*$|[,.;]|\ (?:by|from|in|and|then)\b)
    |floored|flattened|felled|decked|tackled){_BY}?""",
    re.IGNORECASE | re.VERBOSE,
)
"""A body that another, or a blast, brings down: "gets knocked over", "is thrown backwards by an explosion"."""
_FORCE = r"""(?:blasts?|explosions?|shock\ ?waves?|waves?|winds?|gusts?|force|impacts?|hits?|punch|blow|kick
    |shots?|bullets?|recoil|tackle|ball|car|truck|grenade|bomb|rocket)"""
_DOWNS = re.compile(
    rf"""(?:^|(?<=[.;,]\ ))(?:an?|the|his|her|another)\ (?:[\w-]+\ ){{0,3}}?{_FORCE}
    \ (?:knocks|pushes|blows|throws|flings|hurls|slams|sweeps|sends|takes|brings)\ (?P<whom>him|her|them)
    {_FAR}?\ (?:{_TO_THE_FLOOR}|(?:sprawling|tumbling|crashing)(?:\ to\ the\ (?:ground|floor))?){_ENDS}""",
    re.IGNORECASE | re.VERBOSE,
)
"""The same said of what brings it down: "an explosion knocks him off his feet"."""
_RISES_AGAIN = re.compile(
    r"""(?P<falls>\b(?:falls?|falling|collapses?)\b(?:(?!\b(?:and|then|but|before|while)\b)[^.;,])*)
    (?:,?\ (?:(?:and|but)\ )?then\ |,?\ (?:and|but)\ |[,;.]\ )(?:(?:he|she|they)\ )?(?P<how>(?:(?:then|\w+ly)\ )*)
    (?:(?:back\ )?(?:get|climb|scramble|stagger|struggle|spring|jump|rise|come|stumble|leap|stand|bounce)s?
    \ (?:right\ |straight\ )?(?:back\ )?(?:up|(?:(?:on)?to|on)\ (?:his|her|their|its)\ feet|again)
    |rises?(?:\ (?:up|again|to\ (?:his|her|their|its)\ feet))*)
    (?=\W*$|[,.;]|\ (?:and|then|again|slowly|quickly)\b)""",
    re.IGNORECASE | re.VERBOSE,
)
"""A fall, and a rise after it by any words: "falls backward, slowly climbs back to his feet"."""
_KNOWN_RISE = re.compile(r"\bgets? (?:back )?up$", re.IGNORECASE)
_DENIED = re.compile(r"\b(?:almost|nearly|without|not|never|avoids?)\ (?:\w+\ )?$", re.IGNORECASE | re.VERBOSE)
_HOW = {"slip": "on the back with slipping feet", "trip": "on the face with tripping feet"}
"""The way in which it falls: a verb of its own would be read as another movement."""


def with_thrown_bodies(prompt: str) -> str:
    """Return a prompt in which a body that a blast throws falls backward; as it is written, before its actions are put
    in the order of time: the words of a blast are no action."""
    for pattern in (_BLOWN, _BLAST_THROWS, _OFF_FEET, _KNOCKBACK):
        prompt = pattern.sub(THROWN_BACK, prompt)
    return prompt


def with_falls(prompt: str) -> str:
    """Return a prompt in which a body whose feet slip or trip, or that is knocked down, falls, unless it catches itself
    or nearly does so."""
    prompt = _DOWNS.sub(_brought_down, _DOWNED.sub(_knocked_down, prompt))
    text = _SLIPS.sub(lambda found: _falls(found, "slip"), prompt)
    text = _LOSES.sub(lambda found: _falls(found, "slip"), text)
    text = _TRIPS.sub(lambda found: _falls(found, "trip"), text)
    return _RISES_AGAIN.sub(_gets_up, text)


def _gets_up(found: re.Match[str]) -> str:
    """Return a fall, and behind it a rise in words that readers know; as it is where it is told so."""
    if _KNOWN_RISE.search(found[0]):
        return found[0]
    return f"{found['falls']}, then {found['how']}gets up"


def _falls(found: re.Match[str], verb: str) -> str:
    """Return a fall in the form of the verb that is found."""
    if _DENIED.search(found.string[: found.start()]):
        return found[0]
    return f"{in_present_form_of(found['end'] or '', 'fall')} {_HOW[verb]}"


def _knocked_down(found: re.Match[str]) -> str:
    """Return a fall, the way that it is knocked, in place of a body that is knocked down."""
    if _DENIED.search(found.string[: found.start()]):
        return found[0]
    far = (found["far"] or found["away"] or "").strip()
    ongoing = found[0].lower().startswith(("getting", "being"))
    return f"{'falling' if ongoing else 'falls'} {far.lower() or 'to the ground'}"


def _brought_down(found: re.Match[str]) -> str:
    """Return a fall of whom another knocks down."""
    who = {"him": "he", "her": "she", "them": "a person"}[found["whom"].lower()]
    return f"{who} falls {found['far'].lower() if found['far'] else 'to the ground'}"
