"""Readings of prompts for a model (ours): one action in plain words, or movements one after the other; without the
words of what is drawn on the motion."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from marey.text.action_reader import (
    AGREED,
    OUTSIDE,
    RISING,
    SURE_OF_SEVERAL,
    ReadAction,
    action_reader,
    joins_clauses,
    named_actions,
)
from marey.text.clause_order import BOUND_TO_HANDS, ReadClause, comes_with, without_joints
from marey.text.clause_parts import SERIES, before_next_verb, only_named, parts_in_time
from marey.text.elided_words import parts_by_sides
from marey.text.encoders import Encoding
from marey.text.held_hand import with_held_hand
from marey.text.misleading_words import EXERCISE, has_other_sense, lunges_as_exercise, without_misleading
from marey.text.one_shot import with_whole_shots
from marey.text.order_reader import is_asked_for_order, marked, order_reader
from marey.text.plain_action import with_plain_action
from marey.text.reader_file import Float32
from marey.text.sequence_reader import (
    CARRYING,
    WAYS,
    ReadMovement,
    from_there,
    rest,
    sequence_reader,
    turned_to_carry,
    way_to_rest,
)
from marey.text.told_apart import told_apart
from marey.vocabulary.bearing_words import BarePrompt, as_written, parts_by_gestures
from marey.vocabulary.bearings import FEET
from marey.vocabulary.entries import load_vocabulary
from marey.vocabulary.gazes import only_gaze, stated_gaze, without_gaze
from marey.vocabulary.lengths import is_length, stated_length
from marey.vocabulary.scope import STANDING, every_action, match_scope
from marey.vocabulary.stops import way_to_a_stop
from marey.vocabulary.who_acts import says_more

SURELY, SURELY_AGREED = 0.9, 0.4
"""Probabilities from which on there is no doubt about an action, and about the only one that the words name."""
UNSPLIT, GUESSED = 0.35, 0.2
"""Probabilities from which on a prompt that is no sequence asks for one action, and does so if its words name no other
one and nothing but a body acts."""
ATTACK = "stab"
"""Action that "lunges" is read as."""
WHOLE = SERIES | frozenset(BOUND_TO_HANDS)
"""Actions that others are parts of."""
FALLEN = "die"
"""Action from whose end alone one who is read surely to get up does so."""
STAYING = frozenset({STANDING, "sit-down", "sit", "sit-floor", "kneel", "laugh"})
"""Actions at whose end the body stays as it is: what only arms and head do comes in the same movement."""


_STOPS = re.compile(
    r"\W*(?:(?:he|she|they|it|(?:the|an?) (?:[\w-]+ ){0,2}?[\w-]+) )?(?:(?:suddenly|abruptly) )?"
    r"(?:stops?|halts?|pauses?"
    r"|freezes?|stands? still)(?: (?:suddenly|abruptly|short|dead|there))?(?:,? and(?: then)?|,? then)?\W*",
    re.IGNORECASE,
)


@dataclass(frozen=True)
class ReadPrompt:
    """The text that is read for a prompt, and its movements.

    Attributes:
        worded: the text that the model reads.
        movements: those that it asks for, if there are several, one after the other.
        plain: its one action in plain words; empty if it asks for several or none, or in doubt.
        drawn: words of the prompt are left out that ask for a bearing.
    """

    worded: str
    movements: tuple[ReadMovement, ...] = ()
    plain: str = ""
    drawn: bool = False

    @classmethod
    def of(cls, text: str, action: str | None, *, surely: bool = False) -> ReadPrompt:
        """Return the reading of a text that asks for one action; None = for several or none, or in doubt."""
        plain = "" if action is None else load_vocabulary().need(action).plain_words
        return cls(with_plain_action(text, action, surely=surely), plain=plain)


def _stops_and_looks(prompt: str) -> bool:
    """Return True if a prompt asks for a stop and nothing else but that the head turns: "he stops and looks back"."""
    return bool(stated_gaze(prompt)) and _STOPS.fullmatch(without_gaze(prompt)) is not None


def likeliest(bare: BarePrompt, read: ReadAction) -> str | None:
    """Return the action that a prompt of one action is likeliest to ask for; None = several, none, or in doubt."""
    guess = read.likely(GUESSED)
    if guess is None or read.probability >= UNSPLIT:
        return guess
    said = match_scope(bare.prompt, every_action())
    named = {each.action for each in said.actions} - {None}
    return None if "other-subject" in said.flags or not named <= {guess} else guess


def _is_list_of(first: ReadMovement) -> bool:
    """Return True if the first of several movements is the whole of which the others are listed as parts: "a karate
    form: block, punch, kick"."""
    whole, sign, _ = first.text.partition(":")
    return bool(sign) and first.action in SERIES and first.action in named_actions(whole)


