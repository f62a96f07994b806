"""Words of a prompt that say what is not done: "without running", "neither waves nor bows", "doesn't stop walking"."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

from marey.vocabulary.inflection import verb_forms
from marey.vocabulary.lexicon import Lexicon
from marey.vocabulary.phrases import Word
from marey.vocabulary.word_lists import WordLists

Span = tuple[int, int]
"""Words [start, end)."""
_COMMA = ","
_ENDS = frozenset(".;:!?")
_PRONOUNS = frozenset(["he", "she", "they", "it", "i", "you", "we", "who"])
_TURNS = frozenset(["but", "just", "only", "instead", "rather", "merely", "simply", "then"])
"""Behind a comma they say what is done instead."""
_JOINS = frozenset(["or", "nor", "and"])
_OPENINGS = {
    "w": (("w", "o"),),
    "instead": (("instead", "of"),),
    "rather": (("rather", "than"),),
    "short": (("short", "of"),),
    "far": (("far", "from"),),
    "in": (("in", "place", "of"), ("in", "lieu", "of")),
    "with": (("with", "zero"),),
}
"""Words before what is not done, beside single ones."""
_WITHIN = 4
"""Words between "too" or a verb such as "lacks" and its "to", and between "rather" and "than"."""
_OF_VERBS = frozenset(["never", "neither", "nor", "almost", "nearly"])
"""Before these forms in -s are verbs, elsewhere plurals: "no jumps"."""
_NEVER_ENDING = frozenset(["stop", "cease", "quit", "pause", "help", "finish", "end"])
"""Not ended, an action goes on: "can't stop laughing"."""
_EXCEPT = frozenset(["except", "excluding", "minus"])
_SOUGHT = frozenset(["until", "till", "before"])
"""Behind these stands what comes first: "doesn't sit down until he has bowed" has both."""


class Negations:
    """Finds what a prompt says is not done."""

    def __init__(self, lexicon: Lexicon, lists: WordLists) -> None:
        """Keep the tables, with all forms of the verbs that withhold what follows."""
        self._lexicon = lexicon
        self._lists = lists
        self._withheld = _forms(lists.withheld)
        self._withheld_from = _forms(lists.withheld_from)
        self._avoided = _forms(lists.avoided)
        self._endless = _forms(_NEVER_ENDING)

    def spans(self, words: Sequence[Word]) -> list[Span]:
        """Return the words, each time from the negating one on, of which no action is done.

        A word that only weakens ("hardly") negates nothing here.
        """
        texts = [word.text for word in words]
        opened = list(self._opened(texts))
        denied = any(texts[start] not in _EXCEPT for start, _ in opened)
        return [
            (start, end)
            for start, inside in opened
            for end in [self._end(words, texts, start, inside)]
            if not (denied and texts[start] in _EXCEPT) and not self._is_done(texts, start, inside, end)
        ]

    def ended(self, words: Sequence[Word]) -> list[Span]:
        """Return the words of what ends as the prompt begins: "stops walking"."""
        texts = [word.text for word in words]
        return [
            (at, self._end(words, texts, at, at + 1))
            for at, (text, after) in enumerate(pairwise(texts))
            if text in self._lists.ending
            and text not in self._avoided
            and after.endswith("ing")
            and self._lists.denying.isdisjoint(texts[max(at - 2, 0) : at])  # "never stops walking"
        ]

    def _opened(self, texts: list[str]) -> Iterator[Span]:
        """Yield where a negation begins, and the first word behind what negates."""
        for at, text in enumerate(texts):
            inside = self._behind(texts, at, text)
            if inside is not None:
                yield (inside - 1 if text == "rather" and inside > at + 2 else at), inside  # "rather walk than run"

    def _behind(self, texts: list[str], at: int, text: str) -> int | None:
        lists = self._lists
        for opening in _OPENINGS.get(text, ()):
            if tuple(texts[at : at + len(opening)]) == opening:
                return at + len(opening)
        if text in lists.denying:
            return None if (text, *texts[at + 1 : at + 2]) in lists.not_denying else at + 1
        after = texts[at + 1] if at + 1 < len(texts) else ""
        if text in lists.nearly:
            return at + 1 if self._lexicon.is_verb_form(after) else None
        if text in self._avoided:
            return at + 1 if after.endswith("ing") or after == "to" else None
        if text in self._withheld:
            return self._next(texts, at, "to")
        if text in self._withheld_from:
            return self._next(texts, at, "from")
        if text == "rather":
            return self._next(texts, at, "than")
        return None

    def _next(self, texts: list[str], at: int, wanted: str) -> int | None:
        """Return the place behind the next "to", "from" or "than", if it is near and in the same clause."""
        for place in range(at + 1, min(at + 2 + _WITHIN, len(texts))):
            if texts[place] == wanted:
                return place + 1
            if texts[place] in self._lists.breaks:
                return None
        return None

    # -- how far ------------------------------------------------------------------------------------------------------

    def _end(self, words: Sequence[Word], texts: list[str], start: int, inside: int) -> int:
        """Return where what is not done ends: with the clause, or before a verb in a form that cannot go on with it."""
        form, at = "", inside
        if texts[inside : inside + 1] == ["but"]:  # "nothing but"
            return inside
        while at < len(texts):
            text = texts[at]
            if text in _ENDS or (text == _COMMA and not self._goes_on(texts, at, form)):
                return at
            if text in _JOINS:
                if text == "and" and not self._joins(texts, at + 1, form):
                    return at
            elif at > inside and (self._is_break(text) or (text in _PRONOUNS and self._begins_clause(texts, at))):
                return at
            if self._lexicon.is_verb_form(text):
                kind = _form_of(words[at])
                if kind == "s" and not form and texts[start] not in _OF_VERBS:
                    kind = "plural"
                if form and form != "s" and kind == "s" and self._is_finite(texts, at, inside):
                    return at
                form = form or kind
            at += 1
        return len(texts)

    def _is_break(self, text: str) -> bool:
        return (text in self._lists.breaks or text in _TURNS) and text not in (_COMMA, "as", "that")

    def _goes_on(self, texts: list[str], comma: int, form: str) -> bool:
        """Return True if a comma only divides a list: "without running, jumping or turning"."""
        rest = texts[comma + 1 :]
        if not rest or rest[0] in _TURNS or rest[0] in _PRONOUNS or rest[0] in self._lists.denying:
            return False
        clause = rest[: next((at for at, text in enumerate(rest) if text in _ENDS or text in _PRONOUNS), len(rest))]
        joined = rest[0] in ("or", "nor") or "or" in clause or "nor" in clause
        return joined and form not in ("", "s")

    def _joins(self, texts: list[str], after: int, form: str) -> bool:
        """Return True if "and" goes on with a verb or noun of the same form: "no walking and turning"."""
        text = texts[after] if after < len(texts) else ""
        if not form or form == "s" or text in self._lists.denying or not self._lexicon.is_verb_form(text):
            return False
        kind = _form_of(Word(text, self._lexicon.base(text)))
        return kind == form or (form == "plural" and kind == "s")

    def _begins_clause(self, texts: list[str], at: int) -> bool:
        """Return True if a pronoun has a verb of its own."""
        after = texts[at + 1 : at + 3]
        verb = after[1:] if after and after[0].endswith("ly") else after[:1]
        return bool(verb) and (self._lexicon.is_verb_form(verb[0]) or verb[0] in self._lists.auxiliaries | _TURNS)

    def _is_finite(self, texts: list[str], at: int, inside: int) -> bool:
        """Return True if a form in -s is the verb of another clause, and no plural: not "no jumps or turns"."""
        before = texts[at - 1]
        lists = self._lists
        return at > inside and not (before in lists.determiners or before in lists.prepositions or before in _JOINS)

    # -- what is done nevertheless ------------------------------------------------------------------------------------

    def _is_done(self, texts: list[str], start: int, inside: int, end: int) -> bool:
        """Return True where two negations make none, or where only the time is denied."""
        said = [text for text in texts[inside:end] if not text.endswith("ly")]
        if said and said[0] in self._endless and "to" not in said[1:2]:  # "doesn't stop to wave"
            return True
        if said and said[0] in self._lists.denying:
            return True
        if texts[start] == "not" and texts[inside : inside + 1] in (["only"], ["just"], ["merely"]):
            return end < len(texts)
        return end < len(texts) and texts[end] in _SOUGHT and texts[start] not in ("without", "no")


def _forms(verbs: frozenset[str]) -> frozenset[str]:
    return frozenset(form for verb in verbs for form in (verb_forms(verb) if verb.isalpha() else (verb,)))


def _form_of(word: Word) -> str:
    """Return the form of a verb: `base`, `ing`, `s` or `past`."""
    if word.text == word.base:
        return "base"
    if word.text.endswith("ing"):
        return "ing"
    return "s" if word.text.endswith("s") else "past"


def denies(spans: Sequence[Span], at: int) -> bool:
    """Return True if a word is in one of the spans."""
    return any(start <= at < end for start, end in spans)
