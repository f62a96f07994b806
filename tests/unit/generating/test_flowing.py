"""Drawn movements of a sequence that go on into each other."""

from __future__ import annotations

import numpy as np
import pytest

from marey.generation.drawn_whole import drawn_whole
from marey.generation.fine_wish import FineWish
from marey.generation.postured import drawn_posture
from marey.generation.row_postures import row_postures
from marey.generation.shots.flowing import SPEED, flowing, flowing_as_shown, without_rest
from marey.motion.features import HUMANML3D_263
from marey.quality.record import SHOWN
from marey.selector.motion import Motion
from marey.selector.rules import RULES
from tests.support.bodies import Body, steady

LAYOUT = HUMANML3D_263
BESIDE = ("", "walks")
FPS = 20.0


def drawn(action: str, said: str, seed: int = 1) -> np.ndarray:
    made = drawn_whole(LAYOUT, action, FineWish(prompt=said, beside=BESIDE), seed, None)
    assert made is not None
    return made.features


def joints_of(*features: np.ndarray) -> np.ndarray:
    return LAYOUT.decode(np.concatenate(features)).astype(np.float64)


def fastest(joints: np.ndarray) -> float:
    return float(np.linalg.norm(np.diff(joints, axis=0), axis=-1).max()) * FPS


PAIRS = [
    (("wave", "waves"), ("bow", "bows")),
    (("punch", "throws a left hook"), ("kick", "a fighter kicks")),
    (("block", "blocks"), ("punch", "throws a jab")),
    (("clap", "claps twice"), ("raise-arm", "raises both arms")),
    (("kick", "kicks"), ("punch", "throws a cross")),
]


@pytest.mark.parametrize(("one", "other"), PAIRS)
@pytest.mark.parametrize("seed", [1, 2])
def test_the_rest_between_two_movements_is_left_out(one: tuple[str, str], other: tuple[str, str], seed: int) -> None:
    before, after = drawn(*one, seed), drawn(*other, seed)
    joined = flowing(before, after, LAYOUT)
    assert joined is not None
    assert len(joined.before) + len(joined.after) < len(before) + len(after) - 0.5 * FPS
    joints = joints_of(joined.before, joined.after)
    middle = slice(len(joined.before) - 4, len(joined.before) + 20)
    alone = max(fastest(joints_of(before)), fastest(joints_of(after)), 2.5 * SPEED)
    assert fastest(joints[middle]) < 1.3 * alone
    assert joints[:, [7, 8], 1].min() > 0.0


def test_hands_stay_up_between_blows() -> None:
    before, after = drawn("punch", "throws a jab"), drawn("punch", "throws a right cross")
    joined = flowing(before, after, LAYOUT)
    assert joined is not None
    joints = joints_of(joined.before, joined.after)
    assert (joints[:, [20, 21], 1] - joints[:, :1, 1]).min() > 0.2


def test_feet_that_stand_alike_stay() -> None:
    joined = flowing(drawn("wave", "waves"), drawn("clap", "claps"), LAYOUT)
    assert joined is not None
    feet = joints_of(joined.before, joined.after)[:, [7, 8]]
    assert np.ptp(feet[:, :, [0, 2]], axis=0).max() < 0.12


def test_a_movement_that_is_kept_whole_loses_its_edge_alone() -> None:
    before, after = drawn("wave", "waves"), drawn("bow", "bows")
    joined = flowing(before, after, LAYOUT, whole=(True, True))
    assert joined is not None
    assert len(joined.before) + len(joined.after) >= len(before) + len(after) - 20


def test_the_beginning_of_a_jump_is_not_cut() -> None:
    jump = drawn("jump", "jumps up")
    joined = flowing(drawn("clap", "claps"), jump, LAYOUT)
    assert joined is not None
    heights = joints_of(joined.after)[:, 0, 1]
    assert heights.min() == pytest.approx(joints_of(jump)[:, 0, 1].min(), abs=0.03)
    assert heights.max() == pytest.approx(joints_of(jump)[:, 0, 1].max(), abs=0.03)


def test_bodies_that_do_not_stand_are_not_joined() -> None:
    held = row_postures([("sit-down", "sits down"), ("wave", "waves")], 1)[0]
    sits = drawn_posture(LAYOUT, held, "sits down", 1, None)
    assert flowing(sits, drawn("wave", "waves"), LAYOUT) is None


def test_the_rest_beside_a_network_is_left_out() -> None:
    wave = drawn("wave", "waves")
    for first, last in ((True, False), (False, True), (True, True)):
        brief = without_rest(wave, LAYOUT, first=first, last=last)
        assert len(wave) - 2.0 * FPS * (first + last) <= len(brief) < len(wave) - 2 * (first + last)
    assert len(without_rest(wave, LAYOUT, first=False, last=False)) == len(wave)


