"""Edits by a model: kept frames are copied, new ones follow the seed, and the manifest has every input."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from marey.core.errors import InvalidInput
from marey.generation.export import finish
from marey.generation.port import Limits, Request
from marey.generation.shots import context, edits
from marey.generation.shots.context import context_error, model_features
from marey.generation.shots.editor import EditModel
from marey.generation.shots.windows import CONTEXT, FrameGap, crossfaded, fill, most_frames, no_text
from marey.models.hgm3.generate import Generator
from marey.motion import MotionClip, edit
from marey.motion.body import standard_body
from marey.motion.skeleton import HUMANML3D
from tests.support.motions import dancer
from tests.support.prepared import text_features

EXACT = 1e-5
"""Metres: float32 over some metres of travel."""
LEGS = [0, 1, 2, 4, 5, 7, 8, 10, 11]


@pytest.fixture(scope="module")
def model(generator: Generator) -> EditModel:
    return EditModel.of(generator, {}, lambda prompt: text_features(sum(prompt.encode()), 1, 1))


@pytest.fixture(scope="module")
def clip(generator: Generator) -> MotionClip:
    return generated(generator, 1)


@pytest.fixture(scope="module")
def dance() -> MotionClip:
    """A motion that the random model is far from."""
    rotations, root = dancer(3, 120)
    contacts = np.zeros((120, 4), bool)
    return MotionClip.of(HUMANML3D, rotations, root, contacts, 20.0, manifest={"prompt": "a person dances"})


def generated(generator: Generator, seed: int, frames: int = 120, fps: float | None = None) -> MotionClip:
    request = Request(text_features(seed), seed, frames)
    options = generator.settings({})
    (made,) = generator.generate([request], options)
    assert made is not None
    return finish(generator, request, made, options, fps=fps)


def one(model: EditModel, clip: MotionClip, op: Mapping[str, Any]) -> MotionClip:
    (result,) = edit(clip, [{"force": True, **op} if op["op"] != "body-part" else op], model=model)
    return result


def steps(clip: MotionClip) -> np.ndarray:
    """How far the joint that moves most moves from one frame to the next."""
    return np.linalg.norm(np.diff(clip.joints, axis=0), axis=-1).max(1)


def moved_between(first: np.ndarray, second: np.ndarray) -> float:
    """Return the largest difference of the distances to the first pose: 0 where one motion is the other elsewhere."""
    lengths = [np.linalg.norm(each[:, :, None] - each[:1, None], axis=-1) for each in (first, second)]
    return float(np.abs(lengths[0] - lengths[1]).max())


@pytest.mark.parametrize("fps", [20.0, 30.0, 24.0])
def test_an_extension_copies_the_motion_and_goes_on_without_a_jump(
    generator: Generator, model: EditModel, fps: float
) -> None:
    clip = generated(generator, 1, fps=fps)
    longer = one(model, clip, {"op": "extend", "seconds": 2, "prompt": "a person sits down"})
    assert longer.frames == clip.frames + 2 * fps
    assert np.array_equal(longer.joints[: clip.frames], clip.joints)
    assert np.array_equal(longer.contacts[: clip.frames], clip.contacts)
    assert longer.fps == fps


@pytest.mark.parametrize("fps", [20.0, 30.0])
def test_new_frames_meet_the_kept_ones_without_a_jump(model: EditModel, dance: MotionClip, fps: float) -> None:
    (source,) = edit(dance, [{"op": "fps", "rate": fps}])
    most = steps(source).max()
    cut, second = source.frames, round(fps)
    between = {"op": "in-between", "with": source, "seconds": 1}
    repainted = {"op": "repaint", "from": 2, "to": 3}
    for op, seams in (
        ({"op": "extend", "seconds": 2}, [cut - 1]),
        (between, [cut - 1, cut + second - 1]),
        (repainted, [2 * second - 1, 3 * second]),
        ({**repainted, "rest": "stay"}, [2 * second - 1, 3 * second]),
        ({"op": "repaint", "to": 2}, [2 * second]),
    ):
        assert steps(one(model, source, op))[seams].max() < 1.5 * most


def test_an_extension_is_longer_than_a_window_of_the_model(model: EditModel, clip: MotionClip) -> None:
    longer = one(model, clip, {"op": "extend", "seconds": 25})
    assert longer.frames == clip.frames + 500
    assert np.array_equal(longer.joints[: clip.frames], clip.joints)
    pieces = [longer.joints[start : start + 40] for start in (130, 330, 530)]
    assert min(moved_between(a, b) for a, b in pairwise(pieces)) > 0.001  # no window repeats another


def test_the_same_seed_gives_the_same_frames_and_another_seed_others(model: EditModel, clip: MotionClip) -> None:
    op = {"op": "repaint", "from": 2, "to": 4, "prompt": "a person jumps"}
    first, again, other = (one(model, clip, {**op, "seed": seed}) for seed in (7, 7, 8))
    assert first.to_npz() == again.to_npz()
    assert not np.array_equal(first.joints[40:81], other.joints[40:81])
    said = one(model, clip, {**op, "seed": 7, "prompt": "a person waves"})
    assert not np.array_equal(first.joints[40:81], said.joints[40:81])


def test_a_repaint_keeps_the_frames_before_and_after(model: EditModel, clip: MotionClip) -> None:
    changed = one(model, clip, {"op": "repaint", "from": "f40", "to": "f70"})
    assert changed.frames == clip.frames
    assert np.array_equal(changed.joints[:40], clip.joints[:40])
    assert moved_between(changed.joints[71:], clip.joints[71:]) < EXACT
    assert not np.allclose(changed.joints[40:71], clip.joints[40:71], atol=0.01)


def test_frames_after_a_repaint_can_keep_their_place(model: EditModel, clip: MotionClip) -> None:
    op = {"op": "repaint", "from": "f40", "to": "f70", "prompt": "a person jumps"}
    stays = one(model, clip, {**op, "rest": "stay"})
    follows = one(model, clip, op)
    np.testing.assert_allclose(stays.joints[71:], clip.joints[71:], atol=EXACT)
    assert np.abs(follows.joints[71:] - clip.joints[71:]).max() > 0.001


def test_the_beginning_is_repainted_before_the_rest(model: EditModel, clip: MotionClip) -> None:
    changed = one(model, clip, {"op": "repaint", "to": 1.5, "prompt": "a person jumps"})
    assert changed.frames == clip.frames
    assert moved_between(changed.joints[31:], clip.joints[31:]) < EXACT
    assert moved_between(changed.joints[:31], clip.joints[:31]) > 0.01


def test_the_way_between_two_motions_keeps_both(generator: Generator, model: EditModel, clip: MotionClip) -> None:
    other = generated(generator, 2, 80, fps=30.0)
    whole = one(model, clip, {"op": "in-between", "with": other, "seconds": 1.0})
    assert np.array_equal(whole.joints[: clip.frames], clip.joints)
    behind = whole.joints[clip.frames + 20 :]
    assert len(behind) == 79
    (at_20,) = edit(other, [{"op": "fps", "rate": 20}])
    assert moved_between(behind, at_20.joints) < EXACT
    prompted = one(model, clip, {"op": "in-between", "with": other, "seconds": 1.0, "prompt": "a person turns"})
    assert not np.array_equal(prompted.joints[clip.frames : clip.frames + 20], whole.joints[clip.frames :][:20])


def test_a_part_of_the_body_moves_and_the_others_stay(model: EditModel, clip: MotionClip) -> None:
    changed = one(model, clip, {"op": "body-part", "part": "upper-body", "prompt": "a person waves"})
    np.testing.assert_allclose(changed.joints[:, LEGS], clip.joints[:, LEGS], atol=1e-6)
    assert np.array_equal(changed.root, clip.root)
    arm = one(model, clip, {"op": "body-part", "part": "left-arm", "from": 2, "to": 4, "prompt": "a person waves"})
    left = edits.joints_of(HUMANML3D, "left-arm")
    others = [joint for joint in range(22) if joint not in left]
    assert [HUMANML3D.joint_names[joint] for joint in left] == ["L_collar", "L_shoulder", "L_elbow", "L_wrist"]
    np.testing.assert_allclose(arm.joints[:, others], clip.joints[:, others], atol=1e-6)
    assert np.array_equal(arm.rotations[:40], clip.rotations[:40])
    assert np.array_equal(arm.rotations[81:], clip.rotations[81:])
    assert np.abs(arm.joints[50:70][:, left] - clip.joints[50:70][:, left]).max() > 0.01


def test_a_part_moves_in_a_motion_longer_than_a_window(model: EditModel, clip: MotionClip) -> None:
    long = one(model, clip, {"op": "extend", "seconds": 10})
    changed = one(model, long, {"op": "body-part", "part": "arms", "prompt": "a person waves"})
    assert changed.frames == 320
    assert np.abs(changed.joints[-40:] - long.joints[-40:]).max() > 0.001


def test_parts_are_found_by_the_tree() -> None:
    names = {
        part: [HUMANML3D.joint_names[joint] for joint in edits.joints_of(HUMANML3D, part)]
        for part in ("arms", "head", "upper-body")
    }
    assert names["head"] == ["neck", "head"]
    assert len(names["arms"]) == 8
    assert len(names["upper-body"]) == 22 - len(LEGS)


def test_the_manifest_has_every_input(model: EditModel, clip: MotionClip) -> None:
    changed = one(model, clip, {"op": "repaint", "from": 2, "to": 3, "prompt": "a person jumps", "seed": 9})
    (op,) = changed.manifest["edited_from"]["ops"]
    assert op["prompt"] == "a person jumps"
    assert op["seed"] == 9
    assert op["model"]["bundle"] == model.generator.bundle.reference
    assert op["model"]["settings"]["steps"] == model.generator.config.inference.steps
    assert op["model"]["context_error_mm"] > 0
    assert changed.manifest["prompts"] == [[0, "a person moves"], [40, "a person jumps"], [61, "a person moves"]]
    assert changed.manifest["prompt"] == "a person moves, then a person jumps"


def test_the_licence_is_that_of_motion_and_weights(model: EditModel, clip: MotionClip) -> None:
    own = replace(clip, manifest={**clip.manifest, "licence": "CC-BY-NC-4.0"})
    assert one(model, own, {"op": "extend", "seconds": 1}).manifest["licence"] == "CC-BY-NC-4.0"
    without = replace(clip, manifest={"prompt": "a person walks"})
    assert one(model, without, {"op": "extend", "seconds": 1}).manifest["licence"] == model.licence


def test_of_several_candidates_the_one_that_matches_is_taken(
    model: EditModel, clip: MotionClip, monkeypatch: pytest.MonkeyPatch
) -> None:
    op = {"op": "extend", "seconds": 1, "prompt": "a person jumps"}
    wanted = one(model, clip, {**op, "seed": 2})
    asked: list[MotionClip] = []

    def match(candidate: MotionClip, sentences: list[str]) -> Any:
        asked.append(candidate)
        assert sentences == ["a person jumps"]
        return type("Match", (), {"value": 1.0 if len(asked) == 3 else None})()

    monkeypatch.setattr(edits, "match_of", match)
    best = one(model, clip, {**op, "candidates": 4})
    assert [each.frames for each in asked] == [20] * 4
    assert np.array_equal(best.joints, wanted.joints)


@pytest.mark.parametrize(
    ("op", "message"),
    [
        ({"op": "repaint"}, "the whole motion"),
        ({"op": "repaint", "from": 9}, "after the end"),
        ({"op": "body-part", "part": "arms", "from": 3, "to": 2, "prompt": "x"}, "before the beginning"),
    ],
)
def test_ranges_that_cannot_be_generated_are_refused(
    model: EditModel, clip: MotionClip, op: dict[str, Any], message: str
) -> None:
    with pytest.raises(InvalidInput, match=message):
        one(model, clip, op)


def test_an_extension_without_a_prompt_is_refused_where_there_is_none(model: EditModel, clip: MotionClip) -> None:
    with pytest.raises(InvalidInput, match="has no prompt"):
        one(model, replace(clip, manifest={}), {"op": "extend", "seconds": 1})


def test_operations_of_a_model_need_one(clip: MotionClip) -> None:
    with pytest.raises(InvalidInput, match="no model is given"):
        edit(clip, [{"op": "extend", "seconds": 1}])


def test_a_model_that_keeps_no_frames_is_refused(generator: Generator, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(generator, "limits", Limits(16, 196, 20.0, 384))
    with pytest.raises(InvalidInput, match="cannot generate frames around others"):
        EditModel.of(generator, {}, lambda prompt: text_features(0))


def test_another_skeleton_is_refused(model: EditModel, clip: MotionClip) -> None:
    names = ("hips", *clip.skeleton.joint_names[1:])
    other = replace(clip, skeleton=replace(clip.skeleton, joint_names=names), features=clip.features[:0])
    with pytest.raises(InvalidInput, match="another skeleton than the model: hips in place of pelvis of humanml3d"):
        one(model, other, {"op": "extend", "seconds": 1})


def test_frames_that_the_tokens_cannot_show_are_refused_unless_forced(
    model: EditModel, clip: MotionClip, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(context, "LARGEST_ERROR", 0.5)
    with pytest.raises(InvalidInput, match="mm off"):
        edit(clip, [{"op": "extend", "seconds": 1}], model=model)
    assert one(model, clip, {"op": "extend", "seconds": 1}).frames == 140


def test_features_of_a_clip_are_its_own_or_those_of_its_poses(generator: Generator) -> None:
    layout = generator.layout
    rotations, root = dancer(3, 60)
    body = standard_body(layout.skeleton).skeleton
    moving = MotionClip.of(body, rotations, root, np.zeros((60, 4), bool), 20.0)
    made = model_features(moving, layout)
    assert made.shape == (60, layout.dim)
    again = replace(moving, features=made, features_fps=20.0)
    assert model_features(again, layout) is again.features
    scale = body.offsets[4, 1] / layout.skeleton.offsets[4, 1]
    there = layout.decode(made) * scale
    assert moved_between(there[:, LEGS], moving.joints[:, LEGS]) < 2e-3


def test_tokens_show_their_own_motion_exactly_enough(generator: Generator) -> None:
    features = generated(generator, 5).features
    error = context_error(features, generator.tokenizer, generator.layout)
    assert 0 < error < 1000


def test_a_crossfade_changes_the_context_alone(generator: Generator) -> None:
    source = generated(generator, 5, 120).features
    gap = FrameGap(source[:40], 10, source[50:], no_text(384), 3, free=True)
    (window,) = fill(generator, [gap], generator.settings({}))
    assert window is not None
    assert (window.first, window.end) == (40, 50)
    mixed = crossfaded(source, window, 0)
    assert np.array_equal(mixed[40:50], window.new)
    assert np.array_equal(mixed[:32], source[:32])
    assert np.array_equal(mixed[58:], source[58:])
    assert not np.array_equal(mixed[36:40], source[36:40])


def test_windows_are_equal_in_any_batch(generator: Generator) -> None:
    source = generated(generator, 5, 160).features
    gaps = [
        FrameGap(source[:at], 12 + at // 10, source[at + 12 + at // 10 :], text_features(at), at) for at in (20, 60, 90)
    ]
    together = fill(generator, gaps, generator.settings({}))
    for gap, window in zip(gaps, together, strict=True):
        (alone,) = fill(generator, [gap], generator.settings({}))
        assert alone is not None
        assert window is not None
        assert np.array_equal(alone.features, window.features)
        assert len(window.new) == gap.frames


def test_a_gap_that_no_window_holds_is_refused(generator: Generator) -> None:
    source = generated(generator, 5, 160).features
    most = most_frames(generator.limits, 2)
    fill(generator, [FrameGap(source[:CONTEXT], most, source[:CONTEXT], text_features(1), 1)])
    with pytest.raises(InvalidInput, match="at once"):
        fill(generator, [FrameGap(source[:CONTEXT], most + 1, source[:CONTEXT], text_features(1), 1)])


@settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_any_range_of_a_motion_at_any_rate_is_repainted_in_its_length(
    model: EditModel, clip: MotionClip, data: st.DataObject
) -> None:
    rate = data.draw(st.sampled_from([12.0, 20.0, 23.976, 30.0, 60.0]))
    (source,) = edit(clip, [{"op": "fps", "rate": rate}])
    first = data.draw(st.integers(0, source.frames - 1))
    last = data.draw(st.integers(first, source.frames - (1 if first else 2)))
    changed = one(model, source, {"op": "repaint", "from": f"f{first}", "to": f"f{last}", "prompt": "a person turns"})
    assert changed.frames == source.frames
    assert np.array_equal(changed.joints[:first], source.joints[:first])
    if last + 1 < source.frames:
        assert moved_between(changed.joints[last + 1 :], source.joints[last + 1 :]) < EXACT
