"""Phrases of which the readers make other movements, in the words of the one that is meant (ours).

What a clause leaves to the one before it ("then climbs two more", "walks 3 m back, then 2 m ahead"), a trip that does
not end in a fall, who goes back out, and how long a posture is held.
"""

from __future__ import annotations

import re

from marey.vocabulary.inflection import in_form_of
from marey.vocabulary.lengths import TO_TEN

_WHO = r"(?:(?:he|she|they|it)\ )?"
_JOINT = r"(?:,?\ and\ then|,?\ and|,?\ then|,?\ but|[,;.])\ (?:(?:then|but|quickly|just|barely)\ )?"
_TRIPS_AND_CATCHES = re.compile(
    rf"""\b(?:trip|stumble)(?P<s>s)?(?:\ and\ (?:almost|nearly)\ falls?)?(?:\ \w+ly)?
    (?P<over>\ (?:over|on)\ (?:(?:a|an|the|some|his|her|their|its)\ )?(?:[\w-]+\ ){{0,2}}?[\w-]+)?
    (?:{_JOINT}{_WHO}(?:almost|nearly)\ (?:falls?|falling|goes\ down))?
    {_JOINT}{_WHO}(?:\w+ly\ |just\ |manages\ to\ |barely\ )*
    (?:catch(?:es)?\ (?:him|her|them|it)sel(?:f|ves)|(?:catch(?:es)?|regains?|recovers?|finds?|keeps?)
    \ (?:(?:his|her|their|its)\ )?(?:balance|footing|step)|stead(?:ies|y)\ (?:him|her|them|it)sel(?:f|ves)
    |recovers?(?=[,.;]|$|\ (?:and|then|quickly)\b))
    (?:\ (?:just\ )?in\ time|\ before\ (?:falling|he\ falls|she\ falls))?""",
    re.IGNORECASE | re.VERBOSE,
)
"""A stumble without a fall: "trips over a cable, catches himself"."""
_GOES_BACK = re.compile(
    r"""(?P<joint>[,;.]\ (?:and\ )?(?:then\ )?|\ (?:and\ )?then\ |\ and\ )(?P<who>(?:he|she|they)\ )?
    (?P<way>walk|run|jog|stroll|march|sprint|go(?=\ |es)|hurr(?=y|ies)|sneak|head)(?P<s>e?s|y|ies)?(?P<how>\ \w+ly)?
    \ back\ (?P<where>out|outside|over|through\ the)\b(?!\ and\ forth)""",
    re.IGNORECASE | re.VERBOSE,
)
"""A way back out, ahead of which a body turns round."""
_TURNS_BEFORE = re.compile(r"\b(?:turn|spin|pivot|whirl|wheel)\w*\b[^,.;]*[\W\w]{0,6}$", re.IGNORECASE)
_TURNED_AND_COMES = re.compile(
    r"(?P<turn>\bturns?(?: (?:around|round|about))(?:,|,? and(?: then)?|,? then) )"
    r"com(?:e(?P<s>s)?|ing) back\b(?! (?:to|home|in|into|up|down)\b)",
    re.IGNORECASE,
)
_RESTS = re.compile(
    r"(?P<joint>[,;.] (?:and )?(?:then )?|\b(?:then|and) )(?P<who>(?:he|she|they) )?rest(?P<s>s)?(?: there)?"
    r"(?= for (?:about )?(?:\d|a (?:few|couple|moment|while|bit|second)|one|two|three|four|five|six|seven|eight|ten))",
    re.IGNORECASE,
)
"""Rest in a posture that the body has come to."""
_HIGH_KNEES = re.compile(
    r"(?:(?<=^)|(?<=[,;.] )|(?<=\bthen )|(?<=\band ))(?:(?P<does>does|do) )?high[ -]knees?"
    r"(?!\w| (?:in place|on the spot|walk|march|run|skip|kick|forward|across|to|up))",
    re.IGNORECASE,
)
_MORE = re.compile(
    rf"(?P<before>\b(?P<verb>[a-z]+?)(?:s|es)? (?:(?:\w+ly|up|down) )*(?:\d{{1,2}}|{TO_TEN})"
    r" (?P<what>(?:more )?(?:stairs|steps|rungs|push-?ups|sit-?ups|squats|jumps|hops|kicks|punches|laps)\b)"
    rf"[^;]*?\b(?P=verb)(?:s|es)? (?:(?:\w+ly|up|down) )*(?:another )?(?:\d{{1,2}}|{TO_TEN})"
    r"(?: more)?)(?=\W*$|[,.;]| (?:and|then)\b)",
    re.IGNORECASE,
)
"""A number of what the clause before has named: "climbs three stairs, rests, climbs two more"."""
_FAR = (
    rf"(?:\d{{1,2}}(?:[.,]\d+)?|{TO_TEN}|an?|another)"
    r"(?: more)? (?:m|metres?|meters?|steps?|paces?|feet|yards?)"
)
_ALONG = r"(?:forwards?|backwards?|back|ahead|(?:to (?:the|his|her) )?(?:left|right)|sideways)"
_WAY_AND_ANOTHER = re.compile(
    rf"(?P<first>\b(?P<verb>walk|run|jog|step|march|sneak|sprint|stride|move|crawl)(?P<s>s)? {_FAR} {_ALONG}"
    rf"|\b(?P<verb2>walk|run|jog|step|march|sneak|sprint|stride|move|crawl)(?P<s2>s)? {_ALONG} {_FAR})"
    rf"(?P<joint>,? (?:and )?then |, (?:and )?)(?=(?:{_FAR} {_ALONG}|{_ALONG} {_FAR})\b)",
    re.IGNORECASE,
)
"""A way, and another one that has no verb: "walks 3 meters back, then 2 meters ahead"."""
_EXAMINES = re.compile(
    r"\b(?:examin|inspect|stud|survey|search|scan)(?P<s>es|s|ies)?(?P<base>e|y)?(?P<ing>ing|ying)?"
    r" (?:(?:the|some|his|her|a) )?(?:\w+ )?(?P<what>ground|floor|tracks?|footprints?|dirt|soil|trail)\b"
    r"(?! (?:with|for))",
    re.IGNORECASE,
)
"""A gaze down, of which the readers make who kneels or picks up."""
_UPHILL = re.compile(
    r"(?P<push>\b(?:push|shov|heav)\w*\b[^.;]*?) up (?:(?:a|an|the) )?(?:\w+ )?"
    r"(?:hill|slope|ramp|mountain|incline|hillside)\b",
    re.IGNORECASE,
)
"""A way uphill of who pushes something, of which models read a climb."""
_LAND = (
    r"(?:,? (?:and )?(?:then )?land(?:s|ing)?(?: (?:softly|safely|lightly))?"
    r"(?: (?:on|with) (?:(?:both|the|his|her|their"
    r"|two) )*feet(?: together)?)?)?"
)
_JUMPS_BACK_OVER = re.compile(
    r"\b(?P<jump>(?:jump|leap|hop|spring)(?:s|ing)?) backwards? over (?:a|an|the|some|his|her)"
    rf" (?:[\w-]+ ){{0,2}}?[\w-]+(?=$|[,.;]| (?:and|then)\b){_LAND}",
    re.IGNORECASE,
)
"""A jump back over something, of which the readers make one ahead, or a dodge."""
_BOX = r"(?:box|crate|package|parcel|carton|case|chest|barrel|basket)(?:es|s)?"
_PUTS_IT = re.compile(
    rf"(?P<before>\b(?P<what>{_BOX})\b.*\b)(?P<put>(?:put|place|set|load)s?) (?:it|them)(?: (?:down|up|back))?"
    r" (?P<on>on|onto|on top of) (?P<where>(?:(?:a|an|the|his|her) )?(?:\w+ )?(?:shelf|shelves|rack)\b)",
    re.IGNORECASE,
)
"""A box that is put where it belongs by its pronoun: "picks up a box, puts it on the shelf"."""
_INTO_GUARD = re.compile(
    r"\bsteps? back (?:in|on|)to (?:(?:a|an|his|her|the) )?(?:\w+ )?"
    r"(?:guard|en garde|(?:fighting|combat|battle) stance)\b",
    re.IGNORECASE,
)
_SWORD = re.compile(r"\b(?:sword|blade|katana|sab(?:re|er)|rapier|slash\w*)\b", re.IGNORECASE)
_GOES_ON = re.compile(
    r"(?P<stumbles>\bstumbles? forward),? and (?=(?:keeps?|continues?|carr(?:y|ies) on|goes? on)\b)", re.IGNORECASE
)
_DROPS_BACK = re.compile(r"\bdrop(?P<s>s)? back down\b(?! (?:to|on|from|off))", re.IGNORECASE)
_HIDES = re.compile(r"\b(?:crouch|peek|peep|kneel|hid|duck|squat|cover)\w*\b", re.IGNORECASE)
"""Words of who is low, or was: there he "drops back down" without a fall."""
_COMES_UP = re.compile(r"(?<=\bthen )comes? (?:back )?up and (?=[a-z]+s? )", re.IGNORECASE)
"""Beginning of a movement out of a low one, which leads up by itself."""
_ARTICLES = frozenset({"a", "an", "the", "his", "her"})
_SPINS_AND_FREEZES = re.compile(
    r"(?P<spins>\b(?:spin|twirl|pirouette|whirl|turn|jump|kick|punch|leap|danc)e?(?P<s>s|es)?(?: \w+ly| around| up)?)"
    r",? and (?:then )?(?P<ends>freezes?|holds? still|stands? still)(?=\W*$)",
    re.IGNORECASE,
)


