"""Changes of posture that are drawn whole, and gestures that are put onto a posture."""

from __future__ import annotations

import numpy as np
import pytest

from marey.drawing.holds import (
    BACK,
    CROSSED,
    CROUCH,
    FLOOR,
    FOURS,
    FRONT,
    KNEE,
    KNEES,
    LEFT_SIDE,
    PLANK,
    PRONE,
    RIGHT_SIDE,
    SEAT,
    SLIDE,
    UPRIGHT,
)
from marey.drawing.low_deeds import PICKS, POUNDS, REACHES, LowDeed
from marey.generation.drawn_whole import drawn_whole
from marey.generation.fine_wish import FineWish
from marey.generation.posture import NO_POSTURE, RowPosture
from marey.generation.postured import LONGEST_S, drawn_posture, gestures_s, gone_on, on_posture
from marey.motion.features import HUMANML3D_263, encode_all

LAYOUT, FPS = HUMANML3D_263, HUMANML3D_263.fps
LIES = dict.fromkeys((BACK, FRONT, PRONE), 0.125)
LOW = {
    SEAT: 0.5,
    CROSSED: 0.5,
    FLOOR: 0.17,
    UPRIGHT: 0.17,
    KNEES: 0.51,
    KNEE: 0.51,
    FOURS: 0.47,
    PLANK: 0.4,
    CROUCH: 0.52,
    **LIES,
}
STANDS_M, NEAR_M = 0.93, 0.15
SOLE_M = 0.03
"""Metres of the lowest joint of a drawn body over its floor; features have it on the floor."""


def joints_of(held: RowPosture, said: str = "", frames: int | None = None) -> np.ndarray:
    return LAYOUT.decode(drawn_posture(LAYOUT, held, said, 3, frames))


@pytest.mark.parametrize("own", LOW)
def test_a_body_goes_to_its_posture_and_back(own: str) -> None:
    down, up = joints_of(RowPosture("", own, own, seed=1)), joints_of(RowPosture(own, "", "", seed=1))
    for joints, begin, end in ((down, STANDS_M, LOW[own]), (up, LOW[own], STANDS_M)):
        assert joints[0, 0, 1] == pytest.approx(begin, abs=NEAR_M)
        assert joints[-1, 0, 1] == pytest.approx(end, abs=NEAR_M)
        assert joints[..., 1].min() > -0.03
        assert np.linalg.norm(np.diff(joints, axis=0), axis=-1).max() < 0.35, "no joint leaps"
    local = [each[frame] - each[frame, :1] for each, frame in ((down, -1), (up, 0))]
    assert np.abs(local[0] - local[1]).max() < 0.03, "one ends as the other begins"


@pytest.mark.parametrize("begin", LOW)
@pytest.mark.parametrize("end", LOW)
def test_every_posture_leads_to_every_other(begin: str, end: str) -> None:
    joints = joints_of(RowPosture(begin, end, end, seed=2))
    assert joints[0, 0, 1] == pytest.approx(LOW[begin], abs=NEAR_M)
    assert joints[-1, 0, 1] == pytest.approx(LOW[end], abs=NEAR_M)
    assert joints[..., 1].min() > -0.03, "no knee goes through the floor"


def test_who_sits_up_does_so_once() -> None:
    heights = joints_of(RowPosture(BACK, UPRIGHT, UPRIGHT, seed=1))[:, 15, 1]
    assert heights[0] < 0.3
    assert heights[-1] > 0.6
    assert heights[int(heights.argmax()) :].min() > 0.6


def test_a_slide_goes_on_behind_the_feet() -> None:
    joints = joints_of(RowPosture("", SLIDE, "", seed=1))
    low = int(joints[:, 0, 1].argmin())
    assert joints[low, 0, 1] < 0.25
    assert joints[low, 7, 2] > joints[low, 0, 2] + 0.5
    assert joints[-1, 0, 2] - joints[0, 0, 2] > 1.5
    assert joints[-1, 0, 1] > STANDS_M - NEAR_M


def test_a_wait_is_short_and_gestures_have_their_time() -> None:
    wait = RowPosture(SEAT, SEAT, SEAT, seed=1)
    assert 1.4 < len(joints_of(wait)) / FPS < 2.2
    assert gestures_s("yawns and stretches") > gestures_s("yawns") > 1.5
    assert len(joints_of(wait, "yawns and stretches")) / FPS >= gestures_s("yawns and stretches")


