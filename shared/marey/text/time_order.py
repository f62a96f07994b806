"""Words of the order of actions, and of what comes back, written out before a prompt is read (ours).

The readers were trained on clauses in the order of time. "Before she sits down, she waves", the numbers of a list, a
trip before a getting up and a way "in the opposite direction" are written as what is done, one after the other.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from functools import lru_cache

from marey.text.known_verbs import with_sudden_stops
from marey.text.negated_order import without_negated_order
from marey.text.told_later import WHO, told_in_order
from marey.vocabulary.bearings import bearing_words
from marey.vocabulary.entries import load_vocabulary
from marey.vocabulary.inflection import gerund, in_form_of, phrase_in_third_person
from marey.vocabulary.word_lists import load_word_lists

_WHO = WHO.replace(" ", r"\ ")
_BEFORE = re.compile(
    rf"""^(?:right\ |just\ |shortly\ )?before\ (?:(?P<who>{_WHO})\ (?=\w+s\b)|(?=\w+ing\b))
    (?P<later>[^,.;]+),\ (?!and\b|then\b)(?P<first>(?:(?!\bthen\b)[^.;])+?)(?P<end>\W*)$""",
    re.IGNORECASE | re.VERBOSE,
)
"""A prompt whose first clause is done last: "before she sits down, the nurse stretches"."""
_AFTER = re.compile(
    rf"^(?:right |just |shortly )?after (?P<first>\w+ing\b[^,.;]*), (?P<who>{WHO})"
    r" (?P<later>(?:\w+ly )?[a-z]+s\b.*)$",
    re.IGNORECASE,
)
"""A first clause without its subject: "after clapping for two seconds, the old man sits down"."""
_RISES = (
    r"(?:(?:slowly|quickly|painfully|gingerly|then)\ )*(?:(?:he|she|they)\ )?(?:(?:slowly|quickly|immediately|then)\ )*"
    r"(?:(?:gets?|getting|climbs?|rises?|stands?|scrambles?|springs?)\ (?:right\ |straight\ |back\ )?"
    r"(?:up|(?:on)?to\ (?:his|her|their|its)\ feet)|picks?\ (?:him|her|them)sel\w+\ (?:back\ )?up)\b"
)
_TRIPS = re.compile(
    rf"""\b(?P<trip>trip|stumble)(?P<s>s)?
    (?:\ (?:over|on)\ (?:a|an|the|his|her|their|some)\ (?:\w+\ )?\w+|\ over|\ up)?
    (?=(?:,|;|\.|\ ->|\ and|\ then|,\ and|,\ then)?\ (?:and\ |then\ |but\ )*{_RISES})""",
    re.IGNORECASE | re.VERBOSE,
)
"""A trip behind which one gets up, so that it was a fall: "trips, gets back up"."""
_BACK_UP = re.compile(r"\b(?P<rise>get|gets|getting|stand|stands|standing) back up\b(?! (?:the|to|a)\b)", re.IGNORECASE)
_FALLS_AND_CLIMBS = re.compile(
    r"""(?P<falls>\bfalls?\ forward(?:,|;|\.)?\ (?:and\ |then\ )*(?:(?:he|she|they|it)\ )?(?:\w+ly\ )?)
    (?:climb|scramble|stagger|get)(?P<s>s)?(?:\ back)?\ (?:up|to\ (?:his|her|their|its)\ feet)\b(?!\ (?:a|the|to)\b)""",
    re.IGNORECASE | re.VERBOSE,
)
"""A fall behind which one comes to one's feet by other words than "gets up"."""
_GAIT = r"(?:walk|run|jog|sprint|sneak|march|stroll|limp|dash|crawl|go|head|creep)"
_OPPOSITE = re.compile(
    rf"""(?:(?P<turns>\bturns?)\ )?
    (?P<joint>(?:,|;|\.|\band|\bthen|->)\ (?:(?:he|she|they)\ )?)(?P<way>{_GAIT})(?P<s>e?s)?\b
    (?P<off>\ (?:away|off|back))?\ (?:in\ )?the\ (?:opposite|other)\ (?:direction|way)\b(?!\ (?:of|to|from)\b)""",
    re.IGNORECASE | re.VERBOSE,
)
"""A way back to where the body came from: "freezes, then runs off in the opposite direction"."""
_TURNED = re.compile(r"\bturn\w* (?:a?round|back|180)[^.;]*$", re.IGNORECASE)
_CARRIES_ON = re.compile(
    r"\b(?:(?P<carries>carr(?:y|ies)) on|(?<=then )(?P<keeps>keeps?|continues?|goe?s? on)) (?P<verb>\w+ing)\b",
    re.IGNORECASE,
)
"""Words of who does something again, or still: "stumbles, then carries on limping"."""
_ENDS_BY = re.compile(
    r",?\ (?:and\ )?(?:then\ |finally\ )?(?:ends?|finish(?:es)?|clos(?:es|e)|concludes?)\ (?:up\ |off\ )?(?:by|with)"
    r"\ (?P<last>[a-z]+ing\b(?:\ [^,.;]+)?)",
    re.IGNORECASE | re.VERBOSE,
)
"""An action done last, told as an end: "marches ahead and ends by saluting"."""
_COUNTED_BEFORE_TURN = re.compile(
    rf"""(?P<steps>\b{_GAIT}(?:e?s)?\b[^,.;]*\bsteps?\b[^,.;]*?)(?:,?\ (?:and\ )?(?:then\ )?|,\ )
    (?P<turn>turns?\ (?:\w+ly\ )?(?:to\ (?:the|his|her)\ )?(?:left|right|around))(?:,?\ (?:and\ )?(?:then\ )?|,\ )
    (?P<keep>keeps?|continues?|go(?:es)?\ on|carr(?:y|ies)\ on|walks?\ on)(?:\ (?P<again>\w+ing))?\b""",
    re.IGNORECASE | re.VERBOSE,
)
"""Counted steps, a turn and the way behind it: "walks two steps, turns left and walks on"."""
_IN_TURN = re.compile(
    r"\b(?P<verb>turns?|pivots?|sidesteps?|side steps?|steps?|hops?|kicks?|slash(?:es)?|cuts?"
    r"|punch(?:es)?)(?P<how> [^,.;]*\b(?:left|right)\b[^,.;]*),"
    r" (?:and )?(?=(?P=verb)\b[^,.;]*\b(?:left|right)\b)",
    re.IGNORECASE,
)
"""An action on one side before the same on the other: "turns left, turns right"."""
_PUNCH_BEFORE = re.compile(
    r"(?P<punch>\b(?:jab|cross|hook|uppercut)s?), "
    r"(?=(?:[\w-]+ ){0,2}?(?:kick|knee|elbow|block|duck|dodge|weave|sweep)s?\b)",
    re.IGNORECASE,
)
"""A punch by its name before what is none, in a list: "jab, cross, roundhouse kick"."""
_OPENING = re.compile(
    r"""^(?P<opens>\W*(?:(?:before|after|prior\ to|while|when|once|upon)\ (?:\w+ly\ )?\w+ing|having)\b[^,;.:]*?
    (?<!\bwho)(?<!\bwhat)(?<!\bthat)(?<!\bas)(?<!\bwhere)(?<!\bhow)(?<!\bwhen)(?<!\bwhile)(?<!\bthan)(?<!\bbefore)
    (?<!\bafter)(?<!\buntil)(?<!\bif)(?<!\bbecause))\ (?P<who>he|she|they)\ (?=\w)""",
    re.IGNORECASE | re.VERBOSE,
)
"""Beginnings without a subject before the person that the prompt is of: "before sitting down she waves"."""
_AS_SOON_AS = re.compile(r"\bas soon as ", re.IGNORECASE)
_NUMBER = re.compile(r"(?:^|(?<=[\s,;.]))\(?(?P<number>\d{1,2})[.):]\s+(?=[^\W\d])")
LEAST_NUMBERS = 2
"""Numbers from 1 on that make a prompt a list."""
_OF_BEARINGS, _FIRST = re.compile(r"<(\w+)>"), re.compile(r"^[\w|-]+")
"""Verbs in the words of bearings."""
_DOES: Mapping[str, str] = {
    **dict.fromkeys(("jogger",), "jogs"),
    **dict.fromkeys(("runner", "racer"), "runs"),
    **dict.fromkeys(("sprinter",), "sprints"),
    **dict.fromkeys(("walker", "hiker", "wanderer", "stroller", "pedestrian"), "walks"),
    **dict.fromkeys(("dancer", "ballerina"), "dances"),
    **dict.fromkeys(("swimmer",), "swims"),
}
"""Verbs of people whose nouns say what they do."""
_DOER = re.compile(
    rf"""^(?P<who>(?:(?:a|an|the|one)\ )?(?:(?!(?:night|street|rope|tightrope|dog|blade)\b)[\w-]+\ ){{0,2}}?
    (?:{"|".join(_DOES)}))
    (?P<how>(?:,\ |\ (?:who|that)\ (?:is|looks|seems)\ )[\w\ -]+)?[.!]?$""",
    re.IGNORECASE | re.VERBOSE,
)
"""A prompt without a verb, of a person named by what they do: "a jogger, tired"."""


