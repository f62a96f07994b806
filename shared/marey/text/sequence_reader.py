"""Reader of prompts that ask for several movements: where each begins, which action it is, and when it comes (ours).

A convolution over the token states of the sentence encoder finds where movements may begin, and a second network reads
the action of each clause that these cuts make, from the clause's own sentence vector, its words and the states around
it. The cuts that both find likeliest together are taken. `python -m marey.reading.train_sequences` makes
`sequence_reader.safetensors` anew.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from marey.core.hashing import sha256_of
from marey.text.action_reader import OUTSIDE, RISING, named_actions, word_marks
from marey.text.clause_order import (
    BOUND_TO_HANDS,
    CONTEXT,
    PLAIN,
    SURE,
    ReadClause,
    in_order,
    parted,
    with_belongings,
    without_joints,
)
from marey.text.clause_parts import only_named, parts_in_time
from marey.text.encoders import Encoding
from marey.text.plain_action import TURNING, with_plain_action
from marey.text.reader_file import Float32, Reader
from marey.vocabulary.bearing_words import BarePrompt
from marey.vocabulary.bearings import DRAWN_AS
from marey.vocabulary.counts import STEPPING, stated_count
from marey.vocabulary.courses import RUNS
from marey.vocabulary.distances import stated_distance
from marey.vocabulary.entries import load_vocabulary
from marey.vocabulary.gazes import only_gaze, without_gaze
from marey.vocabulary.inflection import phrase_in_third_person
from marey.vocabulary.peeks import only_peeks
from marey.vocabulary.scope import STANDING, every_action, match_scope
from marey.vocabulary.stops import way_to_a_stop

FILE = Path(__file__).with_name("sequence_reader.safetensors")
VERSION = 14
"""Raise it when the same prompt and file give other movements."""
STATE_SCALE, VECTOR_SCALE = 6.0, 10.0
"""Factors of token states and of sentence vectors."""
KERNEL = 5
"""Tokens that a convolution sees."""
MOST_CUTS = 5
"""Cuts that are considered, those most likely; a prompt has one movement more at most."""
LEAST_CUT = 0.03
"""Probability from which on a cut is considered."""
ACTION_WEIGHT = 4.0
"""Weight of the actions of clauses beside that of the cuts."""
FLOOR = frozenset({"lie", "lie-down", "sit-floor", "kneel", "die", "sit-ups", "push-ups", "crawl"})
SEAT = frozenset({"sit", "sit-down", "drive"})
"""Actions that end on the floor, and on a seat: "gets up" and "stands up" behind them are from there."""
HELD = {"sit-down": "sit", "lie-down": "lie", "die": "lie"} | {
    name: name for name in ("sit", "sit-floor", "kneel", "lie", "crouch")
}
"""Actions in whose last pose who "waits" behind them stays, by those that show it."""
TURNS = frozenset({TURNING, "walk", "run"})
"""Actions that a prompt for a turn while walking or running names."""
LIKELY = 0.3
"""Probability from which on a clause whose words name no action has the likeliest."""
WAYS = frozenset({"walk", "run", "sprint", "sneak", "walk-backward"})
"""Actions that a stop ends."""
JUMPS = frozenset({"jump", "jump-forward"})
ON_FEET = WAYS | RISING | {"jump", "jump-forward", "leap", "hop", "climb-stairs", "climb-ladder", "climb-onto", "dance"}
"""Actions behind which a body is on its feet, though it sat before."""
DRAWN_S = 1.8
"""Seconds of an action that is drawn as a gesture, beside other actions."""
REST_S = 2.0
"""Seconds of standing that a stop is read as."""
_TO_A_SEAT = re.compile(
    r"\s(?:(?:over|up|back|out)\s)?(?:to|towards?)\s(?:the|an?|his|her|their|its)\s(?:\w+\s)?"
    r"(?:throne|chair|armchair|seat|sofa|couch|bench|stool|bed)s?\b",
    re.IGNORECASE,
)
_CARRIED_BACK = re.compile(
    r"(\b(?:carr|bring|tak|lug|haul|tot)\w* "
    r"(?:it|them|him|her|(?:the|a|an|his|her|their|this|that) (?!(?:[\w-]+ ){0,3}(?:steps?|paces?|strides?)\b)"
    r"(?:\w+ ){0,2}?\w+))"
    r" back\b(?! (?:and forth|up|down|wards?))",
    re.IGNORECASE,
)
"""Words of who carries something back to where it was."""
TURN_AROUND, CARRYING = "turn-around", WAYS | {"carry"}
"""How a body turns round, and ways on which it may carry something."""
BACKWARD: Mapping[str, str] = {"walk-backward": "walk"}
"""Ways ahead, by those backward."""
_ACROSS = re.compile(r"\b(?:over|across)\b", re.IGNORECASE)
_WAKES = re.compile(
    r"(?:(?:he|she|they) )?(?:\w+ly )?(?:wakes?(?: up)?|awakes?|awakens?|stirs?)(?: \w+ly| with a start)?\W*",
    re.IGNORECASE,
)
"""Words of who is awake and stays where he is."""
_GOES_ON = re.compile(
    r"(?:(?:he|she|they) )?(?:climbs?|goes|keeps|continues?|carries)\b.*\b(?:on|climbing|up)\W*$", re.I
)
"""Words of who climbs further."""
_STANDS = re.compile(r"\bst(?:and|ood|ays? (?:up|standing))|\bupright\b", re.IGNORECASE)
_WITHOUT = re.compile(r"\bwithout (?:\w+ly )?\w+ing\b[^,;.]*", re.IGNORECASE)
"""Words of what does not come with a movement, which is done all the same."""
_IN_TIME = re.compile(r"^\W*(?:and )?(?:then|finally|afterwards?|after that)\b|^\W*(?:and )?stops?\b", re.IGNORECASE)
"""Beginning of a clause that comes behind all before it."""
STOPS = re.compile(r"(?:(?:he|she|they|an? \w+|the \w+) )?(?:stop|halt|paus|stand|com\w* to (?:a|an) )", re.IGNORECASE)
"""Beginning of a clause that ends the way before it."""


@dataclass(frozen=True)
class ReadMovement:
    """One movement of a prompt.

    Attributes:
        text: its words, without those that join it to others.
        action: id of its action in the vocabulary; None = none, in doubt, or several at once.
        seconds: that it lasts; None = the model decides.
    """

    text: str
    action: str | None
    seconds: float | None = None

    @property
    def worded(self) -> str:
        """Its text as the model reads it, behind its action in plain words; of a way without the seat that it leads to,
        on which models would sit at once."""
        text = _TO_A_SEAT.sub("", self.text) if self.action in WAYS else self.text
        return with_plain_action(text, self.action)


@dataclass(frozen=True)
class _Cuts:
    """Places where a text may be cut into clauses.

    Attributes:
        edges: offsets of the characters at its ends and at the cuts (C + 2,).
        spans: indices of two edges, for each part between any two.
        texts: that part, without the words that join it.
        begins: probability of each cut (C,).
        at_once: that what begins there comes at the same time as what is before it (C,).
    """

    edges: list[int]
    spans: list[tuple[int, int]]
    texts: list[str]
    begins: list[float]
    at_once: list[bool]


class SequenceReader(Reader):
    """Both networks. Their classes are the ids of the vocabulary's actions, `OUTSIDE` and `CONTEXT`."""

    file = FILE
    reads = "sequences"
    tensors = frozenset(
        f"{name}{end}" for name in ("states", "first", "second", "begins", "hidden", "out") for end in ("", "_bias")
    )

    def read(
        self,
        bare: BarePrompt,
        written: Sequence[ReadClause],
        in_time: Callable[[Sequence[str], Sequence[bool]], Sequence[int]],
        action: str | None = None,
    ) -> tuple[ReadMovement, ...]:
        """Return the movements of a prompt in the order of time; none if it does not ask for several, one after the
        other, or that is in doubt. There is one where all else is done at a wheel or by hands that hold.

        Standing still beside the one action that a prompt is taken for is no movement but at the end of a way, nor is
        the way before a turn.
        Prompts that say what is not done are not split.

        Args:
            bare: the prompt, and the text of it that is read.
            written: its clauses (`written_clauses`).
            in_time: returns the numbers of the clauses that ask for a movement, in the order of time, from all clauses
                as they are written, and whether each asks for one (`OrderReader.order`).
            action: that the reader of actions takes the prompt for; None = several, none, or in doubt.
        """
        if way := way_to_rest(bare.prompt, action):
            several = [ReadMovement(text, one) for text, one in parts_in_time(way)]  # "jogs, slows to a walk and stops"
            return (*(several or [ReadMovement(way, action)]), rest())
        whole = list(parted(with_belongings(_placed(written, in_time))))
        if len(whole) == 1 < len(written) and (whole[0].name in BOUND_TO_HANDS or _is_doubtless(whole[0])):
            return (ReadMovement(bare.prompt, whole[0].name),)
        groups = in_order(whole)
        clauses = [clause for group in groups for clause in group]
        if len(groups) < 2 or not _is_clear(clauses):
            return ()
        together = _is_one_action([clause.name for clause in clauses], action)
        if together and not (_stops_on_a_way(clauses) or _measures_ways(clauses)):
            return _turn_and_rest(clauses)
        if any("negation" in match_scope(_WITHOUT.sub("", each.text), every_action()).flags for each in clauses):
            return ()
        found = list(from_there(map(_movement, groups)))
        if found[-1].action == STANDING and found[-2].action in WAYS and way_to_a_stop(bare.prompt):
            found[-1] = rest()
        return tuple(found)

    def written_clauses(
        self, bare: BarePrompt, encoding: Encoding, pooled: Callable[[Sequence[str]], Sequence[Float32]]
    ) -> list[ReadClause]:
        """Return the likeliest clauses of a prompt, as they are written.

        Args:
            bare: the prompt, and the text of it that is read.
            encoding: of that text.
            pooled: returns the sentence vectors (W,) of texts.
        """
        cuts = self._cuts(bare.text, encoding)
        edges = cuts.edges
        rows = [
            clause_inputs(text, vector, encoding, (edges[low], edges[high]), self.classes)
            for text, vector, (low, high) in zip(cuts.texts, pooled(cuts.texts), cuts.spans, strict=True)
        ]
        shares = dict(zip(cuts.spans, self.actions(np.stack(rows)), strict=True))
        found: list[ReadClause] = []
        for low, high in itertools.pairwise(_likeliest(cuts.begins, shares)):
            best = int(shares[low, high].argmax())
            together = low > 0 and cuts.at_once[low - 1]
            text = bare.written(edges[low], edges[high]).strip()
            found.append(ReadClause(self.classes[best], float(shares[low, high][best]), text, together))
        return found

    def clauses(self, text: str, encoding: Encoding) -> list[str]:
        """Return all parts of a text that may be a clause of its own: those whose sentence vectors `read` asks for."""
        return self._cuts(text, encoding).texts

    def _cuts(self, text: str, encoding: Encoding) -> _Cuts:
        """Return where a text may be cut, and what lies between."""
        begins, at_once = self.beginnings(encoding.tokens)
        places = [place for place in _word_starts(text, encoding.offsets) if begins[place] > LEAST_CUT]
        places = sorted(sorted(places, key=lambda place: -begins[place])[:MOST_CUTS])
        edges = [0, *(encoding.offsets[place][0] for place in places), len(text)]
        spans = list(itertools.combinations(range(len(edges)), 2))
        texts = [without_joints(text[edges[low] : edges[high]]) for low, high in spans]
        return _Cuts(edges, spans, texts, [float(begins[at]) for at in places], [bool(at_once[at]) for at in places])

    def beginnings(self, states: Float32) -> tuple[Float32, NDArray[np.bool_]]:
        """Return the probability (T,) that a movement begins at each token, and whether (T,) it would come at the same
        time as the one before, from token states (T, W)."""
        weights = self._weights
        hidden = np.maximum(states * STATE_SCALE @ weights["states"].T + weights["states_bias"], 0)
        for layer in ("first", "second"):
            hidden = hidden + np.maximum(_convolved(hidden, weights[layer], weights[f"{layer}_bias"]), 0)
        scores = hidden @ weights["begins"].T + weights["begins_bias"]
        return (1 / (1 + np.exp(-scores[:, 0]))).astype(np.float32), scores[:, 1] > 0

    def actions(self, inputs: Float32) -> Float32:
        """Return the probabilities (N, C) of the classes for clauses (N, I); what is left of 1 is that of several
        actions."""
        weights = self._weights
        hidden = np.maximum(inputs @ weights["hidden"].T + weights["hidden_bias"], 0)
        scores = hidden @ weights["out"].T + weights["out_bias"]
        shares = np.exp(scores - scores.max(axis=1, keepdims=True))
        return (shares / shares.sum(axis=1, keepdims=True))[:, : len(self.classes)]