def _in_turn(before: ReadMovement, bare: BarePrompt) -> bool:
    """Return True if what is done behind a movement of who stands has its own turn: both are acts of which one is no
    gesture, such as feet that stamp, held arms do something else, or one has the head shaken."""
    done = BarePrompt.of(before.text).stated
    acts = (*done, *bare.stated)
    held = any(each.bearing.arms and each.bearing.lasts for each in done)
    works = held and any(each.bearing.arms for each in bare.stated)
    works = works or any(each.bearing.work or each.bearing.gait in FEET for each in acts)
    shakes = ("shake" in stated_gaze(before.text)) != ("shake" in stated_gaze(bare.prompt))
    return before.action == STANDING and bool(done) and (works or shakes)


class TrainedReaders:
    """Reads prompts by the trained readers."""

    def __init__(
        self,
        pooled: Callable[[Sequence[str]], Sequence[Float32]],
        encode: Callable[[Sequence[str]], Sequence[Encoding]],
        encode_marked: Callable[[Sequence[str]], Sequence[Encoding]],
        *,
        movements: bool,
    ) -> None:
        """Keep how texts are encoded.

        Args:
            pooled: returns the sentence vectors (W,) of texts, by the encoder of the readers.
            encode: returns the encodings of texts.
            encode_marked: returns those of texts with marks between their clauses, by the encoder of `OrderReader`.
            movements: a prompt of several movements is read movement by movement.
        """
        self._pooled, self._encode, self._encode_marked, self._movements = pooled, encode, encode_marked, movements
        self._actions: dict[str, ReadAction] = {}
        self._encodings: dict[str, Encoding] = {}
        self._clauses: dict[BarePrompt, Sequence[ReadClause]] = {}
        self._marked: dict[str, Encoding] = {}

    def read(self, texts: Sequence[str]) -> list[ReadPrompt]:
        """Return what each text asks for."""
        bare = [BarePrompt.of(text) for text in texts]
        parts = [said for each in bare for said, _ in parts_in_time(each.text)] if self._movements else []
        self._pooled([*texts, *(each.text for each in bare if each.text), *parts])  # together, in half the time
        self._encode_together([each if each.text else as_written(each.prompt) for each in bare])
        return [self._carried(self._apart(self._whole(each), each), each) for each in bare]

    def clause(self, text: str) -> ReadClause:
        """Return the surest clause that the reader of sequences takes a part of a prompt for."""
        return max(self._clauses_of(as_written(text)), key=lambda clause: clause.probability)

    def _whole(self, bare: BarePrompt) -> ReadPrompt:
        return self._borne(bare) or self._reading(as_written(bare.prompt))

    def _apart(self, reading: ReadPrompt, bare: BarePrompt) -> ReadPrompt:
        """Return a reading in which what stands together though signs set it apart is several movements."""
        if not self._movements:
            return reading
        if not reading.movements:
            movements = told_apart(bare.prompt, self._surely_part)
            if any(each.action in RISING for each in movements) and movements[0].action != FALLEN:
                movements = ()
            found = tuple(with_held_hand(from_there(movements)))
            return ReadPrompt(bare.prompt, found, drawn=reading.drawn) if found else reading
        movements = tuple(
            part
            for each in reading.movements
            for part in (
                () if each.action in WHOLE else self._known(each) or told_apart(each.text, self._part, way=False)
            )
            or (each,)
        )
        whole = with_whole_shots(movements)
        if len(whole) == 1 < len(movements) and not reading.drawn:
            return ReadPrompt.of(bare.prompt, whole[0].action)
        return replace(reading, movements=tuple(with_held_hand(from_there(whole))))

    def _known(self, movement: ReadMovement) -> tuple[ReadMovement, ...]:
        """Return a movement whose action is in doubt with the one that is read in its words alone; else none."""
        found = self._part(movement.text) if movement.action is None and not movement.seconds else ()
        named = named_actions(BarePrompt.of(movement.text).text, surely=True)
        return found if len(found) == 1 and found[0].action in named else ()

    def _part(self, text: str) -> tuple[ReadMovement, ...]:
        """Return the movements of a clause; none if it asks for none, or that is in doubt."""
        bare = BarePrompt.of(without_misleading(text))
        reading = self._whole(bare)
        movements = reading.movements
        if movements and movements[-1] == rest() and not way_to_a_stop(text):
            movements = movements[:-1]  # behind counted steps, where something else comes
        if movements or not reading.plain:
            return movements
        action = next(name for name, each in load_vocabulary().actions.items() if each.plain_words == reading.plain)
        named = reading.drawn or named_actions(bare.text)
        return (ReadMovement(text, action),) if named else ()

    def _surely_part(self, text: str) -> tuple[ReadMovement, ...]:
        """Return the movements of a clause of a prompt that the readers take for one; none unless its words name each
        of them surely."""
        found = self._part(text)
        surely = all(
            each.action not in (None, *WHOLE)
            and (
                only_named(without_gaze(BarePrompt.of(each.text).text)) == each.action != STANDING
                or self._is_gesture(each.text)
            )
            for each in found
        )
        return found if surely else ()

    @staticmethod
    def _is_gesture(text: str) -> bool:
        return any(each.bearing.gesture or each.bearing.work for each in BarePrompt.of(text).stated)

    def _carried(self, reading: ReadPrompt, bare: BarePrompt) -> ReadPrompt:
        """Return a reading in which who carries something back turns round for it."""
        movements = reading.movements
        if not movements:
            way = next(
                (way for way in sorted(CARRYING) if reading.plain == load_vocabulary().need(way).plain_words), None
            )
            movements = (ReadMovement(bare.prompt, way),)
        turned = tuple(turned_to_carry(movements)) if self._movements else movements
        return reading if turned == movements else ReadPrompt(bare.prompt, turned, drawn=reading.drawn)

    def _encode_together(self, bare: Sequence[BarePrompt]) -> None:
        """Encode prompts that may ask for several movements, and all that may be one of these."""
        if not self._movements or len(bare) < 2:
            return
        unsure = {each.text: each for each in bare if not self._is_surely_one(each, self._read_bare(each))}
        self._encodings.update(zip(unsure, self._encode(list(unsure)), strict=True))
        self._pooled([clause for text in unsure for clause in sequence_reader().clauses(text, self._encodings[text])])
        cut = map(self._clauses_of, unsure.values())
        asked = [clauses for clauses in cut if is_asked_for_order([clause.moves for clause in clauses])]
        texts = [marked([clause.text for clause in clauses])[0] for clauses in asked]
        self._marked.update(zip(texts, self._encode_marked(texts), strict=True))

    def _clauses_of(self, bare: BarePrompt) -> Sequence[ReadClause]:
        if bare not in self._clauses:
            encoding = self._encodings.get(bare.text) or self._encode([bare.text])[0]
            self._clauses[bare] = sequence_reader().written_clauses(bare, encoding, self._pooled)
        return self._clauses[bare]

    def _in_time(self, clauses: Sequence[str], moving: Sequence[bool]) -> Sequence[int]:
        """Return the numbers of clauses that ask for a movement, in the order of time."""
        return order_reader().order(clauses, moving, self._marked_encoding)

    def _marked_encoding(self, text: str) -> Encoding:
        return self._marked.get(text) or self._encode_marked([text])[0]

    def _reading(self, bare: BarePrompt) -> ReadPrompt:
        if only_gaze(bare.prompt) or _stops_and_looks(bare.prompt):
            return ReadPrompt.of(bare.prompt, STANDING, surely=True)
        if self._movements and (movements := self._by_sides(bare.prompt)):
            return ReadPrompt(bare.prompt, movements)
        if self._movements and (movements := self._after_gaze(bare.prompt)):
            return ReadPrompt(bare.prompt, movements)
        if self._movements and (movements := self._stop_and_gaze(bare.prompt)):
            return ReadPrompt(bare.prompt, movements)
        read = self._read_bare(bare)
        sure = self._is_surely_one(bare, read)
        if self._movements and not sure and (movements := self._movements_in(bare, read.action)):
            one = len(movements) == 1 or _is_list_of(movements[0])  # "drives, then swerves"
            each_side = tuple(side for each in movements for side in self._by_sides(each.text) or (each,))
            return ReadPrompt.of(bare.prompt, movements[0].action) if one else ReadPrompt(bare.prompt, each_side)
        surely = read.probability >= (SURELY_AGREED if read.least == AGREED else SURELY)
        return ReadPrompt.of(bare.prompt, likeliest(bare, read) if self._movements else read.action, surely=surely)

    def _by_sides(self, prompt: str) -> tuple[ReadMovement, ...]:
        """Return the movements of a prompt that asks for one action on one side and then on the other, and perhaps for
        a body that stands then; else none."""
        sides, rests = parts_by_sides(prompt)
        parts = [(part, self._read_action(part).likely(UNSPLIT)) for part in sides]
        alike = len({action for _, action in parts}) == 1 and None not in {action for _, action in parts}
        found = (*parts, *((part, STANDING) for part in rests))
        return tuple(ReadMovement(part, action) for part, action in found) if alike else ()

    def _after_gaze(self, prompt: str) -> tuple[ReadMovement, ...]:
        """Return the movements of a prompt that has the head turn first, and then asks for one action; else none."""
        acts = without_gaze(prompt)
        said = acts.removeprefix("and ").removeprefix("then ")
        looks = prompt[: prompt.rfind(acts)].strip(" ,;")
        if said == acts or not only_gaze(looks):
            return ()
        action = self._read_action(said).likely(UNSPLIT)
        return () if action is None else (ReadMovement(looks, STANDING), ReadMovement(said, action))

    def _stop_and_gaze(self, prompt: str) -> tuple[ReadMovement, ...]:
        """Return the movements of a prompt of a way to a stop, behind which the head turns; else none."""
        acts = without_gaze(prompt)
        looks = without_joints(prompt[len(acts) :])
        if acts == prompt or not prompt.startswith(acts) or not way_to_a_stop(acts) or not only_gaze(looks):
            return ()
        movements = self._reading(as_written(acts)).movements
        stops = without_joints(prompt[len(way_to_a_stop(acts)) :])
        return (*movements[:-1], ReadMovement(stops, STANDING)) if len(movements) > 1 else ()

    def _is_surely_one(self, bare: BarePrompt, read: ReadAction) -> bool:
        """Return True if a prompt is not looked at for several movements."""
        if read.action is None or read.probability < SURE_OF_SEVERAL or way_to_rest(bare.prompt, read.action):
            return False
        if self._is_in_parts(bare.text):
            return False
        return read.action not in RISING or not named_actions(bare.text) & WAYS  # "stands up and walks away"

    def _is_in_parts(self, text: str) -> bool:
        """Return True if words and network agree that the parts of a text are several actions: "aim, fire"."""
        parts = parts_in_time(text)
        moving = {action for _, action in parts} - {STANDING, *RISING}
        return len(parts) == len(moving) > 1 and all(self._read_action(said).action == action for said, action in parts)

    def _borne(self, bare: BarePrompt) -> ReadPrompt | None:
        """Return the reading of a prompt without the words that ask for a bearing; None if it asks for none, or for one
        that cannot be shown beside its actions."""
        if not bare.stated:
            return None
        if self._movements and (movements := self._movements_of_parts(parts_by_gestures(bare.prompt))):
            only, *others = movements
            if others:
                return ReadPrompt(bare.prompt, movements, drawn=True)
            if only.action == STANDING:
                return replace(ReadPrompt.of(bare.prompt, STANDING, surely=True), drawn=True)
        acts = without_gaze(bare.text)
        acts = acts if says_more(acts) and not is_length(acts) else ""
        if not acts or (self._read_action(acts).action is None and named_actions(acts) <= {STANDING}):
            stands = not acts or not all(each.whole for each in bare.stated)
            other = self._read_action(bare.prompt).action if acts else None  # "cheer" of "cheer with arms in the air"
            stands = stands and (other is None or bare.fits(other))
            return replace(ReadPrompt.of(bare.prompt, STANDING, surely=True), drawn=True) if stands else None
        reading = self._reading(bare)
        shown = [each.action for each in reading.movements] or [self._read_bare(bare).action]
        if any(action is not None and bare.fits(action) for action in shown):
            return replace(reading, drawn=True)
        written = self._reading(as_written(bare.prompt)) if reading.movements else None
        return reading if written is not None and not written.movements else None

    def _movements_of_parts(self, parts: Sequence[str]) -> tuple[ReadMovement, ...]:
        """Return the movements of the parts of a prompt, some of which are gestures.

        Those of a body that sits or stands are made in the same movement, unless its part has a length
        of its own. Parts that ask for no action are left out.
        """
        found: list[ReadMovement] = []
        for part in parts:
            if found and comes_with(found[-1].text, part):
                how, part = before_next_verb(part)
                found[-1] = replace(found[-1], text=f"{found[-1].text} {how}", seconds=None)
            if not part:
                continue
            bare = BarePrompt.of(part)
            stays = found and found[-1].action in STAYING and stated_length(found[-1].text).seconds is None
            looked = found and len(stated_gaze(found[-1].text)) > 1 and not stated_gaze(part)
            if stays and not (looked or _in_turn(found[-1], bare)) and not without_gaze(bare.text):
                found[-1] = replace(found[-1], text=f"{found[-1].text} and {part}", seconds=None)
                continue
            if not without_gaze(bare.text):
                found.append(ReadMovement(part, STANDING))
                continue
            reading = self._borne(bare) or self._reading(as_written(part))
            text = bare.text if bare.stated else part
            action = self._read_action(text).action
            asked = action is not None or named_actions(text)
            found += reading.movements or ([ReadMovement(part, action)] if asked else [])
        return tuple(found) if len(found) > 1 or len(parts) > 1 else ()

    def _read_action(self, text: str) -> ReadAction:
        if text not in self._actions:
            acts = text if joins_clauses(text) else without_gaze(text) or text
            read = action_reader().read(acts, self._pooled([acts])[0])
            if has_other_sense(read.action, text):
                read = ReadAction(OUTSIDE, 1.0, read.least)
            elif read.name in (ATTACK, OUTSIDE) and lunges_as_exercise(text):
                read = ReadAction(EXERCISE, SURELY_AGREED, AGREED)
            self._actions[text] = read
        return self._actions[text]

    def _read_bare(self, bare: BarePrompt) -> ReadAction:
        """Read what is left of a prompt; in doubt, as the only action that its words name, if it can be borne so."""
        read = self._read_action(bare.text)
        named = named_actions(bare.text) if read.action is None and bare.stated else set[str]()
        (only,) = named if len(named) == 1 else ("",)
        return ReadAction(only, AGREED, AGREED) if only and bare.fits(only) else read

    def _movements_in(self, bare: BarePrompt, action: str | None) -> tuple[ReadMovement, ...]:
        if action is None and (way := way_to_a_stop(bare.prompt)) and (ends := self._read_action(way).action) in WAYS:
            action = ends  # "sprints forward then stops suddenly"
        movements = sequence_reader().read(bare, self._clauses_of(bare), self._in_time, action)
        if not lunges_as_exercise(bare.prompt):
            return movements
        return tuple(
            replace(each, action=EXERCISE) if each.action == ATTACK and lunges_as_exercise(each.text) else each
            for each in movements
        )