@pytest.mark.parametrize("frames", [30, 60, 120])
def test_a_length_that_is_fixed_is_kept(frames: int) -> None:
    for held in (RowPosture("", KNEES, KNEES), RowPosture(KNEES, "", ""), RowPosture(KNEES, KNEES, "")):
        joints = joints_of(held, frames=frames)
        assert len(joints) == frames


@pytest.mark.parametrize("own", [own for own in LOW if own not in (FRONT, PRONE)])
@pytest.mark.parametrize("action", ["clap", "aim", "raise-arm", "drink"])
def test_a_gesture_is_done_in_the_posture(own: str, action: str) -> None:
    whole = drawn_whole(LAYOUT, action, FineWish(beside=("sits down", "")), 5, None)
    assert whole is not None
    held = RowPosture(own, own, own, gesture=True, seed=1)
    joints = LAYOUT.decode(on_posture(whole.features, LAYOUT, held, action, fixed=False, whole=False))
    rests = joints_of(RowPosture(own, own, own, seed=1))[0]
    assert np.abs(joints[:, 0, 1] - LOW[own]).max() < NEAR_M
    assert np.abs((joints[0] - joints[0, :1]) - (rests - rests[:1])).max() < 0.05
    assert np.abs((joints[-1] - joints[-1, :1]) - (rests - rests[:1])).max() < 0.08
    wrists = joints[:, [20, 21]] - joints[:, [16, 17]]
    assert np.abs(wrists - wrists[0]).max() > 0.15, "an arm acts"


def test_hands_that_clap_meet_in_a_seat() -> None:
    whole = drawn_whole(LAYOUT, "clap", FineWish(), 5, None)
    assert whole is not None
    joints = LAYOUT.decode(
        on_posture(whole.features, LAYOUT, RowPosture(SEAT, SEAT, SEAT, gesture=True), "clap", fixed=False, whole=False)
    )
    made = LAYOUT.decode(whole.features)
    apart, before = (np.linalg.norm(each[:, 20] - each[:, 21], axis=-1).min() for each in (joints, made))
    assert apart < before + 0.05


def test_a_gesture_leads_to_the_posture_of_the_next_movement() -> None:
    whole = drawn_whole(LAYOUT, "clap", FineWish(), 5, None)
    assert whole is not None
    held = RowPosture(SEAT, SEAT, "", gesture=True)
    joints = LAYOUT.decode(on_posture(whole.features, LAYOUT, held, "clap", fixed=False, whole=False))
    assert joints[-1, 0, 1] > STANDS_M - NEAR_M


def test_a_wave_that_goes_on_and_on_is_cut() -> None:
    hands = LAYOUT.decode(drawn_posture(LAYOUT, RowPosture("", "", ""), "", 1, 200)).astype(np.float64)
    time = np.arange(len(hands)) / FPS
    up = np.clip(time - 2.0, 0.0, 1.0)[:, None]
    hands[:, 18] = (1 - up) * hands[:, 18] + up * (hands[:, 16] + [0.26, 0.0, 0.05])
    hands[:, 20] = (1 - up) * hands[:, 20] + up * (hands[:, 16] + [0.3, 0.25, 0.1])
    kept = LAYOUT.decode(on_posture(encode_all(LAYOUT, hands), LAYOUT, NO_POSTURE, "wave", fixed=False, whole=False))
    assert len(kept) == pytest.approx(LONGEST_S * FPS, abs=2)
    raised = kept[:, 20, 1] - kept[:, 16, 1]
    assert raised.max() > 0.1
    assert raised[0] < -0.4
    assert raised[-1] < -0.4


def test_a_gun_is_aimed_ahead_on_the_elbows_and_shots_drive_it_back() -> None:
    aims, fires = (joints_of(RowPosture(FRONT, PRONE, PRONE, fires=fires, seed=1)) for fires in (False, True))
    for joints in (aims, fires):
        assert (joints[-1, [20, 21], 2] > joints[-1, 15, 2] - 0.05).all()
        assert joints[-1, 15, 1] > 0.3, "the head is up"
        assert joints[-1, [18, 19], 1].max() < 0.15
    ahead = [float(np.diff(joints[-30:, 21, 2]).min()) for joints in (aims, fires)]
    assert ahead[0] > -0.005
    assert ahead[1] < -0.015


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize(("action", "said"), [("reach-up", "reaches up"), ("raise-arm", "raises his right hand")])
def test_arms_of_who_lies_go_up_from_the_floor(action: str, said: str, seed: int) -> None:
    drawn = drawn_whole(LAYOUT, action, FineWish(prompt=said, beside=("lies", "")), seed, None)
    assert drawn is not None
    held = RowPosture(BACK, BACK, BACK, gesture=True, seed=seed)
    joints = LAYOUT.decode(on_posture(drawn.features, LAYOUT, held, action, fixed=False, whole=False))
    assert joints[:, [20, 21], 1].max() > 0.5
    assert joints[:, 0, 1].max() < 0.2, "the body stays on the floor"


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_posture_that_is_only_passed_is_left_soon(seed: int) -> None:
    stays, passes = (
        int((joints_of(RowPosture("", BACK, end, seed=seed))[:, 15, 1] < 0.25).sum()) for end in (BACK, FLOOR)
    )
    assert passes < stays