def _placed(
    clauses: Sequence[ReadClause], in_time: Callable[[Sequence[str], Sequence[bool]], Sequence[int]]
) -> list[ReadClause]:
    """Return clauses with their places in time."""
    order = in_time([clause.text for clause in clauses], [clause.moves for clause in clauses])
    place_of = {number: place for place, number in enumerate(order)}
    placed = list[ReadClause]()
    for number, clause in enumerate(clauses):
        place, before = place_of.get(number, 0), max((each.place for each in placed), default=0)
        placed.append(replace(clause, place=place, at_once=clause.at_once and place >= before))  # or it comes first
    return placed


def clause_inputs(
    text: str, vector: Float32, encoding: Encoding, span: tuple[int, int], classes: Sequence[str]
) -> Float32:
    """Return the input (2 W + C + 1,) of the network of actions: the sentence vector of a clause, a mark of each class
    that its words name, a mark of words that name several, and the mean state of its tokens in the prompt.

    Args:
        text: the clause, without joining words.
        vector: (W,) of the clause alone.
        encoding: of the prompt.
        span: its first character in the prompt, and the one after its last.
        classes: ids of the actions, and the classes behind them.
    """
    within = encoding.span(*span)
    around = np.zeros_like(vector) if within is None else within
    parts = vector * VECTOR_SCALE, word_marks(text, classes)[:-1], around * STATE_SCALE
    return np.concatenate(parts).astype(np.float32)


