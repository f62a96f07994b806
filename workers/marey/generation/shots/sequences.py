"""Sequences: a prompt of several movements, made as a timeline of them.

A model that learned single actions shows two of them in one pass for every second prompt, and three for every sixth.
Made one by one, each as long as it takes alone, four of five and two of three show
(docs/decisions/0044-sequences.md).
"""

from __future__ import annotations

import random
import re
from collections.abc import Sequence
from dataclasses import replace
from itertools import accumulate, pairwise
from typing import Any

from marey.generation.asked import draws
from marey.generation.lengths import resolved_length
from marey.generation.port import Generator, Limits, Request
from marey.generation.posture import NO_POSTURE
from marey.generation.postured import gestures_s
from marey.generation.row_postures import Row, rises, row_postures
from marey.generation.shots.one_movement import joined_movements
from marey.generation.shots.way_lengths import with_least_ways, with_room_back
from marey.generation.timed import TimedText, part_seed
from marey.generation.wish import action_of
from marey.items.timeline import MAX_TIMELINE_SECONDS, MIN_ROW_SECONDS
from marey.text.features import TextFeatures
from marey.vocabulary.courses import RUNS
from marey.vocabulary.entries import load_vocabulary
from marey.vocabulary.gazes import stated_gaze
from marey.vocabulary.lengths import only_length, stated_length
from marey.vocabulary.scope import STANDING
from marey.vocabulary.stops import only_stops

SEED = "movement"
"""Part of the seed by which the length of a movement is drawn."""
WAITS_S = 2.0
"""Seconds of a body that stands and waits beside other movements."""
LOOKS_S, STOPS_S = 3.0, (1.0, 1.25)
"""The same of one that looks around, and of one that only stops."""
LEAP, JUMPS_AHEAD = "leap", frozenset({"jump", "jump-forward", "hop"})
"""Action of a jump out of a run, and those of jumps that may be one."""
_OVER = re.compile(r"\b(?:over|across|clear(?:s|ing))\b")
_ON_SPOT = re.compile(
    r"\b(?:up and down|in place|on (?:the spot|(?:one|his|her|their|the)(?: \w+)? (?:leg|foot))|straight up|for joy"
    r"|high five|twice|times|backwards?|onto|into|off|down|up)\b"
)
"""Words of jumps that are none."""
_TRIPS = re.compile(
    r"\W*(?:(?:(?:a|the|this) )?\w+ )?(?:(?:then|suddenly) )*"
    r"(?:trip(?:s|ping)|stumbl(?:es|ing)|slip(?:s|ping)|stagger(?:s|ing)|los(?:es|ing) \w+ (?:balance|footing))"
    r"(?: (?!out\b|off\b|away\b|into\b|on (?:his|her|their)\b).*)?\W*"
)
"""Words of a body that loses its footing."""
_DEAD = re.compile(r"\b(?:dead|dies|die|died|dying|death|killed|slain|lifeless(?:ly)?)\b")
_LIVES = re.compile(
    r"\b(?:reviv\w*|resurrect\w*|reanimat\w*|respawn\w*|(?:to|back to) life|alive|zombies?|undead|ghosts?|spirits?"
    r"|pretend\w*|play\w* dead|fak\w+|almost|nearly|half|like)\b"
)
"""Words of a death that is none, or not the end."""
_RESTS = frozenset({STANDING, "lie", "lie-down", "die"})
"""Actions behind a death: the body lies."""


