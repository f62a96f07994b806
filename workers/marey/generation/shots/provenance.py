"""Provenance of timelines: the part of the manifest about rows and transitions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from marey.generation.carrying import WALKS
from marey.generation.named import names_movement
from marey.generation.port import Limits, Request
from marey.generation.row_postures import is_as_alone
from marey.generation.shots.flowing import BENT_ON
from marey.generation.shots.freezing import AS_BEFORE
from marey.generation.shots.timeline_plan import gaps_of, plan_timeline
from marey.generation.timed import TimedText
from marey.generation.wish import action_of, is_winding
from marey.items.timeline import TimelineRow, text_of
from marey.motion.clip import SELECTION, MotionClip
from marey.quality.postures import rises_of
from marey.quality.record import PromptMatch
from marey.quality.selection import Selection
from marey.selector.matching import ON_THE_SPOT, side_of
from marey.selector.records import match_of
from marey.vocabulary.counts import stated_count
from marey.vocabulary.loads import puts_load
from marey.vocabulary.scope import ActionLists, match_scope, scope_of_rows

KEY = "timeline"
SHORT_WAY = 2.5
"""Metres of a way that no rule takes for one."""
STRIDES, MOST_STRIDES, STRIDE_M = frozenset({"walk", "walk-backward", "sidestep"}), 6, 0.28
"""Ways that are drawn of stated steps, how many at most, and the metres of each from which on it is one in full."""

TURNS_BEFORE_S = 0.3
"""Seconds before its row in which a turn on the spot begins: the hips turn while the body still comes out of what it
did."""


def describe_timeline(
    request: Request, timeline: Sequence[TimedText], limits: Limits, lists: ActionLists | None
) -> dict[str, Any]:
    """Return the part of the provenance that says what the prompts of a timeline are and how they were read; that of a
    sequence has the prompt of the whole.

    Times are in seconds; those of transitions and gaps are of the frames that they have.
    """
    plan = plan_timeline(timeline, request.seed, limits)
    rows = [_describe_row(row, part.seed) for row, part in zip(timeline, plan.rows, strict=True)]
    transitions = [
        {"start": part.start / limits.fps, "end": part.end / limits.fps, "seed": part.seed} for part in plan.transitions
    ]
    gaps = [{"start": start / limits.fps, "end": end / limits.fps} for start, end in gaps_of(plan)]
    prompt = text_of([TimelineRow(row.start, row.end, row.text.prompt) for row in timeline])
    return {
        "prompt": request.text.prompt if request.is_sequence else prompt,
        "rewritten": text_of([TimelineRow(row.start, row.end, row.text.rewritten) for row in timeline]),
        **({} if lists is None else {"scope": dict(request.scope or _scope(request, timeline, lists))}),
        KEY: {"rows": rows, "transitions": transitions, "gaps": gaps},
    }


def _describe_row(row: TimedText, seed: int) -> dict[str, Any]:
    text = row.text
    return {
        "start": row.start,
        "end": row.end,
        "prompt": text.prompt,
        "rewritten": text.rewritten,
        **({} if text.not_rewritten is None else {"not_rewritten": text.not_rewritten}),
        "graph": text.graph.to_json(),
        "seed": seed,
        **row.changes,
    }


def _scope(request: Request, timeline: Sequence[TimedText], lists: ActionLists) -> Mapping[str, Any]:
    if request.is_sequence:
        return match_scope(request.text.prompt, lists).as_json()
    return scope_of_rows([match_scope(row.text.prompt, lists) for row in timeline]).as_json()


def with_rows(clip: MotionClip, timeline: Sequence[TimedText], as_made: MotionClip) -> MotionClip:
    """Return the clip of a timeline with the first frame of each prompt, and the match of each row, in its manifest.

    Args:
        clip: the finished motion.
        timeline: its rows.
        as_made: the same without bearings, by which rows are matched.
    """
    record: Mapping[str, Any] = clip.manifest[KEY]
    prompts = [[round(row.start * clip.fps), row.text.prompt] for row in timeline]
    spans = record["transitions"]
    matches = [_match(as_made, timed, spans).value for timed in timeline]
    rows = [{**row, "match": value} for row, value in zip(record["rows"], matches, strict=True)]
    transitions = [{**span, "rise": rise} for span, rise in zip(spans, rises_of(clip, spans), strict=True)]
    told = {**record, "rows": rows, "transitions": transitions}
    return replace(clip, manifest={**clip.manifest, "prompts": prompts, KEY: told})


def with_selections(clip: MotionClip, selections: Sequence[Selection]) -> MotionClip:
    """Return the clip of a timeline with the choice among the candidates of each row in its manifest."""
    record: Mapping[str, Any] = clip.manifest[KEY]
    pairs = zip(record["rows"], selections, strict=True)
    rows = [{**row, SELECTION: selection.model_dump(mode="json")} for row, selection in pairs]
    return replace(clip, manifest={**clip.manifest, KEY: {**record, "rows": rows}})


def _match(clip: MotionClip, row: TimedText, transitions: Sequence[Mapping[str, Any]]) -> PromptMatch:
    """Return the match of a row without the transition that it begins with: who stops first ends a step. Movements that
    are no action have none, nor has one whose rule describes a body that is in another posture before or after, or a
    longer way."""
    if row.changes.get("posture") in (AS_BEFORE, BENT_ON):
        return PromptMatch()
    puts = "drawn" in row.changes and puts_load(row.text.said, WALKS)
    if puts or names_movement(row.text.said) or not is_as_alone(row.held, action_of(row.text)):
        return PromptMatch()
    if row.changes.get("distance", {}).get("asked", SHORT_WAY) < SHORT_WAY:
        return PromptMatch()
    if (few := _drawn_strides(clip, row)) is not None:
        return few
    begins = [float(each["end"]) for each in transitions if each["start"] <= row.start < each["end"] < row.end]
    first = max(begins, default=row.start)
    if action_of(row.text) == ON_THE_SPOT:
        first = max(row.start - TURNS_BEFORE_S, 0.0)
    frames = slice(round(first * clip.fps), round(row.end * clip.fps))
    sentences, winds = row.text.actions or (row.text.rewritten,), is_winding(row.text)
    return match_of(clip, sentences, row.scope, frames=frames, winds=winds)


def _drawn_strides(clip: MotionClip, row: TimedText) -> PromptMatch | None:
    """Return the match of a way of a few stated steps that is drawn as such, by how far it goes and to which side; None
    for any other row. A rule that counts steps would miss those in the transitions, and no rule is of one or two."""
    action = action_of(row.text)
    number = stated_count(row.text.said, action) if action in STRIDES and "drawn" in row.changes else None
    if number is None or not 1 <= number <= MOST_STRIDES:
        return None
    frames = slice(round(row.start * clip.fps), round(row.end * clip.fps))
    if clip.frames < 2 or len(clip.joints[frames]) < 2:
        return None
    forward, left = way_of(clip.joints[frames])
    side = side_of(row.text.said)
    gone = {"walk": forward, "walk-backward": -forward}.get(action, {"left": left, "right": -left}.get(side, abs(left)))
    return PromptMatch(value=round(float(np.clip(gone / (number * STRIDE_M), 0.0, 1.0)), 3))


def way_of(joints: NDArray[np.floating]) -> tuple[float, float]:
    """Return the metres that joints (T, 22, 3) go forward and to the left, as the body faces at first."""
    left = (joints[0, 1] - joints[0, 2]) * [1.0, 0.0, 1.0]
    left = left / np.linalg.norm(left)
    gone = joints[-1, 0] - joints[0, 0]
    return float(gone @ np.cross(left, [0.0, 1.0, 0.0])), float(gone @ left)


def least_match(clip: MotionClip) -> PromptMatch:
    """Return the match of the row of a timeline that shows its prompt least; null where no row has one."""
    values = [row["match"] for row in clip.manifest[KEY]["rows"] if row["match"] is not None]
    return PromptMatch(value=min(values, default=None))