def in_time_order(prompt: str) -> str:
    """Return a prompt with its actions in the order of time, and with the words of those that it leaves out: "claps,
    then sits down" of "before she sits down, she claps". Any other prompt is returned as it is."""
    said = without_negated_order(_without_numbers(prompt))
    opened = _OPENING.sub(r"\g<opens>, \g<who> ", said, count=1)
    text = told_in_order(_AS_SOON_AS.sub("once ", opened), _does_so)
    text = _AFTER.sub(_after, _BEFORE.sub(_before, text))
    text = _BACK_UP.sub(r"\g<rise> up", _TRIPS.sub(_trips, text))
    text = _FALLS_AND_CLIMBS.sub(lambda up: f"{up['falls']}get{up['s'] or ''} up", text)
    text = _CARRIES_ON.sub(_carries_on, with_sudden_stops(text))
    text = _COUNTED_BEFORE_TURN.sub(_steps_and_turn, _ENDS_BY.sub(_ends, text))
    text = _IN_TURN.sub(r"\g<verb>\g<how>, then ", _PUNCH_BEFORE.sub(r"\g<punch>, then ", text))
    return _OPPOSITE.sub(_turned, _DOER.sub(_does, text))


def _does_so(phrase: str) -> str | None:
    """Return a phrase that begins with a verb in -ing in the third person; None if the verb is not known."""
    verb, _, rest = phrase.partition(" ")
    known = _verbs_of_gerunds().get(verb.lower())
    return None if known is None else " ".join(filter(None, (phrase_in_third_person(known), rest)))


