"""Edits whose prompt is drawn, or changed as its words ask, in motions of a model whose bundle may draw."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from marey.bundles.manifest import BundleManifest
from marey.generation.export import finish
from marey.generation.port import Request
from marey.generation.shots.asked_frames import JOIN, asks_more, frames_alone, joined
from marey.generation.shots.editor import EditModel
from marey.generation.shots.windows import CROSSFADE
from marey.models.hgm3.generate import Generator
from marey.motion import MotionClip, edit
from marey.motion.clip import Float32
from marey.text.features import TextFeatures
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
    whole = joined(drawing, before, new, after, 3, drawing.settings({}))
    changed = (whole != np.concatenate([before, new, after])).any(axis=1)
    near = np.zeros(180, bool)
    near[60 - CROSSFADE : 60 + JOIN + CROSSFADE] = near[120 - JOIN - CROSSFADE : 120 + CROSSFADE] = True
    assert changed[60 : 60 + JOIN].all()
    assert changed[120 - JOIN : 120].all()
    assert not changed[~near].any()


def test_a_body_that_gets_up_has_more_frames_for_it(drawing: Generator) -> None:
    before, new, _ = rows(drawing)
    low = new.copy()
    low[:, drawing.layout.slices["height"]] -= 0.6
    whole = joined(drawing, before, low, new[:0], 3, drawing.settings({}))
    changed = (whole != np.concatenate([before, low])).any(axis=1)
    assert changed[60:72].all()