def way_to_rest(text: str, action: str | None) -> str:
    """Return the words of a way after which the body stands still, since the text says so or counts the steps; empty if
    there is none.

    Args:
        text: of one action.
        action: its id; None = several, none, or in doubt.
    """
    if action not in WAYS:
        return ""
    steps = stated_count(text, action) if action in STEPPING else None
    return way_to_a_stop(text) or (text if steps is not None else "")


def rest() -> ReadMovement:
    """Return what a stop is read as: standing, in plain words alone."""
    return ReadMovement(phrase_in_third_person(load_vocabulary().need(STANDING).plain), STANDING, REST_S)


def _is_clear(clauses: Sequence[ReadClause]) -> bool:
    """Return True if no clause is in doubt, or two at least are in none at all."""
    return min(clause.probability for clause in clauses) >= SURE or sum(map(_is_doubtless, clauses)) > 1


def _is_doubtless(clause: ReadClause) -> bool:
    return clause.probability >= PLAIN and clause.name not in (OUTSIDE, CONTEXT)


def _is_one_action(names: Sequence[str], action: str | None) -> bool:
    """Return True if clauses with these names are one action: "stands and waves" of a prompt that is taken for one, and
    "walks ahead, then veers off", since who turns walks. "Stands idle, walks" is two if it is taken for standing."""
    moving = set(names) - {STANDING}
    if action == STANDING == names[0] and moving:
        return False
    turns = TURNING in moving and moving <= TURNS and not moving >= TURNS
    if turns and len(moving) > 1 and names.index(TURNING) == 0:  # "turns left, then walks up"
        return False
    return turns or (action is not None and len(moving) < 2)


