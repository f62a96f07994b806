"""Made clips of deaths, dodges, hits, rolls, flips and swimming: the numbers that define their actions."""

from __future__ import annotations

import random
import re
from collections import Counter

import numpy as np
import pytest

from marey.data import gestures
from marey.data.gestures import made_gestures
from marey.data.part import MAX_FRAMES, Part
from marey.drawing.cartwheels import cartwheel
from marey.drawing.tumbling import Limb, Tumble, Whole, centre_of_mass, flipped, stood
from marey.motion.pose import solve_pose
from marey.motion.skeleton import HUMANML3D
from marey.posing.standing import StandingBody
from marey.posing.still import standing_still
from tests.support.bodies import FPS
from tests.unit.data.test_gestures import FALLS, OTHER, few, idle, tilt

COUNT = 12
HEAD, CHEST, TOES = 15, 9, [10, 11]
ARMS = [16, 17, 18, 19]


@pytest.fixture(scope="module")
def made() -> list[Part]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(gestures, "KINDS", {action: few(COUNT)[action] for action in FALLS})
        return list(made_gestures([idle(), idle(2.0)]))


def of(made: list[Part], action: str) -> list[Part]:
    found = [part for part in made if part.content == action]
    assert len(found) == COUNT
    return found


def texts(part: Part) -> list[str]:
    return [text.lower() for author in part.source.captions[:-1] for text in author]  # without the vocabulary's


def moved(part: Part, joint: int, seconds: float) -> float:
    """Largest distance, metres, of a joint between two frames at most `seconds` apart."""
    joints, longest = part.joints[:, joint], round(seconds * FPS)
    return max(float(np.linalg.norm(joints[lag:] - joints[:-lag], axis=-1).max()) for lag in range(1, longest + 1))


def test_bodies_keep_their_bones_and_stay_over_the_floor(made: list[Part]) -> None:
    assert Counter(part.content for part in made) == dict.fromkeys(FALLS, COUNT)
    lengths = np.linalg.norm(HUMANML3D.offsets[1:], axis=-1)
    for part in made:
        assert 1.5 * FPS <= len(part.joints) <= MAX_FRAMES + 1
        bones = np.linalg.norm(part.joints[:, 1:] - part.joints[:, list(HUMANML3D.parents[1:])], axis=-1)
        assert np.abs(bones - lengths).max() < 1e-4
        assert part.joints[..., 1].min() > -0.06, part.source.captions
        fastest = 14 if part.content == "flip" else 12
        assert np.linalg.norm(np.diff(part.joints, axis=0), axis=-1).max() * FPS < fastest, part.source.captions
        assert not any("{" in text for text in texts(part))


def test_the_dead_fall_from_standing_with_gravity_and_stay_down(made: list[Part]) -> None:
    for part in of(made, "die"):
        height = part.joints[:, [0, CHEST, HEAD], 1]
        assert height[0].min() > 0.8
        assert height[-8:].max() < 0.4, part.source.captions
        speed = np.diff(part.joints[:, HEAD, 1]) * FPS
        assert -7.0 < speed.min() < -2.0, part.source.captions
        up = part.joints[-1, 16:18].mean(0) - part.joints[-1, 0]
        faces = np.cross(part.joints[-1, 16] - part.joints[-1, 17], up)[1]
        told = " ".join(texts(part))
        if re.search(r"\b(face down|on (his|her|their) (front|face))\b", told):
            assert faces < 0
        if re.search(r"\b(face up|on (the|his|her|its) back)\b", told):
            assert faces > 0


def test_feet_turn_over_within_several_frames(made: list[Part]) -> None:
    for part in (*of(made, "die"), *of(made, "roll"), *of(made, "flip")):
        for ankle, toe in ((7, 10), (8, 11)):
            foot = part.joints[:, toe] - part.joints[:, ankle]
            foot /= np.linalg.norm(foot, axis=-1, keepdims=True)
            turns = np.degrees(np.arccos(np.clip((foot[1:] * foot[:-1]).sum(-1), -1.0, 1.0)))
            assert turns.max() < 31.0, part.source.captions
            assert part.joints[:, toe, 1].min() > -0.02, part.source.captions


def test_a_dodge_moves_the_head_fast_and_ends_on_the_feet(made: list[Part]) -> None:
    sides = Counter(part.source.side for part in of(made, "dodge"))
    assert {"left", "right", ""} == sides.keys()
    for part in of(made, "dodge"):
        assert moved(part, HEAD, 0.6) >= 0.25, part.source.captions
        assert part.joints[:, 0, 1].min() > 0.45
        assert part.joints[-1, 0, 1] > 0.75
        if side := part.source.side:
            assert OTHER[side] not in " ".join(texts(part))
            aside = part.joints[:, HEAD, 0] - part.joints[0, HEAD, 0]  # the body faces +Z
            assert aside[np.abs(aside).argmax()] * (1 if side == "left" else -1) > 0.2


def test_a_hit_jerks_head_and_chest_and_the_body_stands_again(made: list[Part]) -> None:
    for part in of(made, "flinch"):
        assert moved(part, HEAD, 0.3) >= 0.08
        assert moved(part, CHEST, 0.3) >= 0.08, part.source.captions
        assert part.joints[:, 0, 1].min() > 0.55
        np.testing.assert_allclose(part.joints[-1, HEAD], part.joints[0, HEAD], atol=0.15)
        if side := part.source.side:
            assert OTHER[side] not in " ".join(texts(part))


