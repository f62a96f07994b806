"""Rows of a timeline in a manifest, as they follow cuts and changes of time. Standard library only."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from marey.core.frame_rates import frames_at_rate
from marey.core.sides import swap_sides_in
from marey.motion.edits.operation import frame_number
from marey.motion.edits.prompts import READ_PROMPT
from marey.motion.edits.steps import Step

TIMELINE, PROMPTS, CYCLE = "timeline", "prompts", "loop"
"""Keys of a manifest: the rows, transitions and gaps of a timeline in seconds; the first frame of each prompt; the
record of a loop."""
ROUNDING = 1e-6
"""Frames: a number as near to the next whole one counts as that."""
DIGITS = 3
"""Decimal places of times in a text, as in `marey.items.timeline`."""


def has_rows(manifest: Mapping[str, Any]) -> bool:
    """Return True if a manifest has the rows of a timeline."""
    record: Mapping[str, Any] = manifest.get(TIMELINE) or {}
    return bool(record.get("rows"))


def cut_rows(manifest: Mapping[str, Any], first: int, last: int, fps: float) -> dict[str, Any]:
    """Return the manifest of a timeline of which these frames remain: its rows and the text of its prompt are those of
    what is left. A timeline of which one row is left has its prompt alone; a manifest without rows is unchanged.

    Args:
        first, last: frames that remain, both included.
        fps: frames a second.
    """
    told = dict(manifest)
    if not has_rows(told):
        return told
    record: Mapping[str, Any] = told[TIMELINE]
    cut = {name: _left(spans, first, last, fps) for name, spans in record.items()}
    if _times(cut) == _times(record):
        return told
    return _with_record(told, {**cut, "rows": cut["rows"] or [_before(record["rows"], first / fps)]})


def reversed_rows(manifest: Mapping[str, Any], frames: int, fps: float) -> dict[str, Any]:
    """Return the manifest of a timeline that is played backwards; a manifest without rows is unchanged.

    Args:
        frames: of the motion.
        fps: frames a second.
    """
    end = frames / fps

    def turned(start: float, stop: float) -> tuple[float, float]:
        return max(end - stop, 0.0), end - start

    return _retimed(manifest, turned)


def faster_rows(manifest: Mapping[str, Any], factor: float, frames: int, count: int, fps: float) -> dict[str, Any]:
    """Return the manifest of a timeline that is played `factor` times as fast; a manifest without rows is unchanged.

    Args:
        frames: of the motion.
        count: of the result.
        fps: frames a second.
    """

    def played(time: float) -> float:
        return count / fps if time > (frames - 0.5) / fps else min(time / factor, count / fps)

    return _retimed(manifest, lambda start, end: (played(start), played(end)))


def prompt_after_cuts(
    about: Mapping[str, Any], prompt: str, steps: Sequence[Step], frames: int, fps: float
) -> tuple[str, Sequence[Step]]:
    """Return the prompt of a timeline after the first steps, as far as they leave its rows known, and the steps after
    these.

    Args:
        about: manifest of the motion.
        prompt: of the motion.
        frames: of the motion.
        fps: of the motion.
    """
    if not prompt or not has_rows(about):
        return prompt, steps
    told: dict[str, Any] = {**about, "prompt": prompt}
    for number, step in enumerate(steps):
        name, values = step.operation.name, step.values
        if not step.operation.keeps_rows or name == "loop":  # the frames of a cycle are found by the worker
            return told["prompt"], steps[number:]
        if name == "mirror":
            told = {key: swap_sides_in(value) if key in ("prompt", TIMELINE) else value for key, value in told.items()}
        elif name == "fps":
            frames, fps = frames_at_rate(frames, fps, values["rate"]), values["rate"]
        elif name == "reverse":
            told = reversed_rows(told, frames, fps)
        elif name == "speed":
            count = frames_at_speed(frames, values["factor"], cycle=CYCLE in about)
            told, frames = faster_rows(told, values["factor"], frames, count, fps), count
        elif name == "trim":
            first = frame_number(values["from"], fps)
            last = frames - 1 if values["to"] is None else frame_number(values["to"], fps)
            if not first <= last < frames:  # the worker refuses it
                return told["prompt"], steps[number:]
            told, frames = cut_rows(told, first, last, fps), last - first + 1
    return told["prompt"], ()


def frames_at_speed(frames: int, factor: float, *, cycle: bool = False) -> int:
    """Return the frames of a motion of so many that is played `factor` times as fast; the last frame of a `cycle` stays
    its last."""
    intervals = (frames - 1) / factor
    return (max(round(intervals), 1) if cycle else int(intervals + ROUNDING)) + 1


def _with_record(manifest: Mapping[str, Any], record: Mapping[str, Any]) -> dict[str, Any]:
    """Return a manifest with another record of its timeline, and the text of its rows; of one row the prompt alone."""
    rows: Sequence[Mapping[str, Any]] = record["rows"]
    told = {name: value for name, value in manifest.items() if name not in (*READ_PROMPT, TIMELINE)}
    if len(rows) > 1:
        own = [{**row, "rewritten": row.get("rewritten", row["prompt"])} for row in rows]
        return {**told, TIMELINE: record, "prompt": _text(own, "prompt"), "rewritten": _text(own, "rewritten")}
    del told["prompt"]
    told.pop(PROMPTS, None)
    return {**told, **{name: rows[0][name] for name in ("prompt", *READ_PROMPT) if name in rows[0]}}


def _retimed(manifest: Mapping[str, Any], times: Callable[[float, float], tuple[float, float]]) -> dict[str, Any]:
    """Return a manifest whose timeline is at other times.

    Args:
        times: returns the first and the last moment of a span in the result.
    """
    if not has_rows(manifest):
        return dict(manifest)
    record: Mapping[str, Any] = manifest[TIMELINE]
    moved = {
        name: sorted((_at(span, *times(span["start"], span["end"])) for span in spans), key=_start)
        for name, spans in record.items()
    }
    return _with_record(manifest, moved)


def _at(span: Mapping[str, Any], start: float, end: float) -> dict[str, Any]:
    """Return a span of time at another place; a match, a choice and a rise were of its own frames."""
    kept = {name: value for name, value in span.items() if name not in ("selection", "rise")}
    changed = {"match": None} if "match" in span else {}
    return {**kept, "start": round(start, 6), "end": round(end, 6), **changed}


def _start(span: Mapping[str, Any]) -> float:
    return span["start"]


def _times(record: Mapping[str, Any]) -> list[tuple[float, float]]:
    return [(row["start"], row["end"]) for row in record["rows"]]


def _left(spans: Sequence[Mapping[str, Any]], first: int, last: int, fps: float) -> list[dict[str, Any]]:
    """Return what is left of spans of time, at least half a frame."""
    begin, length = first / fps, (last - first + 1) / fps
    left: list[dict[str, Any]] = []
    for span in spans:
        start, end = max(span["start"] - begin, 0.0), min(span["end"] - begin, length)
        if end - start > 0.5 / fps:
            left.append(_at(span, start, end))
    return left


def _before(rows: Sequence[Mapping[str, Any]], time: float) -> Mapping[str, Any]:
    """Return the last row that begins up to a time; else the first."""
    return next((row for row in reversed(rows) if row["start"] <= time), rows[0])


def _text(rows: Sequence[Mapping[str, Any]], field: str) -> str:
    """Return the text form of rows, as `marey.items.timeline.text_of`."""
    times = [(round(row["start"], DIGITS), round(row["end"], DIGITS)) for row in rows]
    return "; ".join(f"{start:g}-{end:g} {row[field]}" for (start, end), row in zip(times, rows, strict=True))
