"""Timelines whose rows do not fit together: the pelvis rises or sinks too fast in a transition."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from marey.editing.judge import judged
from marey.motion import MotionClip, edit
from marey.quality.postures import posture_jumps, rises_of
from marey.quality.record import Flag, read_quality
from tests.support.walker import walker

SPAN = {"start": 1.0, "end": 1.4, "seed": 4}


def risen(metres: float, seconds: float, span: dict[str, float] = SPAN) -> MotionClip:
    """A walk whose root rises from frame 20 on, with the record of a transition there."""
    clip = walker()
    root, count = clip.root.copy(), round(seconds * clip.fps)
    root[:, 1] += np.interp(np.arange(clip.frames), [19, 19 + count], [-metres, 0.0])
    rows = [{"start": 0.0, "end": 1.0, "prompt": "a person lies down"}, {"start": 1.0, "end": 2.0, "prompt": "walks"}]
    told = {**clip.manifest, "timeline": {"rows": rows, "transitions": [span], "gaps": []}}
    told["prompts"] = [[0, "a person lies down"], [20, "walks"]]
    return MotionClip.of(clip.skeleton, clip.rotations, root, clip.contacts, clip.fps, manifest=told)


@pytest.mark.parametrize(
    ("metres", "seconds", "jumps"),
    [
        (0.7, 0.4, True),
        (-0.5, 0.3, True),
        (0.25, 0.2, False),  # within what a step does
        (0.0, 0.4, False),
    ],
)
def test_a_fast_change_of_height_in_a_transition_is_a_jump(metres: float, seconds: float, jumps: bool) -> None:
    clip = risen(metres, seconds)
    sway = float(walker().root[28, 1] - walker().root[19, 1])
    assert rises_of(clip, [SPAN]) == [pytest.approx(metres + sway, abs=1e-3)]
    found = posture_jumps(clip)
    assert [(each["start"], each["rise"]) for each in found] == ([(1.0, rises_of(clip, [SPAN])[0])] if jumps else [])
    quality = read_quality(judged(clip).manifest)
    assert quality is not None
    assert (Flag.POSTURE_JUMP in quality.flags) is jumps
    assert not (jumps and quality.ok)


def test_a_slow_way_up_in_a_gap_is_none() -> None:
    assert posture_jumps(risen(0.7, 0.9, {**SPAN, "end": 1.9})) == []
    assert posture_jumps(risen(0.7, 0.4, {**SPAN, "end": 1.9})) == []  # the model had the time


def test_a_motion_without_rows_has_no_jump_and_edits_keep_theirs() -> None:
    clip = risen(0.7, 0.4)
    assert posture_jumps(replace(clip, manifest={})) == []
    (mirrored,) = edit(clip, [{"op": "mirror"}])
    assert posture_jumps(mirrored)
    (back,) = edit(clip, [{"op": "reverse"}])
    (jump,) = posture_jumps(back)
    assert jump["rise"] == pytest.approx(-posture_jumps(clip)[0]["rise"], abs=0.05)
    (first,) = edit(clip, [{"op": "trim", "to": 0.9}])
    assert posture_jumps(first) == []
