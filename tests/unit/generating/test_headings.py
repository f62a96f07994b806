"""Turns of sequences, whole after they are joined."""

from __future__ import annotations

import numpy as np
import pytest

from marey.generation.shots.headings import JoinedTurn, heading_change, with_whole_turns
from marey.motion.features import HUMANML3D_263
from tests.support.bodies import Body, steady, walker

LAYOUT = HUMANML3D_263


@pytest.mark.parametrize(("made", "asked"), [(140.0, 180.0), (-150.0, -180.0), (110.0, 90.0)])
def test_what_transitions_took_from_a_turn_is_added(made: float, asked: float) -> None:
    features = LAYOUT.encode(walker(8.0, turn=made))
    turn = JoinedTurn(20, 20, 130, asked, follows=True)
    joined = with_whole_turns(features, LAYOUT, [turn])
    missing = heading_change(joined, LAYOUT) - heading_change(features, LAYOUT)
    inside = heading_change(features[10:145], LAYOUT)
    assert missing == pytest.approx(asked - inside, abs=12)
    assert np.abs(LAYOUT.decode(joined)[:15, 0] - LAYOUT.decode(features)[:15, 0]).max() < 0.05


def test_a_run_turns_with_its_feet() -> None:
    features = LAYOUT.encode(Body(6.0, speed=steady(3.6)).joints())
    turned = with_whole_turns(features, LAYOUT, [JoinedTurn(20, 20, 44, 40.0, follows=True, runs=True)])
    assert heading_change(turned, LAYOUT) == pytest.approx(40.0, abs=3)
    before, after = (LAYOUT.decode(each)[..., 1] for each in (features, turned))
    np.testing.assert_allclose(after, before, atol=0.03)


def test_whole_turns_stay() -> None:
    features = LAYOUT.encode(walker(8.0))
    assert with_whole_turns(features, LAYOUT, [JoinedTurn(60, 60, 90, 0.0)]) is features
    assert with_whole_turns(features, LAYOUT, []) is features
