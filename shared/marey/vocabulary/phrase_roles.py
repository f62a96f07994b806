"""Grammatical roles around a phrase: whether the person does what it names, or something else is said."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from marey.vocabulary.entries import Action, Vocabulary
from marey.vocabulary.lexicon import SELF, Lexicon, words_of
from marey.vocabulary.phrases import STOPS, Match, Word
from marey.vocabulary.word_lists import WordLists

PARTICLES = frozenset(["up", "down", "off", "out", "away", "back", "in", "forward", "aside", "sideways"])
"""Between a verb and its object: "throws back her head"."""
_SIDED = {
    "hand": frozenset(["arm", "hand", "fist", "forearm", "palm", "finger"]),
    "foot": frozenset(["leg", "foot", "knee"]),
}
"""Parts that do an action by its field `sided`."""
_GOING_ON = frozenset(["carry", "go", "keep", "move"])
_TRUNK = frozenset(["torso", "trunk"])
_DEFINED = frozenset(["One", "Both", "A", "The"])
_DEFINED_WORDS = 4
"""A definition whose first words are "One or both hands" is done by the hands."""
_HEADS = 3
"""Words within which the noun of an object stands behind its article."""
_WITHIN = 5
_TOGETHER_WITH = frozenset(["with", "and", "while", "as", "but", "so"])
"""Words before a clause of a part's own: "with his arms hanging"."""
_OTHERS_CLAUSE = frozenset(["as", "while", "when", "whenever", "because", "until", "since", "where"])
_OTHERS = frozenset(["someone", "somebody", "everyone", "everybody", "others", "people", "another"])
_PRONOUNS = frozenset(["he", "she", "they", "it", "i", "you", "we"])
_PATHS = frozenset(["arc", "curve", "circle"])
_HOW = frozenset(["with", "in", "by", "between", "at", "on", "along", "around"])
_UNDER = frozenset(["under", "against"])
_STRUCK = frozenset(["him", "her", "them", "in", "at"])
_BLOWS = frozenset(["kick", "punch"])
_KINDS_OF_BLOWS = frozenset(["spin", "turn", "turn-around", "jump", "jump-turn", "push"])
"""Actions that say what kind of blow it is before its noun."""
_KIND_WORDS = 2
"""Words between such a word and the noun: "360 degree spin kick"."""
_DEFINITE = frozenset(["the", "his", "her", "their", "its"])


