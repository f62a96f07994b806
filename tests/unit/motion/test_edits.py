"""Operations on motions: identities, place, provenance."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from marey.core.errors import InvalidInput, TooLarge
from marey.items.timeline import timeline_text
from marey.motion import MotionClip, edit, load_npz
from marey.motion.arrange import placement_of
from marey.motion.edits import editing
from marey.motion.edits.editing import EditSource
from marey.motion.edits.prompts import prompt_of
from marey.motion.edits.steps import pieces_of, read_steps
from marey.motion.edits.table import OPERATIONS
from marey.motion.edits.timeline_rows import frames_at_speed, prompt_after_cuts
from marey.motion.features import HUMANML3D_263
from marey.motion.feet import skate
from marey.motion.finish import finish_motion
from marey.motion.kinematics import facing, forward_kinematics
from marey.motion.pose import solve_pose
from marey.motion.rotations import about, multiply, rotate
from marey.motion.skeleton import HUMANML3D, Skeleton
from tests.support import bodies
from tests.support.motions import dancer
from tests.support.walker import walker

MILLIMETRE = 1e-3
EXACT = 1e-5
"""Metres: float32 over some metres of travel."""
clips = st.builds(
    lambda seed, frames, turn: dance(seed, frames, turn), st.integers(0, 99), st.integers(8, 60), st.floats(-3, 3)
)


def dance(seed: int, frames: int = 60, turn: float = 0.0) -> MotionClip:
    """A dancer who begins anywhere and faces anywhere."""
    rotations, root = dancer(seed, frames)
    rotations[:, 0] = multiply(about("Y", turn), rotations[:, 0])
    joints = forward_kinematics(HUMANML3D, rotations, root)
    contacts = joints[:, list(HUMANML3D.feet), 1] < 0.1
    manifest = {"prompt": "a person waves with the left hand", "licence": "CC-BY-4.0"}
    return MotionClip.of(HUMANML3D, rotations, root, contacts, 20.0, manifest=manifest)


def one(clip: MotionClip, *ops: dict) -> MotionClip:
    (result,) = edit(clip, ops)
    return result


def placed(clip: MotionClip) -> np.ndarray:
    """Joints where the manifest says that the motion was taken from."""
    turn, shift = placement_of(clip)
    return rotate(turn, clip.joints.astype(np.float64)) + shift


def same(a: MotionClip, b: MotionClip, limit: float = EXACT) -> None:
    assert a.frames == b.frames
    np.testing.assert_allclose(placed(a), placed(b), atol=limit)


def faces_z_at_the_origin(clip: MotionClip) -> bool:
    x, _, z = facing(clip.joints[0].astype(np.float64), clip.skeleton)
    return abs(np.arctan2(x, z)) < 0.036 and np.hypot(*clip.root[0, [0, 2]]) < 6e-3


@settings(max_examples=25, deadline=None)
@given(clip=clips, data=st.data())
def test_pieces_joined_again_are_the_motion(clip, data):
    at = data.draw(st.integers(0, clip.frames - 1))
    first, second = edit(clip, [{"op": "split", "at": f"f{at}"}])
    assert (first.frames, second.frames) == (at + 1, clip.frames - at)
    assert faces_z_at_the_origin(first)
    assert faces_z_at_the_origin(second)
    same(second, replace(clip, joints=clip.joints[at:], root=clip.root[at:]))
    whole = one(first, {"op": "concat", "with": second})
    same(whole, clip)
    np.testing.assert_array_equal(whole.contacts, clip.contacts)


@settings(max_examples=25, deadline=None)
@given(clip=clips)
def test_twice_is_the_motion_again(clip):
    for name in ("mirror", "reverse"):
        twice = one(one(clip, {"op": name}), {"op": name})
        same(twice, clip)
        np.testing.assert_array_equal(twice.contacts, clip.contacts)
        assert twice.manifest["prompt"] == clip.manifest["prompt"]
        assert faces_z_at_the_origin(one(clip, {"op": name}))


def test_twice_is_the_motion_again_to_the_last_place():
    """Without any placement: a motion that stands at its own place is there again."""
    clip = walker(seconds=3.0, turn=0.4)
    for name in ("mirror", "reverse"):
        twice = one(one(clip, {"op": name}), {"op": name})
        assert "placement" not in twice.manifest
        np.testing.assert_allclose(twice.joints, clip.joints, atol=EXACT)


@settings(max_examples=25, deadline=None)
@given(clip=clips, factor=st.sampled_from([2.0, 4.0, 0.5]))
def test_faster_and_slower_again_is_the_motion(clip, factor):
    back = one(clip, {"op": "speed", "factor": factor}, {"op": "speed", "factor": 1 / factor})
    same(back, clip, 5 * MILLIMETRE)
    slower = one(one(clip, {"op": "speed", "factor": 0.5}), {"op": "speed", "factor": 2})
    same(slower, clip, 5 * MILLIMETRE)


def test_twice_as_fast_in_two_edits_is_within_5_mm_for_a_calm_motion():
    clip = dance(3, 81)
    slow = one(clip, {"op": "speed", "factor": 0.25})
    fast = one(slow, {"op": "speed", "factor": 2})
    same(one(fast, {"op": "speed", "factor": 0.5}), slow, 5 * MILLIMETRE)


def test_a_mirrored_motion_is_the_other_side():
    clip = dance(1, 30)
    clip = replace(clip, manifest={**clip.manifest, "scope": {"actions": [{"text": "Left-handed wave"}]}})
    mirrored = one(clip, {"op": "mirror"})
    swapped = clip.joints[:, list(HUMANML3D.mirror)] * np.array([-1, 1, 1])
    np.testing.assert_allclose(placed(mirrored), swapped, atol=EXACT)
    np.testing.assert_array_equal(mirrored.contacts, clip.contacts[:, [2, 3, 0, 1]])
    assert mirrored.manifest["prompt"] == "a person waves with the right hand"
    assert mirrored.manifest["scope"]["actions"][0]["text"] == "Right-handed wave"


def test_a_mirrored_body_has_mirrored_bones():
    offsets = HUMANML3D.offsets.copy()
    offsets[HUMANML3D.index("L_knee"), 1] -= 0.05
    rotations, root = dancer(2, 20)
    clip = MotionClip.of(HUMANML3D.with_offsets(offsets), rotations, root, np.zeros((20, 4), bool), 20.0)
    mirrored = one(clip, {"op": "mirror"})
    np.testing.assert_allclose(
        placed(mirrored), clip.joints[:, list(HUMANML3D.mirror)] * np.array([-1, 1, 1]), atol=EXACT
    )


def test_trim_keeps_both_ends_and_the_place():
    clip = walker(seconds=3.0, turn=0.5)
    kept = one(clip, {"op": "trim", "from": 0.5, "to": "f30"})
    assert kept.frames == 21
    assert faces_z_at_the_origin(kept)
    assert kept.manifest["placement"]["z"] > 0.4
    np.testing.assert_allclose(placed(kept), clip.joints[10:31], atol=EXACT)
    again = one(kept, {"op": "trim", "from": 0.2})  # placements add up
    np.testing.assert_allclose(placed(again), clip.joints[14:31], atol=EXACT)


def test_motions_join_where_the_last_pose_stands_and_nothing_jumps():
    first, second = dance(4, 40, turn=1.0), dance(5, 50, turn=-2.0)
    whole = one(first, {"op": "concat", "with": second, "blend": 0.25})
    assert whole.frames == 40 + 50 - 1
    same(one(whole, {"op": "trim", "to": "f39"}), one(first, {"op": "trim"}))
    steps = np.linalg.norm(np.diff(whole.joints, axis=0), axis=-1)
    usual = max(np.linalg.norm(np.diff(c.joints, axis=0), axis=-1).max() for c in (first, second))
    blunt = one(first, {"op": "concat", "with": second, "blend": 0})
    assert np.linalg.norm(np.diff(blunt.joints, axis=0), axis=-1)[39].max() > 3 * usual
    assert steps[38:46].max() < 3 * usual
    change = np.linalg.norm(np.diff(whole.joints, 2, axis=0), axis=-1)[38].max()
    assert change < 0.5 * np.linalg.norm(np.diff(blunt.joints, 2, axis=0), axis=-1)[38].max()
    tail = one(whole, {"op": "trim", "from": "f44"})  # after 5 frames of blending: the second motion
    np.testing.assert_allclose(one(second, {"op": "trim", "from": "f5"}).joints, tail.joints, atol=EXACT)


def timeline_of(frames: int = 60) -> MotionClip:
    """A motion of three prompts, as a timeline's manifest says it."""
    prompts = [[0, "a person walks"], [20, "a person bows"], [40, "a person waves"]]
    told = {"prompt": "0-1 …", "prompts": prompts, "timeline": {"rows": []}, "constraints": [{"type": "root_path"}]}
    return replace(dance(1, frames), manifest=told)