def as_timeline(generator: Generator[Any], request: Request) -> Request:
    """Return the request of a sequence as that of a timeline with a row for each movement, and that of one movement
    that lasts longer by its words than the model's longest motion as that of one row; any other as it is.

    Each movement has the length that its words state, or the model gives it alone. Where the length of the whole is
    asked for, all are longer or shorter by the same factor; where that leaves one of them less than a second, the
    prompt stays one text.

    Args:
        generator: of the motion; one that cannot generate frames around others makes the prompt in one pass.
        request: of one prompt.

    Raises:
        InvalidInput: as `Limits.check`.
    """
    movements = _until_death(_merged_falls(request.text), request.text.said.lower())
    if draws(generator, request):
        movements = joined_movements(_leaping(movements), request.seed)
    alone = not (request.kept or request.free or request.recording or request.timeline)
    if not movements and alone and request.frames is None:
        only = _only_frames(generator.limits, request.text.said) if action_of(request.text) else None
        request = replace(request, frames=only)
    if not (alone and generator.limits.keeps):
        return request
    generator.limits.check(request)
    request = replace(request, frames=request.frames or _long_frames(generator.limits, request.text.prompt))
    fps = generator.limits.fps
    if len(movements) == 1:
        request, movements = replace(request, text=replace(movements[0], prompt=request.text.prompt)), ()
    if not movements:
        return _as_one_row(generator.limits, request)
    if _is_sum_of_parts(request, movements, fps):
        request = replace(request, frames=None)
    stated = [_stated_frames(generator.limits, request, movement) for movement in movements]
    lengths = [
        own or _drawn_frames(generator, request, movement, number)
        for number, (own, movement) in enumerate(zip(stated, movements, strict=True))
    ]
    lengths = with_least_ways(movements, lengths, generator.limits, stated)
    if request.frames is None:
        roomy = with_room_back(request.text.said, movements, lengths, generator.limits, stated)
        lengths = [own or room for own, room in zip(stated, roomy, strict=True)]
    else:
        lengths = _shared(request.frames, lengths)
    if min(lengths) < MIN_ROW_SECONDS * fps:
        return request
    ends = list(accumulate(lengths))
    postures = [NO_POSTURE] * len(movements)
    if draws(generator, request):
        postures = row_postures([_row(text) for text in movements], request.seed)
    rows = tuple(
        TimedText((end - length) / fps, end / fps, text, open=own is None and request.frames is None, held=held)
        for end, length, text, own, held in zip(ends, lengths, movements, stated, postures, strict=True)
    )
    return replace(request, timeline=rows)


def _long_frames(limits: Limits, prompt: str) -> int | None:
    """Return the frames of a length that a prompt states, if it is longer than the longest motion of the model and a
    timeline may have it."""
    seconds = stated_length(prompt).seconds
    frames = 0 if seconds is None or seconds > MAX_TIMELINE_SECONDS else round(seconds * limits.fps)
    return frames if frames > limits.max_frames else None


def _as_one_row(limits: Limits, request: Request) -> Request:
    """Return the request of one movement that is longer than the longest motion of the model as that of a timeline of
    one row; any other as it is."""
    if request.frames is None or request.frames <= limits.max_frames:
        return request
    text = replace(request.text, movements=(request.text,))
    return replace(request, text=text, timeline=(TimedText(0.0, request.frames / limits.fps, request.text),))


def _only_frames(limits: Limits, said: str) -> int | None:
    """Return the frames of a prompt of one movement that names one length; None = it names none within the range of the
    bundle."""
    seconds = only_length(said)
    frames = None if seconds is None else round(seconds * limits.fps)
    return frames if frames is not None and limits.min_frames <= frames <= limits.max_frames else None


def _is_sum_of_parts(request: Request, movements: Sequence[TextFeatures], fps: float) -> bool:
    """Return True if the frames of a request are the sum of the lengths that the words of some movements state, and
    others have none: these need time of their own."""
    said = [stated_length(movement.prompt).seconds for movement in movements]
    known = [each for each in said if each is not None]
    return len(known) < len(said) and len(known) > 0 and request.frames == round(sum(known) * fps)


def _stated_frames(limits: Limits, request: Request, movement: TextFeatures) -> int | None:
    """Return the frames of a movement that its words state, or its reader; None = they do not, or the prompt has a
    length that no timeline has."""
    if movement.seconds is not None:
        return limits.within(round(movement.seconds * limits.fps))
    whole, own = stated_length(request.text.prompt), stated_length(movement.prompt).seconds
    used = whole.is_partial or whole.within(limits.min_frames / limits.fps, MAX_TIMELINE_SECONDS)
    if not used or own is None:
        return None
    return max(round(min(own, MAX_TIMELINE_SECONDS) * limits.fps), limits.min_frames)


