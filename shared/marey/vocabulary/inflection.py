"""Forms of English verbs and nouns, made by rule and a table of irregular ones."""

from __future__ import annotations

import re
from functools import lru_cache

_IRREGULAR = {  # base: forms that no rule makes
    "be": "was were been is are am being",
    "bend": "bent",
    "bind": "bound",
    "bite": "bit bitten",
    "blow": "blew blown",
    "break": "broke broken",
    "bring": "brought",
    "build": "built",
    "buy": "bought",
    "catch": "caught",
    "come": "came",
    "creep": "crept",
    "dig": "dug",
    "do": "did done does",
    "draw": "drew drawn",
    "drink": "drank drunk",
    "drive": "drove driven",
    "eat": "ate eaten",
    "fall": "fell fallen",
    "feed": "fed",
    "fight": "fought",
    "flee": "fled",
    "fling": "flung",
    "fly": "flew flown",
    "freeze": "froze frozen",
    "get": "got gotten",
    "give": "gave given",
    "go": "went gone goes",
    "grind": "ground",
    "grow": "grew grown",
    "hang": "hung",
    "have": "had has",
    "hide": "hid hidden",
    "hit": "",
    "hold": "held",
    "keep": "kept",
    "kneel": "knelt",
    "lay": "laid",
    "lead": "led",
    "leap": "leapt",
    "leave": "left",
    "lie": "lay lain lying",
    "make": "made",
    "pay": "paid",
    "put": "",
    "read": "",
    "ride": "rode ridden",
    "ring": "rang rung",
    "rise": "rose risen",
    "run": "ran",
    "say": "said",
    "shake": "shook shaken",
    "shoot": "shot",
    "shrink": "shrank shrunk",
    "sing": "sang sung",
    "sink": "sank sunk",
    "sit": "sat",
    "sleep": "slept",
    "sling": "slung",
    "slink": "slunk",
    "speak": "spoke spoken",
    "spin": "spun",
    "spring": "sprang sprung",
    "stand": "stood",
    "steal": "stole stolen",
    "stick": "stuck",
    "stride": "strode stridden",
    "strike": "struck",
    "sweep": "swept",
    "swim": "swam swum",
    "swing": "swung",
    "take": "took taken",
    "teach": "taught",
    "tell": "told",
    "think": "thought",
    "throw": "threw thrown",
    "wake": "woke woken",
    "weave": "wove woven",
    "weep": "wept",
    "wind": "wound",
    "wring": "wrung",
    "write": "wrote written",
}
_PLURALS = {"foot": "feet", "man": "men", "woman": "women", "knife": "knives", "child": "children", "shelf": "shelves"}
_DOUBLES = re.compile(r"^[^aeiou]*(?:qu)?[aeiou][bdfgklmnprtz]$")
"""One syllable that ends in one vowel and one consonant: stop, spin, quit."""
_REGULAR_TOO = ("kneel", "leap")


def verb_forms(base: str) -> frozenset[str]:
    """Return all forms of a verb: base, third person, gerund, past and participle.

    Both spellings stand where writers differ (signaling, signalling).
    """
    forms = {base, third_person(base), *_gerunds(base)}
    irregular = _IRREGULAR.get(base)
    if irregular is not None:
        forms |= set(irregular.split())
        if base not in _REGULAR_TOO:
            return frozenset(forms)
    return frozenset(forms | _pasts(base))


@lru_cache(maxsize=4096)
def noun_forms(base: str) -> frozenset[str]:
    """Return singular and plural of a noun."""
    return frozenset({base, _PLURALS.get(base) or third_person(base)})


def third_person(base: str) -> str:
    """Return the form with -s: walks, carries, punches."""
    if re.search(r"[^aeiou]y$", base):
        return base[:-1] + "ies"
    return base + ("es" if base.endswith(("ch", "sh", "s", "x", "z", "o")) else "s")


def phrase_in_third_person(phrase: str) -> str:
    """Return a verb phrase with its first word in the form with -s: "waves a hand"."""
    verb, *rest = phrase.split()
    return " ".join([third_person(verb), *rest])


def forms_of_other(base: str, other: str) -> dict[str, str]:
    """Return the form of another, regular verb for each form of a verb: of "walk" "walking" for "strolling"."""
    same = {third_person(base): third_person(other), base: other}
    return {
        form: same.get(form) or (gerund(other) if form.endswith("ing") else f"{other}ed") for form in verb_forms(base)
    }


def gerund(base: str) -> str:
    """Return the form with -ing: walking, carrying, stopping."""
    return max(_gerunds(base), key=len)


def _gerunds(base: str) -> set[str]:
    if base.endswith("ie"):
        return {base[:-2] + "ying"}
    if base.endswith("e") and not base.endswith(("ee", "oe", "ye")):
        return {base[:-1] + "ing"}
    return {stem + "ing" for stem in _stems(base)}


def _pasts(base: str) -> set[str]:
    if base.endswith("e"):
        return {base + "d"}
    if re.search(r"[^aeiou]y$", base):
        return {base[:-1] + "ied"}
    return {stem + "ed" for stem in _stems(base)}


def _stems(base: str) -> set[str]:
    """Stems before -ing and -ed: with the last letter doubled, single, or both where writers differ."""
    doubled = base + base[-1]
    if _DOUBLES.match(base):
        return {doubled}
    if base.endswith(("al", "el", "il", "ap", "ip", "op")) and not base.endswith(("eal", "eel", "ail", "oil", "oop")):
        return {base, doubled}
    return {base}


def indefinite_article(word: str) -> str:
    """Return "a" or "an" for a word, by its first letter."""
    return "an" if word[0].lower() in "aeiou" else "a"


def in_form_of(said: str, verb: str) -> str:
    """Return a verb in the form of another one, or of its ending: in -ing, in the third person, or as it is."""
    end = said.lower()
    return gerund(verb) if end.endswith("ing") else third_person(verb) if end.endswith("s") else verb


def in_present_form_of(said: str, verb: str) -> str:
    """Return a verb in the form of another one, or of its ending; of a past one in the third person: "sits" for
    "slumped", "falls" for "lost"."""
    return in_form_of("s" if said.lower().endswith(("d", "t")) else said, verb)