@pytest.mark.parametrize(
    ("op", "expected"),
    [
        ({"op": "trim", "from": "f30", "to": "f45"}, [[0, "a person bows"], [10, "a person waves"]]),
        ({"op": "trim", "from": "f25", "to": "f35"}, [[0, "a person bows"]]),
        ({"op": "reverse"}, [[0, "a person waves"], [20, "a person bows"], [40, "a person walks"]]),
        ({"op": "speed", "factor": 2}, [[0, "a person walks"], [10, "a person bows"], [20, "a person waves"]]),
        ({"op": "fps", "rate": 40}, [[0, "a person walks"], [40, "a person bows"], [80, "a person waves"]]),
        ({"op": "mirror"}, [[0, "a person walks"], [20, "a person bows"], [40, "a person waves"]]),
    ],
)
def test_prompts_follow_their_frames(op: dict, expected: list):
    about = one(timeline_of(), op).manifest
    assert about["prompts"] == expected
    assert not {"timeline", "constraints"} & set(about)  # of the frames of the source


@given(st.integers(0, 58), st.integers(1, 59), st.floats(0.2, 4))
@settings(deadline=None, max_examples=30)
def test_each_frame_keeps_its_prompt(first: int, length: int, factor: float):
    last = min(first + length, 59)
    result = one(
        timeline_of(), {"op": "trim", "from": f"f{first}", "to": f"f{last}"}, {"op": "speed", "factor": factor}
    )
    told = result.manifest["prompts"]
    source = {"a person walks": 0, "a person bows": 20, "a person waves": 40}
    for frame, text in told[1:]:
        assert source[text] <= first + frame * factor + 1e-5 < source[text] + max(factor, 1) + 1e-5
    assert told[0][0] == 0
    assert all(frame < result.frames for frame, _ in told)


