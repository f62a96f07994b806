"""Normalise the clauses of actions to the words and forms of training captions (ours, after MOGO's TCA, which asks a
language model).

A prompt's clause may be a command ("raise its left arm, bring it down"), a note ("right arm up and down") or a noun ("a
short walk"). A model trained on captions such as "a person raises the left arm" follows those prompts, but only
half of such clauses: sentence encodings of paraphrases lie far from each other. So the subject, the third person and
the present tense are inserted, and "put the arm down" becomes "lower the arm"; no action is added or dropped.
"""

from __future__ import annotations

import re
from dataclasses import replace

from marey.text.clauses import DOING, LIMBS, LISTS, SIDES, SUBJECTS, Clause
from marey.text.words import inflected, is_past, lemma
from marey.vocabulary.inflection import indefinite_article

DEFAULT_SUBJECT = "a person"

_BY = re.compile(r"\b(?:start|begin|end|continue|finish)(?:s|es|ing|ning)? by\b ?")
_LOWERED = re.compile(
    r"\b(?:(?:put|bring|take)s (?P<what>it|them|that)(?: back| all the way)? down"
    r"|drops (?P<dropped>it|them|that)"
    r"|lets (?P<left>it|them) (?:fall|drop|sink|go|come)(?: back| down)*)(?: too| again)?\b"
)
_ASIDE, _LETTING, _OF_WHAT, _PEOPLE, _UNFINITE = (
    frozenset(LISTS[name]) for name in ("aside", "letting", "of_what", "people", "unfinite")
)
_PERSONS = SUBJECTS - {"his", "her", "their", "this", "that"}


def join_in_order(sentences: tuple[str, ...]) -> str:
    """Join actions into one sentence, in order of time."""
    return ", and then ".join([sentences[0], *(one[:1].lower() + one[1:] for one in sentences[1:])]) + "."


def normalize_clause(clause: Clause) -> str:
    """A clause as a sentence in the third person with a subject."""
    clause = _present(_without_aside(clause))
    said = _BY.sub("", " ".join(clause.words)).strip(" ,;:.")
    return _LOWERED.sub(_lowered, _with_subject(clause, said))


def noun_of(clause: Clause) -> str:
    """The noun that names the action: "bow" in "a slow bow"; empty if it is a verb or missing."""
    for k in range(min(4, len(clause))):
        if clause.bare(k) in _OF_WHAT:
            return ""
        if clause.bare(k) in DOING and k > 0:
            # A labeller takes "bow" of "a bow" for a verb.
            taken = k == 1 and clause.verbs == frozenset({k}) and clause.bare(0) in {"a", "an", "the"}
            return clause.bare(k) if taken or not clause.verbs else ""
    return ""


def _with_subject(clause: Clause, said: str) -> str:
    first, second = clause.bare(0), clause.bare(1)
    small = said[:1].lower() + said[1:]
    if first in SIDES and second in LIMBS:
        return _of_a_limb(clause, small)
    noun = noun_of(clause)
    if noun:
        return f"{DEFAULT_SUBJECT} {DOING[noun]} {small}"
    if first in _PEOPLE:
        return f"{indefinite_article(first)} {small}"
    if first in SUBJECTS or _subject_later(clause):
        return said
    doing = first.endswith("ing") or (second.endswith("ing") and (first.endswith("ly") or first in {"just", "still"}))
    return f"{DEFAULT_SUBJECT} {'is ' if doing else ''}{small}"


def _of_a_limb(clause: Clause, said: str) -> str:
    """Add a subject to clauses about a limb: "right arm waves", "left hand up and down", "both hands go up"."""
    side, limb, rest = clause.bare(0), clause.bare(1), " ".join(clause.words[2:]).strip(" ,;:.")
    both = side in {"both", "two"}
    own = f"{side} {limb}" if both else f"the {side} {limb}"
    if clause.bare(2).startswith("wav"):
        return " ".join([DEFAULT_SUBJECT, "waves", own, *rest.split()[1:]])
    if clause.verbs & set(range(2, len(clause))):
        return said if both else f"{DEFAULT_SUBJECT}'s {said}"
    return f"{DEFAULT_SUBJECT} puts {own} {rest}".strip()


def _subject_later(clause: Clause) -> bool:
    """Return True if the subject follows behind a comma: "after some more steps, he jogs off"."""
    return any(
        clause.stopped(k, ",") and clause.bare(k + 1) in _PERSONS and _done_within(clause, k + 2)
        for k in range(len(clause) - 2)
    )


def _done_within(clause: Clause, start: int) -> bool:
    """Return True if a verb is at this word or up to two words later; not for "the other arm hanging"."""
    return any(clause.is_verb(k) and not clause.bare(k).endswith("ing") for k in range(start, start + 3))


def _without_aside(clause: Clause) -> Clause:
    """Drop the words before the comma that give only a time: "when the show is over, she bows"."""
    if clause.bare(0) not in _ASIDE:
        return clause
    for k in range(len(clause) - 2):
        if clause.stopped(k, ","):
            return clause.cut(k + 1) if clause.bare(k + 1) in _PERSONS or clause.is_verb(k + 1) else clause
    return clause


def _present(clause: Clause) -> Clause:
    """Convert imperatives and past forms to the present: "raise its arm, drop it", "raises the arm, drops it"."""
    start = 0
    while clause.bare(start).endswith("ly"):
        start += 1
    first = clause.bare(start)
    if first in SUBJECTS | SIDES or first.endswith("ing") or not (clause.is_verb(start) or first in DOING):
        return clause
    if lemma(first) != first and not is_past(first):
        return clause  # "walks": normalised already
    bidden = not is_past(first)
    words, letting = list(clause.words), False
    for verb in sorted({start, *clause.verbs, *(_listed(clause) if bidden else ())}):
        said = clause.bare(verb)
        if (is_past(said) or lemma(said) == said) and not letting and clause.bare(verb - 1) not in _UNFINITE:
            words[verb] = inflected(words[verb])
        letting |= said in _LETTING
    if bidden:  # "its" is of whom the command is about
        words = ["the" if word == "its" else word for word in words]
    return replace(clause, words=tuple(words))


def _listed(clause: Clause) -> set[int]:
    """Words behind a comma in front of "it" are verbs: "raise the arm, bring it down", whatever the labeller found."""
    return {
        k + 1
        for k in range(len(clause) - 2)
        if clause.stopped(k, ",") and clause.bare(k + 2) in {"it", "them"} and clause.bare(k + 1) not in SUBJECTS
    }


def _lowered(match: re.Match[str]) -> str:
    what = match["what"] or match["dropped"] or match["left"]
    return f"lowers {'it' if what == 'that' else what}"
