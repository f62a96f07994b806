"""Runs that set off from a stand, and come to one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from marey.generation.distances import distance_of
from marey.generation.port import Limits
from marey.generation.shots.setting_off import (
    CHANGES,
    Beside,
    end_speeds,
    set_off,
    setting_off,
    setting_off_as_far,
    with_even_speed,
)
from marey.generation.shots.strands import Fate, RowStrand
from marey.generation.shots.timeline_plan import TimelinePart
from marey.generation.shots.windows import no_text
from marey.generation.timed import TimedText
from marey.motion.courses import course_of
from marey.motion.features import HUMANML3D_263
from tests.support.bodies import Body, steady

LAYOUT, FPS = HUMANML3D_263, HUMANML3D_263.fps
RUN = LAYOUT.encode(Body(4.0, speed=steady(4.0)).joints())


def row(said: str, features: np.ndarray, *, is_open: bool = True) -> RowStrand:
    """A row of a sequence that is made."""
    text = replace(no_text(4), prompt=said, rewritten=said)
    limits = Limits(min_frames=8, max_frames=196, fps=FPS, text_width=4, keeps=4)
    strand = RowStrand(
        Fate(drawing=True), TimelinePart(0, len(features), 1), TimedText(0.0, 4.0, text, open=is_open), limits
    )
    strand.features = features
    return strand


def test_a_run_sets_off_slowly_and_slows_down() -> None:
    off = setting_off(RUN, LAYOUT, Beside(0.0, 0.0, 8))
    assert off is not None
    begins, ends = end_speeds(off, LAYOUT)
    assert max(begins, ends) < 2.8 < end_speeds(RUN, LAYOUT)[0]
    speeds = course_of(off, LAYOUT).speeds(FPS)
    assert speeds.max() == pytest.approx(4.0, abs=0.3)
    assert np.abs(np.diff(speeds)).max() * FPS < 6.0


def test_a_run_beside_nothing_or_as_fast_stays() -> None:
    assert setting_off(RUN, LAYOUT, Beside(None, None, 8)) is None
    assert setting_off(RUN, LAYOUT, Beside(3.0, 3.5, 8)) is None


@pytest.mark.parametrize(("is_open", "fixed"), [(True, True), (False, False), (True, False)])
def test_stated_times_stay(is_open: bool, fixed: bool) -> None:
    stand = LAYOUT.encode(Body(2.0, speed=steady(0.0)).joints())
    rows = [row("a person waves", stand), row("a person runs", RUN, is_open=is_open), row("a person nods", stand)]
    set_off(rows, LAYOUT, fixed=fixed)
    made = rows[1].features
    assert made is not None
    assert made is not RUN
    assert (len(made) == len(RUN)) is (fixed or not is_open)


def test_a_run_of_stated_metres_sets_off_slowly_and_goes_so_far() -> None:
    off = setting_off_as_far(RUN, LAYOUT, Beside(0.0, 0.0, 8), 16.0)
    assert off is not None
    assert distance_of(off, LAYOUT) == pytest.approx(16.0, rel=0.03)
    assert max(end_speeds(off, LAYOUT)) < 2.8
    assert np.abs(np.diff(course_of(off, LAYOUT).speeds(FPS))).max() * FPS < 6.0
    assert setting_off_as_far(RUN, LAYOUT, Beside(None, None, 8), 16.0) is None


@pytest.mark.parametrize(
    ("said", "fixed", "longer"),
    [
        ("a person runs 16 meters", False, True),
        ("a person runs 16 meters", True, False),
        ("a person runs 16 meters in a circle", False, False),
    ],
)
def test_a_way_of_stated_metres_takes_longer_where_it_may(said: str, fixed: bool, longer: bool) -> None:
    stand = LAYOUT.encode(Body(2.0, speed=steady(0.0)).joints())
    rows = [row("a person waves", stand), row(said, RUN), row("a person nods", stand)]
    set_off(rows, LAYOUT, fixed=fixed)
    made = rows[1].features
    assert made is not None
    assert (len(made) > len(RUN) + 10) is longer


def test_a_body_is_not_thrown_forward() -> None:
    thrown = Body(6.0, speed=lambda t: 3.0 * np.clip((t - 2.0) / 0.2, 0, 1))
    features = LAYOUT.encode(thrown.joints())
    rows = [row("a person waves", features[:40]), row("a person runs", features[40:])]
    even = with_even_speed(features, LAYOUT, rows, [TimelinePart(40, 48, 1)])
    assert len(even) == len(features)
    gains = [float(np.abs(np.diff(course_of(each, LAYOUT).speeds(FPS))).max() * FPS) for each in (features, even)]
    assert gains[1] < CHANGES[-1]
    assert gains[1] < 0.85 * gains[0]
    rows[1] = row("a person runs 10 meters", features[40:])
    assert with_even_speed(features, LAYOUT, rows, [TimelinePart(40, 48, 1)]) is features
