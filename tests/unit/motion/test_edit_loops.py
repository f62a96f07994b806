"""Loops: cycles of a walk and of an idle, and motions that have none."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from marey.core.errors import InvalidInput
from marey.motion import MotionClip, edit
from marey.motion.arrange import moved, placement_of
from marey.motion.edits.loop_feet import on_the_spot, onsets, standing_spans, stands, supports
from marey.motion.edits.loop_search import cycles, has_steps
from marey.motion.edits.steps import read_steps
from marey.motion.edits.timeline_rows import cut_rows, prompt_after_cuts
from marey.motion.export_options import ExportOptions
from marey.motion.feet import find_contacts, skate
from marey.motion.kinematics import forward_kinematics
from marey.motion.retarget.apply import on_body
from marey.motion.retarget.load import load_body
from marey.motion.rotations import about, from_rotvec, multiply, rotate
from marey.motion.skeleton import HUMANML3D
from tests.support import bodies
from tests.support.loops import LOOP, idle, run, swaying, thrice, walked


@pytest.fixture(scope="module")
def walk() -> MotionClip:
    return walked()


def test_a_walk_is_played_on_without_a_seam(walk):
    (loop,) = edit(walk, [LOOP])
    first, last = loop.manifest["loop"]["source_frames"]
    assert loop.frames == last - first + 1
    played = thrice(loop)
    step, change = (np.linalg.norm(np.diff(walk.joints, n, axis=0), axis=-1) for n in (1, 2))
    mine, bend = (np.linalg.norm(np.diff(played.joints, n, axis=0), axis=-1) for n in (1, 2))
    for seam in (loop.frames - 1, 2 * (loop.frames - 1)):
        assert (mine[seam - 1 : seam + 1] <= np.percentile(step, 95, axis=0) + 1e-4).all()
        assert (bend[seam - 1] <= np.percentile(change, 95, axis=0) + 1e-4).all()
    contacts = find_contacts(played.joints, played.skeleton, 20.0)
    assert (
        skate(played.joints, contacts, played.skeleton, 20.0)
        <= 1.1 * skate(walk.joints, walk.contacts, walk.skeleton, 20.0) + 3e-3
    )


def test_a_loop_is_its_source_outside_the_blend(walk):
    (loop,) = edit(walk, [LOOP])
    (first, last), blend = loop.manifest["loop"]["source_frames"], loop.manifest["loop"]["blend_frames"]
    assert blend["first"] + blend["last"] == 6  # 0.3 s
    turn, shift = placement_of(loop)
    placed = rotate(turn, loop.joints.astype(np.float64)) + shift
    source = walk.joints[first : last + 1]
    own = slice(blend["first"], loop.frames - blend["last"])
    np.testing.assert_allclose(placed[own], source[own], atol=2e-5)
    assert np.abs(placed - source).max() > 1e-3


def test_the_last_frame_is_the_first_after_the_travel(walk):
    (closed,) = edit(walk, [LOOP])
    (open_,) = edit(walk, [{"op": "loop", "end": "open"}])
    assert open_.frames == closed.frames - 1
    np.testing.assert_allclose(open_.joints, closed.joints[:-1], atol=1e-5)
    cycle = closed.manifest["loop"]["cycle"]
    way = closed.root[-1] - closed.root[0]
    assert (way[0], way[2]) == pytest.approx((cycle["x"], cycle["z"]), abs=1e-5)
    assert cycle["z"] / cycle["seconds"] == pytest.approx(1.1, abs=0.1)
    moved = rotate(about("Y", cycle["heading"]), closed.joints[0] - closed.root[0]) + closed.root[-1]
    np.testing.assert_allclose(moved, closed.joints[-1], atol=1e-4)
    assert (closed.contacts[0] == closed.contacts[-1]).all()


def test_prompts_follow_the_frames_of_a_loop(walk):
    told = {**walk.manifest, "prompt": "both", "prompts": [[0, "a person walks"], [40, "a person goes on"]]}
    (loop,) = edit(replace(walk, manifest=told), [{"op": "loop"}])
    first, last = loop.manifest["loop"]["source_frames"]
    expected = [[0, "a person walks"], [40 - first, "a person goes on"]] if first < 40 <= last else None
    assert loop.manifest["prompts"] == (expected or [[0, "a person walks" if last < 40 else "a person goes on"]])


def test_a_walk_keeps_whole_gait_cycles(walk):
    (loop,) = edit(walk, [LOOP])
    seconds = loop.manifest["loop"]["cycle"]["seconds"]
    cycles = seconds * 1.8 / 2  # 1.8 steps a second
    assert cycles > 0.9
    assert abs(cycles - round(cycles)) < 0.08


def test_an_idle_loop_has_two_seconds_or_more():
    (loop,) = edit(idle(8.0), [LOOP])
    assert loop.manifest["loop"]["cycle"]["seconds"] >= 2.0
    with pytest.raises(InvalidInput, match="a loop without steps has 2 s or more"):
        edit(idle(1.9), [LOOP])


def leaning(seconds: float) -> MotionClip:
    """A standing body that leans over to one side and does not come back."""
    clip = idle(seconds)
    rotations, way = clip.rotations.astype(np.float64), np.tanh(np.linspace(-2.0, 2.0, clip.frames))
    rotations[:, HUMANML3D.index("spine1")] = from_rotvec(np.outer(way, [0.015, 0.0, 0.05]))
    return MotionClip.of(HUMANML3D, rotations, clip.root, clip.contacts, clip.fps)


def test_a_body_that_shifts_its_weight_fades_over_a_longer_span():
    clip = leaning(5.0)
    (loop,) = edit(clip, [LOOP])
    blend = sum(loop.manifest["loop"]["blend_frames"].values())
    assert 6 < blend <= 40
    played = thrice(loop)
    for number in (1, 2):
        source, found = (np.linalg.norm(np.diff(c.joints, number, axis=0), axis=-1) for c in (clip, played))
        assert (found.max(axis=0) <= 1.1 * source.max(axis=0) + 2e-4).all()


@pytest.mark.parametrize("speed", [0.8, 1.1, 1.4])
def test_no_joint_moves_more_at_the_seam_than_elsewhere_in_the_cycle(speed):
    """A foot that lands, or a hand that turns back, just at the seam would be a hitch in each cycle."""
    short = swaying(bodies.Body(3.6, speed=lambda t: speed + 0 * t, duty=0.6, cadence=2.0))
    (loop,) = edit(short, [LOOP])
    (in_place,) = edit(loop, [{"op": "in-place"}])
    for clip in (loop, in_place):
        joints, cycle = thrice(clip).joints.astype(np.float64), clip.frames - 1
        for number in (1, 2):
            moves = np.linalg.norm(np.diff(joints, number, axis=0), axis=-1)[:cycle]
            assert (moves[-number:].max(axis=0) - moves[:-number].max(axis=0)).max() < 7e-4


def test_a_motion_without_a_cycle_is_refused_with_the_bar_that_it_misses():
    frames = 45
    rotations = np.zeros((frames, 22, 4))
    rotations[..., 0] = 1.0
    rotations[:, HUMANML3D.index("L_shoulder")] = from_rotvec(
        np.outer(np.linspace(0, 1.0, frames) ** 3, [0.0, 0.0, 2.5])
    )
    root = np.tile([0.0, 0.94, 0.0], (frames, 1))
    rising = MotionClip.of(HUMANML3D, rotations, root, np.ones((frames, 4), bool), 20.0)
    with pytest.raises(InvalidInput, match=r"no cycle without a visible seam: .* mm (at the seam|in the blend), "):
        edit(rising, [LOOP])


def test_steps_that_make_no_whole_gait_are_refused_as_such_and_no_steps_with_their_length(walk):
    (part,) = edit(walk, [{"op": "trim", "from": "f12", "to": "f24"}])
    assert has_steps(part, part.contacts)
    with pytest.raises(InvalidInput, match=r"^ops\.0 .*no whole gait cycle, a step of each foot") as refused:
        edit(part, [LOOP])
    assert refused.value.hint == "Generate a longer one: two steps of each foot or more."
    with pytest.raises(InvalidInput, match=r"^ops\.0 .*no steps and 1\.25 s; a loop without steps has 2 s or more"):
        edit(idle(1.25), [LOOP])


def test_numbers_of_the_record_of_a_loop_have_six_decimals(walk):
    (loop,) = edit(bent(walk, 0.2), [LOOP])
    cycle = loop.manifest["loop"]["cycle"]
    assert cycle == {name: round(value, 6) for name, value in cycle.items()}


def test_a_loop_follows_its_record_through_other_operations(walk):
    (loop,) = edit(walk, [LOOP])
    x = loop.manifest["loop"]["cycle"]["x"]
    (mirrored,) = edit(loop, [{"op": "mirror"}])
    assert mirrored.manifest["loop"]["cycle"]["x"] == pytest.approx(-x)
    (fast,) = edit(loop, [{"op": "speed", "factor": 1.3}])
    cycle = fast.manifest["loop"]["cycle"]
    assert (fast.frames - 1) / 20 == pytest.approx(cycle["seconds"])
    np.testing.assert_allclose(fast.root[-1], loop.root[-1], atol=1e-4)  # the last frame is still the first, moved
    assert "loop" not in edit(loop, [{"op": "trim", "to": 0.5}])[0].manifest
    for rate in (10, 30, 60):
        (again,) = edit(loop, [{"op": "fps", "rate": rate}])
        assert again.frames == round((loop.frames - 1) * rate / 20) + 1
        np.testing.assert_allclose(again.root[-1], loop.root[-1], atol=1e-4)
    (open_,) = edit(walk, [{"op": "loop", "end": "open"}])
    with pytest.raises(InvalidInput, match="open loop"):
        edit(open_, [{"op": "fps", "rate": 30}])


def test_a_loop_in_place_stays_there(walk):
    (loop,) = edit(walk, [LOOP, {"op": "in-place"}])
    assert np.ptp(loop.root[:, [0, 2]], axis=0).max() < 1e-6
    assert loop.manifest["travel"]["z"] > 0.5
    steps = np.linalg.norm(np.diff(np.concatenate([loop.joints, loop.joints[1:3]]), axis=0), axis=-1)
    assert steps[loop.frames - 1].max() <= steps[: loop.frames - 1].max() + 2e-3


def bent(clip: MotionClip, speed: float) -> MotionClip:
    """A clip that turns to the left besides, at so many radians a second."""
    turn = about("Y", speed * np.arange(clip.frames) / clip.fps)
    steps = np.diff(clip.root.astype(np.float64), axis=0, prepend=0.0)
    rotations = clip.rotations.astype(np.float64)
    rotations[:, 0] = multiply(turn, rotations[:, 0])
    return MotionClip.of(clip.skeleton, rotations, np.cumsum(rotate(turn, steps), axis=0), clip.contacts, clip.fps)


@pytest.mark.parametrize("way", ["edit", "export", "edit, then export", "rig"])
def test_a_loop_in_place_ends_as_it_began_although_its_cycle_turns(walk, way):
    (loop,) = edit(bent(walk, 0.2), [LOOP])
    turn = loop.manifest["loop"]["cycle"]["heading"]
    assert turn == pytest.approx(0.2 * loop.manifest["loop"]["cycle"]["seconds"], abs=0.05)
    if way.startswith("edit"):
        (loop,) = edit(loop, [{"op": "in-place"}])
        assert loop.manifest["loop"]["cycle"] | {"seconds": 0} == {"x": 0, "z": 0, "heading": 0, "seconds": 0}
        assert loop.manifest["travel"]["heading"] == pytest.approx(turn, abs=1e-4)
    options = ExportOptions(in_place="travel") if "export" in way or way == "rig" else ExportOptions()
    if way == "rig":
        places = on_body(loop, load_body("mixamo"), options).world()[1]
    else:
        rotations, root, heading, removed = moved(loop, options)
        places = forward_kinematics(loop.skeleton, rotations, root)
        np.testing.assert_allclose(np.abs(heading[-1]), np.abs(heading[0]), atol=1e-4)
        if way == "export":
            assert removed["travel"]["heading"] == pytest.approx(turn, abs=1e-4)
    np.testing.assert_allclose(places[-1], places[0], atol=1e-4)


@pytest.mark.parametrize("remove", ["travel", "heading"])
@pytest.mark.parametrize("end", ["closed", "open"])
def test_a_loop_in_place_is_on_a_rig_as_one_of_many_cycles(walk, end, remove):
    """Legs of other proportions move the hips; where a cycle begins anew, they have to be where it ended."""
    body, options = load_body("mixamo"), ExportOptions(in_place=remove)
    (loop,) = edit(bent(walk, 0.2), [{"op": "loop", "end": end}])
    cycle = loop.frames - (end == "closed")
    rotations, root, *_ = moved(loop, options)
    parts = rotations[:cycle], root[:cycle], loop.contacts[:cycle]
    many = MotionClip.of(loop.skeleton, *(np.concatenate([part] * 5) for part in parts), loop.fps)
    wanted = on_body(many, body).world()[1][2 * cycle : 3 * cycle]
    np.testing.assert_allclose(on_body(loop, body, options).world()[1][:cycle], wanted, atol=1e-4)


@pytest.mark.parametrize("placement", ["origin", "keep"])
def test_a_loop_that_travels_ends_on_a_rig_as_it_began(walk, placement):
    body = load_body("mixamo")
    (loop,) = edit(bent(walk, 0.2), [LOOP])
    motion = on_body(loop, body, ExportOptions(placement=placement))
    places = motion.world()[1]
    first, last = (places[k] - places[k, motion.hips] for k in (0, -1))
    turn = about("Y", loop.manifest["loop"]["cycle"]["heading"])
    np.testing.assert_allclose(rotate(turn, first), last, atol=1e-4)
    assert places[-1, motion.hips, 1] == pytest.approx(places[0, motion.hips, 1], abs=1e-4)


@pytest.mark.parametrize(
    "record",
    [{"end": "soon", "cycle": {"x": 0, "z": 1, "heading": 0}}, {"end": "open", "cycle": {}}, {"end": "open"}, "x"],
)
def test_a_loop_on_a_rig_whose_record_cannot_be_read_is_refused(walk, record):
    with pytest.raises(InvalidInput, match="loop"):
        on_body(replace(walk, manifest={**walk.manifest, "loop": record}), load_body("mixamo"))


def test_a_turn_in_place_stays_a_turn(walk):
    clip = bent(walk, 0.2)
    rotations, *_ = moved(clip, ExportOptions(in_place="travel"))
    np.testing.assert_array_equal(rotations, clip.rotations)


def test_a_loop_whose_record_has_no_numbers_is_refused_in_place(walk):
    for cycle in (
        {"heading": "left", "seconds": 1},
        {"heading": 0.1, "seconds": 0},
        [],
        {"heading": float("nan"), "seconds": 1},
    ):
        broken = replace(walk, manifest={**walk.manifest, "loop": {"cycle": cycle}})
        with pytest.raises(InvalidInput, match=r"loop\.cycle"):
            moved(broken, ExportOptions(in_place="travel"))


def test_a_run_has_steps_where_its_contacts_are_not_found():
    clip = run()
    assert not clip.contacts[:, 2:].any()
    feet = supports(clip.joints, clip.contacts, clip.skeleton, clip.fps)
    begins = [(begin, foot) for begin, _, foot in standing_spans(feet)]
    assert [foot for _, foot in begins] == [0, 1, 0, 1, 0]
    assert set(np.diff([begin for begin, _ in begins])) <= {6, 7}
    (loop,) = edit(clip, [LOOP])
    assert loop.manifest["loop"]["cycle"]["seconds"] == pytest.approx(2 / 3, abs=0.051)


def test_a_walk_is_told_by_its_contacts_alone(walk):
    assert (supports(walk.joints, walk.contacts, walk.skeleton, 20.0) == stands(walk.contacts)).all()


def test_both_feet_step_in_the_cycle_wherever_its_seam_is():
    clip = run()
    feet = supports(clip.joints, clip.contacts, clip.skeleton, clip.fps)
    steps = onsets(feet)
    found = list(cycles(clip, clip.contacts, 6, 100))
    assert found
    for cycle in found:
        for earlier in range(min(cycle.first, 6) + 1):
            assert steps[cycle.first - earlier + 1 : cycle.last - earlier + 1].any(axis=0).all()


def test_all_pairs_are_tried_before_a_motion_is_refused(walk):
    few, all_ = ({(each.first, each.last) for each in cycles(walk, walk.contacts, 6, 10_000, n)} for n in (1, 0))
    assert few < all_


def treadmill(clip: MotionClip) -> MotionClip:
    """A walk whose root stays, as clips of games have it: feet slide back, and none stands."""
    root = clip.root * np.array([0.0, 1.0, 0.0], np.float32)
    return MotionClip.of(clip.skeleton, clip.rotations, root, np.zeros((clip.frames, 4), bool), clip.fps)


def test_a_walk_on_the_spot_keeps_whole_gait_cycles():
    clip = treadmill(walked(3.4))
    feet = supports(clip.joints, clip.contacts, clip.skeleton, clip.fps)
    begins = [foot for _, _, foot in standing_spans(feet)]
    assert len(begins) >= 5
    assert all(foot != other for foot, other in pairwise(begins))
    assert has_steps(clip, clip.contacts)
    (loop,) = edit(clip, [LOOP])
    count = loop.manifest["loop"]["cycle"]["seconds"] * 1.8 / 2
    assert abs(count - round(count)) < 0.08
    assert loop.manifest["loop"]["cycle"]["z"] == pytest.approx(0, abs=0.01)


def test_a_walk_on_the_spot_is_still_for_a_frame_now_and_then():
    clip = treadmill(walked(3.4))
    contacts = clip.contacts.copy()
    contacts[10::10, 1] = True
    expected = on_the_spot(clip.joints, clip.contacts, clip.skeleton)
    assert expected.any()
    np.testing.assert_array_equal(on_the_spot(clip.joints, contacts, clip.skeleton), expected)


@pytest.mark.parametrize("case", ["stands", "travels", "one foot"])
def test_other_bodies_do_not_walk_on_the_spot(case, walk):
    clip = treadmill(walk)
    joints, contacts = clip.joints.astype(np.float64), clip.contacts.copy()
    if case == "stands":
        contacts[: len(contacts) // 3, 0] = True
    elif case == "travels":
        joints = walk.joints.astype(np.float64)
    else:
        joints[:, clip.skeleton.index("L_foot"), 1] += 0.5
    assert not on_the_spot(joints, contacts, clip.skeleton).any()


def test_a_loop_of_a_timeline_has_the_rows_of_its_cycle():
    clip, rows = walked(), [(0.0, 2.0, "a person walks"), (2.0, 6.0, "a person walks on")]
    told = [{"start": start, "end": end, "prompt": text} for start, end, text in rows]
    manifest: dict[str, Any] = {
        "prompt": "0-2 a person walks; 2-6 a person walks on",
        "prompts": [[0, "a person walks"], [40, "a person walks on"]],
        "timeline": {"rows": told, "transitions": [], "gaps": []},
    }
    (loop,) = edit(replace(clip, manifest=manifest), [LOOP])
    first, last = loop.manifest["loop"]["source_frames"]
    expected = cut_rows(manifest, first, last, clip.fps)
    assert loop.manifest["prompt"] == expected["prompt"] != manifest["prompt"]
    assert loop.manifest.get("timeline") == expected.get("timeline")
    steps = read_steps([LOOP])
    assert prompt_after_cuts(manifest, manifest["prompt"], steps, clip.frames, clip.fps) == (manifest["prompt"], steps)


def test_a_foot_begins_to_stand_in_the_first_frame_of_each_stand_but_in_no_first_frame():
    feet = np.array([[1, 0], [1, 1], [0, 1], [1, 0], [1, 1]], bool)
    found = onsets(feet)
    assert found.dtype == bool
    assert [tuple(place) for place in np.argwhere(found)] == [(1, 1), (3, 0), (4, 1)]
