"""Made clips in which the hips go far down or a foot leaves the floor: the numbers that define their actions."""

from __future__ import annotations

import re
from collections import Counter

import numpy as np
import pytest

from marey.data import gestures
from marey.data.gestures import made_gestures, read_captions
from marey.data.part import MAX_FRAMES, Part
from marey.drawing.passing import pose
from marey.drawing.postures import STAND, FootPlace, HandPlace, Posture, mirrored
from marey.motion.skeleton import HUMANML3D
from marey.posing.standing import StandingBody
from tests.support.bodies import FPS
from tests.unit.data.test_gestures import OTHER, POSTURES, few, idle, tilt

COUNT = 8
ANKLE, TOE = {"left": 7, "right": 8}, {"left": 10, "right": 11}
WRISTS = [20, 21]


@pytest.fixture(scope="module")
def made() -> list[Part]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(gestures, "KINDS", {action: kind for action, kind in few(COUNT).items() if action in POSTURES})
        return list(made_gestures([idle(), idle(2.0)]))


def of(made: list[Part], *actions: str) -> list[Part]:
    found = [part for part in made if part.content in actions]
    assert len(found) == COUNT * len(actions)
    return found


def hips(part: Part) -> np.ndarray:
    """Metres of the pelvis over the floor, (T,)."""
    return part.joints[:, 0, 1]


def ahead(part: Part, joint: int) -> np.ndarray:
    """Metres by which a joint is before the middle of the ankles of the first frame, (T,); the body faces +Z."""
    return part.joints[:, joint, 2] - part.joints[0, [7, 8], 2].mean()


def knees(part: Part) -> np.ndarray:
    """Degrees by which the knees are bent, (T, 2)."""
    thighs = part.joints[:, [4, 5]] - part.joints[:, [1, 2]]
    shanks = part.joints[:, [7, 8]] - part.joints[:, [4, 5]]
    cosine = (thighs * shanks).sum(-1) / np.linalg.norm(thighs, axis=-1) / np.linalg.norm(shanks, axis=-1)
    return np.degrees(np.arccos(np.clip(cosine, -1, 1)))


def speeds(part: Part, joint: int) -> np.ndarray:
    """Metres per second of a joint, (T - 1,)."""
    return np.linalg.norm(np.diff(part.joints[:, joint], axis=0), axis=-1) * FPS


def test_bodies_keep_their_bones_and_stay_over_the_floor(made: list[Part]) -> None:
    lengths = np.linalg.norm(HUMANML3D.offsets[1:], axis=-1)
    for part in made:
        assert 20 < len(part.joints) <= MAX_FRAMES + 1
        bones = np.linalg.norm(part.joints[:, 1:] - part.joints[:, list(HUMANML3D.parents[1:])], axis=-1)
        assert np.abs(bones - lengths).max() < 1e-4
        assert part.joints[..., 1].min() > -0.06
        assert np.linalg.norm(np.diff(part.joints, axis=0), axis=-1).max() * FPS < 12


def test_feet_on_the_floor_do_not_slide(made: list[Part]) -> None:
    for part in of(made, "squat", "bend-over", "pick-up", "sit-down", "stand-up", "sit", "push-ups", "sit-ups"):
        assert np.ptp(part.joints[:, [10, 11]], axis=0).max() < 0.03, part.id


def test_a_squat_lowers_the_hips_and_rises_as_often_as_told(made: list[Part]) -> None:
    for part in of(made, "squat"):
        low = hips(part) < 0.75 * hips(part)[0]
        assert low.any()
        assert hips(part)[-1] > 0.97 * hips(part)[0]
        assert tilt(part).max() < 60
        times = int((low[1:] & ~low[:-1]).sum())
        told = " ".join(text for author in part.source.captions for text in author)
        for word, number in (("twice", 2), ("three times", 3)):
            assert word not in told or times == number


def test_a_body_bends_over_with_nearly_straight_knees(made: list[Part]) -> None:
    for part in of(made, "bend-over"):
        assert ((tilt(part) >= 60) & (knees(part).max(-1) < 60)).sum() >= 3
        assert tilt(part)[-1] < 15


