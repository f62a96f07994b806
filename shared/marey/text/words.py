"""English word tables of the rewriter and its guard: verb forms, sides, directions, numbers, units."""

from __future__ import annotations

from marey.vocabulary import inflection

EDGE_PUNCTUATION = ".,;:!?\"'()[]…"
"""Punctuation stripped from the ends of words and of nodes' texts."""
IRREGULAR = {  # base: (past, participle)
    "be": ("was", "been"),
    "begin": ("began", "begun"),
    "bend": ("bent", "bent"),
    "catch": ("caught", "caught"),
    "come": ("came", "come"),
    "do": ("did", "done"),
    "drink": ("drank", "drunk"),
    "fall": ("fell", "fallen"),
    "get": ("got", "gotten"),
    "give": ("gave", "given"),
    "go": ("went", "gone"),
    "hold": ("held", "held"),
    "keep": ("kept", "kept"),
    "kneel": ("knelt", "knelt"),
    "leave": ("left", "left"),
    "lose": ("lost", "lost"),
    "make": ("made", "made"),
    "rise": ("rose", "risen"),
    "run": ("ran", "run"),
    "shake": ("shook", "shaken"),
    "sit": ("sat", "sat"),
    "spin": ("spun", "spun"),
    "stand": ("stood", "stood"),
    "strike": ("struck", "struck"),
    "sweep": ("swept", "swept"),
    "swim": ("swam", "swum"),
    "swing": ("swung", "swung"),
    "take": ("took", "taken"),
    "throw": ("threw", "thrown"),
}
_PRESENT = {"is": "be", "are": "be", "am": "be", "being": "be", "has": "have", "going": "go", "doing": "do"}
_BASE = {form: base for base, forms in IRREGULAR.items() for form in forms} | _PRESENT
KEEPS_DOUBLE = ("kiss", "cross", "pass", "press", "toss", "roll", "pull", "call", "fall", "kneel", "add", "spell")
"""Verbs whose doubled last letter is their own."""
_ENDS_IN_E = """
arrive balance bike bounce breathe cause celebrate change charge choose circle close come compensate continue
cycle dance die dive dodge dribble drive evade exercise exhale face gesture give grimace handle have hesitate hike
hobble hustle imitate inhale judge juggle leave lie like live lose lounge lunge make massage move operate pace paddle
pause place plunge pose prepare produce raise rake resume rise rotate saddle scrape shake shove shuffle slice smile
sneeze squeeze stare stride strike stroke struggle stumble swipe take tie trade tumble type use waddle wave wiggle wipe
wobble write
"""
ENDS_IN_E = frozenset(_ENDS_IN_E.split())


def _table(text: str) -> dict[str, str]:
    """Lines of `meaning: word word …` as word → meaning."""
    lines = [line.partition(":") for line in text.strip().splitlines()]
    return {word: meaning.strip() for meaning, _, words in lines for word in words.split()}


SIDES = _table("""
left: left leftward leftwards
right: right rightward rightwards
both: both
clockwise: clockwise
counterclockwise: counterclockwise counter-clockwise anticlockwise anti-clockwise
""")
DIRECTIONS = _table("""
forward: forward forwards ahead
back: back backward backwards
up: up upward upwards
down: down downward downwards
side: sideways sidewards
diagonal: diagonally
around: around
""")
NUMBERS = _table("""
0: zero
0.5: half
1: one once single
2: two twice couple
3: three thrice
4: four
5: five
6: six
7: seven
8: eight
9: nine
10: ten
some: several few
""")
UNITS = _table("""
meters: m
centimeters: cm
feet: ft
inches: in
seconds: s sec secs
minutes: min
degrees: deg degs °
times: x
""")
SINGULAR = {
    "meters": "meter",
    "centimeters": "centimeter",
    "feet": "foot",
    "inches": "inch",
    "seconds": "second",
    "minutes": "minute",
    "degrees": "degree",
    "times": "time",
}


def bare(word: str) -> str:
    """Lower case, without punctuation at the ends."""
    return word.lower().strip(EDGE_PUNCTUATION)


def lemma(word: str) -> str:
    """The base form of a verb: walks, walking, walked → walk."""
    word = bare(word)
    if word in _BASE:
        return _BASE[word]
    for ending in ("ing", "ed"):
        if word.endswith(ending) and not word.endswith("eed") and len(word) > len(ending) + 2:
            return _restore(word.removesuffix(ending))
    if word.endswith("ies") and len(word) > 4:
        return word[:-3] + "y"
    if word.endswith(("ches", "shes", "sses", "xes", "zes", "oes")):
        return word[:-2]
    return word[:-1] if word.endswith("s") and not word.endswith("ss") and len(word) > 3 else word


def _restore(stem: str) -> str:
    """Return the base form of a word from its stem before -ing or -ed."""
    if stem + "e" in ENDS_IN_E:
        return stem + "e"
    if stem.endswith("i"):
        return stem[:-1] + "y"
    doubled = len(stem) > 3 and stem[-1] == stem[-2] and stem[-1] not in "aeiou"
    return stem[:-1] if doubled and stem not in KEEPS_DOUBLE else stem


def third_person(base: str) -> str:
    """walk → walks, carry → carries, punch → punches."""
    return {"be": "is", "have": "has"}.get(base) or inflection.third_person(base)


def inflected(word: str) -> str:
    """A verb of any form in the third person singular, with its punctuation: "walk," → "walks,"."""
    core = bare(word)
    return word.lower().replace(core, third_person(lemma(core)), 1)


def is_past(word: str) -> bool:
    """Return True if the word is a past form: -ed or an irregular one."""
    word = bare(word)
    return any(word == past for past, _ in IRREGULAR.values()) or (
        word.endswith("ed") and not word.endswith("eed") and len(word) > 4
    )


def one_slip(wrong: str, right: str) -> bool:
    """Return True if one letter lost, added, replaced or swapped with its neighbour turns `wrong` into `right`."""
    if wrong == right or abs(len(wrong) - len(right)) > 1:
        return False
    start = 0
    while start < min(len(wrong), len(right)) and wrong[start] == right[start]:
        start += 1
    a, b = wrong[start:], right[start:]
    return a[1:] == b or a == b[1:] or a[1:] == b[1:] or (len(a) > 1 and a[:2] == b[1::-1] and a[2:] == b[2:])