@pytest.mark.parametrize("own", ["kneels", "lies down on his belly"])
def test_who_is_bent_goes_down_from_there(own: str) -> None:
    rows = [("bend-over", "doubles over"), ("kneel" if own == "kneels" else "lie-down", own)]
    bends, down = drawn(*rows[0]), drawn_posture(LAYOUT, row_postures(rows, 1)[1], own, 1, None)
    joined, upright = flowing(bends, down, LAYOUT, down=True), flowing(bends, down, LAYOUT, whole=(False, True))
    assert joined is not None
    assert upright is not None
    assert len(joined.before) < len(upright.before)
    assert joints_of(joined.before)[-1, 15, 1] < 1.2


@pytest.mark.parametrize(
    ("action", "said"), [("die", "trips and falls"), ("die", "faints"), ("roll", "rolls"), ("throw", "throws a stone")]
)
@pytest.mark.parametrize("speed", [1.2, 2.5])
def test_a_way_goes_on_into_what_is_drawn_behind_it(action: str, said: str, speed: float) -> None:
    way, after = LAYOUT.encode(Body(4.0, speed=steady(speed)).joints()), drawn(action, said)
    joined = flowing(way, after, LAYOUT, onward=True)
    assert joined is not None
    joints = joints_of(joined.before, joined.after)
    goes = np.linalg.norm(np.diff(joints[:, 0, [0, 2]], axis=0), axis=-1) * FPS
    end = len(joined.before)
    assert goes[10 : end + 2].min() > 0.6 * speed, "there is no halt before it"
    slower = np.diff(goes[end - 4 : end + 30])
    assert slower.max() < 0.8, "the speed does not jump"
    assert joints[..., 1].min() > -0.1
    if action == "die":
        assert joints[end : end + 12, 0, 1].max() > 0.85, "the fall begins on the feet"


def test_who_stands_does_not_go_on() -> None:
    stands = LAYOUT.encode(Body(4.0).joints())
    assert flowing(stands, drawn("die", "falls"), LAYOUT, onward=True) is None


@pytest.mark.parametrize("said", ["gets hit in the stomach", "is punched in the belly"])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_who_is_hit_bends_on(said: str, seed: int) -> None:
    hit, bends = drawn("flinch", said, seed), drawn("bend-over", "doubles over", seed)
    joined = flowing(hit, bends, LAYOUT, down=True)
    assert joined is not None
    head = joints_of(joined.before, joined.after)[:, 15, 1]
    first = int(np.flatnonzero(head < head[0] - 0.2)[0])
    assert head[first : int(head.argmin())].max() < head[0] - 0.15, "the body does not come upright in between"


def test_what_is_left_out_leaves_the_actions_to_be_seen() -> None:
    hidden = 0
    for seed in range(6):
        rows = {action: drawn(action, said, seed) for action, said in (("aim", "aims a pistol"), ("shoot", "fires"))}
        aims, fires = rows["aim"], rows["shoot"]
        joined, kept = flowing(aims, fires, LAYOUT), flowing_as_shown(aims, fires, LAYOUT, ("aim", "shoot"))
        assert joined is not None
        if kept is None:
            continue
        assert all(shows(each, action) for each, action in zip((kept.before, kept.after), rows, strict=True))
        hidden += not all(shows(each, action) for each, action in zip((joined.before, joined.after), rows, strict=True))
    assert hidden


def shows(features: np.ndarray, action: str) -> bool:
    return RULES[action](Motion(LAYOUT.decode(features), FPS), "") >= SHOWN


@pytest.mark.parametrize(
    ("action", "said"),
    [("climb-onto", "vaults over the wall"), ("jump-forward", "jumps over a log"), ("flip", "does a front flip")],
)
@pytest.mark.parametrize("seed", [1, 2])
def test_who_lands_rolls_on_from_there(action: str, said: str, seed: int) -> None:
    before, after = drawn(action, said, seed), drawn("roll", "rolls", seed)
    joined = flowing_as_shown(before, after, LAYOUT, (action, "roll"), landing=True)
    stopped = flowing_as_shown(before, after, LAYOUT, (action, "roll"))
    assert joined is not None
    assert stopped is not None

    def highest_between(before: np.ndarray, after: np.ndarray) -> float:
        joints = joints_of(before, after)
        feet = joints[: len(before), [7, 8, 10, 11], 1].min(axis=1)
        lands = int(np.flatnonzero(feet > 0.12)[-1]) + 3
        return float(joints[lands : lands + int((joints[lands:, 0, 1] < 0.55).argmax()), 0, 1].max())

    assert highest_between(joined.before, joined.after) < 0.9
    assert highest_between(stopped.before, stopped.after) > 0.9, "without it the body stands up first"
    for rule, features in ((action, joined.before), ("roll", joined.after)):
        assert RULES[rule](Motion(LAYOUT.decode(features), FPS), "") >= SHOWN
    whole = joints_of(joined.before, joined.after)
    middle = slice(len(joined.before) - 4, len(joined.before) + 14)
    assert fastest(whole[middle]) < max(fastest(joints_of(before)), fastest(joints_of(after)))
    assert whole[:, [7, 8, 10, 11], 1].min() > -0.04