def with_rows() -> MotionClip:
    """A motion of three prompts of a second each, and a gap of half a second, with the record of a timeline."""
    times = ((0.0, 1.0, "a person walks"), (1.0, 2.0, "a person bows"), (2.5, 3.0, "a person waves left"))
    rows = [
        {"start": start, "end": end, "prompt": prompt, "rewritten": prompt, "graph": {"of": prompt}, "match": 0.9}
        for start, end, prompt in times
    ]
    spans = {"transitions": [{"start": 1.0, "end": 1.2, "seed": 4}], "gaps": [{"start": 2.0, "end": 2.5}]}
    text = "0-1 a person walks; 1-2 a person bows; 2.5-3 a person waves left"
    told = {
        "prompt": text,
        "rewritten": text,
        "scope": {},
        "prompts": [[0, "a person walks"], [20, "a person bows"], [50, "a person waves left"]],
        "timeline": {"rows": rows, **spans},
    }
    return replace(dance(1, 60), manifest=told)


@pytest.mark.parametrize(
    ("ops", "prompt"),
    [
        ([{"op": "trim", "from": 0.5}], "0-0.5 a person walks; 0.5-1.5 a person bows; 2-2.5 a person waves left"),
        ([{"op": "trim", "to": "f39"}], "0-1 a person walks; 1-2 a person bows"),
        ([{"op": "trim", "from": "f20", "to": "f39"}], "a person bows"),
        ([{"op": "trim", "from": "f42", "to": "f47"}], "a person bows"),  # the gap after it
        ([{"op": "trim", "from": 1}, {"op": "trim", "to": 0.5}], "a person bows"),
        ([{"op": "fps", "rate": 40}, {"op": "trim", "to": "f79"}], "0-1 a person walks; 1-2 a person bows"),
        ([{"op": "mirror"}, {"op": "trim", "from": 1}], "0-1 a person bows; 1.5-2 a person waves right"),
        ([{"op": "trim", "from": 1}, {"op": "mirror"}], "0-1 a person bows; 1.5-2 a person waves right"),
        ([{"op": "smooth", "hz": 6}], "0-1 a person walks; 1-2 a person bows; 2.5-3 a person waves left"),
        ([{"op": "trim", "to": "f39"}, {"op": "reverse"}], "0-1 a person bows; 1-2 a person walks"),
        ([{"op": "reverse"}], "0-0.5 a person waves left; 1-2 a person bows; 2-3 a person walks"),
        ([{"op": "reverse"}, {"op": "trim", "to": 1.4}], "0-0.5 a person waves left; 1-1.45 a person bows"),
        ([{"op": "speed", "factor": 2}], "0-0.5 a person walks; 0.5-1 a person bows; 1.25-1.5 a person waves left"),
        ([{"op": "speed", "factor": 0.5}], "0-2 a person walks; 2-4 a person bows; 5-5.95 a person waves left"),
        (
            [{"op": "speed", "factor": 2}, {"op": "trim", "from": "f10"}],
            "0-0.5 a person bows; 0.75-1 a person waves left",
        ),
    ],
)
def test_a_cut_timeline_says_what_is_left(ops: list[dict[str, Any]], prompt: str):
    source = with_rows()
    about = one(source, *ops).manifest
    assert about["prompt"] == prompt
    if ";" not in prompt:
        assert (about["rewritten"], about["graph"]) == (prompt, {"of": prompt})
        assert not {"timeline", "prompts"} & set(about)
    else:
        assert timeline_text(read_timeline_rows(about["timeline"]["rows"])) == prompt
        assert [text for _, text in about["prompts"]] == [row["prompt"] for row in about["timeline"]["rows"]]
    told, rest = prompt_after_cuts(source.manifest, source.manifest["prompt"], read_steps(ops), 60, 20.0)
    assert prompt_of(told, rest, lambda step: "") == prompt