def _turn_and_rest(clauses: Sequence[ReadClause]) -> tuple[ReadMovement, ...]:
    """Return the movements of a way with a turn behind which the body is said to stand: "walks up to us, turns left and
    then waits"; none if it is not."""
    *way, last = clauses
    if last.name != STANDING or TURNING not in {clause.name for clause in way} or not _IN_TIME.match(last.text):
        return ()
    said = without_joints(" ".join(clause.text for clause in way))
    return ReadMovement(said, TURNING), ReadMovement(without_joints(last.text), STANDING)


def _stops_on_a_way(clauses: Sequence[ReadClause]) -> bool:
    """Return True if a way ends with a stop: "walks forward, stops and looks around"."""
    return any(
        way.name in WAYS and after.name == STANDING and STOPS.match(without_joints(after.text)) is not None
        for way, after in itertools.pairwise(clauses)
    )


def _measures_ways(clauses: Sequence[ReadClause]) -> bool:
    """Return True if the lengths of two ways are said: "takes three steps, turns and takes two more steps"."""
    ways = [clause for clause in clauses if clause.name in WAYS]
    return len(ways) > 1 and any(stated_distance(clause.text, clause.name) is not None for clause in ways)


def from_there(movements: Iterable[ReadMovement]) -> tuple[ReadMovement, ...]:
    """Return movements that begin as the one before has ended: who sat down and waits sits, who stands up does so from
    there, and who runs and jumps over something leaps."""
    return tuple(_from_there(movements))


