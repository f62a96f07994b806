"""Repetitions of an action in a motion, and motions that are made to have another number of them."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from marey.generation.repetitions import repeated
from marey.motion.features import HUMANML3D_263
from marey.quality.record import SHOWN
from marey.selector.matching import match, wanted_of
from marey.selector.motion import Motion
from marey.selector.repetitions import REPETITIONS, Repetition
from marey.selector.rules import RULES
from tests.support.bodies import FPS, Body, lift, zero

Joints = np.ndarray[Any, Any]


def bows(times: int, held: float = 0.2) -> Joints:
    each = 1.6 + held
    curves = [zero, *(lift(0.4 + each * number, 0.4 + each * number + 0.8 + held) for number in range(times))]
    return Body(0.8 + each * times, lean=lambda t: 45 * sum(curve(t) for curve in curves)).joints()


def raises(times: int) -> Joints:
    curves = [lift(0.4 + 1.5 * number, 1.3 + 1.5 * number) for number in range(times)]
    return Body(0.8 + 1.5 * times, left=lambda t: sum(curve(t) for curve in curves)).joints()


def found(action: str, joints: Joints) -> list[Repetition]:
    return REPETITIONS[action](Motion(joints, FPS))


def test_the_table_has_actions_of_rules_only() -> None:
    assert set(REPETITIONS) <= set(RULES)


@pytest.mark.parametrize("times", [0, 1, 2, 5])
def test_bows_are_counted(times: int) -> None:
    repetitions = found("bow", bows(times))
    assert len(repetitions) == times
    assert all(0 < each.begin < each.end for each in repetitions)
    assert all(before.end <= after.begin for before, after in pairwise(repetitions))


@pytest.mark.parametrize("times", [1, 3])
def test_raised_hands_are_counted(times: int) -> None:
    assert len(found("raise-arm", raises(times))) == times


@settings(deadline=None, max_examples=25)
@given(made=st.integers(1, 5), asked=st.integers(1, 8))
def test_any_number_is_made_of_any(made: int, asked: int) -> None:
    layout, joints = HUMANML3D_263, bows(made)
    features = layout.encode(joints)
    often = repeated(features, layout, lambda each: found("bow", each), asked)
    assert often is not None
    after = layout.decode(often)
    assert len(found("bow", after)) == asked
    steps = np.linalg.norm(np.diff(after, axis=0), axis=-1)
    assert steps.max() < 1.3 * np.linalg.norm(np.diff(joints, axis=0), axis=-1).max()  # no jump at a seam


def test_a_motion_with_the_number_stays_and_one_without_the_action_cannot_be_made() -> None:
    layout = HUMANML3D_263
    features = layout.encode(bows(2))
    assert repeated(features, layout, lambda each: found("bow", each), 2) is features
    assert repeated(features, layout, lambda each: found("raise-arm", each), 2) is None


def test_repetitions_of_several_are_not_held_long() -> None:
    layout = HUMANML3D_263
    features = layout.encode(bows(1, held=5.0))
    often = repeated(features, layout, lambda each: found("bow", each), 3)
    assert often is not None
    assert len(often) < len(features)


def test_another_number_than_was_asked_for_does_not_show_the_prompt() -> None:
    def value(prompt: str, times: int = 2) -> float:
        steps = wanted_of([prompt])
        assert steps is not None
        return match(Motion(bows(times), FPS), steps)

    assert value("a person bows") >= SHOWN
    assert value("a person bows twice") >= SHOWN
    assert value("a person bows three times") < SHOWN
    assert value("a person bows, three bows") < SHOWN
    assert value("a person bows, bows", 3) >= SHOWN  # said once in plain words, and once by the prompt
