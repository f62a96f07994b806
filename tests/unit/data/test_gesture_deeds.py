"""Made clips of crawls, crouches, cheers, hops, jumps, twists, hangs, drives, spells, shots, washing, standing crunches
and arabesques: the numbers that define their actions."""

from __future__ import annotations

import random
import re
from collections import Counter

import numpy as np
import pytest

from marey.data import gestures
from marey.data.gestures import KINDS, made_gestures
from marey.data.part import MAX_FRAMES, Part
from marey.drawing.flights import flight_height, standing_feet
from marey.motion.skeleton import HUMANML3D
from marey.posing.limbs import GRAVITY
from marey.posing.standing import StandingBody
from tests.support.bodies import FPS
from tests.unit.data.test_gesture_acts import swings
from tests.unit.data.test_gestures import DEEDS, OTHER, few, idle, tilt

COUNT = 9
HEAD, HIPS = 15, 0
KNEE, ANKLE, TOE = {"left": 4, "right": 5}, {"left": 7, "right": 8}, {"left": 10, "right": 11}
ELBOW, WRIST = {"left": 18, "right": 19}, {"left": 20, "right": 21}
ALOFT = 0.04  # metres of a toe over where it stands


@pytest.fixture(scope="module")
def made() -> list[Part]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(gestures, "KINDS", {action: kind for action, kind in few(COUNT).items() if action in DEEDS})
        return list(made_gestures([idle(), idle(2.0)]))


def of(made: list[Part], *actions: str) -> list[Part]:
    found = [part for part in made if part.content in actions]
    assert len(found) == COUNT * len(actions)
    return found