def _from_there(movements: Iterable[ReadMovement]) -> Iterator[ReadMovement]:
    before = down = climbed = None
    for movement in movements:
        action = movement.action
        if action in (STANDING, *HELD) and only_peeks(movement.text):
            action = STANDING  # out of the posture in which the body is
        elif action == STANDING and before in HELD and not _STANDS.search(movement.text):
            action = HELD[before]
        elif action in RISING and _WAKES.fullmatch(movement.text) and down in HELD:
            action = HELD[down]
        elif action in RISING and down is not None:
            action = "get-up" if down in FLOOR else "stand-up"
        elif action in RISING and before is not None:
            action = STANDING
        elif action == "climb-onto" and climbed and _GOES_ON.match(movement.text):
            action = climbed
        elif action in JUMPS and before in RUNS and _ACROSS.search(movement.text):
            action = "leap"
        yield replace(movement, action=action)
        before = before if action == STANDING and only_peeks(movement.text) else action
        climbed = action if action in ("climb-stairs", "climb-ladder") else climbed
        if action in FLOOR | SEAT:
            down = action
        elif action in ON_FEET:
            down = None


def turned_to_carry(movements: Iterable[ReadMovement]) -> Iterator[ReadMovement]:
    """Yield movements; who carries something back turns round first, unless that is said, and walks ahead."""
    before = None
    for movement in movements:
        carried = _CARRIED_BACK.sub(r"\1", movement.text) if movement.action in CARRYING else movement.text
        if carried == movement.text:
            yield movement
        else:
            if before not in (TURN_AROUND, TURNING):
                yield ReadMovement("turns around", TURN_AROUND)
            yield replace(movement, text=carried, action=BACKWARD.get(movement.action or "", movement.action))
        before = movement.action


def _movement(group: Sequence[ReadClause]) -> ReadMovement:
    text = without_joints(" ".join(clause.text for clause in group))
    if only_gaze(text):
        return ReadMovement(text, STANDING)
    single = len(group) == 1 and group[0].name != OUTSIDE and group[0].probability >= PLAIN
    outside = len(group) == 1 and group[0].name == OUTSIDE and group[0].probability >= PLAIN
    action = group[0].name if single else None if outside else only_named(without_gaze(text))
    if action is None and (outside or STOPS.match(text)) and not named_actions(text) - {STANDING}:
        action = STANDING  # of words that they do not know, models make falls and hops
    likely = len(group) == 1 and group[0].name != OUTSIDE and group[0].probability >= LIKELY
    if action is None and likely and not named_actions(text):
        action = group[0].name
    return ReadMovement(text, action, DRAWN_S if action in DRAWN_AS else None)


def _word_starts(prompt: str, offsets: Sequence[tuple[int, int]]) -> Iterator[int]:
    """Yield the tokens that begin a word or a sign, but the first."""
    real = [place for place, (start, end) in enumerate(offsets) if end > start]
    for before, place in itertools.pairwise(real):
        start = offsets[place][0]
        if start > offsets[before][1] or not prompt[start].isalnum():
            yield place


def _likeliest(begins: Sequence[float], shares: Mapping[tuple[int, int], Float32]) -> list[int]:
    """Return the edges of the likeliest clauses, the first and the last among them.

    Args:
        begins: probability of each cut between the first and the last edge.
        shares: probabilities of the classes of each clause, by its edges.
    """
    score_of = {span: ACTION_WEIGHT * math.log(float(share.max())) for span, share in shares.items()}

    def score(taken: Sequence[bool]) -> tuple[float, list[int]]:
        edges = [0, *(number + 1 for number, cut in enumerate(taken) if cut), len(begins) + 1]
        cut = sum(math.log(max(share if now else 1 - share, 1e-4)) for share, now in zip(begins, taken, strict=True))
        return cut + sum(score_of[span] for span in itertools.pairwise(edges)), edges

    return max(map(score, itertools.product((False, True), repeat=len(begins))), key=lambda each: each[0])[1]


def _convolved(hidden: Float32, weight: Float32, bias: Float32) -> Float32:
    """Convolve states (T, H) with a kernel (H, H, K), zeros around them."""
    reach = weight.shape[2] // 2
    padded = np.pad(hidden, ((reach, reach), (0, 0)))
    windows = np.stack([padded[shift : shift + len(hidden)] for shift in range(weight.shape[2])], axis=2)
    return windows.reshape(len(hidden), -1) @ weight.reshape(len(weight), -1).T + bias


@cache
def sequence_reader() -> SequenceReader:
    """Return the reader, loaded once."""
    return SequenceReader.load()


@cache
def sequence_reader_sha256() -> str:
    """Return the hash of the reader's file."""
    return sha256_of(FILE)