def test_a_hand_goes_down_to_the_floor_and_the_body_stands_again(made: list[Part]) -> None:
    for part in of(made, "pick-up"):
        side = part.source.side
        hands = WRISTS if side == "both" else [{"left": 20, "right": 21}[side]]
        assert part.joints[:, hands, 1].max(-1).min() < 0.5
        assert hips(part)[-1] > 0.97 * hips(part)[0]


def test_a_seat_is_behind_the_feet(made: list[Part]) -> None:
    for part in of(made, "sit-down", "stand-up", "sit"):
        seated = {"sit-down": -1, "stand-up": 0, "sit": len(part.joints) // 2}[part.content]
        assert 0.42 < hips(part)[seated] < 0.68
        assert part.joints[seated, 0, 2] < part.joints[seated, [7, 8], 2].mean() - 0.1
        thighs = part.joints[seated, [4, 5], 1] - part.joints[seated, [1, 2], 1]
        assert np.degrees(np.arcsin(np.abs(thighs) / 0.39)).max() < 35
        assert tilt(part)[seated] < 45
        if part.content == "sit":
            assert np.ptp(hips(part)) < 0.05
        else:
            assert hips(part)[0 if part.content == "sit-down" else -1] - hips(part)[seated] > 0.25


def test_one_foot_kicks_while_the_other_stands(made: list[Part]) -> None:
    for part in of(made, "kick", "kick-ball"):
        side = part.source.side
        foot, fast = ANKLE[side], 2.0 if part.content == "kick" else 3.0
        assert speeds(part, foot).max() > fast
        assert part.joints[:, foot, 1].max() > 0.45
        far = np.linalg.norm((part.joints[:, foot] - part.joints[:, 0])[:, [0, 2]], axis=-1)
        assert far[part.joints[:, foot, 1] > 0.4].max() > 0.35
        assert part.joints[:, ANKLE[OTHER[side]], 1].max() < 0.35
    for part in of(made, "kick-ball"):
        before = part.joints[:, ANKLE[part.source.side], 2] - part.joints[:, 0, 2]
        assert before.min() < -0.2
        assert before.max() > 0.4
        assert before.argmin() < before.argmax()


def test_a_body_balances_on_the_foot_that_is_told(made: list[Part]) -> None:
    for part in of(made, "balance"):
        side = part.source.side
        lifted = part.joints[:, [ANKLE[OTHER[side]], TOE[OTHER[side]]], 1].min(-1) > 0.1
        assert lifted.sum() >= 1.5 * FPS
        assert np.ptp(part.joints[:, TOE[side]], axis=0).max() < 0.03


def test_feet_jump_apart_while_the_arms_swing_over_the_shoulders(made: list[Part]) -> None:
    for part in of(made, "jumping-jacks"):
        apart = np.linalg.norm(part.joints[:, 7] - part.joints[:, 8], axis=-1)
        wide = apart > 0.5
        assert wide.any()
        assert not wide[0]
        assert not wide[-1]
        over = (part.joints[:, WRISTS, 1] - part.joints[:, [16, 17], 1]).min(-1)
        assert over[wide].max() > 0.3
        assert (part.joints[:, [10, 11], 1].min(-1) > part.joints[0, [10, 11], 1].max() + 0.03).any()


def test_knees_rest_on_the_floor_in_a_kneel(made: list[Part]) -> None:
    for part in of(made, "kneel"):
        down = (part.joints[:, [4, 5], 1].min(-1) < 0.2) & (hips(part) > 0.25)
        down &= part.joints[:, WRISTS, 1].min(-1) > 0.15
        assert down.sum() >= FPS


def test_push_ups_and_sit_ups_move_the_trunk_over_still_supports(made: list[Part]) -> None:
    for part in of(made, "push-ups"):
        assert np.ptp(part.joints[:, 9, 1]) > 0.1
        assert np.abs(tilt(part) - 90).max() < 40
        assert np.ptp(part.joints[:, WRISTS], axis=0).max() < 0.05
        assert part.joints[:, WRISTS, 1].max() < 0.1
    for part in of(made, "sit-ups"):
        assert np.ptp(tilt(part)) > 30
        assert tilt(part)[0] > 70
        assert knees(part).min() > 60


def test_bodies_lie_and_get_there_and_back(made: list[Part]) -> None:
    for part in of(made, "lie", "lie-down", "get-up"):
        top = part.joints[:, [0, 9, 15], 1].max(-1)
        if part.content != "get-up":
            assert top[-1] < 0.45
        if part.content != "lie-down":
            assert top[0] < 0.45
        if part.content == "lie-down":
            assert hips(part)[0] > 0.85
        if part.content == "get-up":
            assert hips(part)[-1] > 0.85


def test_a_body_sits_on_the_floor(made: list[Part]) -> None:
    for part in of(made, "sit-floor"):
        assert ((hips(part) < 0.3) & (tilt(part) < 50)).mean() > 1 / 3


def test_captions_name_no_thing_to_sit_on_and_the_side_that_acts(made: list[Part]) -> None:
    assert Counter(part.content for part in made) == dict.fromkeys(POSTURES, COUNT)
    for part in made:
        texts = [text.lower() for author in part.source.captions[:-1] for text in author]  # without the vocabulary's
        for text in texts:
            assert "{" not in text
            if part.content in ("sit", "sit-down", "stand-up"):
                assert not re.search(r"\b(chair|stool|bench|sofa|desk|table)\b", text), text
            if part.content in ("kick", "kick-ball", "balance"):
                assert OTHER[part.source.side] not in text, text


def test_every_key_has_captions_in_every_voice() -> None:
    said = read_captions(gestures.Path(gestures.__file__).parent)
    assert len({frozenset(rows) for rows in said.values()}) == 1


def test_a_posture_puts_hips_hand_and_foot_where_it_says() -> None:
    body = StandingBody(idle(2.0).joints)
    before = body.joints.copy()
    hand, foot = HandPlace((0.2, 0.75, 0.3), "floor"), FootPlace((0.1, 0.4, 0.2), (0.0, -0.5, 0.8))
    low = Posture((0.0, 0.7, -0.1), (30.0, 0.0, 0.0), hands={"left": hand}, feet={"right": foot})
    pose(body, (0.3, 1.0, 1.4, 1.8), (STAND, low, low, STAND))
    joints = body.solved()
    origin = before[:, [7, 8]].mean((0, 1)) * [1, 0, 1]
    held = round(1.2 * FPS)
    assert np.abs(joints[held, 0, 2] - origin[2] + 0.1) < 0.02
    np.testing.assert_allclose(joints[held, 20] - origin, [0.2, 0.75, 0.3], atol=0.02)
    np.testing.assert_allclose((joints[held, 8] - origin)[[0, 2]], [-0.1, 0.2], atol=0.02)
    assert np.abs(joints[:, 10] - before[:, 10]).max() < 0.01
    np.testing.assert_allclose(joints[-1], before[-1], atol=0.02)


@pytest.mark.parametrize(("seconds", "hops"), [(0.8, False), (0.2, True)])
def test_feet_that_go_elsewhere_step_one_after_the_other_if_there_is_time(seconds: float, hops: bool) -> None:
    body = StandingBody(idle(3.0).joints)
    feet = {"left": FootPlace((0.11, 0.07, 0.2)), "right": FootPlace((0.12, 0.115, -0.2), (0.2, -0.72, 0.65))}
    low = Posture((0.0, 0.5, -0.05), (20.0, 0.0, 0.0), (20.0, 0.0, 0.0), feet=feet)
    pose(body, (0.5, 0.5 + seconds, 1.7, 1.7 + seconds), (STAND, low, low, STAND))
    toes = body.solved()[:, [10, 11]]
    assert np.ptp(toes[..., 2], axis=0).min() > 0.18
    assert toes[..., 1].max(axis=0).min() > 0.07
    assert (toes[..., 1].min(axis=1).max() > 0.05) == hops


def test_a_mirrored_posture_twice_is_itself() -> None:
    posture = Posture(
        (0.1, 0.8, 0.0), (1, 2, 3), (4, 5, 6), (7, 8, 9), hands={"left": HandPlace((0, 0, 0))}, over="right"
    )
    turned = mirrored(posture)
    assert turned.hands.keys() == {"right"}
    assert (turned.over, turned.tilt) == ("left", (1, -2, -3))
    assert mirrored(turned) == posture