_PICKS_SELF_UP = re.compile(
    r"\bpick(?P<end>s|ing|ed)? (?:him|her|it|them|my|your)sel(?:f|ves) (?:right |back )?up\b"
    r"(?: off (?:of )?the (?:floor|ground))?",
    re.IGNORECASE,
)
"""A rise after a fall, of which the readers make a thing that is picked up."""
_PATROLS = re.compile(
    r"\b(?P<subject>(?:a|an|the|two|one) (?:\w+ ){0,3}|^|he |she |they |and |then )patrol(?P<end>s|ling)?\b"
    r"(?! (?:cars?|officers?|duty|route|vehicle)\b)(?P<along> (?=(?:the|an?|his|her|their) ))?",
    re.IGNORECASE,
)
"""A walk of which the readers make a signal of the guard who takes it."""


def with_plain_phrases(prompt: str) -> str:
    """Return a prompt in which such phrases are told in words that the readers know.

    Args:
        prompt: without asides (`marey.text.asides`).
    """
    text = _TRIPS_AND_CATCHES.sub(_stumbles, prompt)
    text = _PICKS_SELF_UP.sub(_gets_up, _PATROLS.sub(_walks_along, text))
    text = _GOES_ON.sub(r"\g<stumbles>, then ", text)
    if _HIDES.search(text):
        text = _DROPS_BACK.sub(lambda it: f"{in_form_of(it['s'] or '', 'crouch')} down", text)
    text = _COMES_UP.sub("", text)
    text = _TURNED_AND_COMES.sub(lambda it: f"{it['turn']}walk{it['s'] or ''} forward", text)
    text = _GOES_BACK.sub(_turned_back, text)
    text = _RESTS.sub(lambda it: f"{it['joint']}{it['who'] or ''}wait{it['s'] or ''}", text)
    text = _HIGH_KNEES.sub(lambda it: f"run{'s' if it['does'] == 'does' else ''} in place with high knees", text)
    text = _MORE.sub(lambda it: f"{it['before']} {it['what'].removeprefix('more ')}", text)
    text = _WAY_AND_ANOTHER.sub(_with_verb, text)
    text = _EXAMINES.sub(lambda it: f"{in_form_of(it['ing'] or it['s'] or '', 'look')} down at the ground", text)
    text = _JUMPS_BACK_OVER.sub(r"\g<jump> backwards", text)
    text = _PUTS_IT.sub(_puts_box, _UPHILL.sub(r"\g<push>", text))
    text = _INTO_GUARD.sub(_steps_into_guard, text)
    return _SPINS_AND_FREEZES.sub(lambda it: f"{it['spins']}, then stand{(it['s'] and 's') or ''} still", text)


