"""Flags of a prompt: what its words say that no motion of one person shows."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterator
from itertools import dropwhile, pairwise
from typing import Literal

from marey.vocabulary.inflection import verb_forms
from marey.vocabulary.lexicon import Lexicon
from marey.vocabulary.phrases import Match, Word
from marey.vocabulary.word_lists import WordLists

Flag = Literal[
    "negation",
    "objects",
    "counts",
    "length",
    "several-people",
    "subject",
    "other-subject",
    "other-language",
    "no-action",
    "gibberish",
]
"""`subject`: a noun that is in no list acts, and is read as a person; `objects`: mimed, the motion shows the body
alone; `length`: a stated one is that of a part, or out of the bundle's range; `counts`: may be done another number of
times."""

_FOREIGN_SHARE = 0.3
"""Share of the words that are another language's and not English, from which on the prompt is; twice that with any."""
_GIBBERISH_SHARE = 0.5
_LEAST_WORDS = 4
"""Words of a prompt with an action that may be gibberish nevertheless ("lorem ipsum dolor sit amet")."""
_TOGETHER = frozenset([("each", "other"), ("one", "another")])
"""Of people, unless parts of one are named before."""
_ARM_IN_ARM = frozenset([("hand", "in", "hand"), ("arm", "in", "arm")])
_SPEAKERS = frozenset(["i", "you", "we", "me"])
"""Those who ask for a motion, and are asked: "I need a guard"."""
_UNREAL = frozenset(["imaginary", "imagined", "invisible"])
_NUMBERS = frozenset(["two", "three", "four", "five", "both", "several", "many"])
_INTRODUCES = frozenset(["a", "an", "another", "other", "his", "her", "their", "my", "your"])
_TO = frozenset(["to", "at", "toward", "towards", "for"])
_LIKE = frozenset(["like", "as"])
_PRONOUNS = frozenset(["he", "she", "they", "it", "i", "you", "we"])
_NAMELESS = _PRONOUNS | {"someone", "somebody"}
_INDEFINITE = frozenset(["a", "an", "another"])
_DEFINITE = frozenset(["the", "his", "her", "its", "their", "my", "your"])
_LIGHT = frozenset(["do", "make", "give", "take", "have", "get", "perform", "be"])
"""Verbs whose object is an action: "does a shimmy"."""
_PARTICLES = frozenset(["up", "down", "away", "off", "out", "back"])
"""Between a verb and its object: "picks up a gauntlet"."""
_DOERS = re.compile(r"(?:[^aeiou]er|or|ist|ian|eer|ess|man|men|woman|women|boy|girl|lady)s?$")
"""Endings of nouns that name people by what they do."""
_MAX_OBJECT = 3
"""Words of an object: "the red fire extinguisher"."""
_OWNING = frozenset(["his", "her", "its", "their", "my", "your"])
_ORDINALS = frozenset(["another", "second", "third", "fourth", "fifth"])
"""Before an action's noun, or "time", they count it: "does a second cartwheel"."""
_SETS = frozenset(["pair", "duo", "trio"])
"""With "of" before an action's noun."""
_ANGLES = range(45, 100, 15)
"""Degrees that a turn may have: "turns 90"."""
_MAX_SUBJECT = 5
"""Words within which the subject stands."""