def test_spans_of_a_cut_timeline_are_moved_and_matches_of_whole_rows_dropped():
    record = one(with_rows(), {"op": "trim", "from": 1.1}).manifest["timeline"]
    assert [(row["start"], row["end"], row["match"]) for row in record["rows"]] == [(0.0, 0.9, None), (1.4, 1.9, None)]
    assert record["transitions"] == [{"start": 0.0, "end": 0.1, "seed": 4}]
    assert record["gaps"] == [{"start": 0.9, "end": 1.4}]


def test_spans_of_a_timeline_that_is_played_backwards_or_faster_follow_their_frames():
    record = one(with_rows(), {"op": "reverse"}).manifest["timeline"]
    assert record["transitions"] == [{"start": 1.8, "end": 2.0, "seed": 4}]
    assert record["gaps"] == [{"start": 0.5, "end": 1.0}]
    assert [row["match"] for row in record["rows"]] == [None] * 3
    faster = one(with_rows(), {"op": "speed", "factor": 2}).manifest["timeline"]
    assert faster["transitions"] == [{"start": 0.5, "end": 0.6, "seed": 4}]
    assert one(with_rows(), {"op": "reverse"}, {"op": "reverse"}).manifest["prompt"] == with_rows().manifest["prompt"]


@pytest.mark.parametrize("factor", [0.7, 1.5, 9.0])
def test_a_loop_of_a_timeline_at_another_speed_has_the_prompt_and_the_frames_that_are_told_before(factor: float):
    loop = {"end": "closed", "cycle": {"seconds": 2.95, "x": 0.0, "z": 0.0, "heading": 0.0}}
    clip = replace(with_rows(), manifest={**with_rows().manifest, "loop": loop})
    step = {"op": "speed", "factor": factor}
    faster = one(clip, step)
    assert faster.frames == frames_at_speed(clip.frames, factor, cycle=True)
    told = prompt_after_cuts(clip.manifest, clip.manifest["prompt"], read_steps([step]), clip.frames, clip.fps)
    assert told == (faster.manifest["prompt"], ())


def test_a_cycle_has_a_frame_besides_its_first_however_fast_it_is():
    assert frames_at_speed(2, 4.0, cycle=True) == 2
    assert frames_at_speed(2, 4.0) == 1