class PhraseRoles:
    """Rules by which a phrase names no action of the person, though its words are in the vocabulary."""

    def __init__(self, lexicon: Lexicon, lists: WordLists, vocabulary: Vocabulary, travels: frozenset[str]) -> None:
        """Keep the tables, and the parts of the body that each action's entry names."""
        self._lexicon = lexicon
        self._lists = lists
        self._travels = travels
        self._people = lists.people - lists.body_parts - _PRONOUNS - {"body", "someone", "somebody"}
        self._things = lists.objects | lists.not_people
        self._lifeless = self._things - lists.people
        self._moved: dict[str, frozenset[str]] = {}
        self._named: dict[str, frozenset[str]] = {}
        for action in vocabulary.actions.values():
            phrases = [
                [lists.limbs.get(word, word) for word in words_of(phrase)] for phrase in (*action.verbs, *action.near)
            ]
            self._named[action.id] = frozenset(word for words in phrases for word in words)
            objects = frozenset(words[1] for words in phrases if len(words) > 1)
            self._moved[action.id] = objects | _SIDED.get(action.sided, frozenset()) | self._defined(action)

    def _defined(self, action: Action) -> frozenset[str]:
        """Return the parts of the body that do an action by the first words of its definition; what they hold on to
        carries the body."""
        first = [word.strip(",") for word in action.definition.split()[:_DEFINED_WORDS]]
        if first[0] not in _DEFINED or action.support == "raised":
            return frozenset()
        parts = {self._lists.limbs[word] for word in first if word in self._lists.limbs}
        return frozenset(parts).union(*(group for group in _SIDED.values() if group & parts))

    def actions(self, words: list[Word], found: Sequence[Match]) -> list[Match]:
        """Return the phrases that the person does.

        A verb with another object than its action's is none at all; what is said beside an action counts only where
        nothing else does.
        """
        done = [match for match in found if not self._has_other_object(words, match)]
        main = [match for at, match in enumerate(done) if not self._is_beside(words, done, at)]
        return main or done

    # -- objects ------------------------------------------------------------------------------------------------------

    def _has_other_object(self, words: list[Word], match: Match) -> bool:
        """Return True for a verb of things with the body, a part of it or another thing as its object: "throws himself
        aside", "turns her head", "rolls a barrel"; not where the action's own words have the part ("rolls shoulders").
        """
        lists, verb = self._lists, words[match.start]
        if verb.base not in lists.of_things or not self._lexicon.is_verb_form(verb.text):
            return False
        noun = self._object(words, match.start + 1)
        if noun is None:
            return False
        if noun.base != SELF and noun.text not in lists.limbs and noun.text not in _TRUNK:
            single = match.end - match.start == 1
            turned = verb.base in lists.turning and not {noun.text, noun.base}.isdisjoint(lists.objects)
            return single and (turned or (noun.text == "body" and verb.base not in lists.turning))
        part = lists.limbs.get(noun.text, noun.base)
        return not any(part in self._named[each.action] for each in match.meanings if each.action)

    def _object(self, words: list[Word], start: int) -> Word | None:
        """Return the noun behind a verb, if it is the body, a part of it or a thing that a body handles."""
        lists, at = self._lists, start
        if at < len(words) and words[at].text in PARTICLES:
            at += 1
        for word, after in zip(words[at : at + _HEADS + 1], [*words[at + 1 :], Word("", "")], strict=False):
            ends = word.text in lists.breaks or word.text in lists.prepositions or word.text in lists.auxiliaries
            if ends or word.text.endswith("ing"):
                return None
            listed = word.text in lists.limbs or word.text in _TRUNK or word.text == "body"
            thing = not {word.text, word.base}.isdisjoint(lists.objects)
            if word.base == SELF or ((listed or thing) and self._ends_noun(after)):
                return word
        return None

    def _ends_noun(self, after: Word) -> bool:
        """Return True if a noun before this word is no modifier: not "hand" in "hand grenade"."""
        lists, text = self._lists, after.text
        if not text or text in lists.breaks or text in lists.prepositions or text in lists.auxiliaries:
            return True
        return text in lists.skipped or text in PARTICLES or text.endswith(("ly", "ing", "ed", "s"))

    # -- what is said beside an action --------------------------------------------------------------------------------

    def _is_beside(self, words: list[Word], found: Sequence[Match], at: int) -> bool:
        match = found[at]
        if any(meaning.aside for meaning in match.meanings):
            return True
        return (
            self._is_part(words, match)
            or self._is_of_part(words, match)
            or self._performs_next(words, found, at)
            or self._continues(words, match)
            or self._is_averted(words, match)
            or self._modifies_person(words, match)
            or self._says_how(words, found, at)
            or self._is_kind_of_blow(words, found, at)
            or self._is_by_others(words, match)
            or self._is_likened(words, found, at)
            or self._is_held(words, match)
        )

    def _is_part(self, words: list[Word], match: Match) -> bool:
        """Return True for a part of the body whose word is a verb, too, that strikes nothing: "elbows bent"."""
        if match.end - match.start > 1 or words[match.start].text not in self._lists.limbs:
            return False
        after = words[match.end].text if match.end < len(words) else ""
        return not (after in self._lists.determiners or after in self._people or after in _STRUCK)

    def _is_of_part(self, words: list[Word], match: Match) -> bool:
        """Return True if a part of the body, or a thing, has the verb in a clause of its own ("arms hanging", "the gun
        kicks back"), and the action is not done by that part ("the left arm waves")."""
        lists, verb = self._lists, words[match.start]
        if not self._lexicon.is_verb_form(verb.text):
            return False
        noun = match.start - 1
        while noun >= 0 and (words[noun].text.endswith("ly") or words[noun].text in ("is", "are", "was", "were")):
            noun -= 1
        if noun < 0:
            return False
        text = words[noun].text
        if text not in lists.limbs and {text, words[noun].base}.isdisjoint(self._lifeless):
            return False
        first = noun
        while first > 0 and (words[first - 1].text in lists.skipped or words[first - 1].text in ("and", *lists.limbs)):
            first -= 1
        before = words[first - 1].text if first else ""
        if words[first].text == "and":
            before = "and"
        if before and before not in STOPS and before not in _TOGETHER_WITH:
            return False
        plural, progressive = text.endswith("s") or text == "feet", verb.text.endswith("ing")
        if not progressive and (before == "with" or (plural and verb.text.endswith("s"))):
            return False  # "with a raised hand walks", "with long arms walks"
        if text not in lists.limbs:
            return bool(before)  # "the flag waves" is another subject's
        state = verb.text.endswith("ed") and bool(before)  # "head bowed"
        part = lists.limbs[text]
        return state or not any(part in self._moved[each.action] for each in match.meanings if each.action)

    def _performs_next(self, words: list[Word], found: Sequence[Match], at: int) -> bool:
        """Return True for a verb that only performs the action of the next phrase: "throws a handspring"."""
        match = found[at]
        if words[match.start].base not in self._lists.light or match.end - match.start > 1 or at + 1 == len(found):
            return False
        after = found[at + 1]
        article = words[after.start - 1].text in self._lists.determiners  # "throws a back handspring", a verb as a noun
        if not article and not any(meaning.noun for meaning in after.meanings):
            return False
        between = words[match.end : after.start]
        if between and between[0].text in PARTICLES:
            between = between[1:]
        lists = self._lists
        return len(between) <= _HEADS + 1 and not any(
            word.text in lists.breaks or word.text in lists.prepositions for word in between
        )

    def _continues(self, words: list[Word], match: Match) -> bool:
        """Return True for a verb that only goes on with the next one: "carries on running"."""
        after = [word.text for word in words[match.start + 1 : match.start + 3]]
        return words[match.start].base in _GOING_ON and after[:1] == ["on"] and after[-1].endswith("ing")

    def _is_averted(self, words: list[Word], match: Match) -> bool:
        """Return True for a noun that is done by another person: "ducks under a punch", "dodges the kick"."""
        if not self._is_noun(words, match):
            return False
        at = self._before_noun(words, match.start)
        if at < 0 or at == match.start - 1:
            return False
        word, averting = words[at], self._lists.averting
        if word.base in averting or word.text in _UNDER:
            return True
        said = [each.text for each in words[max(at - _WITHIN, 0) : at]]
        verbs = {each.base for each in words[max(at - _WITHIN, 0) : at]}
        return (word.text == "of" and ("way" in said or said[-1:] == ["out"])) or (
            word.text in ("from", "of", "at") and bool(verbs & averting)
        )

    def _modifies_person(self, words: list[Word], match: Match) -> bool:
        """Return True for a noun that says what a person is: "a basketball player", "rock climber"."""
        last = words[match.end - 1]
        if match.end == len(words) or last.text != last.base:
            return False
        return words[match.end].text in self._people

    def _says_how(self, words: list[Word], found: Sequence[Match], at: int) -> bool:
        """Return True for a noun of paths and gaits behind a preposition and another action: "in a wide arc"."""
        match = found[at]
        if at == 0 or match.end - match.start > 1 or words[match.start].base not in self._lists.units:
            return False
        if words[match.start].base in _PATHS and any(each.action in self._travels for each in found[at - 1].meanings):
            return False  # "walks along a curve"
        before = self._before_noun(words, match.start)
        return before >= 0 and words[before].text in _HOW

    def _is_kind_of_blow(self, words: list[Word], found: Sequence[Match], at: int) -> bool:
        """Return True for a movement that is part of the blow behind it: "a spinning back kick", "360 degree kick"."""
        match = found[at]
        if at + 1 == len(found):
            return False
        verb, after = words[match.start], found[at + 1]
        is_form = verb.text == verb.base or verb.text.endswith("ing")  # "spins" is a verb of its own
        kinds = all(each.action in _KINDS_OF_BLOWS or each.action is None for each in match.meanings)
        is_blow = any(each.noun and each.action in _BLOWS for each in after.meanings)
        between = words[match.end : after.start]
        lists = self._lists
        apart = len(between) > _KIND_WORDS or any(
            word.text in STOPS or word.text in lists.breaks or word.text in lists.determiners for word in between
        )
        return is_form and kinds and is_blow and not apart

    def _is_by_others(self, words: list[Word], match: Match) -> bool:
        """Return True if another person does it in a clause of time: "while someone explains the plan"."""
        verb = words[match.start]
        if verb.text == verb.base or verb.text.endswith("ing") or match.start == 0:
            return False
        who = words[match.start - 1]
        if not (who.text in self._people or who.text in _OTHERS or _does(who.text)):
            return False
        before = self._before_noun(words, match.start - 1)
        if before < 0 or words[before].text not in _OTHERS_CLAUSE:
            return False
        if before:
            return True
        comma = next((k for k in range(match.end, len(words)) if words[k].text == ","), None)
        return comma is not None and comma + 1 < len(words) and words[comma + 1].text in self._lists.determiners

    def _is_likened(self, words: list[Word], found: Sequence[Match], at: int) -> bool:
        """Return True for what an action before only resembles: "jerks as if slapped"."""
        if at == 0:
            return False
        texts = [word.text for word in words[found[at - 1].end : found[at].start]]
        return any(pair in (("as", "if"), ("as", "though")) for pair in pairwise(texts))

    def _is_held(self, words: list[Word], match: Match) -> bool:
        """Return True for a thing that is handled, though its word names an action, too: "holds the bow"."""
        if (
            match.end - match.start > 1
            or not self._is_noun(words, match)
            or words[match.start].text not in self._things
        ):
            return False
        at = self._before_noun(words, match.start)
        if at < 0 or at == match.start - 1 or words[at + 1].text not in _DEFINITE:
            return False
        return self._lexicon.is_verb_form(words[at].text) and words[at].base not in ("take", "make", "give", "do")

    def _is_noun(self, words: list[Word], match: Match) -> bool:
        before = words[match.start - 1].text if match.start else ""
        return any(meaning.noun for meaning in match.meanings) and not (
            before in _PRONOUNS or words[match.start].text.endswith("ing")
        )

    def _before_noun(self, words: list[Word], noun: int) -> int:
        """Return the place of the word before a noun with its article and adjectives; -1 = none."""
        lists, at = self._lists, noun - 1
        for _ in range(_HEADS):
            if at < 0 or words[at].text in lists.determiners:
                break
            text = words[at].text
            if text in lists.breaks or text in lists.prepositions or text in lists.people or text in lists.auxiliaries:
                return at
            at -= 1
        while at >= 0 and (words[at].text in lists.determiners or words[at].text in lists.skipped):
            at -= 1
        return at


def _does(text: str) -> bool:
    """Return True for a noun with the ending of a doer: "attacker"."""
    return text.endswith(("er", "or", "ers", "ors")) and len(text) > 4