class Flagger:
    """Reads flags from the words of a prompt."""

    def __init__(self, lexicon: Lexicon, lists: WordLists, travels: frozenset[str], handling: frozenset[str]) -> None:
        """Keep the tables.

        Args:
            travels: ids of actions whose words say travel: what stands behind their verbs is a place.
            handling: verbs that the vocabulary has with an object right behind them: "lift a box".
        """
        self._lexicon = lexicon
        self._travels = travels
        self._handling = handling
        self._lists = lists
        self._persons = lists.people | lists.plural_people | lists.groups | lists.companions
        self._single_persons = (lists.people | lists.companions) - _PRONOUNS
        self._likened = lists.likened | {form for verb in lists.likened for form in verb_forms(verb)}

    def details(self, words: list[Word], found: list[Match], *, negated: bool) -> Iterator[Flag]:
        """Yield the flags of a prompt whatever it names.

        Args:
            found: phrases, also of what is not done.
            negated: something is said to be not done.
        """
        inside = {at for match in found for at in range(match.start, match.end)}  # "does nothing" is idle
        denied = (self._negates(words, at) for at in range(len(words)) if at not in inside)
        if negated or any(denied):
            yield "negation"
        named = (m.start for m in found if m.end - m.start == 1 or not all(meaning.noun for meaning in m.meanings))
        verbs = {*named}  # "bows deeply" has no bow
        listed = any(at not in verbs and self._is_listed_object(words, at) for at in range(len(words)))
        if listed or any(self._handles(words, at) for at in range(len(words))):
            yield "objects"
        if self._repeats(words, found) or any(self._counts(words, at) for at in range(len(words))):
            yield "counts"
        if self._several(words):
            yield "several-people"
        if self._has_strange_subject(words, found):
            yield "subject"

    def foreign(self, words: list[Word], found: list[Match]) -> Flag | None:
        """Return the flag of a prompt that names no person's action in English."""
        texts = [word.text for word in words if word.text.isalpha()]
        if self._is_other_language(texts):
            return "other-language"
        if words and self._is_other_subject(words, found):
            return "other-subject"
        return "gibberish" if self._is_gibberish(texts, bool(found)) else None

    def has_other_script(self, words: list[Word]) -> bool:
        """Return True if a word is written in other letters than English ones; single letters may be signs."""
        return any(
            len(word.text) > 1 and not word.text.isascii() and not any(map(_is_latin, word.text)) for word in words
        )

    def _negates(self, words: list[Word], at: int) -> bool:
        """Return True for "not" and its like; for "stops" and its like only before what is not done: "stops walking",
        not "stops at the door"."""
        text = words[at].text
        if text not in self._lists.negations:
            return False
        if text not in self._lists.ending:
            return True
        after = words[at + 1].text if at + 1 < len(words) else ""
        return after.endswith("ing") or (after == "to" and text not in ("stop", "stops"))  # "stops to wave"

    def _is_listed_object(self, words: list[Word], at: int) -> bool:
        """Return True for a noun of the list; a word for a part of the body, too, is one as the object of a verb that
        the vocabulary has with objects: "opens the chest", not "close to the chest"."""
        word, lists = words[at], self._lists
        if word.base not in lists.objects:
            return False
        if word.text not in lists.parts:
            return True
        before = [each for each in words[max(at - _MAX_OBJECT, 0) : at] if not self._is_skipped(each)]
        owned = at > 0 and words[at - 1].text in _OWNING
        return not owned and bool(before) and before[-1].base in self._handling

    def _repeats(self, words: list[Word], found: list[Match]) -> bool:
        """Return True if an action is named a second time with "again": "jumps, then jumps again"."""
        seen = set[str | None]()
        for match in found:
            actions = {each.action for each in match.meanings}
            if seen & actions and [word.text for word in words[match.end : match.end + 1]] == ["again"]:
                return True
            seen |= actions - {None}
        return False

    def _counts(self, words: list[Word], at: int) -> bool:
        text, lists = words[at].text, self._lists
        before, after = (words[k] if 0 <= k < len(words) else Word("", "") for k in (at - 1, at + 1))
        if text == "one":  # "does one jump", but not "one walks", nor "one step after another"
            node, third = self._lexicon.root.get(after.base), words[at + 2 : at + 3]
            begins = at == 0 or before.base in _LIGHT
            if after.text != after.base or node is None or not node.meanings or not begins:
                return False
            if third and third[0].text in lists.breaks | lists.prepositions:
                return False
        elif text.isdecimal():
            ends = not after.text or after.text in lists.breaks | lists.prepositions | lists.auxiliaries | lists.sides
            if ends and before.text != "x" and (before.text == before.base or int(text) in _ANGLES):
                return False  # a number of a file ("Jump_2"), or an angle; "squats 10" and "jump x3" are counts
            if text.startswith("0") or len(text) > 2:
                return False
        elif text in _ORDINALS or text in _SETS:
            behind = words[at + 1 + (text in _SETS) :][:1]
            if text in _SETS and after.text != "of":
                return False
            return bool(behind) and (self._names_action(behind[0]) or behind[0].text == "time")
        elif text not in lists.counts:
            return False
        return after.base not in self._lists.uncounted and after.text.removesuffix("s") not in self._lists.uncounted

    def _names_action(self, word: Word) -> bool:
        """Return True for a noun of an action."""
        node = self._lexicon.root.get(word.base)
        return node is not None and any(each.noun for each in node.meanings)

    def _handles(self, words: list[Word], at: int) -> bool:
        """Return True if a verb, but one of travel, is followed by "a" and a noun that is in no list: "swings a
        halberd", but not "walks a tightrope". Behind "the" and possessives, which places and parts of the body have
        as well, only verbs count that the vocabulary has with objects."""
        verb, rest = words[at], words[at + 1 :]
        if rest and rest[0].text in _PARTICLES:
            rest = rest[1:]
        if not self._lexicon.is_verb_form(verb.text) or not rest or rest[0].text not in _DEFINITE | _INDEFINITE:
            return False
        if rest[0].text in _DEFINITE and verb.base not in self._handling:
            return False
        node = self._lexicon.root.get(verb.base)
        meanings = () if node is None else node.meanings
        moves = rest[0].text in _INDEFINITE and verb.base not in self._handling  # "pushes a gurney" does, and handles
        if verb.base in _LIGHT or (moves and any(each.action in self._travels and not each.near for each in meanings)):
            return False
        phrase, after = self._noun_phrase(list(dropwhile(self._is_skipped, rest[1:])))
        if not phrase or after == "of" or len(phrase) > _MAX_OBJECT:  # "a series of" names no object
            return False
        if any(word.text in self._lists.limbs or word.text in self._lists.body_parts for word in phrase):
            return False  # "brings the feet underneath"
        *modifiers, noun = phrase
        if self._is_unlisted(noun.text):
            return True
        strange = any(self._is_unlisted(word.text) for word in modifiers)  # "the manhole cover", not "a timid bow"
        return strange and verb.base in self._handling and self._may_be_object(noun)

    def _noun_phrase(self, words: list[Word]) -> tuple[list[Word], str]:
        """Return a noun with the words before it, and the word behind it."""
        lists, phrase = self._lists, list[Word]()
        for word in words:
            ends = word.text in lists.breaks or word.text in lists.prepositions or word.text in lists.auxiliaries
            if ends and not (word.text == "can" and phrase):  # "the trash can"
                return phrase, word.text
            if word.text.endswith("ly") or word.text in _PARTICLES:
                return phrase, word.text
            phrase.append(word)
        return phrase, ""

    def _is_unlisted(self, text: str) -> bool:
        return len(text) > 2 and text.isalpha() and not self._is_english(text) and not self._is_english(_single(text))

    def _may_be_object(self, noun: Word) -> bool:
        """Return True for a listed noun that names no action, person or part of one, nor a place or time."""
        lists = self._lists
        if self._names_action(noun) or self._is_person(noun) or noun.text in lists.parts:
            return False
        return not noun.text.endswith(("ing", "ed")) and noun.text not in lists.sides | lists.units

    def _has_strange_subject(self, words: list[Word], found: list[Match]) -> bool:
        """Return True if a noun that is in no list, and has no ending of a doer, does the first action: "a mermaid
        swims", "the toaster walks"; not "a stumbling walk", whose action is a noun."""
        acts = next((m.start for m in found if words[m.start].text != words[m.start].base), 0)
        clause = [word for word in words[:acts] if not self._is_skipped(word) and not word.text.endswith("ly")]
        if not clause or words[0].text not in self._lists.determiners or words[acts].text.endswith("ing"):
            return False
        if any(self._is_person(word) or word.text in self._lists.breaks | self._lists.prepositions for word in clause):
            return False
        noun = clause[-1].text
        known = self._is_english(noun) or self._is_english(_single(noun)) or _DOERS.search(noun)
        return len(noun) > 2 and noun.isalpha() and not known

    def _is_skipped(self, word: Word) -> bool:
        return word.text in self._lists.skipped

    def _several(self, words: list[Word]) -> bool:
        """Return True if more than one person is named, or a person beside the one who acts."""
        lists, texts = self._lists, [word.text for word in words]
        if _ARM_IN_ARM & set(zip(texts, texts[1:], texts[2:], strict=False)) or ("someone", "else") in pairwise(texts):
            return True
        parts = self._lists.body_parts | self._lists.uncounted - self._lists.people - self._lists.plural_people
        for at, pair in enumerate(pairwise(texts)):
            if pair in _TOGETHER and not any({word.text, word.base} & parts for word in words[:at]):
                return True
        first: str | None = None
        for at, word in enumerate(words):
            if not self._is_person(word) or (word.text in lists.groups and not self._is_group(words, at)):
                continue
            if self._is_likened(words, at) or self._is_addressed(words, at):
                continue
            if self._is_plural(words, at) or self._are_two(words, at):
                return True
            if first is None and word.text not in lists.companions:
                first = word.base
            elif word.text not in _PRONOUNS and self._is_other(words, at, first):
                return True
        return False

    def _is_person(self, word: Word) -> bool:
        """Return True if a word is a person or several, not a part of one."""
        lists = self._lists
        if {word.text, word.base} & lists.body_parts or word.text in _SPEAKERS:
            return False
        return word.text in self._persons or _single(word.text) in self._single_persons

    def _is_group(self, words: list[Word], at: int) -> bool:
        """Return True if a word such as "crowd" is no part of another: not "a couple of steps", "a crowd member"."""
        if at + 1 == len(words):
            return True
        after, lists = words[at + 1].text, self._lists
        if after == "of":
            return False
        ends = lists.breaks | lists.prepositions | lists.auxiliaries | lists.skipped
        return after in ends or self._lexicon.is_verb_form(after)

    def _is_plural(self, words: list[Word], at: int) -> bool:
        """Return True if a word names several people: "soldiers march", "a crowd"."""
        lists, text = self._lists, words[at].text
        before = words[at - 1].text if at else ""
        if text in lists.groups or (before in _NUMBERS and text not in _NAMELESS):
            return True
        many = text in lists.plural_people or (text.endswith("s") and text not in lists.people | lists.companions)
        return many and before not in lists.people  # "she guards the door"

    def _are_two(self, words: list[Word], at: int) -> bool:
        """Return True if "and" joins a word with another person: "a man and his dog" are one, "father and son" two."""
        after = words[at + 1 : at + 5]
        if not after or after[0].text != "and":
            return False
        after = after[2:] if len(after) > 1 and after[1].text in self._lists.determiners else after[1:]
        named = next((word for word in after[:2] if self._is_person(word)), None)
        return named is not None and (named is after[0] or not self._lexicon.is_verb_form(after[0].text))

    def _is_other(self, words: list[Word], at: int, first: str | None) -> bool:
        """Return True if a noun behind the first person introduces another one: "hugs his friend", "a boy chases a
        girl", but not "a person does a soldier crawl"."""
        lists = self._lists
        start = next((k for k in range(at - 1, max(at - 4, -1), -1) if words[k].text in lists.determiners), None)
        if start is None or words[start].text not in _INTRODUCES:
            return False
        between = words[start + 1 : at + 1]
        if any(self._lexicon.is_verb_form(word.text) or word.text in _UNREAL for word in between):
            return False
        if words[at].base == first and words[start].text not in ("another", "other"):
            return False
        if first in _PRONOUNS and start and words[start - 1].text in lists.breaks:  # "where she stands, a woman …"
            return False
        after = words[at + 1] if at + 1 < len(words) else None
        ends = lists.breaks | lists.prepositions | lists.auxiliaries | lists.skipped
        return after is None or after.text in ends or after.text.endswith(("ly", "ing"))

    def _is_addressed(self, words: list[Word], at: int) -> bool:
        """Return True if something is done to, or for, a person who need not be there: "bows to the audience"."""
        for word in reversed(words[max(at - 4, 0) : at]):
            if word.text in self._lists.prepositions or word.text in _TO or word.text in self._lists.breaks:
                return word.text in _TO
        return False

    def _is_likened(self, words: list[Word], at: int) -> bool:
        """Return True if a person is only what another acts or looks like: "like a boxer", "the walk of a zombie"."""
        for word in reversed(words[max(at - 4, 0) : at]):
            if word.text in (".", ",", ";"):
                return False
            if word.text in _LIKE or word.text in self._likened:
                return True
            if word.text == "of":
                return not {each.text for each in words[max(at - 4, 0) : at]} & (self._lists.groups | {"front"})
        return False

    def _is_other_subject(self, words: list[Word], found: list[Match]) -> bool:
        """Return True if the first noun is an animal or a thing that does something; not that of a phrase such as
        "star jumps" or "wave hands"."""
        lists = self._lists
        phrases = {match.start for match in found if match.end - match.start > 1}
        bare = words[0].text not in lists.determiners
        for at, word in enumerate(words[:_MAX_SUBJECT]):
            if word.text in lists.people or word.base in lists.people:
                return False
            if at in phrases and (bare or words[0].text in lists.counts):
                return False
            if self._is_thing(word):
                after, third = [*words[at + 1 : at + 3], None, None][:2]
                # "the flag waves", but in "the ocean waves crash" the waves do.
                acts = third is None or not self._lexicon.is_verb_form(third.text)
                if after is None or not self._is_thing(after) or (acts and self._acts(word, after)):
                    sure = not bare and not self._lexicon.knows(word.text)
                    return sure or (after is not None and self._acts(word, after))
            elif word.text in lists.breaks or word.text in lists.prepositions or (bare and at):
                return False
        return False

    def _is_thing(self, word: Word) -> bool:
        things = self._lists.not_people
        return word.text in things or (word.text.endswith("s") and word.text[:-1] in things)

    def _acts(self, subject: Word, after: Word) -> bool:
        return self._lexicon.is_verb_form(after.text) and (after.text != after.base or subject.text.endswith("s"))

    def _is_other_language(self, texts: list[str]) -> bool:
        strange = {text for text in texts if not self._is_english(text)}
        return bool(strange) and any(self._speaks(known, texts, strange) for known in self._lists.languages)

    def _speaks(self, known: frozenset[str], texts: list[str], strange: set[str]) -> bool:
        hits, least = sum(text in known for text in strange), _FOREIGN_SHARE * len(texts)
        return hits >= least or (hits > 0 and sum(text in known for text in texts) >= 2 * least)

    def _is_gibberish(self, texts: list[str], named: bool) -> bool:
        if named and len(texts) < _LEAST_WORDS:
            return False
        share = _GIBBERISH_SHARE / 2 if named else _GIBBERISH_SHARE
        return sum(self._is_english(text) for text in texts) < share * max(len(texts), 1)

    def _is_english(self, text: str) -> bool:
        return self._lexicon.knows(text) or text in self._lists.english


def _single(text: str) -> str:
    """Return the singular of a regular plural; any other word as it is."""
    return text[:-1] if len(text) > 3 and text.endswith("s") else text


def _is_latin(letter: str) -> bool:
    return unicodedata.name(letter, "").startswith(("LATIN", "FULLWIDTH LATIN"))
