"""Feet that slide while they carry the body."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from marey.motion.carrying import CARRIES_M, FASTEST, SHORTEST_S, carrying_contacts
from marey.motion.courses import SWING_S
from marey.motion.features import HUMANML3D_263
from marey.motion.feet import RULE, find_contacts, runs
from marey.motion.finish import finish_motion
from marey.motion.skeleton import HUMANML3D
from marey.quality.measure import pops, skate
from tests.support.stepping import stepping

FPS = 20.0
TOES = [10, 11]


def dragged(speed: float, seconds: float = 0.25, every: float = 1.0) -> np.ndarray:
    """Return joints of a walk whose body is dragged aside at `speed` m/s for some time of each second, feet and all."""
    joints = stepping()
    time = np.arange(len(joints)) / FPS
    joints[..., 0] += speed * np.cumsum((time + 0.3) % every < seconds)[:, None] / FPS
    return joints


def test_feet_that_stand_have_the_contacts_that_are_found() -> None:
    joints = stepping()
    np.testing.assert_array_equal(carrying_contacts(joints, HUMANML3D, FPS), find_contacts(joints, HUMANML3D, FPS))


def test_the_slower_of_two_sliding_feet_stands() -> None:
    joints = dragged(0.8)
    plain, carried = find_contacts(joints, HUMANML3D, FPS), carrying_contacts(joints, HUMANML3D, FPS)
    assert carried[plain].all()
    assert carried[:, [1, 3]].sum() > plain[:, [1, 3]].sum() + 10
    low = joints[:, TOES, 1] - joints[:, TOES, 1].min() < CARRIES_M
    assert low[carried[:, [1, 3]]].all()


def test_a_finished_motion_slides_less_and_no_joint_jumps() -> None:
    raw, done = (
        finish_motion(HUMANML3D_263.encode(dragged(0.8)), HUMANML3D_263, clean=clean).joints.astype(np.float64)
        for clean in (False, True)
    )
    assert skate(raw, FPS) > 0.12
    assert skate(done, FPS) < 0.4 * skate(raw, FPS)
    assert pops(done, FPS) == 0
    hardest = [np.linalg.norm(np.diff(each, 2, axis=0), axis=-1).max() for each in (raw, done)]
    assert hardest[1] < 1.2 * hardest[0]


def test_stands_stray_little_and_leave_time_for_a_step() -> None:
    joints = dragged(1.0, seconds=0.6)
    contacts = carrying_contacts(joints, HUMANML3D, FPS)
    plain = find_contacts(joints, HUMANML3D, FPS)
    for side, toe in enumerate(TOES):
        stands = runs(contacts[:, 2 * side + 1])
        assert all(after - before >= SWING_S * FPS for (_, before), (after, _) in pairwise(stands))
        for begin, end in stands:
            flat = joints[begin:end, toe][:, [0, 2]]
            own = plain[begin:end, 2 * side + 1].all()
            assert own or np.linalg.norm(flat - flat.mean(0), axis=1).max() <= RULE.slide + 1e-9
            assert own or end - begin > SHORTEST_S * FPS


@pytest.mark.parametrize("change", ["fast", "in the air"])
def test_a_foot_that_is_fast_or_in_the_air_does_not_stand(change: str) -> None:
    joints = stepping()
    time = np.arange(len(joints)) / FPS
    if change == "fast":
        joints[..., 0] += (1.5 * FASTEST * time)[:, None]
        assert not carrying_contacts(joints, HUMANML3D, FPS).any()
        return
    flies = (time > 2.0) & (time < 3.0)
    joints[..., 0] += 0.8 * np.cumsum(flies)[:, None] / FPS
    joints[flies, :, 1] += 0.3
    assert not carrying_contacts(joints, HUMANML3D, FPS)[flies].any()


def test_feet_that_hop_apart_do_not_stand() -> None:
    """Of a jumping jack neither foot stays where it is; of a body that lets one foot go the other one does."""
    joints = np.tile(HUMANML3D.rest.astype(float), (40, 1, 1))
    way = np.clip((np.arange(40) - 15) / 10, 0.0, 1.0)[:, None] * 0.4
    for side, foot in ((1, [7, 10]), (-1, [8, 11])):
        joints[:, foot, 0] += side * way
    contacts = carrying_contacts(joints, HUMANML3D, FPS)
    assert not contacts[17:24].any()
    joints[:, :, 0] += 0.6 * way
    contacts = carrying_contacts(joints, HUMANML3D, FPS)
    assert contacts[17:24, 3].all()
    assert not contacts[17:24, 1].any()


@pytest.mark.parametrize("frames", [1, 2, 3])
def test_the_shortest_motions(frames: int) -> None:
    assert carrying_contacts(dragged(0.8)[:frames], HUMANML3D, FPS).shape == (frames, 4)