def _before(found: re.Match[str]) -> str:
    """Return what is done first, and then what comes later."""
    later = found["later"]
    if found["who"] is None:
        said = _does_so(later)
        if said is None:
            return found[0]
        later = said
    return f"{found['first']}, then {later}{found['end']}"


def _after(found: re.Match[str]) -> str:
    """Return what is done first with its subject, and then what comes later."""
    first = _does_so(found["first"])
    return found[0] if first is None else f"{found['who']} {first}, then {found['later']}"


@lru_cache(maxsize=1)
def _verbs_of_gerunds() -> Mapping[str, str]:
    """Return each verb that is known, by its form in -ing."""
    phrases = [phrase for each in load_vocabulary().actions.values() for phrase in (*each.verbs, *each.near)]
    verbs = {phrase.split()[0] for phrase in (*phrases, *load_word_lists().other_verbs)}
    for _, words in bearing_words():
        verbs.update(verb for entries in words.values() for entry in entries for verb in _OF_BEARINGS.findall(entry))
        verbs.update(verb for entry in words.get("gaits", ()) for verb in _FIRST.findall(entry)[0].split("|"))
    return {gerund(verb): verb for verb in sorted(verbs) if verb.isalpha()} | {"leaving": "walk off"}


def _carries_on(found: re.Match[str]) -> str:
    """Return a verb in the form of the one that says that it goes on."""
    said = found["carries"] or found["keeps"]
    verb = _verbs_of_gerunds().get(found["verb"].lower())
    if verb is None:
        return f"{'keeps' if said.lower().endswith('s') else 'keep'} {found['verb']}"
    return in_form_of(said.split()[0], verb)


def _trips(found: re.Match[str]) -> str:
    """Return the fall that a trip ends with."""
    return f"fall{found['s'] or ''} forward"


def _ends(found: re.Match[str]) -> str:
    """Return what is done last behind what comes before it."""
    last = _does_so(found["last"])
    return found[0] if last is None else f", then {last}"


def _steps_and_turn(found: re.Match[str]) -> str:
    """Return steps, a turn and a way, one after the other."""
    way = _verbs_of_gerunds().get((found["again"] or "walking").lower(), "walk")
    turns = found["turn"].split()[0]
    return f"{found['steps']}, then {found['turn']}, then {in_form_of(turns, way)} forward"


def _turned(found: re.Match[str]) -> str:
    """Return a way behind the turn that it begins with; without another where one is told before."""
    if found["turns"]:  # "turns and walks in the opposite direction"
        return f"{found['turns']} around and then {found['way']}{found['s'] or ''} away"
    way = f"{found['way']}{found['s'] or ''} away"
    if _TURNED.search(found.string[: found.start("way")]):
        return f"{found['joint']}{way}"
    return f"{found['joint']}{in_form_of(found['s'] or '', 'turn')} around and then {way}"


def _does(found: re.Match[str]) -> str:
    """Return who is named by what they do with the verb of it; as it is where words behind say what else is done."""
    how = found["how"] or ""
    noun = found["who"].split()[-1].lower()
    if re.search(r"\b\w+ing\b|\b(?:is|looks|seems) (?:at|in|on)\b", how):
        return found[0]
    return f"{found['who']} {_DOES[noun]}{how}"


def _without_numbers(prompt: str) -> str:
    """Return a list with numbers from 1 on, in their order, as what is done one after the other."""
    signs = list(_NUMBER.finditer(prompt))
    if len(signs) < LEAST_NUMBERS or [int(sign["number"]) for sign in signs] != list(range(1, len(signs) + 1)):
        return prompt
    before = prompt[: signs[0].start()].strip()
    listed = ", then ".join(_listed(prompt, signs))
    return f"{before} {listed}".strip()


def _listed(prompt: str, signs: list[re.Match[str]]) -> Iterator[str]:
    ends = [*(sign.start() for sign in signs[1:]), len(prompt)]
    for sign, end in zip(signs, ends, strict=True):
        yield prompt[sign.end() : end].strip(" ,;.")
