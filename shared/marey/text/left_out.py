"""Movements that the words of a prompt ask for, and that nothing of its reading covers (ours).

The readers know actions, gestures, manners and glances. A clause of any other verb falls out of the movements that they
find, or is read as standing, or is part of another one's words. Here the predicates of the labeller are looked for in
what was read.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from marey.text.action_reader import OUTSIDE, named_actions
from marey.text.clause_order import CONTEXT, PLAIN, ReadClause, is_end, without_joints
from marey.text.clause_parts import goes_on
from marey.text.one_shot import is_part_of_shot
from marey.text.readings import ReadPrompt
from marey.text.roles import Argument, Frame
from marey.text.sequence_reader import STOPS, ReadMovement
from marey.text.told_apart import HERE
from marey.vocabulary.bearing_words import BarePrompt, stated_bearings
from marey.vocabulary.entries import load_vocabulary
from marey.vocabulary.gazes import only_gaze, without_gaze
from marey.vocabulary.loads import puts_load
from marey.vocabulary.scope import STANDING, every_action, match_scope
from marey.vocabulary.stops import comes_to_a_stop
from marey.vocabulary.word_lists import load_word_lists

IN_TIME = "ARGM-TMP"
"""Role of clauses that say when: what who acts does in them is a movement, too."""
_SAME = ("he", "she", "they")
"""Words of who has been named."""
_WORD = re.compile(r"[a-z]+(?:['’-][a-z]+)*")
_JOINTS = re.compile(r"[,;:.]\s|\b(?:and|then|while|as|before|after|until|but)\b", re.IGNORECASE)
"""Words and signs between clauses."""
_SIGNS = " ,.;:!?()\"'"


@dataclass(frozen=True)
class _Clause:
    """A predicate of a prompt with its words.

    Attributes:
        frame: of the predicate.
        verb: its word, in small letters and without signs.
        text: from the predicate on, to the end of what belongs to it or to the next one.
        subject: words before it of who or what does it, in small letters; empty if there are none.
        drawn: the predicate is one of the words of a bearing.
        acts: its word stands as a verb that is done, not as a noun or an auxiliary.
    """

    frame: Frame
    verb: str
    text: str
    subject: str
    drawn: bool
    acts: bool


def may_leave_out(text: str) -> bool:
    """Return True if a prompt may have several clauses, of which one can be left out."""
    return _JOINTS.search(text) is not None


def parts_left_out(
    text: str, frames: Sequence[Frame], reading: ReadPrompt, read: Callable[[str], ReadClause]
) -> tuple[str, ...]:
    """Return the parts of a prompt that ask for a movement, and that no row of its reading, bearing or glance covers.

    Args:
        text: of the prompt as the readers know it, words one space apart.
        frames: of its predicates.
        reading: of the text.
        read: returns what the trained readers take a clause alone for; asked only for those that nothing else covers.
    """
    clauses = list(_clauses(text, frames))
    named = _words_of_actions(text)
    rows = reading.movements or (ReadMovement(text, _action_of(reading)),)
    said = [_is_said(clause, _row_of(clause, rows), named) for clause in clauses]
    found = list[str]()
    for number, clause in enumerate(clauses):
        if said[number] or not _is_own(clause, clauses):
            continue
        row = _row_of(clause, rows)
        if row is not None and puts_load(row.text, _before(row, rows)):
            continue
        if row is not None and is_part_of_shot(clause.text, row.action):
            continue
        if row is not None and row.action not in (None, STANDING):
            before = zip(clauses[:number], said, strict=False)
            if not any(known and other.verb in row.text.lower() for other, known in before):
                continue  # the readers take its words for that action, or it leads to it
        if _is_movement(read(clause.text), row):
            found.append(clause.text)
    for row in reading.movements:
        unknown = _is_as_written(row) and _says_nothing_known(row.text) and not any(part in row.text for part in found)
        if unknown and read(row.text).name == OUTSIDE:
            found.append(row.text)
    return tuple(dict.fromkeys(found))


def _row_of(clause: _Clause, rows: Sequence[ReadMovement]) -> ReadMovement | None:
    """Return the row whose words have the verb of a clause; None = it is in none."""
    return next((row for row in rows if clause.verb in row.text.lower()), None)


def _is_as_written(row: ReadMovement | None) -> bool:
    """Return True for a row without an action, whose words the model gets as they are."""
    return row is not None and row.action is None


def _before(row: ReadMovement, rows: Sequence[ReadMovement]) -> str:
    """Return the words of the movement before one; empty if it is the first."""
    place = rows.index(row)
    return rows[place - 1].text if place else ""


def _is_movement(clause: ReadClause, row: ReadMovement | None) -> bool:
    """Return True if a clause asks for a movement of its own, beside the action of the row whose words have it."""
    if clause.name == CONTEXT or (clause.name == STANDING and clause.probability >= PLAIN):
        return False
    if row is None or row.action == STANDING:
        return True
    if row.action is None:
        return clause.name == OUTSIDE or (clause.probability < PLAIN and not named_actions(clause.text))
    return clause.name != row.action and clause.probability >= PLAIN


def _clauses(text: str, frames: Sequence[Frame]) -> Iterator[_Clause]:
    words, starts, at = text.split(), list[int](), 0
    for word in words:
        starts.append(text.index(word, at))
        at = starts[-1] + len(word)
    kept = set(BarePrompt.of(text).places)
    ends = [*(frame.predicate for frame in frames[1:]), len(words)]
    for frame, end in zip(frames, ends, strict=False):
        place = frame.predicate
        stop = min(end, max((each.stop for each in frame.arguments), default=0))
        said = " ".join(words[place : max(stop, place + 1)]).strip(_SIGNS)
        subject = next((_said(words, each) for each in frame.arguments if _is_subject(each, frame)), "")
        leads = place + 1 == end < len(words) and not words[place].endswith(tuple(",.;:!?"))
        yield _Clause(
            frame, _said(words, place), said, subject, starts[place] not in kept, not leads and _acts(words, place)
        )


def _acts(words: Sequence[str], place: int) -> bool:
    """Return True if a word stands where a verb does that is done: not behind an article, nor a part of the body."""
    lists, word = load_word_lists(), words[place].strip(_SIGNS).lower()
    before = words[place - 1].lower() if place else ""
    noun = before in lists.determiners or before in lists.prepositions - {"to"}
    return word.isascii() and not noun and word not in lists.auxiliaries and word not in lists.limbs and "'" not in word


def _is_subject(argument: Argument, frame: Frame) -> bool:
    return argument.role in ("ARG0", "ARG1") and argument.stop <= frame.predicate


def _said(words: Sequence[str], at: Argument | int) -> str:
    part = words[at : at + 1] if isinstance(at, int) else words[at.start : at.stop]
    return " ".join(part).strip(_SIGNS).lower()


def _words_of_actions(text: str) -> frozenset[str]:
    """Return the words of a text that name its actions and gestures, with what stands around them in mind."""
    actions = match_scope(text, every_action()).actions
    return frozenset(word for each in actions if each.verdict != "unknown" for word in _WORD.findall(each.text.lower()))


def _action_of(reading: ReadPrompt) -> str | None:
    """Return the id of the one action that a prompt is read as."""
    actions = load_vocabulary().actions.items()
    return next((name for name, each in actions if each.plain_words == reading.plain), None)


def _is_said(clause: _Clause, row: ReadMovement | None, named: frozenset[str]) -> bool:
    """Return True if words of a clause name what is shown: an action, a bearing, a glance, or that a movement ends or
    goes on. A bearing whose words are in no row is not drawn; of a row that the model gets as it is written, words that
    are only close to an action say nothing."""
    text = clause.text
    if clause.drawn or stated_bearings(text):
        return row is not None
    if without_gaze(text) != text or named_actions(text, surely=_is_as_written(row)):
        return True
    if named & set(_WORD.findall(clause.verb)) and not (_is_as_written(row)):
        return True
    stops = STOPS.match(text) is not None or HERE.match(text) is not None or comes_to_a_stop(text)
    return is_end(without_joints(text)) or goes_on(text) or stops


def _is_own(clause: _Clause, clauses: Sequence[_Clause]) -> bool:
    """Return True if a clause says of the one who acts that something is done: not an aim, a reason, a comparison, what
    is not done, what someone else does, or a verb that only joins another one to who acts ("starts to")."""
    frame, others = clause.frame, [each.frame for each in clauses if each is not clause]
    if not clause.acts or any(each.role == "ARGM-NEG" or each.role.startswith("R-") for each in frame.arguments):
        return False
    if any(_holds(each, other.predicate) for each in frame.arguments if _is_core(each) for other in others):
        return False
    around = [each for other in others for each in other.arguments if _holds(each, frame.predicate)]
    if any(each.role != IN_TIME and not (_is_core(each) and frame.predicate - each.start < 2) for each in around):
        return False
    if not clause.subject and any(frame.predicate - each.start > 1 for each in around):
        return False  # "while the band plays"
    if clause.subject.rpartition(" ")[2] in load_word_lists().limbs:
        return False
    first = next((each.subject for each in clauses if each.subject and not _is_in_time(each, clauses)), "")
    return clause.subject in ("", first, *_SAME)


def _is_in_time(clause: _Clause, clauses: Sequence[_Clause]) -> bool:
    """Return True if a clause says when another one comes."""
    arguments = (each for other in clauses if other is not clause for each in other.frame.arguments)
    return any(each.role == IN_TIME and _holds(each, clause.frame.predicate) for each in arguments)


def _is_core(argument: Argument) -> bool:
    return argument.role[3:].isdigit()


def _holds(argument: Argument, word: int) -> bool:
    return argument.start <= word < argument.stop


def _says_nothing_known(text: str) -> bool:
    """Return True if words of a movement name no action, bearing or glance, so that the model gets them as written."""
    return not (named_actions(text, surely=True) or stated_bearings(text) or only_gaze(text))