def test_a_roll_goes_over_back_or_shoulders_and_comes_up_on_the_feet(made: list[Part]) -> None:
    for part in of(made, "roll"):
        hips, head = part.joints[:, 0, 1], part.joints[:, HEAD, 1]
        lies = (part.joints[:, [9, 12, 16, 17], 1].min(-1) < 0.2) & (head < hips)
        assert lies.any(), part.source.captions
        assert part.joints[:, [0, CHEST], 1].min() < 0.3
        assert hips[0] > 0.8
        assert hips[-1] > 0.45
        assert (part.joints[-1, [7, 8], 1] < 0.15).all()
        went = part.joints[-1, 0] - part.joints[0, 0]  # the body faces +Z
        told = " ".join(texts(part))
        if part.source.side:
            assert went[0] * (1 if part.source.side == "left" else -1) > 1.0
            assert OTHER[part.source.side] not in told
        elif "backward" in told:
            assert went[2] < -1.0
        else:
            assert went[2] > 1.0 or not re.search("forward|ahead", told)


def test_a_swimmer_lies_level_or_leans_and_strokes_off_the_floor(made: list[Part]) -> None:
    for part in of(made, "swim"):
        told = " ".join(texts(part))
        assert part.joints[..., 1].min() > 0.05
        treads = bool(re.search(r"tread|upright", told))
        degrees = tilt(part)
        assert (degrees.min() > 5 and degrees.max() < 35) or (degrees.min() > 60 and not treads), part.source.captions
        for ends in ([20, 21], [7, 8]):
            place = part.joints[:, ends] - part.joints[:, :1]
            path = np.linalg.norm(np.diff(place, axis=0), axis=-1).sum(0)
            assert path.min() > 0.4 * len(part.joints) / FPS  # metres a second


def fastest_turn(joints: np.ndarray) -> float:
    """Degrees by which an upper arm or a forearm turns from its parent from one frame to the next at most."""
    rotations = solve_pose(joints.astype(np.float64), HUMANML3D, fps=FPS, measure=False).rotations
    same = np.abs((rotations[1:, ARMS] * rotations[:-1, ARMS]).sum(-1))
    return float(np.degrees(2 * np.arccos(np.clip(same, 0.0, 1.0))).max())


def test_arms_of_a_flip_swing_ahead_and_do_not_fold(made: list[Part]) -> None:
    turns = [fastest_turn(part.joints) for part in of(made, "flip")]
    assert np.median(turns) < 45.0
    assert max(turns) < 80.0


@pytest.mark.parametrize("seed", range(3))
def test_arms_of_a_cartwheel_turn_evenly(seed: int) -> None:
    rng = random.Random(seed)
    gesture = cartwheel(rng, times=2)
    body = StandingBody(standing_still(round(gesture.seconds * FPS), rng))
    gesture.change(body)
    assert fastest_turn(body.joints) < 80.0


def test_a_flip_turns_over_in_the_air_and_lands_on_the_feet(made: list[Part]) -> None:
    for part in of(made, "flip"):
        trunk = (part.joints[:, CHEST] - part.joints[:, 0])[:, [1, 2]]  # the body faces +Z
        turned = np.degrees(np.unwrap(np.arctan2(trunk[:, 1], trunk[:, 0])))
        assert 300 <= abs(turned[-1] - turned[0]) < 420
        told = " ".join(texts(part))
        assert not re.search("back", told) or turned[-1] < turned[0]
        assert not re.search("front|forward", told) or turned[-1] > turned[0]
        aloft = part.joints[:, TOES, 1].min(-1) > part.joints[0, TOES, 1].max() + 0.1
        assert 0.3 < aloft.sum() / FPS < 0.9
        assert (part.joints[aloft][:, [7, 8], 1].min(-1) > part.joints[aloft][:, HEAD, 1]).any()
        assert part.joints[-1, 0, 1] > 0.8


def test_a_body_in_flight_follows_a_parabola_under_gravity() -> None:
    body = StandingBody(idle(2.0).joints)
    done = Tumble(times=[0.5])
    before = centre_of_mass(body.joints)[0]
    up = Whole((0.0, 0.2), 1.1, (180.0, 0.0, 0.0), feet={side: Limb((0.1, -0.5, 0.3)) for side in ("left", "right")})
    done.then(0.3, up)
    done.then(0.3, Whole((0.0, 0.4), tilt=(360.0, 0.0, 0.0), feet=stood(0.0, 0.4)), 0.5)
    done.flights.append((0.5, 1.1))
    done.apply(body)
    centre = centre_of_mass(body.joints)[10:23]
    np.testing.assert_allclose(np.diff(centre[:, 1], 2) * FPS**2, -9.81, atol=1e-6)
    np.testing.assert_allclose(centre[6, 1] - centre[[0, -1], 1].mean(), 0.5 * 9.81 * 0.3**2, atol=1e-6)
    np.testing.assert_allclose(centre_of_mass(body.joints)[-1] - before, [0.0, 0.0, 0.4], atol=0.03)


def test_a_pose_and_its_mirror_image_exchange_left_and_right() -> None:
    hand = Limb((0.3, 0.1, 0.2))
    pose = Whole((0.2, 0.1), 0.5, (20.0, 30.0, 10.0), (5.0, 6.0, 7.0), hands={"left": hand}, rest=1.0)
    other = flipped(pose)
    assert other == Whole(
        (-0.2, 0.1), 0.5, (20.0, -30.0, -10.0), (5.0, -6.0, -7.0), (0.0, 0.0, 0.0), {"right": hand}, rest=1.0
    )
    assert flipped(other) == pose