@pytest.mark.parametrize(
    "op",
    [
        {"op": "trim", "from": 0.5}, {"op": "reverse"}, {"op": "smooth", "hz": 4}, {"op": "feet", "mode": "lock"},
        {"op": "split", "at": 1.0}, {"op": "concat", "with": "next"}, {"op": "mirror"}, {"op": "speed", "factor": 2},
        {"op": "in-place"}, {"op": "fps", "rate": 30},
    ],
    ids=lambda op: op["op"],
)  # fmt: skip
def test_an_operation_on_a_loop_keeps_its_record_or_leaves_it_out(op: dict[str, Any]):
    loop = {"end": "closed", "cycle": {"seconds": 2.95, "x": 0.0, "z": 0.0, "heading": 0.0}}
    clip = replace(dance(1, 60), manifest={"loop": loop})
    kept = OPERATIONS[op["op"]].keeps_cycle
    for made in edit(clip, [op], load=lambda _: dance(2, 30)):
        assert ("loop" in made.manifest) is kept


def test_a_moment_beyond_the_motion_leaves_the_prompt_to_the_worker():
    about = with_rows().manifest
    told, rest = prompt_after_cuts(about, about["prompt"], read_steps([{"op": "trim", "from": 99}]), 60, 20.0)
    assert (told, len(rest)) == (about["prompt"], 1)
    cut = read_steps([{"op": "trim", "to": 1}])
    assert prompt_after_cuts({}, "a person walks", cut, 60, 20.0) == ("a person walks", cut)


