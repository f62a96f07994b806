"""Edits whose prompt is drawn, or changed as its words ask, in motions of a model whose bundle may draw."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from marey.bundles.manifest import BundleManifest
from marey.generation.export import finish
from marey.generation.port import Request
from marey.generation.shots.asked_frames import JOIN, STEPS, asks_more, frames_alone, frames_between, joined, ways
from marey.generation.shots.edit_levels import LevelledFrames
from marey.generation.shots.editor import EditModel
from marey.generation.shots.lifted_steps import STOOD
from marey.generation.shots.windows import CROSSFADE
from marey.models.hgm3.generate import Generator
from marey.motion import MotionClip, edit
from marey.motion.clip import Float32
from marey.motion.features import encode_all
from marey.motion.finish import finish_motion
from marey.text.features import TextFeatures
from tests.support.bodies import Body
from tests.support.prepared import text_features

WAVE = "a person waves the left hand"
ARM = [16, 18, 20]
FRAMES = 120


def text(prompt: str) -> TextFeatures:
    return replace(text_features(1), prompt=prompt, rewritten=prompt)


@pytest.fixture
def drawing(generator: Generator, monkeypatch: pytest.MonkeyPatch) -> Generator:
    monkeypatch.setattr(BundleManifest, "draws_bearings", property(lambda manifest: True))
    return generator


@pytest.fixture(scope="module")
def clip(generator: Generator) -> MotionClip:
    request, options = Request(text_features(1), 1, FRAMES), generator.settings({})
    (made,) = generator.generate([request], options)
    assert made is not None
    return finish(generator, request, made, options)


@pytest.fixture(scope="module")
def standing(generator: Generator) -> MotionClip:
    """A body that stands still, on the skeleton of the clip."""
    joints = Body(8.0).joints()
    return finish_motion(encode_all(generator.layout, joints), generator.layout)


def made_by(generator: Generator, clip: MotionClip, **op: object) -> MotionClip:
    forced = {} if op["op"] == "body-part" else {"force": True}
    (result,) = edit(clip, [{**forced, "seed": 3, **op}], model=EditModel.of(generator, {}, text))
    return result


def between_joints(joints: np.ndarray) -> np.ndarray:
    """Distances (T, J, J), which do not depend on place and heading."""
    return np.linalg.norm(joints[:, :, None] - joints[:, None], axis=-1)


@pytest.mark.parametrize(
    ("prompt", "more"),
    [
        (WAVE, True),
        ("a person walks", False),
        ("a person runs", True),
        ("a person climbs stairs", True),
        ("a person stands", False),
        ("a person walks forward three steps", True),
        ("a person walks slowly", True),
        ("a person turns left by 90 degrees", True),
        ("a person walks like a zombie", True),
    ],
)
def test_prompts_that_ask_for_more_than_a_network_reads(drawing: Generator, prompt: str, more: bool) -> None:
    assert asks_more(drawing, text(prompt), drawing.settings({})) is more


def test_a_bundle_that_does_not_draw_generates_all_of_it(generator: Generator) -> None:
    assert not asks_more(generator, text(WAVE), generator.settings({}))


@pytest.mark.parametrize(("first", "last"), [(120, 199), (30, 100), (0, 60)])
def test_new_frames_are_those_of_the_movement_that_is_drawn(
    drawing: Generator, clip: MotionClip, first: int, last: int
) -> None:
    is_extension = first == clip.frames
    op = {"op": "extend", "seconds": 4.0} if is_extension else {"op": "repaint", "from": f"f{first}", "to": f"f{last}"}
    result = made_by(drawing, clip, prompt=WAVE, **op)
    assert result.frames == (200 if is_extension else clip.frames)
    count = last - first + 1 + is_extension
    alone = frames_alone(drawing, text(WAVE), 3, count, drawing.settings({})).features
    shown, wanted = result.joints[first : last + 1], drawing.layout.decode(alone)[is_extension:]
    ends = JOIN + 6  # the difference to kept frames fades within 0.25 s
    apart = np.abs(between_joints(shown) - between_joints(wanted))[ends:-ends]
    assert np.median(apart) < 0.01
    raised = shown[:, 20, 1] > shown[:, 16, 1]
    assert raised[ends:-ends].any()


def test_a_part_of_the_body_moves_as_the_movement_that_is_drawn(drawing: Generator, clip: MotionClip) -> None:
    result = made_by(drawing, clip, op="body-part", part="left-arm", prompt=WAVE, **{"from": "f20", "to": "f100"})
    kept = [joint for joint in range(22) if joint not in ARM]
    assert np.array_equal(result.joints[:, kept], clip.joints[:, kept])
    assert (result.joints[40:90, 20, 1] > result.joints[40:90, 16, 1]).any()


def test_the_same_seed_gives_the_same_frames(drawing: Generator, clip: MotionClip) -> None:
    op = {"op": "repaint", "from": 1, "to": 4, "prompt": WAVE}
    first, again, other = (made_by(drawing, clip, **{**op, "seed": seed}) for seed in (1, 1, 2))
    assert first.to_npz() == again.to_npz()
    assert not np.array_equal(first.joints, other.joints)


def test_a_range_longer_than_the_longest_motion_is_made(drawing: Generator, clip: MotionClip) -> None:
    longest = drawing.limits.max_frames
    new = frames_alone(drawing, text(WAVE), 3, longest + 50, drawing.settings({})).features
    assert len(new) == longest + 50
    assert made_by(drawing, clip, op="extend", seconds=12, prompt=WAVE).frames == clip.frames + 240


def rows(generator: Generator) -> tuple[Float32, Float32, Float32]:
    options = generator.settings({})
    parts = generator.generate([Request(text_features(seed), seed, 60) for seed in (4, 5, 6)], options)
    before, new, after = (part.features for part in parts if part is not None)
    return before, new, after


def test_only_frames_at_the_ends_are_generated_again(drawing: Generator) -> None:
    before, new, after = rows(drawing)
    whole = joined(drawing, before, LevelledFrames(new), after, 3, drawing.settings({}), ends=(JOIN, JOIN))
    changed = (whole != np.concatenate([before, new, after])).any(axis=1)
    near = np.zeros(180, bool)
    near[60 - CROSSFADE : 60 + JOIN + CROSSFADE] = near[120 - JOIN - CROSSFADE : 120 + CROSSFADE] = True
    assert changed[60 : 60 + JOIN].all()
    assert changed[120 - JOIN : 120].all()
    assert not changed[~near].any()


def at_height(drawing: Generator, features: np.ndarray, metres: float) -> np.ndarray:
    """Features of one pose at a height of the pelvis."""
    moved = features.copy()
    moved[:, drawing.layout.slices["height"]] = metres
    return moved


@pytest.mark.parametrize(
    ("before", "new", "after", "expected"),
    [
        (0.9, 0.9, 0.9, (JOIN, JOIN)),
        (0.9, 0.3, 0.9, (12, 20)),  # a body gets up at 0.6 m/s, and goes down at 1 m/s
        (0.3, 0.9, 0.3, (20, 12)),
        (0.9, 0.3, None, (12, 0)),
        (None, 0.3, 0.9, (0, 20)),
    ],
)
def test_a_body_that_gets_up_has_more_frames_for_it(
    drawing: Generator, before: float | None, new: float, after: float | None, expected: tuple[int, int]
) -> None:
    pose = np.repeat(rows(drawing)[1][:1], 80, axis=0)
    beside = [pose[:0] if each is None else at_height(drawing, pose, each) for each in (before, after)]
    level = LevelledFrames(at_height(drawing, pose, new))
    assert ways(beside[0], level, beside[1], drawing.layout, 4) == expected


def test_a_movement_is_not_cut_by_the_way_to_it(drawing: Generator, monkeypatch: pytest.MonkeyPatch) -> None:
    before, _, after = rows(drawing)
    options, prompt = drawing.settings({}), text("a person dies")
    beside = [at_height(drawing, np.repeat(each[:1], 60, axis=0), 0.9) for each in (before, after)]
    made = frames_between(drawing, beside[0], 80, beside[1], prompt, 3, options)
    assert len(made.features) == 200
    rest = ways(beside[0], LevelledFrames(alone(drawing, prompt, 80)), beside[1], drawing.layout, 4)[1]
    assert rest > JOIN
    shorter = alone(drawing, prompt, 80 - (rest - JOIN))
    kept = slice(60 + STEPS + STOOD, 60 + 80 - rest - CROSSFADE)
    np.testing.assert_allclose(made.features[kept], shorter[kept.start - 60 : kept.stop - 60], atol=1e-6)


def alone(drawing: Generator, prompt: TextFeatures, frames: int) -> np.ndarray:
    return frames_alone(drawing, prompt, 3, frames, drawing.settings({})).features


UP, DOWN = "a person climbs up the stairs", "a person walks down the stairs"


@pytest.mark.parametrize(("prompt", "low", "high"), [(UP, 0, -1), (DOWN, -1, 0)])
def test_a_motion_goes_on_where_a_climb_ends(
    drawing: Generator, standing: MotionClip, prompt: str, low: int, high: int
) -> None:
    op = {"op": "repaint", "from": "f40", "to": "f119"}
    result = made_by(drawing, standing, prompt=prompt, **op)
    rise = result.joints[:, 0, 1] - standing.joints[:, 0, 1]
    assert abs(rise[low]) < 0.01
    assert rise[high] > 0.25
    for kept in (slice(0, 40), slice(120, None)):
        np.testing.assert_allclose(
            between_joints(result.joints[kept]), between_joints(standing.joints[kept]), atol=1e-5
        )
        assert np.ptp(rise[kept]) < 1e-5
    stays = made_by(drawing, standing, prompt=prompt, rest="stay", **op)
    np.testing.assert_allclose(stays.joints[120:], standing.joints[120:], atol=1e-5)


def recorded(result: MotionClip) -> dict[str, Any]:
    (op,) = result.manifest["edited_from"]["ops"]
    return op["model"]


def test_the_manifest_says_what_was_drawn_and_with_which_bearing(drawing: Generator, clip: MotionClip) -> None:
    op = {"op": "repaint", "from": 1, "to": 4}
    assert recorded(made_by(drawing, clip, **op, prompt="a person kneels"))["drawn"] == "kneel"
    manifest = recorded(made_by(drawing, clip, **op, prompt="a person walks like a zombie"))
    assert "zombie" in [each["name"] for each in manifest["bearing"]]
    part = {"op": "body-part", "part": "left-arm"}
    assert recorded(made_by(drawing, clip, **part, prompt="a person bows"))["drawn"] == "bow"
    between = {"op": "in-between", "with": clip, "seconds": 2}
    assert recorded(made_by(drawing, clip, **between, prompt="a person bows"))["drawn"] == "bow"
    plain = recorded(made_by(drawing, clip, **op))
    assert not {"drawn", "bearing"} & plain.keys()


def test_the_manifest_is_that_of_the_chosen_candidate(drawing: Generator, clip: MotionClip) -> None:
    prompt = "a person walks forward two metres"
    op = {"op": "extend", "seconds": 4, "prompt": prompt}
    chosen = made_by(drawing, clip, **op, candidates=3)
    singles = [made_by(drawing, clip, **op, seed=3 + number) for number in range(3)]
    same = [each for each in singles if np.array_equal(each.joints, chosen.joints)]
    assert [recorded(each).get("distance") for each in same] == [recorded(chosen).get("distance")]