@pytest.mark.parametrize(("action", "leaves"), [("push-ups", PLANK), ("crawl", FOURS), ("sit-ups", BACK)])
@pytest.mark.parametrize("end", ["", FRONT, CROUCH])
@pytest.mark.parametrize("seed", [1, 2])
def test_a_movement_that_ends_low_goes_on_from_there(action: str, leaves: str, end: str, seed: int) -> None:
    made = drawn_whole(LAYOUT, action, FineWish(prompt="", beside=("", "goes on")), seed, None)
    assert made is not None
    features = gone_on(made.features, LAYOUT, RowPosture(leaves=leaves, end=end, seed=seed))
    assert np.array_equal(features[: len(made.features)], made.features)
    joints = LAYOUT.decode(features)[len(made.features) - 2 :]
    assert joints[-1, 0, 1] == pytest.approx(LOW.get(end, STANDS_M), abs=NEAR_M + SOLE_M)
    assert joints[..., 1].min() > -0.04
    assert np.linalg.norm(np.diff(joints, axis=0), axis=-1).max() < 0.35, "no joint leaps"
    same = RowPosture(leaves=leaves, end=leaves, seed=seed)
    assert gone_on(made.features, LAYOUT, same) is made.features


@pytest.mark.parametrize("own", sorted(REACHES))
@pytest.mark.parametrize("hand", ["left", "right", "both"])
def test_hands_reach_the_floor_from_low_postures(own: str, hand: str) -> None:
    held = RowPosture(own, own, own, deed=LowDeed(PICKS, hand), seed=1)
    joints = joints_of(held)
    reached = joints[:, [20, 21], 1].min(0) < 0.2
    assert reached[0] or hand == "right"
    assert reached[1] or hand == "left"
    assert joints[:, 0, 1].max() < joints[0, 0, 1] + 0.05, "it does not stand up"
    assert joints[..., 1].min() > -0.03


def test_fists_beat_the_floor_as_often_as_is_said() -> None:
    wrists = joints_of(RowPosture(KNEES, KNEES, KNEES, deed=LowDeed(POUNDS, "both", 3), seed=1))[:, 20, 1]
    down = wrists < 0.2
    assert np.count_nonzero(down[1:] & ~down[:-1]) == 3


@pytest.mark.parametrize(("begin", "own"), [(BACK, FRONT), (FRONT, BACK)])
def test_who_lies_rolls_over_on_the_floor(begin: str, own: str) -> None:
    joints = joints_of(RowPosture(begin, own, own, seed=1))
    assert joints[:, 0, 1].max() < 0.45, "it does not stand up in between"
    assert -0.03 < joints[..., 1].min(1).min() <= joints[..., 1].min(1).max() < 0.12
    heads = joints[:, 15, 1] - joints[:, 12, 1]
    assert np.abs(heads).max() < 0.25
    across = joints[:, 1] - joints[:, 2]
    front = np.cross(across, joints[:, 12] - joints[:, 0])[:, 1]
    assert (front[0] > 0) != (front[-1] > 0), "the front turns to the other side"


def test_who_rolls_over_twice_lies_as_before() -> None:
    once, twice = (joints_of(RowPosture(BACK, BACK, BACK, halves=halves, seed=1)) for halves in (0, 2))
    assert len(twice) > len(once) + 10
    assert np.abs((twice[-1] - twice[-1, :1]) - (twice[0] - twice[0, :1]))[:, 1].max() < 0.1


@pytest.mark.parametrize("begin", [LEFT_SIDE, RIGHT_SIDE])
def test_who_lies_on_a_side_comes_up_over_hands_and_knees(begin: str) -> None:
    joints = joints_of(RowPosture(begin, "", "", seed=1))
    assert joints[0, 0, 1] < 0.35
    assert joints[-1, 0, 1] == pytest.approx(STANDS_M, abs=NEAR_M)
    assert np.linalg.norm(np.diff(joints, axis=0), axis=-1).max() < 0.35
    assert joints[..., 1].min(1).max() < 0.13, "it never leaves the floor"
