"""The action that a prompt asks for, said first in plain words (ours).

A model that learned an action from a few takes knows few of the ways to ask for it: "two slow steps of a stroll" and
"the waiter takes a bow" are further from its captions than "a person walks" and "a person bows". What else the prompt
says stays behind the plain words.
"""

from __future__ import annotations

import re
from functools import lru_cache

from marey.text.clause_normalization import DEFAULT_SUBJECT
from marey.vocabulary.bearing_words import BarePrompt
from marey.vocabulary.bearings import DRAWN_AS, DRAWN_ON
from marey.vocabulary.courses import STRAIGHT, WAYS, dribbles_ahead, stated_course, without_course
from marey.vocabulary.entries import load_vocabulary
from marey.vocabulary.gazes import without_gaze
from marey.vocabulary.inflection import third_person
from marey.vocabulary.lengths import without_length
from marey.vocabulary.scope import STANDING, every_action, match_scope
from marey.vocabulary.word_lists import load_word_lists

VERSION = 17
"""Raise it when the same prompt, vocabulary and reader give other words."""
MOST_WORDS = 20
"""Longer prompts tell a movement part by part: by their words, three of ten that name one action ask for another."""
TURNING = "turn"
"""Said beside gaits: "walks and turns the corner"."""
NODDING = "nod"
"""Read in "shakes his head"."""
BACK = "walk-backward"
DRIBBLING = "dribble"
"""Of it models know the stance alone."""
ALONE = frozenset({STANDING, NODDING})
"""Actions of which models read the plain words alone, where they are read surely: of "a bored watchman stands at his
post" they made a walk."""
PLAINER = {"walk": (re.compile(r"\bfast\b"), "quickly")}
"""Words of actions that models read as those of another: of eight motions of "walks fast" three run."""
_WITH_LOAD = re.compile(r" (?:with|carrying) a load\b")
_RUNS = re.compile(r"\b(?:run|jog|sprint|dash|rac)\w*\b", re.IGNORECASE)
_NOD = re.compile(r"\bnod", re.IGNORECASE)
_WORD = re.compile(r"[A-Za-z]+")


def with_subject(prompt: str) -> str:
    """Return a prompt that begins with a verb in the third person behind its subject: "bows deeply" as "a person bows
    deeply"; any other as it is.

    Captions have subjects. Behind the plain words of its action, "a person bows, bows deeply" is two bows.
    """
    words = _WORD.findall(prompt.lower())
    first, after = ([word for word in words if not word.endswith("ly")] + ["", ""])[:2]
    people = first.removesuffix("s") in load_word_lists().people and after in _verbs()  # "guards patrol the gate"
    if not words or not prompt.lower().startswith(words[0]) or first not in _third_persons() or people:
        return prompt
    return f"{DEFAULT_SUBJECT} {_lowered(prompt)}"


@lru_cache(maxsize=1)
def _verbs() -> frozenset[str]:
    """Return the base forms of all verbs that are known."""
    phrases = [phrase for each in load_vocabulary().actions.values() for phrase in (*each.verbs, *each.near)]
    return frozenset(phrase.split()[0] for phrase in (*phrases, *load_word_lists().other_verbs))


@lru_cache(maxsize=1)
def _third_persons() -> frozenset[str]:
    """Return the forms with -s of all verbs that are known, but for those that are parts of the body, too: "arms"."""
    lists = load_word_lists()
    return frozenset(third_person(verb) for verb in _verbs() if verb.isalpha()) - lists.body_parts - lists.uncounted


def with_plain_action(prompt: str, action: str | None, *, surely: bool = False) -> str:
    """Return a prompt behind its action in plain words: "a person bows, the waiter takes a bow".

    Without them where it has them already, and as written where no action is known that it asks for. A verb without
    a subject gets one (`with_subject`), words that mislead are replaced (`PLAINER`), and those that have the head turn,
    or ask for a bearing that fits the action, are left out: both are drawn. So are the words of a way to a side, in a
    circle or in a zigzag, to which the motion of a plain way is bent, and lengths. Of a way in a manner that is drawn
    the plain words alone are read.

    Args:
        prompt: as `check_prompt` returns it.
        action: id of the one action that it asks for; None = several, none, or in doubt.
        surely: there is no doubt at all.
    """
    borne = BarePrompt.of(prompt)
    said = borne.text if action is not None and borne.fits(action) else prompt
    bare = without_gaze(said)  # the head moves alone: of "looks left" models turn the whole body
    if action is None:
        return bare or prompt
    if action == NODDING and bare != said and not _NOD.search(prompt):
        action = STANDING
    if action in DRAWN_ON and any(each.bearing.load for each in borne.stated):
        action, bare = "walk", _WITH_LOAD.sub("", bare)  # the arms are drawn
    course = stated_course(prompt, action)
    if action == DRIBBLING and dribbles_ahead(prompt):
        return load_vocabulary().need("run" if _RUNS.search(prompt) else "walk").plain_words  # the hand is drawn
    if course is not None and course.kind != STRAIGHT:
        way = action if action in WAYS else "run" if _RUNS.search(prompt) else "walk"
        action, bare = way, without_course(bare, way)  # the way is bent
    plain = load_vocabulary().need(action).plain_words
    if action == BACK and _RUNS.search(prompt):
        return plain  # it is drawn, and "jogs" behind the plain words is read as another action
    if action in WAYS and course is not None and course.kind == STRAIGHT and _is_in_manner(borne, action):
        return plain
    if not bare or action in DRAWN_AS or (surely and action in ALONE):
        return plain
    prompt = with_subject(without_length(bare))
    if action in PLAINER:
        pattern, words = PLAINER[action]
        prompt = pattern.sub(words, prompt)
    return prompt if plain in prompt.lower() else f"{plain}, {_lowered(prompt)}"


def _is_in_manner(borne: BarePrompt, action: str) -> bool:
    """Return True if a prompt states a manner of going, which is drawn on a plain way: where it leads ("home across the
    alley") shows in no motion, and models make something else of such words at its end."""
    return any(each.bearing.is_manner and each.shown_in(action) == "body" for each in borne.stated)


def only_action(prompt: str) -> str | None:
    """Return the id of the one action that the words of a prompt ask for; None = several, none, or in doubt. For
    encoders that `marey.text.action_reader` does not read."""
    if len(prompt.split()) > MOST_WORDS:
        return None
    scope = match_scope(prompt, every_action())
    if scope.left not in (None, "part"):
        return None
    vocabulary = load_vocabulary()
    found = {each.action for each in scope.actions if each.action is not None}
    if any(each.action is None for each in scope.actions):
        return None
    names = vocabulary.without_implied(found - {STANDING} if len(found) > 1 else found)
    if TURNING in names:
        names = {name for name in names if name == TURNING or not vocabulary.need(name).in_place}
    return names.pop() if len(names) == 1 else None


def _lowered(prompt: str) -> str:
    """Return a prompt as it stands inside a sentence: "The waiter" with a small letter, "I'm" and "NPC" as they are."""
    first = prompt.split(maxsplit=1)[0]
    small = first == "A" or (first[1:2].isalpha() and not first[1:2].isupper())
    return prompt[:1].lower() + prompt[1:] if small else prompt