def read_timeline_rows(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    return [{name: row[name] for name in ("start", "end", "prompt")} for row in rows]


def test_pieces_of_a_split_have_their_own_prompts():
    pieces = edit(timeline_of(), [{"op": "split", "at": "f30"}])
    firsts = [[[0, "a person walks"], [20, "a person bows"]], [[0, "a person bows"], [10, "a person waves"]]]
    assert [piece.manifest["prompts"] for piece in pieces] == firsts


def test_prompts_of_a_joined_motion_are_counted_at_the_rate_of_the_first():
    second = one(timeline_of(), {"op": "fps", "rate": 60})
    about = one(dance(2, 30), {"op": "concat", "with": second}).manifest
    assert [frame for frame, _ in about["prompts"]] == [0, 29, 49, 69]


def test_joined_motions_keep_both_prompts_and_the_strictest_licence():
    first, second = dance(1, 30), dance(2, 30)
    second = replace(second, manifest={"prompt": "a person bows", "licence": "CC-BY-NC-4.0", "rewritten": "bows"})
    whole = one(first, {"op": "concat", "with": EditSource(second, "bow.npz", "ab" * 32)})
    about = whole.manifest
    assert about["prompt"] == "a person waves with the left hand, then a person bows"
    assert about["prompts"] == [[0, "a person waves with the left hand"], [29, "a person bows"]]
    assert about["licence"] == "CC-BY-NC-4.0"
    assert [each["licence"] for each in about["edited_from"]["sources"]] == ["CC-BY-4.0", "CC-BY-NC-4.0"]
    assert about["edited_from"]["sources"][1]["sha256"] == about["edited_from"]["ops"][0]["with"] == "ab" * 32
    shared = replace(second, manifest={"licence": "CC-BY-SA-4.0"})
    with pytest.raises(InvalidInput, match=r"^licence: .*no licence satisfies both"):
        edit(whole, [{"op": "concat", "with": shared}])


def test_other_bodies_are_not_joined():
    other = dance(2, 20)
    taller = other.skeleton.with_offsets(1.1 * other.skeleton.offsets)
    with pytest.raises(InvalidInput, match="bodies differ"):
        edit(dance(1, 20), [{"op": "concat", "with": replace(other, skeleton=taller)}])


def test_in_place_records_what_it_removes():
    clip = walker(seconds=2.0, turn=0.6)
    still = one(clip, {"op": "in-place", "remove": "heading"})
    assert np.ptp(still.root[:, [0, 2]], axis=0).max() == 0
    assert still.manifest["travel"]["heading"] == pytest.approx(1.2, abs=1e-3)
    forward = facing(still.joints[-1].astype(np.float64), still.skeleton)
    assert forward[2] == pytest.approx(1.0, abs=1e-3)
    turning = one(clip, {"op": "in-place"})
    assert facing(turning.joints[-1].astype(np.float64), turning.skeleton)[2] < 0.5


def test_smoothing_removes_trembling_and_keeps_the_ends():
    clip = one(dance(6, 60), {"op": "speed", "factor": 0.25})
    clip = replace(clip, manifest={})
    noise = np.random.default_rng(0).normal(scale=0.003, size=clip.root.shape)
    shaky = MotionClip.of(clip.skeleton, clip.rotations, clip.root + noise, clip.contacts, clip.fps)
    smooth = one(shaky, {"op": "smooth", "hz": 3})
    calm, rough = (np.abs(np.diff(each.joints, 2, axis=0)).mean() for each in (smooth, shaky))
    assert calm < 0.4 * rough
    assert np.abs(placed(smooth)[[0, -1]] - shaky.joints[[0, -1]]).max() < 10 * MILLIMETRE
    assert np.abs(placed(smooth) - clip.joints).mean() < 5 * MILLIMETRE


def stepping(seconds: float = 4.0) -> MotionClip:
    """A walk whose standing feet slide to the side."""
    joints = bodies.Body(seconds, speed=lambda t: 1.1 + 0 * t).joints()
    joints[..., 0] += 0.05 * np.sin(3 * np.arange(len(joints)) / 20.0)[:, None]
    pose = solve_pose(joints, HUMANML3D, fps=20.0)
    return MotionClip.of(pose.skeleton, pose.rotations, pose.root, np.zeros((len(joints), 4), bool), 20.0)


def test_standing_feet_are_locked():
    clip = stepping()
    locked = one(clip, {"op": "feet", "mode": "lock"})
    slides = [skate(each.joints, locked.contacts, each.skeleton, 20.0) for each in (clip, locked)]
    assert slides[1] < 0.2 * slides[0]
    np.testing.assert_allclose(placed(locked)[:, 12:], clip.joints[:, 12:], atol=20 * MILLIMETRE)  # arms and head


def test_contacts_are_found_again_and_nothing_moves():
    clip = stepping()
    free = one(clip, {"op": "feet", "mode": "free"})
    assert free.contacts.any()
    np.testing.assert_allclose(placed(free), clip.joints, atol=EXACT)


def test_raw_feet_are_those_of_the_model():
    features = HUMANML3D_263.encode(stepping().joints.astype(np.float64))
    clean = finish_motion(features, HUMANML3D_263)
    raw = one(clean, {"op": "feet", "mode": "raw"})
    wanted = finish_motion(features, HUMANML3D_263, clean=False)
    same(raw, wanted, 2 * MILLIMETRE)
    assert np.abs(clean.joints - wanted.joints).max() > 5 * MILLIMETRE
    assert raw.manifest["feet_cleaned"] is False
    with pytest.raises(InvalidInput, match="no features"):
        edit(clean, [{"op": "mirror"}, {"op": "feet", "mode": "raw"}])


def test_results_have_no_features_and_name_their_source(tmp_path):
    clip = replace(walker(), features=np.ones((4, 263), np.float32), features_fps=20.0)
    clip = replace(clip, manifest={**clip.manifest, "quality": {"ok": True}, "selection": {"chosen": 1}})
    clip.save_npz(tmp_path / "a.npz")
    kept = one(load_npz(tmp_path / "a.npz"), {"op": "trim", "to": 1.0}, {"op": "fps", "rate": 30})
    assert kept.features.shape == (0, 0)
    assert kept.features_fps == 0
    assert kept.fps == 30
    assert kept.frames == 31
    assert not {"quality", "selection"} & kept.manifest.keys()
    record = kept.manifest["edited_from"]
    assert record["ops"] == [{"op": "trim", "from": 0.0, "to": 1.0}, {"op": "fps", "rate": 30.0}]
    assert record["sources"][0]["sha256"] == hashlib.sha256((tmp_path / "a.npz").read_bytes()).hexdigest()
    twice = one(kept, {"op": "mirror"})
    assert twice.manifest["edited_from"]["sources"][0]["edited_from"] == record
    kept.save_npz(tmp_path / "b.npz")
    same(load_npz(tmp_path / "b.npz"), kept)


def test_splits_make_at_most_32_pieces():
    steps = read_steps([{"op": "split", "at": "f2"}] * 5)
    assert len(pieces_of(steps)) == 32
    with pytest.raises(TooLarge, match=r"^ops\.5: 6 splits make 64 pieces"):
        pieces_of(read_steps([{"op": "split", "at": "f2"}] * 32)[:6])


def test_the_prompt_of_a_result_is_known_before_it_is_made():
    clip, other = walker(prompt="a person turns left"), walker(prompt="a person waves")
    ops = [{"op": "mirror"}, {"op": "concat", "with": other}, {"op": "reverse"}]
    (made,) = edit(clip, ops)
    assert prompt_of("a person turns left", read_steps(ops), lambda _: "a person waves") == made.manifest["prompt"]


def test_names_of_digits_are_no_numbers():
    assert OPERATIONS["concat"].values_of_text("01234567") == {"with": "01234567"}
    assert OPERATIONS["concat"].values_of_text("1234e567") == {"with": "1234e567"}


def test_unknown_sides_are_not_mirrored():
    tree = Skeleton("other", ("a", "b", "c"), (-1, 0, 1), np.ones((3, 3), np.float32), (0, 1, 2))
    rotations = np.tile([1.0, 0, 0, 0], (5, 3, 1))
    clip = MotionClip.of(tree, rotations, np.zeros((5, 3)), np.zeros((5, 4), bool), 20.0)
    with pytest.raises(InvalidInput, match=r"ops.0 \(mirror\).*do not tell left from right"):
        edit(clip, [{"op": "mirror"}])
    assert one(clip, {"op": "reverse"}).frames == 5


@pytest.mark.parametrize(
    ("ops", "said"),
    [
        ("mirror", "is not a list"),
        ([], "0 operations"),
        (["mirror"], "is not an object"),
        ([{"op": "fly"}], "unknown operation"),
        ([{"op": "mirror", "axis": "x"}], "unknown parameter 'axis'"),
        ([{"op": "speed"}], r"ops.0\.factor: is missing"),
        ([{"op": "speed", "factor": True}], "True is not a number from 0.1 to 10"),
        ([{"op": "speed", "factor": float("nan")}], "is not a number"),
        ([{"op": "trim", "from": "1.5"}], "is not seconds"),
        ([{"op": "trim", "from": 99}], "99 s is after the end of the motion"),
        ([{"op": "trim", "from": "f5", "to": "f4"}], "before the beginning"),
        ([{"op": "loop", "blend": 0.5}], "0.5 is not a number from 0.1 to 0.3"),
        ([{"op": "feet", "mode": "soft"}], "'soft' is not lock or free or raw"),
        ([{"op": "concat", "with": ["a"]}], "is not the name of a motion"),
        ([{"op": "mirror"}] * 33, "33 operations"),
        ([{"op": "speed", "factor": 0.1}] * 5, r"ops.4 \(speed\): the result would have 4e\+06 frames"),
        ([{"op": "speed", "factor": 0.1}] * 32, r"ops.31 \(speed\): the result would have 4e\+33 frames"),
        ([{"op": "speed", "factor": 0.1}, {"op": "fps", "rate": 1}, {"op": "fps", "rate": 240}] * 5, "would have"),
        ([{"op": "extend", "seconds": 1, "seed": float("inf")}], "inf is not a whole number"),
        ([{"op": "extend", "seconds": 1, "seed": float("nan")}], "nan is not a whole number"),
        ([{"op": "extend", "seconds": 1, "seed": 10**400}], "is not a whole number"),
    ],
)
def test_what_cannot_be_done_is_said(ops, said):
    with pytest.raises(InvalidInput, match=said) as refused:
        edit(walker(), ops)
    where, row = str(refused.value.where), next((n for n, op in enumerate(ops) if ops.count(op) == 1), None)
    assert where.startswith("ops" if len(ops) > 9 or row is None or ops == "mirror" else f"ops.{row}")


def test_prompts_hold_marks_that_scripts_need():
    (step,) = read_steps([{"op": "repaint", "prompt": "a person\u200f  walks"}])
    assert step.values["prompt"] == "a person\u200f walks"
    with pytest.raises(InvalidInput, match="printable"):
        read_steps([{"op": "repaint", "prompt": "a person\u202e walks"}])


def test_every_operation_can_be_computed():
    for operation in OPERATIONS.values():
        if not operation.pieces:
            assert callable(operation.function()), operation.name


BOUNDS = [
    ("extend", "seconds", 0.1, 60.0),
    ("in-between", "seconds", 0.1, 8.0),
    ("concat", "blend", 0.0, 2.0),
    ("loop", "blend", 0.1, 0.3),
    ("speed", "factor", 0.1, 10.0),
    ("smooth", "hz", 0.5, 60.0),
    ("fps", "rate", 1.0, 240.0),
    *((name, "seed", 0, 2**31 - 1) for name in ("extend", "in-between", "repaint", "body-part")),
    *((name, "candidates", 1, 8) for name in ("extend", "repaint", "body-part")),
]
"""As docs/reference/edits.md and the help of the command line have them."""
DEFAULTS = {"seed": 0, "candidates": 1, "force": False, "rest": "follow", "end": "closed", "remove": "travel"}


@pytest.mark.parametrize(("name", "parameter", "low", "high"), BOUNDS)
def test_both_bounds_of_a_number_are_allowed_and_nothing_beyond(name: str, parameter: str, low: float, high: float):
    (read,) = (each.read for each in OPERATIONS[name].parameters if each.name == parameter)
    assert [read(low), read(high)] == [low, high]
    whole = isinstance(low, int)
    for beyond in (low - 1, high + 1) if whole else (np.nextafter(low, -1), np.nextafter(high, 999)):
        with pytest.raises(
            ValueError, match=rf"number from {low:g} to" if not whole else rf"number from {low} to {high}"
        ):
            read(float(beyond))


def test_what_is_not_said_of_an_operation_is_as_documented():
    found = {each.name: each.default for operation in OPERATIONS.values() for each in operation.parameters}
    assert {name: found[name] for name in DEFAULTS} == DEFAULTS
    (joined,), (between,) = (read_steps([{"op": name, "with": "a"}]) for name in ("concat", "in-between"))
    assert (joined.values["blend"], between.values["seconds"]) == (0.25, 1.0)
    (loop,) = read_steps([{"op": "loop"}])
    assert loop.values["blend"] == 0.3
    generated = {"extend", "in-between", "repaint", "body-part"}
    assert {operation.name for operation in OPERATIONS.values() if operation.needs_model} == generated


def test_an_operation_after_which_a_loop_is_one_and_a_timeline_has_its_rows():
    """As the table of the manifest in docs/reference/edits.md tells them."""
    cycle = {operation.name for operation in OPERATIONS.values() if operation.keeps_cycle}
    rows = {operation.name for operation in OPERATIONS.values() if operation.keeps_rows}
    assert cycle == {"mirror", "speed", "in-place", "fps"}
    assert rows == {"trim", "loop", "mirror", "speed", "in-place", "reverse", "smooth", "fps", "feet"}
    assert [operation.name for operation in OPERATIONS.values() if operation.pieces] == ["split"]


def test_a_result_of_too_many_frames_names_its_operation(monkeypatch: pytest.MonkeyPatch):
    clip, ops = dance(1, 30), [{"op": "mirror"}, {"op": "concat", "with": dance(2, 30)}]
    monkeypatch.setattr(editing, "MOST_FRAMES", 59)
    assert one(clip, *ops).frames == 59
    monkeypatch.setattr(editing, "MOST_FRAMES", 58)
    with pytest.raises(InvalidInput, match=r"^ops\.1: the result has 59 frames; the most is 58"):
        edit(clip, ops)


def test_an_operation_that_generates_frames_needs_a_model():
    with pytest.raises(InvalidInput, match=r"^ops\.1: extend generates frames, and no model is given") as refused:
        edit(dance(1, 30), [{"op": "mirror"}, {"op": "extend", "seconds": 1}])
    assert refused.value.argument == "model"


@pytest.mark.parametrize(("hz", "left"), [(2.0, 0.5**0.5), (4.0, 0.5**0.125), (2 / 3, 0.5**4.5)])
def test_smoothing_halves_the_power_of_its_frequency_and_takes_more_of_higher_ones(hz: float, left: float):
    """A Gaussian: of n times its frequency it leaves the n-th square of that."""
    frames = 400
    rotations, root = dancer(1, frames)
    swing = 0.1 * np.sin(2 * np.pi * 2.0 * np.arange(frames) / 20.0)
    clips = (
        MotionClip.of(HUMANML3D, rotations, root + np.outer(each, [0.0, 1.0, 0.0]), np.zeros((frames, 4), bool), 20.0)
        for each in (swing, 0 * swing)
    )
    with_swing, without = (one(clip, {"op": "smooth", "hz": hz}).root[:, 1].astype(np.float64) for clip in clips)
    middle = slice(60, -60)
    np.testing.assert_allclose((with_swing - without)[middle], left * swing[middle], atol=2e-3)
