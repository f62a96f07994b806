"""Motions on the side, as often and at the pace that their prompt names."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from marey.generation import asked
from marey.generation.asked import AskedMotion, changes_of, generate_as_asked
from marey.generation.paced import SPEEDS, WAY_SPEEDS
from marey.generation.port import KeptFrames, Limits, Request
from marey.generation.shots.windows import no_text
from marey.generation.stepped import frames_of_steps
from marey.generation.timed import CUT
from marey.generation.wish import Wish, is_winding
from marey.motion.courses import natural_course
from marey.motion.features import HUMANML3D_263
from marey.motion.skeleton import HUMANML3D
from marey.selector.motion import Motion
from marey.selector.repetitions import REPETITIONS
from tests.support.bodies import Body, lift, raiser, steady, walker, waver


@dataclass(frozen=True)
class RawMotion:
    features: np.ndarray[Any, Any]


class OneMotion:
    """A generator that makes the same motion for every request."""

    layout = HUMANML3D_263
    limits = Limits(16, 400, 20.0, 4)
    bundle = SimpleNamespace(manifest=SimpleNamespace(draws_bearings=False))

    def __init__(self, joints: np.ndarray[Any, Any]) -> None:
        self.made = RawMotion(self.layout.encode(joints))

    def generate(self, requests: Sequence[Request], settings: Any, *, control: Any) -> list[Any]:
        self.frames = [request.frames for request in requests]
        return [self.made for _ in requests]


def ask(prompt: str) -> Request:
    return Request(replace(no_text(4), prompt=prompt, rewritten=prompt), 1)


def make(joints: np.ndarray[Any, Any], request: Request) -> Any:
    (made,) = generate_as_asked(OneMotion(joints), [request])  # type: ignore[arg-type]
    return made


def test_the_wrong_hand_is_mirrored() -> None:
    made = make(waver("left"), ask("a man waves with his right hand"))
    assert isinstance(made, AskedMotion)
    assert made.changes == {"mirrored": True}
    mirrored = HUMANML3D_263.decode(made.features)
    left = HUMANML3D_263.canonicalize(waver("left"))[: len(mirrored)]
    np.testing.assert_allclose(mirrored, HUMANML3D_263.mirror_joints(left), atol=1e-4)


@pytest.mark.parametrize(
    ("joints", "prompt"),
    [
        (waver("left"), "a man waves with his left hand"),
        (waver("left"), "a man waves"),
        (raiser("both"), "a man claps his right hand"),
        (waver("left"), "a man walks to the right"),
        (waver("both"), "a man waves with his right hand"),
    ],
    ids=["right side", "no side", "neither side", "no rule for the side", "both sides"],
)
def test_motions_that_a_mirror_does_not_help_stay(joints: np.ndarray[Any, Any], prompt: str) -> None:
    assert isinstance(make(joints, ask(prompt)), RawMotion)


def test_motions_around_kept_frames_are_not_mirrored() -> None:
    request = ask("a man waves with his right hand")
    kept = KeptFrames(0, np.zeros((4, 263), np.float32))
    assert isinstance(make(waver("left"), replace(request, kept=(kept,))), RawMotion)
    assert isinstance(make(waver("left"), replace(request, free=True)), RawMotion)


def bower(times: int) -> np.ndarray[Any, Any]:
    curves = [lift(0.4 + 1.8 * number, 1.4 + 1.8 * number) for number in range(times)]
    return Body(0.8 + 1.8 * times, lean=lambda t: 45 * sum(curve(t) for curve in curves)).joints()


def count(made: Any) -> int:
    return len(REPETITIONS["bow"](Motion(HUMANML3D_263.decode(made.features), 20.0)))


def test_repetitions_become_as_many_as_asked_for() -> None:
    made = make(bower(3), replace(ask("a man bows twice"), open=True))
    assert made.changes == {"repetitions": {"made": 3, "asked": 2}}
    assert count(made) == 2


def test_a_motion_of_a_fixed_length_keeps_it() -> None:
    features = HUMANML3D_263.encode(bower(3))
    made = make(bower(3), replace(ask("a man bows twice"), frames=len(features)))
    assert len(made.features) == len(features)
    assert count(made) == 2
    assert made.changes["speed"] < 1


def test_repetitions_stay_where_the_fixed_length_would_change_the_pace_too_much() -> None:
    features = HUMANML3D_263.encode(bower(4))
    assert isinstance(make(bower(4), replace(ask("a man bows once"), frames=len(features))), RawMotion)


def test_a_motion_whose_length_is_not_that_of_its_request_stays() -> None:
    """Models may round a length to whole tokens."""
    features = HUMANML3D_263.encode(bower(2))
    request = replace(ask("a man bows twice"), frames=len(features) + 2)
    assert isinstance(make(bower(2), request), RawMotion)


def test_no_motion_becomes_longer_than_one_may_be(monkeypatch: pytest.MonkeyPatch) -> None:
    request = replace(ask("a man bows 12 times"), open=True)
    assert count(make(bower(1), request)) == 12
    monkeypatch.setattr(asked, "MAX_SECONDS", 10.0)
    assert isinstance(make(bower(1), request), RawMotion)


@pytest.mark.parametrize(("word", "pace"), [("slowly", "slow"), ("quickly", "fast")])
def test_the_pace_of_an_open_length_changes_it(word: str, pace: str) -> None:
    features = HUMANML3D_263.encode(bower(1))
    made = make(bower(1), replace(ask(f"a man bows {word}"), frames=len(features), open=True))
    assert len(made.features) == round(len(features) / SPEEDS[pace])
    assert made.changes == {"speed": pytest.approx(SPEEDS[pace], rel=0.02)}


def test_the_pace_of_a_fixed_length_changes_what_is_drawn() -> None:
    generator = OneMotion(bower(1))
    (made,) = generate_as_asked(generator, [replace(ask("a man bows slowly"), frames=100)])  # type: ignore[arg-type]
    assert generator.frames == [round(100 * SPEEDS["slow"])]
    assert made is not None
    assert len(made.features) == 100


@pytest.mark.parametrize(
    "prompt", ["a man sprints slowly", "a man jumps quickly", "a man bows", "a man bows beside a fast car"]
)
def test_learned_paces_and_those_of_gravity_stay(prompt: str) -> None:
    assert isinstance(make(bower(1), replace(ask(prompt), open=True)), RawMotion)


def only_ended(made: Any) -> bool:
    """Return True for a motion as it was made, but for a last step that is left out."""
    return isinstance(made, RawMotion) or made.changes.keys() == {"left_out"}


def speed_of(made: Any) -> float:
    joints = HUMANML3D_263.decode(made.features)
    return float(np.linalg.norm(joints[-1, 0, [0, 2]] - joints[0, 0, [0, 2]]) / (len(joints) - 1) * 20.0)


@pytest.mark.parametrize(("word", "pace"), [("slowly", "slow"), ("briskly", "fast")])
def test_a_walk_is_brought_to_the_speed_of_its_pace(word: str, pace: str) -> None:
    made = make(walker(6.0), replace(ask(f"a man walks {word}"), open=True))
    assert speed_of(made) == pytest.approx(getattr(WAY_SPEEDS["walk"], pace), rel=0.05)
    assert made.changes["speed"] == pytest.approx(getattr(WAY_SPEEDS["walk"], pace) / 1.1, rel=0.05)
    assert made.changes.keys() <= {"speed", "left_out"}


def test_a_walk_that_has_the_pace_stays_as_it_is() -> None:
    slow = Body(6.0, speed=steady(0.7), cadence=1.3).joints()
    made = make(slow, replace(ask("a man walks slowly"), open=True))
    assert only_ended(made)
    assert len(slow) - len(made.features) <= 15


def test_ways_of_open_length_end_on_a_settled_step_but_for_circles() -> None:
    straight, around, fixed = (
        make(walker(6.0), replace(ask(prompt), open=frames is None, frames=frames))
        for prompt, frames in (("a man walks", None), ("a man walks in a circle", None), ("a man walks", 112))
    )
    assert straight.changes["left_out"] > 0
    assert HUMANML3D_263.decode(straight.features)[-1, [10, 11], 1].max() < 0.05
    assert not {"left_out"} & getattr(around, "changes", {}).keys()
    assert not {"left_out"} & getattr(fixed, "changes", {}).keys()


def test_a_walk_in_place_has_no_speed() -> None:
    stepping = Body(6.0, speed=steady(0.02)).joints()
    assert only_ended(make(stepping, replace(ask("a man walks in place slowly"), open=True)))


def test_steps_of_a_run_are_not_slowed_down_for_long() -> None:
    made = make(Body(4.0, speed=steady(4.5), duty=0.35).joints(), replace(ask("a man runs slowly"), open=True))
    assert made.changes["speed"] == pytest.approx(WAY_SPEEDS["run"].played[0], rel=0.02)


def test_a_run_without_a_pace_is_no_slower_than_a_jog() -> None:
    made = make(Body(4.0, speed=steady(1.8), duty=0.4).joints(), replace(ask("a man runs"), open=True))
    assert speed_of(made) == pytest.approx(WAY_SPEEDS["run"].least, rel=0.05)
    assert only_ended(make(walker(6.0), replace(ask("a man walks"), open=True)))


def test_a_run_of_a_fixed_length_keeps_it() -> None:
    joints = Body(4.0, speed=steady(1.8), duty=0.4).joints()
    made = make(joints, replace(ask("a man runs"), frames=len(HUMANML3D_263.encode(joints))))
    assert isinstance(made, RawMotion)


def test_a_slow_walk_of_a_fixed_length_ends_sooner_on_its_way() -> None:
    features = HUMANML3D_263.encode(walker(6.0))
    made = make(walker(6.0), replace(ask("a man walks slowly"), frames=len(features)))
    assert len(made.features) == len(features)
    assert speed_of(made) == pytest.approx(WAY_SPEEDS["walk"].slow, rel=0.05)


def test_for_a_fast_walk_of_a_fixed_length_more_is_drawn() -> None:
    generator = OneMotion(walker(6.0))
    (made,) = generate_as_asked(generator, [replace(ask("a man walks fast"), frames=80)])  # type: ignore[arg-type]
    assert generator.frames == [round(80 * WAY_SPEEDS["walk"].played[1])]
    assert made is not None
    assert len(made.features) == 80
    assert speed_of(made) == pytest.approx(WAY_SPEEDS["walk"].fast, rel=0.05)


@pytest.mark.parametrize("count", [1, 2, 3, 5])
def test_steps_are_as_many_as_asked_for(count: int) -> None:
    made = make(walker(6.0), replace(ask(f"a man walks {count} steps"), open=True))
    assert len(REPETITIONS["walk"](Motion(HUMANML3D_263.decode(made.features), 20.0))) == count
    assert made.changes["repetitions"]["asked"] == count


def test_a_motion_of_fewer_steps_stays_and_one_with_more_is_drawn_for_them() -> None:
    generator = OneMotion(walker(3.0))
    request = replace(ask("a man takes 12 steps"), frames=60, open=True)
    (made,) = generate_as_asked(generator, [request])  # type: ignore[arg-type]
    assert isinstance(made, RawMotion)
    assert generator.frames == [frames_of_steps(12, 20.0)]


def test_steps_of_a_fixed_length_are_drawn_and_kept_in_it() -> None:
    generator = OneMotion(walker(6.0))
    fixed = len(generator.made.features)
    (made,) = generate_as_asked(generator, [replace(ask("a man takes 2 steps"), frames=fixed)])  # type: ignore[arg-type]
    assert generator.frames == [fixed]
    assert isinstance(made, RawMotion)  # two steps in six seconds would be too slow


def test_a_walk_that_is_done_twice_has_any_steps() -> None:
    assert only_ended(make(walker(6.0), replace(ask("a man walks twice around the table"), open=True)))


def test_the_limb_that_acts_is_the_one_that_the_prompt_names() -> None:
    """Of an action that no rule knows, and of one that both images show."""
    salute = make(raiser("left"), ask("a guard salutes with his right hand"))
    assert isinstance(salute, AskedMotion)
    assert salute.changes == {"mirrored": True}
    assert isinstance(make(raiser("left"), ask("a guard salutes with his left hand")), RawMotion)
    assert isinstance(make(raiser("left"), ask("a guard salutes to the right")), RawMotion)


def test_turns_are_as_large_as_asked_for() -> None:
    made = make(walker(6.0, turn=150.0), ask("a man walks ahead and then turns left by 90 degrees"))
    assert made.changes == {"turn": {"made": pytest.approx(150, abs=5), "shown": pytest.approx(90, abs=5)}}


def test_frames_that_a_transition_replaces_are_no_part_of_a_turn() -> None:
    request = ask("a man walks ahead and then turns left by 90 degrees")
    joints = walker(6.0, turn=150.0)[40:]
    whole = make(joints, request)
    joined = make(joints, replace(request, beside=("a man waves", "")))
    headings = [
        natural_course(HUMANML3D_263.decode(each.features), HUMANML3D, 20.0).headings for each in (whole, joined)
    ]
    assert abs(math.degrees(headings[0][-1] - headings[0][8])) < 80
    assert abs(math.degrees(headings[1][-1] - headings[1][8])) == pytest.approx(90, abs=7)


def test_a_turn_to_the_other_side_is_mirrored_first() -> None:
    made = make(walker(6.0, turn=150.0), ask("a man walks and turns right 90 degrees"))
    assert made.changes["mirrored"]
    assert made.changes["turn"]["shown"] == pytest.approx(-90, abs=5)


def test_ways_are_straight_unless_their_prompt_says_otherwise() -> None:
    curved = walker(6.0, turn=50.0)
    assert make(curved, ask("a man walks to work")).changes["turn"]["shown"] == pytest.approx(0, abs=5)
    assert only_ended(make(curved, ask("a man wanders around")))


def test_a_circle_has_the_time_to_close() -> None:
    wish = Wish.of(ask("a man walks in a wide circle"))
    limits = Limits(16, 196, 20.0, 8, keeps=4)
    short = replace(ask("a man walks in a wide circle"), frames=60, open=True)
    assert (wish.for_network(short, limits).frames or 0) > 150
    assert wish.for_network(replace(short, open=False), limits).frames == 60


def test_a_way_is_read_with_its_course() -> None:
    assert is_winding(ask("a man walks off to the left").text)
    assert not is_winding(ask("a man walks with his left arm up").text)


@pytest.mark.parametrize(("prompt", "action"), [("a man nods twice", "nod"), ("she shivers", "shiver")])
def test_small_movements_are_drawn_where_they_are_missing(prompt: str, action: str) -> None:
    made = make(Body(4.0).joints(), ask(prompt))
    assert made.changes["drawn"] == action
    if action == "nod":
        assert len(REPETITIONS["nod"](Motion(HUMANML3D_263.decode(made.features), 20.0))) == 2
        again = make(HUMANML3D_263.decode(made.features), ask(prompt))
        assert "drawn" not in changes_of(again)


def test_a_glance_turns_the_head_and_leaves_the_pace_of_the_action() -> None:
    made = make(walker(6.0), replace(ask("a man walks and quickly looks around"), open=True))
    assert made.changes["gaze"] == ["around"]
    assert "turn" not in made.changes
    assert made.changes["speed"] > 1


def test_a_motion_that_does_not_show_its_action_is_drawn_by_bundles_that_draw() -> None:
    generator = OneMotion(Body(4.0).joints())
    generator.bundle = SimpleNamespace(manifest=SimpleNamespace(draws_bearings=True))
    (made,) = generate_as_asked(generator, [ask("a man kneels")])  # type: ignore[arg-type]
    assert isinstance(made, AskedMotion)
    assert made.changes == {"drawn": "kneel"}
    assert isinstance(make(Body(4.0).joints(), ask("a man kneels")), RawMotion)


def test_a_movement_whose_form_is_stated_is_drawn_by_models_that_draw(monkeypatch: pytest.MonkeyPatch) -> None:
    prompt = "a man raises his right arm to shoulder height"
    assert isinstance(make(raiser("right"), ask(prompt)), RawMotion)
    monkeypatch.setattr(OneMotion, "bundle", SimpleNamespace(manifest=SimpleNamespace(draws_bearings=True)))
    made = make(raiser("right"), ask(prompt))
    assert made.changes == {"drawn": "raise-arm"}
    joints = HUMANML3D_263.decode(made.features)
    assert abs((joints[:, 21, 1] - joints[:, 17, 1]).max()) < 0.14
    assert make(raiser("right"), ask("her right arm stretched out to the side")).changes == {"drawn": "raise-arm"}


def test_steps_aside_are_drawn_at_the_pace_that_is_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(OneMotion, "bundle", SimpleNamespace(manifest=SimpleNamespace(draws_bearings=True)))
    request = ask("a man steps to the left fast")
    assert make(walker(), replace(request, open=True)).changes == {"drawn": "sidestep"}
    fixed = make(walker(), replace(request, frames=80))
    assert len(fixed.features) == 80
    assert "speed" not in fixed.changes


def test_a_number_of_what_is_only_drawn_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(OneMotion, "bundle", SimpleNamespace(manifest=SimpleNamespace(draws_bearings=True)))
    once, often = (
        len(make(walker(), replace(ask(f"a knight slashes {number}"), open=True)).features)
        for number in ("once", "five times")
    )
    assert often > 2 * once


def test_a_drawn_movement_behind_another_stands_still_first(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(OneMotion, "bundle", SimpleNamespace(manifest=SimpleNamespace(draws_bearings=True)))
    request = replace(ask("a man throws a jab"), open=True, beside=("walks", ""))
    joints = HUMANML3D_263.decode(make(walker(), request).features)
    assert np.abs(np.diff(joints[: CUT + 1], axis=0)).max() < 0.03