def _drawn_frames(generator: Generator[Any], request: Request, movement: TextFeatures, number: int) -> int:
    """Return the frames that the model gives a movement alone; who stands and waits beside others does so for as long
    as what is drawn on it takes."""
    alone = Request(movement, part_seed(request.seed, SEED, number), drawing=request.drawing)
    frames = resolved_length(generator, alone).frames or generator.limits.min_frames
    if action_of(movement) != STANDING:
        return frames
    said, rng = movement.said.lower(), random.Random(f"{request.seed} {number} stands")  # noqa: S311
    stops = only_stops(said.strip(" .!"))
    seconds = rng.uniform(*STOPS_S) if stops else LOOKS_S if stated_gaze(said) else WAITS_S
    return min(frames, generator.limits.within(round(max(seconds, gestures_s(movement.said)) * generator.limits.fps)))


def _row(text: TextFeatures) -> Row:
    """Return the action and the words of a movement."""
    return action_of(text), text.said.lower()


def _until_death(movements: Sequence[TextFeatures], said: str) -> tuple[TextFeatures, ...]:
    """Return the movements of a prompt; behind a death only those of a body that lies, until one says that it rises.

    Args:
        movements: in their order.
        said: words of the prompt.
    """
    found, dead = list[TextFeatures](), False
    for row, movement in zip(map(_row, movements), movements, strict=True):
        if rises(row):
            dead = False
        if not dead or row[0] in _RESTS:
            found.append(movement)
        dead = dead or (row[0] == "die" and bool(_DEAD.search(row[1])) and not _LIVES.search(said))
    return tuple(found)


def _leaping(movements: Sequence[TextFeatures]) -> tuple[TextFeatures, ...]:
    """Return movements of which those that jump out of a run, over something or into the next run, are leaps: who jumps
    on the spot stops before it."""
    actions = [action_of(movement) for movement in movements]
    found = list(movements)
    for number, (movement, action) in enumerate(zip(movements, actions, strict=True)):
        said = movement.said.lower()
        runs = number > 0 and actions[number - 1] in RUNS
        goes_on = (number + 1 < len(actions) and actions[number + 1] in RUNS) or _OVER.search(said) is not None
        if action in JUMPS_AHEAD and runs and goes_on and not _ON_SPOT.search(said):
            leap = f"{load_vocabulary().need(LEAP).plain_words}, {said}"
            found[number] = replace(movement, rewritten=leap, actions=(), action_rows=None)
    return tuple(found)


def _merged_falls(text: TextFeatures) -> tuple[TextFeatures, ...]:
    """Return the movements of a text; a hit or a trip and the fall behind it are one: the body does not recover in
    between."""
    found: list[TextFeatures] = []
    for movement in text.movements:
        if found and action_of(movement) == "die" and _fells(found[-1]):
            found[-1] = replace(movement, prompt=f"{found[-1].prompt} and {movement.prompt}")
        elif found and action_of(movement) == "die":
            found.append(replace(movement, prompt=_with_words_before(text.prompt, found[-1].prompt, movement.prompt)))
        else:
            found.append(movement)
    return tuple(found)


def _fells(movement: TextFeatures) -> bool:
    """Return True if a movement is what makes a body fall."""
    return action_of(movement) == "flinch" or _TRIPS.fullmatch(movement.said.lower()) is not None


def _shared(frames: int, lengths: Sequence[int]) -> list[int]:
    """Return lengths in the same ratio that sum up to `frames`."""
    ends = [round(frames * end / sum(lengths)) for end in accumulate(lengths, initial=0)]
    return [end - start for start, end in pairwise(ends)]


def _with_words_before(prompt: str, before: str, movement: str) -> str:
    """Return the words of a movement with those that lie between it and the one before it, which say what makes a body
    fall: "is shot in the chest and dies"."""
    _, _, rest = prompt.partition(before)
    lost, found, _ = rest.partition(movement)
    lost = lost.strip(" ,;.")
    return f"{lost} {movement}" if found and len(lost.split()) > 2 else movement