def runs(mask: np.ndarray) -> list[tuple[int, int]]:
    """First frame and the one after the last of each run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(int), [0]])))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


def speeds(points: np.ndarray) -> np.ndarray:
    """Metres per second of (T, 3), (T - 1,)."""
    return np.linalg.norm(np.diff(points, axis=0), axis=-1) * FPS


def floor(part: Part, joint: int) -> float:
    """Metres at which a joint stands in the first frame."""
    return float(part.joints[0, joint, 1])


def captions(part: Part) -> str:
    return " ".join(text.lower() for author in part.source.captions for text in author)


def test_bodies_keep_their_bones_and_stay_over_the_floor(made: list[Part]) -> None:
    lengths = np.linalg.norm(HUMANML3D.offsets[1:], axis=-1)
    assert Counter(part.content for part in made) == dict.fromkeys(DEEDS, COUNT)
    for part in made:
        assert 30 < len(part.joints) <= MAX_FRAMES + 1
        bones = np.linalg.norm(part.joints[:, 1:] - part.joints[:, list(HUMANML3D.parents[1:])], axis=-1)
        assert np.abs(bones - lengths).max() < 1e-4
        assert part.joints[..., 1].min() > -0.03
        assert np.linalg.norm(np.diff(part.joints, axis=0), axis=-1).max() * FPS < 12


def test_feet_that_stand_do_not_slide(made: list[Part]) -> None:
    for part in of(made, "twist", "wash", "drive"):
        assert np.ptp(part.joints[:, [10, 11]], axis=0).max() < 0.03, part.id
    for part in of(made, "hop", "jump", "jump-forward", "knee-to-elbow", "arabesque", "cast-spell", "crouch"):
        for toe in TOE.values():
            stands = part.joints[:, toe, 1] < floor(part, toe) + 0.012
            moved = speeds(part.joints[:, toe] * [1, 0, 1]) * (stands[1:] & stands[:-1])
            assert np.percentile(moved, 97) < 0.3, part.id


def test_knees_are_bent_and_hips_low_for_most_of_a_crouch(made: list[Part]) -> None:
    for part in of(made, "crouch"):
        hips = part.joints[:, HIPS, 1]
        low = hips < 0.75 * 0.94
        assert low.mean() > 0.5, part.id
        assert part.joints[:, [20, 21], 1].min() > 0.08
        assert part.joints[:, [7, 8], 1].max() < 0.25
        if re.search("crouch down, then stand up|rises|stands up again", captions(part)):
            assert hips[-1] > 0.9


def test_fists_are_thrown_up_or_pumped_in_a_cheer(made: list[Part]) -> None:
    ways = Counter()
    for part in of(made, "cheer"):
        side = part.source.side
        for one in ("left", "right") if side == "both" else (side,):
            wrist = part.joints[:, WRIST[one]]
            fast = np.abs(np.diff((wrist - part.joints[:, 9])[:, 1])) * FPS
            over = bool((wrist[:, 1] > part.joints[:, HEAD, 1]).any())
            assert fast.max() > 1.0
            assert wrist[:, 1].max() > part.joints[:, 9, 1].mean()
            ways[over] += 1
    assert min(ways[True], ways[False]) > 0


def flights(part: Part, toes: list[int]) -> list[tuple[int, int]]:
    """Runs of frames in which all the toes are off the floor."""
    return runs(np.all([part.joints[:, toe, 1] > floor(part, toe) + ALOFT for toe in toes], axis=0))


def test_a_hop_leaves_and_lands_on_one_foot_while_the_other_is_up(made: list[Part]) -> None:
    travels = []
    for part in of(made, "hop"):
        side = part.source.side
        hops = flights(part, [10, 11])
        assert len(hops) >= 1
        assert OTHER[side] not in captions(part).replace("other", "")
        first, last = hops[0][0], hops[-1][1]
        free = part.joints[first - 2 : last + 2, ANKLE[OTHER[side]], 1]
        assert free.min() > 0.15
        travels.append(np.linalg.norm((part.joints[-1, 0] - part.joints[0, 0])[[0, 2]]))
        assert bool(re.search("in place|on the spot", captions(part))) is False or travels[-1] < 0.15
    assert min(travels) < 0.15
    assert max(travels) > 0.6


def test_both_feet_leave_the_floor_at_once_and_fall_as_bodies_fall(made: list[Part]) -> None:
    for part in of(made, "jump", "jump-forward"):
        found = flights(part, [10, 11])
        assert found
        far = part.joints[-1, HIPS, 2] - part.joints[0, HIPS, 2]
        for begin, end in found:
            pelvis = part.joints[begin:end, HIPS, 1]
            assert part.joints[begin:end, [7, 8], 1].min(1).max() > 0.1 + 0.07
            middle = np.diff(pelvis, 2)[1:-1] * FPS**2
            assert middle.mean() == pytest.approx(-GRAVITY, rel=0.35)
        if part.content == "jump":
            assert abs(far) < 0.2
            assert ("up and down" in captions(part)) <= (len(found) > 1)
        else:
            assert far / len(found) > 0.6


def test_shoulders_turn_against_the_hips_to_both_sides_in_a_twist(made: list[Part]) -> None:
    for part in of(made, "twist"):
        across = [part.joints[:, a] - part.joints[:, b] for a, b in ((16, 17), (1, 2))]
        shoulders, hips = (np.degrees(np.arctan2(-one[:, 2], one[:, 0])) for one in across)
        turned = shoulders - hips
        assert swings(turned, 40.0) >= 3
        assert turned.max() > 20
        assert turned.min() < -20


def test_a_body_hangs_from_hands_that_stay(made: list[Part]) -> None:
    for part in of(made, "hang"):
        hands = part.joints[:, [20, 21]]
        assert np.ptp(hands, axis=0).max() < 0.08, part.id
        assert (hands[..., 1].min(1) > part.joints[:, HEAD, 1]).mean() > 0.6
        assert part.joints[:, [10, 11], 1].min() > 0.2
        straight = np.linalg.norm(part.joints[:, 20] - part.joints[:, 16], axis=-1)
        assert straight.max() > 0.48


def test_limbs_move_in_turn_under_a_level_trunk_in_a_crawl(made: list[Part]) -> None:
    for part in of(made, "crawl"):
        assert np.abs(tilt(part) - 90).max() < 45
        assert part.joints[:, [HIPS, 16, 17], 1].max() < 0.6 * 1.4
        assert part.joints[:, [4, 5], 1].max() < 0.15
        along = part.joints[-1, HIPS, 2] - part.joints[0, HIPS, 2]
        assert abs(along) > 0.3
        assert (along < 0) == bool(re.search("back|reverse", captions(part)))
        for limb in (20, 21, 7, 8):
            still = speeds(part.joints[:, limb] * [1, 0, 1]) < 0.05
            assert 0.25 < still.mean() < 0.85
            assert len(runs(still)) >= 2


def test_hands_turn_a_wheel_before_a_seated_driver(made: list[Part]) -> None:
    for part in of(made, "drive"):
        left, right = part.joints[:, 20], part.joints[:, 21]
        apart = np.linalg.norm(left - right, axis=-1)
        assert apart.min() > 0.25
        assert apart.max() < 0.6
        turned = np.degrees(np.arctan2((left - right)[:, 1], (left - right)[:, 0]))
        assert np.ptp(turned) > 8
        assert (np.minimum(left, right)[:, 2] - part.joints[:, 9, 2]).min() > 0.2
        assert part.joints[:, HIPS, 1].max() < 0.62
        assert (part.joints[:, [7, 8], 2].min(1) - part.joints[:, HIPS, 2]).min() > 0.2


def test_hands_push_out_or_rise_and_stay_in_a_spell(made: list[Part]) -> None:
    for part in of(made, "cast-spell"):
        side = part.source.side
        moved = []
        for one in ("left", "right") if side == "both" else (side,):
            seen = part.joints[:, WRIST[one]] - part.joints[:, 9]
            for after in range(8, len(seen)):
                stays = np.linalg.norm(np.ptp(seen[after : after + 4], axis=0)) < 0.08
                way = seen[after] - seen[max(after - 22, 0) : after]
                out = np.maximum(way[:, 2], way[:, 1])
                moved.append(stays * max(out.max(), np.abs(way[:, 0]).max()))
        assert max(moved) > 0.3, part.id


def test_shots_jerk_aimed_hands_back(made: list[Part]) -> None:
    for part in of(made, "shoot"):
        side = part.source.side
        wrist = part.joints[:, WRIST["right" if side == "both" else side]]
        ahead = part.joints[:, [20, 21], 2].max(1) - part.joints[:, 9, 2]
        aimed = ahead > 0.3
        seen = (wrist - part.joints[:, HIPS])[:, 2]
        back = np.array([seen[k] - seen[k + 1 : k + 4].min() for k in range(len(seen) - 3)])
        fired = [(a, b) for a, b in runs((back > 0.02) & aimed[:-3] & aimed[3:]) if a > 4]
        assert fired, part.id
        assert aimed.mean() > 0.4


def test_hands_rub_to_and_fro_five_times(made: list[Part]) -> None:
    for part in of(made, "wash"):
        side = part.source.side
        most = 0
        for one in ("left", "right") if side == "both" else (side,):
            seen = part.joints[:, WRIST[one]] - part.joints[:, 9]
            reach = np.linalg.norm(seen, axis=-1)
            assert np.median(reach) < 0.7
            most = max(most, *(swings(seen[:, axis], 0.1) for axis in range(3)))
        assert most >= 5, part.id


def test_elbow_and_knee_meet_over_one_standing_foot(made: list[Part]) -> None:
    for part in of(made, "knee-to-elbow"):
        gaps = {
            (knee, elbow): np.linalg.norm(part.joints[:, KNEE[knee]] - part.joints[:, ELBOW[elbow]], axis=-1)
            for knee in KNEE
            for elbow in ELBOW
        }
        (knee, elbow), gap = min(gaps.items(), key=lambda item: item[1].min())
        met = int(np.argmin(gap))
        assert gap[met] < 0.25
        assert part.joints[met, KNEE[knee], 1] > part.joints[met, HIPS, 1] - 0.15
        assert part.joints[met, ANKLE[OTHER[knee]], 1] < 0.12
        assert ("cross" in captions(part)) <= (knee != elbow)


def test_a_straight_leg_is_stretched_behind_in_an_arabesque(made: list[Part]) -> None:
    for part in of(made, "arabesque"):
        side = part.source.side
        hip = 1 if side == "left" else 2
        leg = np.linalg.norm(part.joints[:, ANKLE[side]] - part.joints[:, hip], axis=-1)
        behind = part.joints[:, HIPS, 2] - part.joints[:, ANKLE[side], 2]
        held = (part.joints[:, ANKLE[side], 1] > 0.4) & (behind > 0.35) & (leg > 0.75)
        assert held.sum() >= 0.5 * FPS, part.id
        assert part.joints[held][:, ANKLE[OTHER[side]], 1].max() < 0.15
        assert OTHER[side] not in captions(part)


def test_vocabulary_words_that_are_not_true_of_a_clip_are_left_out() -> None:
    rng = random.Random(0)
    for action, word, kind in (
        ("shoot", "shotgun", "shoot-shotgun"),
        ("wash", "window", "wash-window"),
        ("crouch", "cover", "crouch-cover"),
        ("hang", "swing", "hang-swing"),
        ("cheer", "pump", "cheer-yes"),
    ):
        drawn = [KINDS[action].draw(rng) for _ in range(40)]
        assert {bool(re.search(one.untrue, word)) for one in drawn if any(k.startswith(kind) for k in one.kinds)} == {
            False
        }
        assert {
            bool(re.search(one.untrue, word)) for one in drawn if not any(k.startswith(kind) for k in one.kinds)
        } == {True}


def test_a_flight_lasts_as_long_as_a_fall_from_its_height() -> None:
    assert flight_height(0.5) == pytest.approx(0.5 * GRAVITY * 0.25**2)
    feet = standing_feet(StandingBody(idle().joints))
    flat, raised = feet["left"].flat(), feet["left"].tiptoe(50, up=0.1)
    assert flat.at[1] == pytest.approx(0.07)
    assert raised.at[1] > flat.at[1] + 0.1