def _gets_up(found: re.Match[str]) -> str:
    gets = {"s": "gets", "ing": "getting", "ed": "got"}.get((found["end"] or "").lower(), "get")
    return f"{gets} up from the floor"


def _walks_along(found: re.Match[str]) -> str:
    walks = in_form_of(found["end"] or "", "walk")
    return f"{found['subject']}{walks}{' along ' if found['along'] else ''}"


def _stumbles(found: re.Match[str]) -> str:
    return f"stumble{found['s'] or ''} forward"


def _turned_back(found: re.Match[str]) -> str:
    """Return a way back out behind a turn, unless one is told before it."""
    s = found["s"] or ""
    way = f"{found['way']}{s}{found['how'] or ''} {found['where']}"
    if _TURNS_BEFORE.search(found.string[: found.start()]):
        return f"{found['joint']}{found['who'] or ''}{way}"
    turns = "turns" if s.endswith("s") else "turn"
    return f"{found['joint']}{found['who'] or ''}{turns} around and {way}"


def _steps_into_guard(found: re.Match[str]) -> str:
    """Return a step back, and the guard that it ends in; of who has a sword, with the sword."""
    s = "s" if found[0].lower().startswith("steps") else ""
    guard = f"stand{s} on guard with the sword" if _SWORD.search(found.string) else f"take{s} a fighting stance"
    return f"step{s} back, then {guard}"


def _puts_box(found: re.Match[str]) -> str:
    """Return who puts a box on a shelf, with the box by its name."""
    where = found["where"] if found["where"].split()[0].lower() in _ARTICLES else f"the {found['where']}"
    return f"{found['before']}{found['put']} the {found['what']} {found['on']} {where}"


def _with_verb(found: re.Match[str]) -> str:
    """Return a way, and the next one with the same verb."""
    verb, s = found["verb"] or found["verb2"], found["s"] or found["s2"]
    return f"{found['first']}, then {in_form_of(s or '', verb.lower())} "
