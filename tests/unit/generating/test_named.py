"""Movements of the whole body that are asked for by name."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from marey.generation.fine_wish import FineWish
from marey.generation.named import NAMED, names_movement
from marey.generation.stated import stated_features
from marey.motion.features import HUMANML3D_263
from marey.vocabulary.bearings import load_bearings
from tests.support.drawn_motions import named_movement

LAYOUT = HUMANML3D_263
FPS = LAYOUT.fps
NECK = 12
SEEDS = range(3)
PELVIS, HEAD, ANKLES, TOES, SHOULDERS, WRISTS = 0, 15, [7, 8], [10, 11], [16, 17], [20, 21]


def test_every_bearing_that_moves_is_drawn() -> None:
    assert {name for name, each in load_bearings().items() if each.moves} == set(NAMED)
    assert stated_features(LAYOUT, "idle", FineWish(prompt="stands still"), 60, 1) is None
    assert names_movement("does a burpee")
    assert not names_movement("does a squat")


@pytest.mark.parametrize(
    "prompt",
    [
        "does burpees",
        "does lunges",
        "lunges to the left",
        "pulls her left knee up to her chest",
        "gallops sideways to the right",
        "a knee strike",
        "moonwalks",
        "stumbles forward and catches himself",
        "slips on ice but stays on her feet",
        "winds up and throws a fastball",
        "peeks round the corner",
        "catches the ball high in the air",
        "dives to the left",
        "slides on the ground feet first",
        "a tennis serve",
        "throws a javelin",
        "throws a discus",
        "puts the shot",
        "throws a frisbee",
        "a woman bowls a strike",
        "two jump shots",
        "a fencer advances and lunges",
        "lifts a box onto a high shelf",
        "ties both shoes",
        "curtsies",
        "cowers",
        "a boxer bounces on his toes",
        "bounces from foot to foot",
        "vacuums the rug",
        "pulls the gate open",
        "shoves the heavy door open",
        "steps over a puddle",
        "steps over the cable",
        "steps over a low wall",
        "steps over two logs",
    ],
)
@pytest.mark.parametrize("seed", SEEDS)
def test_they_are_smooth_and_on_the_floor(prompt: str, seed: int) -> None:
    joints = named_movement(prompt, seed=seed)
    assert joints[..., 1].min() > -0.03
    assert joints[:, TOES, 1].min() < 0.03
    assert np.linalg.norm(np.diff(joints, n=2, axis=0), axis=-1).max() * FPS**2 < 160
    assert joints[0, PELVIS, 1] > 0.84


@pytest.mark.parametrize(("prompt", "times"), [("does three burpees", 3), ("a burpee", 1), ("burpees twice", 2)])
def test_burpees_are_as_many_as_asked_for_each_with_a_plank_and_a_jump(prompt: str, times: int) -> None:
    joints = named_movement(prompt)
    down = joints[:, HEAD, 1] < 0.7
    assert (np.diff(down.astype(int)) == 1).sum() == times
    behind = joints[:, PELVIS, 2] - joints[:, ANKLES, 2].max(axis=1)
    assert ((behind > 0.6) & down).any()
    assert joints[:, TOES, 1].min(axis=1).max() > 0.08
    assert joints[:, WRISTS, 1].min(axis=1).max() > 1.7


@pytest.mark.parametrize(
    ("prompt", "times", "way"),
    [("does five lunges", 5, 0.0), ("three walking lunges", 3, 0.8), ("does a lunge with her right leg", 1, 0.0)],
)
def test_lunges_are_as_many_as_asked_for_with_a_level_thigh_and_a_low_knee(prompt: str, times: int, way: float) -> None:
    joints = named_movement(prompt)
    down = joints[:, PELVIS, 1] < 0.65
    starts = np.flatnonzero(np.diff(down.astype(int)) == 1) + 1
    assert len(starts) == times
    fronts = []
    for start in starts:
        low = start + int(joints[start : start + round(FPS), PELVIS, 1].argmin())
        front = int(joints[low, ANKLES, 2].argmax())
        assert abs(joints[low, 1 + front, 1] - joints[low, 4 + front, 1]) < 0.1
        assert joints[low, 5 - front, 1] < 0.13
        fronts.append(front)
    assert all(a != b for a, b in itertools.pairwise(fronts))
    assert "right" not in prompt or fronts == [1]
    assert joints[-1, PELVIS, 2] - joints[0, PELVIS, 2] == pytest.approx(times * way, abs=0.2)


@pytest.mark.parametrize(
    ("prompt", "knee", "times"),
    [("knee R", 5, 1), ("knees him in the stomach with his left knee", 4, 1), ("two right knee strikes", 5, 2)],
)
def test_a_knee_strike_drives_the_knee_up_as_the_hands_come_down(prompt: str, knee: int, times: int) -> None:
    joints = named_movement(prompt)
    up = joints[:, knee, 1] > 0.8
    assert (np.diff(up.astype(int)) == 1).sum() == times
    assert joints[:, 9 - knee, 1].max() < 0.6
    top = int(joints[:, knee, 1].argmax())
    assert joints[top, knee, 2] > joints[top, PELVIS, 2] + 0.25
    assert joints[top - round(0.3 * FPS), WRISTS, 1].min() > joints[top, WRISTS, 1].max() + 0.1
    assert joints[-1, PELVIS, 1] > 0.9


def test_a_moonwalk_glides_backward_on_a_flat_foot() -> None:
    joints = named_movement("moonwalks across the stage", frames=100)
    assert len(joints) == 100
    assert joints[-1, PELVIS, 2] < joints[0, PELVIS, 2] - 1.0
    ahead = np.diff(joints[:, ANKLES, 2], axis=0) * FPS
    assert ahead.max() < 0.25  # no foot steps ahead
    glides = ahead < -0.8
    assert (joints[1:, ANKLES, 1][glides] < 0.14).mean() > 0.8


@pytest.mark.parametrize("seed", range(5))
def test_who_stumbles_is_pitched_forward_steps_and_stands_upright_again(seed: int) -> None:
    joints = named_movement("a man stumbles forward and catches his balance", seed=seed)
    trunk = joints[:, HEAD] - joints[:, PELVIS]
    lean = np.degrees(np.arctan2(trunk[:, 2], trunk[:, 1]))
    assert lean.max() > 30
    assert abs(lean[-1] - lean[0]) < 8
    assert 0.6 < joints[-1, PELVIS, 2] - joints[0, PELVIS, 2] < 1.8
    assert joints[:, PELVIS, 1].min() > 0.7


@pytest.mark.parametrize(
    ("prompt", "height"),
    [
        ("lifts a box onto the top shelf", 1.65),
        ("lifts a crate onto the shelf", 1.4),
        ("lifts a box onto the table", 1.0),
    ],
)
def test_a_load_is_lifted_from_the_floor_with_bent_knees_and_put_up(prompt: str, height: float) -> None:
    joints = named_movement(prompt)
    low = int(joints[:, WRISTS, 1].mean(1).argmin())
    assert joints[low, WRISTS, 1].max() < 0.4
    assert joints[low, PELVIS, 1] < 0.65
    assert joints[low:, WRISTS, 1].min(1).max() == pytest.approx(height, abs=0.16)
    apart = np.linalg.norm(joints[:, 20] - joints[:, 21], axis=1)
    carried = slice(low, int(joints[:, WRISTS, 1].min(1).argmax()))
    assert np.ptp(apart[carried]) < 0.16


@pytest.mark.parametrize(("prompt", "ankle"), [("ties his left shoe", 7), ("kneels to tie her right shoe", 8)])
def test_hands_that_tie_a_shoe_come_down_to_it(prompt: str, ankle: int) -> None:
    joints = named_movement(prompt)
    near = np.linalg.norm(joints[:, WRISTS] - joints[:, None, ankle], axis=-1).max(1) < 0.24
    assert near.sum() > 1.5 * FPS
    assert joints[near, ANKLES[1 - ANKLES.index(ankle)] - 3, 1].max() < 0.16  # the knee of the other leg is down
    assert joints[-1, PELVIS, 1] > 0.9


@pytest.mark.parametrize(("prompt", "times"), [("curtsies", 1), ("curtsies twice", 2)])
def test_a_curtsy_crosses_a_foot_behind_and_bends_the_knees(prompt: str, times: int) -> None:
    joints = named_movement(prompt)
    down = joints[:, PELVIS, 1] < 0.82
    assert (np.diff(down.astype(int)) == 1).sum() == times
    low = int(joints[:, PELVIS, 1].argmin())
    assert joints[low, 8, 0] > joints[low, 7, 0] - 0.03  # the right foot is behind the left one
    assert joints[low, 8, 2] < joints[low, 7, 2] - 0.15


def test_who_cowers_goes_down_behind_the_arms_and_rises() -> None:
    joints = named_movement("cowers in fear", frames=120)
    low = int(joints[:, PELVIS, 1].argmin())
    assert joints[low, PELVIS, 1] < 0.68
    assert np.linalg.norm(joints[low, WRISTS] - joints[low, HEAD], axis=1).max() < 0.35
    assert joints[-1, PELVIS, 1] > 0.88


@pytest.mark.parametrize(
    ("prompt", "axis", "sign"),
    [
        ("a drunk sailor staggers to the left", 0, 1.0),
        ("she reels to her right side", 0, -1.0),
        ("a dizzy man staggers forward a few steps", 2, 1.0),
        ("he lurches drunkenly backwards", 2, -1.0),
        ("a dazed boxer reels and nearly falls", 2, 1.0),
    ],
)
@pytest.mark.parametrize("seed", SEEDS)
def test_a_stagger_goes_its_way_on_crooked_steps_and_ends_upright(
    prompt: str, axis: int, sign: float, seed: int
) -> None:
    joints = named_movement(prompt, seed=seed)
    assert 1.7 < sign * (joints[-1, PELVIS, axis] - joints[0, PELVIS, axis]) < 3.6
    assert abs(joints[-1, PELVIS, 2 - axis] - joints[0, PELVIS, 2 - axis]) < 0.5
    sways = joints[:, NECK, 0] - joints[:, PELVIS, 0]
    assert np.ptp(sways) > 0.12
    assert joints[..., 1].min() > -0.03
    assert joints[:, TOES, 1].min(axis=1).max() < 0.05  # never off the floor
    assert np.linalg.norm(joints[:, 4] - joints[:, 5], axis=1).min() > 0.05
    assert joints[-1, PELVIS, 1] > 0.9
    assert ("nearly" in prompt) == (joints[:, PELVIS, 1].min() < 0.84)


@pytest.mark.parametrize(("prompt", "steps"), [("staggers back two steps", 2), ("reels four steps backwards", 4)])
def test_a_stagger_has_as_many_steps_as_are_said(prompt: str, steps: int) -> None:
    joints = named_movement(prompt)
    lifted = joints[:, TOES, 1] > joints[:, TOES, 1].min() + 0.04
    assert (np.diff(lifted.astype(int), axis=0) == 1).sum() in (steps, steps + 1)  # the last closes the feet
    assert 0.15 * steps < joints[0, PELVIS, 2] - joints[-1, PELVIS, 2] < 0.6 * steps + 0.2


@pytest.mark.parametrize("seed", SEEDS)
def test_a_foot_that_slips_slides_ahead_as_the_trunk_goes_back_and_the_body_stands_again(seed: int) -> None:
    joints = named_movement("slips on a wet leaf but catches herself", seed=seed)
    apart = np.abs(joints[:, TOES[0], 2] - joints[:, TOES[1], 2])
    assert apart.max() > 0.4
    leans = joints[:, NECK, 2] - joints[:, PELVIS, 2]
    assert leans.min() < -0.1
    assert joints[-1, PELVIS, 1] > 0.9
    assert joints[:, PELVIS, 1].min() > 0.7


@pytest.mark.parametrize(
    ("prompt", "sign", "low"),
    [("leans out to the left", 1.0, False), ("crouches and peeps out to the right", -1.0, True)],
)
def test_who_peeks_leans_trunk_and_head_out_to_the_side_on_planted_feet(prompt: str, sign: float, low: bool) -> None:
    joints = named_movement(prompt)
    out = sign * (joints[:, HEAD, 0] - joints[0, HEAD, 0])  # to the left of a body that faces +Z
    far = int(out.argmax())
    assert out[far] > 0.28
    assert sign * (joints[far, HEAD, 0] - joints[far, PELVIS, 0]) > 0.15
    assert np.abs(joints[far - 6 : far + 6, TOES] - joints[far, TOES]).max() < 0.02
    assert bool(joints[far, PELVIS, 1] < 0.75) is low


@pytest.mark.parametrize("seed", SEEDS)
def test_a_vacuumed_floor_has_strokes_of_half_a_metre_at_the_hips(seed: int) -> None:
    joints = named_movement("hoovers the hall", seed=seed)
    wrist = joints[:, WRISTS[1]]
    assert np.ptp(wrist[:, 2]) > 0.45
    assert 0.7 < wrist[30:-30, 1].min() < wrist[30:-30, 1].max() < 1.05
    left = named_movement("vacuums the stairs with her left hand", seed=seed)
    assert np.ptp(left[:, WRISTS[0], 2]) > 0.45


@pytest.mark.parametrize(
    ("prompt", "wrist", "sign"),
    [
        ("she pulls the front door open", 21, -1.0),
        ("pulls open the gate with his left hand", 20, -1.0),
        ("pushes it open", 21, 1.0),
        ("shoves the door open with her left hand", 20, 1.0),
    ],
)
@pytest.mark.parametrize("seed", SEEDS)
def test_a_hand_goes_to_the_door_and_the_body_steps_with_it(prompt: str, wrist: int, sign: float, seed: int) -> None:
    joints = named_movement(prompt, seed=seed)
    way = joints[-1, PELVIS, 2] - joints[0, PELVIS, 2]
    assert 0.3 < sign * way < 1.0
    hand = joints[:, wrist] - joints[0, PELVIS]
    reached = int(hand[:, 2].argmax()) if sign < 0 else int(np.flatnonzero(hand[:, 2] > 0.4)[0])
    assert hand[reached, 2] > 0.4
    assert 0.9 < joints[reached, wrist, 1] < 1.25
    assert joints[:, TOES, 1].min(axis=1).max() < 0.04


@pytest.mark.parametrize(
    "prompt",
    [
        "bounces the ball on the spot",
        "pushes the door shut",
        "pulls a cart to the gate",
        "a vacuum cleaner hums",
        "pushes it",
    ],
)
def test_others_do_not_name_these_movements(prompt: str) -> None:
    assert not names_movement(prompt)


@pytest.mark.parametrize(
    ("prompt", "front"),
    [("lunges forward with the left leg", 0), ("lunge, the left leg back", 1), ("deep lunge, right leg in front", 1)],
)
def test_the_leg_that_is_named_is_in_front_of_a_single_lunge(prompt: str, front: int) -> None:
    joints = named_movement(prompt)
    low = joints[:, PELVIS, 1].argmin()
    assert joints[low, ANKLES, 2].argmax() == front
    assert np.ptp(joints[low, ANKLES, 2]) > 0.6
    assert (np.diff((joints[:, PELVIS, 1] < 0.65).astype(int)) == 1).sum() == 1


def test_a_lunge_is_held_as_long_as_is_said() -> None:
    joints = named_movement("holds a lunge for four seconds")
    assert 4.0 < (joints[:, PELVIS, 1] < 0.65).sum() / FPS < 5.2


@pytest.mark.parametrize(("side", "sign"), [("left", 1), ("right", -1)])
def test_a_lunge_to_a_side_bends_one_knee_and_stretches_the_other_leg(side: str, sign: int) -> None:
    joints = named_movement(f"lunges to the {side}")
    low = joints[joints[:, PELVIS, 1].argmin()]
    bent, straight = ((1, 4, 7), (2, 5, 8)) if sign > 0 else ((2, 5, 8), (1, 4, 7))
    angle = [np.degrees(np.arccos(_cosine(low[b] - low[a], low[c] - low[b]))) for a, b, c in (bent, straight)]
    assert angle[0] > 60
    assert angle[1] < 35
    assert sign * (low[bent[2], 0] - joints[0, bent[2], 0]) > 0.5


@pytest.mark.parametrize(("side", "knees"), [("left", (4, 5)), ("right", (5, 4))])
def test_one_knee_is_lifted_as_often_and_as_high_as_is_said(side: str, knees: tuple[int, int]) -> None:
    low, high = (named_movement(f"lifts the {side} knee {height}") for height in ("to hip height", "to the chest"))
    assert low[:, knees[0], 1].max() > low[0, PELVIS, 1] - 0.15
    assert high[:, knees[0], 1].max() > low[:, knees[0], 1].max() + 0.05
    assert np.ptp(high[:, knees[1], 1]) < 0.06
    thrice = named_movement(f"raises the {side} knee to hip height three times")[:, knees[0], 1] > 0.75
    assert (np.diff(thrice.astype(int)) == 1).sum() == 3


@pytest.mark.parametrize(("side", "sign"), [("left", 1), ("right", -1)])
def test_a_side_gallop_leaves_the_floor_in_each_step_to_its_side(side: str, sign: int) -> None:
    joints = named_movement(f"gallops sideways to the {side}")
    gone = joints[-1, PELVIS] - joints[0, PELVIS]
    assert sign * gone[0] > 1.5
    assert abs(gone[2]) < 0.2
    assert (joints[:, TOES, 1].min(axis=1) > 0.04).sum() >= 4


def _cosine(a: np.ndarray, b: np.ndarray) -> float:
    return float(a @ b / np.linalg.norm(a) / np.linalg.norm(b))


@pytest.mark.parametrize(
    ("prompt", "least", "most"),
    [("steps over a puddle", 0.2, 0.32), ("steps over a log", 0.4, 0.52), ("steps over a low wall", 0.58, 0.72)],
)
@pytest.mark.parametrize("seed", SEEDS)
def test_both_feet_go_over_what_is_stepped_over(prompt: str, least: float, most: float, seed: int) -> None:
    joints = named_movement(prompt, seed=seed)
    assert ((joints[:, ANKLES, 1].max(axis=0) > least - 0.12) & (joints[:, ANKLES, 1].max(axis=0) < most)).all()
    standing = joints[:, ANKLES, 1].min(axis=1) < 0.2
    assert standing.all(), "one foot is always on the floor"
    strides = np.abs(joints[:, 7, 2] - joints[:, 8, 2]).max()
    assert strides > (0.8 if "puddle" in prompt else 0.45)
    assert joints[-1, PELVIS, 2] - joints[0, PELVIS, 2] > 1.0


def test_it_steps_over_as_many_things_as_are_named() -> None:
    def lifts(prompt: str) -> int:
        high = named_movement(prompt)[:, 7, 1] > 0.3
        return int(np.count_nonzero(high[1:] & ~high[:-1]))

    assert lifts("steps over a log") == 1
    assert lifts("steps over three logs") == 3
    assert lifts("steps over several obstacles") == 2


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("seed", SEEDS)
def test_an_elbow_strikes_with_a_folded_arm(side: str, seed: int) -> None:
    joints = named_movement(f"throws a {side} elbow to the jaw", seed=seed)
    shoulder, elbow, wrist = (joints[:, one + (side == "right")] for one in (16, 18, 20))
    hit = elbow[:, 2].argmax()
    assert np.linalg.norm(wrist - shoulder, axis=-1)[hit - 3 : hit + 3].max() < 0.36
    assert elbow[hit, 1] > shoulder[hit, 1] - 0.08, "the upper arm is level"
    assert np.linalg.norm(np.diff(elbow, axis=0), axis=-1).max() * FPS > 2.0


@pytest.mark.parametrize("seed", SEEDS)
def test_a_headbutt_draws_back_and_snaps_the_head_forward(seed: int) -> None:
    joints = named_movement("headbutts his opponent", seed=seed)
    ahead = joints[:, HEAD, 2] - joints[:, PELVIS, 2]
    assert ahead.max() > 0.3
    assert ahead[: ahead.argmax()].min() < ahead[0] - 0.03
    assert np.diff(ahead).max() * FPS > 1.5


@pytest.mark.parametrize(("prompt", "way"), [("slaps him with the right hand", 1), ("backhands him", -1)])
@pytest.mark.parametrize("seed", SEEDS)
def test_a_slap_goes_across_a_face(prompt: str, way: int, seed: int) -> None:
    joints = named_movement(prompt, seed=seed)
    hand = joints[:, WRISTS] - joints[:, [NECK]]
    speed = np.linalg.norm(np.diff(hand, axis=0), axis=-1) * FPS
    passes, acts = np.unravel_index(int(speed.argmax()), speed.shape)
    across, ahead = hand[:, acts, 0] * (1 if acts else -1), hand[:, acts, 2]
    assert speed.max() > 3.0
    assert ahead[passes - 3 : passes + 4].max() > 0.3
    assert way * (across[passes + 2] - across[passes - 2]) > 0.15


@pytest.mark.parametrize("seed", SEEDS)
def test_a_spun_backfist_strikes_out_of_a_whole_turn(seed: int) -> None:
    joints = named_movement("a spinning backfist", seed=seed)
    across = joints[:, 1] - joints[:, 2]
    turned = np.degrees(np.unwrap(np.arctan2(-across[:, 2], across[:, 0])))
    assert 350 < abs(turned[-1] - turned[0]) < 370
    reach = np.linalg.norm(joints[:, WRISTS] - joints[:, SHOULDERS], axis=-1).max(axis=1)
    round_again = np.abs(turned - turned[0]) > 250
    assert reach[round_again].max() > 0.42
    assert np.ptp(joints[round_again][:, TOES, 1].min(axis=1)) < 0.05
