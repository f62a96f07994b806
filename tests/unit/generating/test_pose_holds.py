"""Poses that are held for as long as the words say."""

from __future__ import annotations

import numpy as np
import pytest

from marey.generation.drawn_whole import STAYING, drawn_whole
from marey.generation.fine_wish import FineWish
from marey.generation.pose_holds import with_frames_held, with_held_pose
from marey.motion.features import HUMANML3D_263
from marey.selector.motion import Motion
from marey.selector.repetitions import REPETITIONS
from marey.vocabulary.held_poses import held_pose
from marey.vocabulary.lengths import stated_length

LAYOUT = HUMANML3D_263
BRIEF_S, LASTS_S = 5, 14


@pytest.mark.parametrize(
    ("prompt", "seconds"),
    [
        ("he squats and holds it for two seconds", 2.0),
        ("she bows, holding the pose for 3 seconds", 3.0),
        ("reaches up and holds the stretch for a moment", 1.5),
        ("raises both arms and keeps the position", 1.5),
        ("bows deeply from the waist, hold three seconds", 3.0),
        ("holds a squat for five seconds", 5.0),
        ("raises the right arm for five seconds", 5.0),
        ("he holds the bow in his left hand", None),
        ("squats for two seconds", None),
        ("holds a plank for eight seconds", None),
        ("raises his arms and claps for five seconds", None),
    ],
)
def test_words_say_how_long_a_pose_is_held(prompt: str, seconds: float | None) -> None:
    assert held_pose(prompt) == seconds
    assert (stated_length(prompt).seconds is None) == (seconds is not None or "for" not in prompt)


@pytest.mark.parametrize("action", ["squat", "bow", "reach-up"])
@pytest.mark.parametrize("seed", [1, 2])
def test_a_held_pose_lasts_and_the_rest_stays(action: str, seed: int) -> None:
    made = drawn_whole(LAYOUT, action, FineWish(None, "", action, False, ("", "")), seed, None)
    assert made is not None
    held = with_held_pose(made.features, LAYOUT, 3.0)
    joints, before = (LAYOUT.decode(each).astype(np.float64) for each in (held, made.features))
    far = np.linalg.norm(joints - joints[:1], axis=-1).mean(axis=1)
    near = np.linalg.norm(joints - joints[far.argmax()], axis=-1).mean(axis=1) < 0.15 * far.max()
    assert 2.8 * LAYOUT.fps < near.sum() < 5.0 * LAYOUT.fps
    assert np.abs(joints[-1] - joints[0] - (before[-1] - before[0])).max() < 0.05
    assert np.linalg.norm(np.diff(joints, n=2, axis=0), axis=-1).max() * LAYOUT.fps**2 < 160


def test_frames_are_held_only_where_there_are_too_few() -> None:
    joints = np.zeros((30, 22, 3))
    joints[:, :, 1] = np.sin(np.linspace(0.0, np.pi, 30))[:, None]
    held = with_frames_held(joints, 90, 20.0)
    assert held.shape == (90, 22, 3)
    assert (held[:, 0, 1] > 0.99).sum() > 60
    assert np.array_equal(held[[0, -1]], joints[[0, -1]])
    assert with_frames_held(joints, 30, 20.0) is joints


@pytest.mark.parametrize("action", sorted(STAYING))
def test_a_pose_is_held_for_as_long_as_words_say_that_it_lasts(action: str) -> None:
    brief, lasting = f"a person does it for {BRIEF_S} seconds", f"a person does it for {LASTS_S} seconds"
    found = [
        drawn_whole(LAYOUT, action, FineWish(None, "", prompt, True), 3, round(seconds * LAYOUT.fps))
        for prompt, seconds in ((brief, BRIEF_S), (lasting, LASTS_S))
    ]
    away = list[int]()
    for made in found:
        assert made is not None
        joints = LAYOUT.decode(made.features).astype(np.float64)
        far = np.linalg.norm(joints - joints[:1], axis=-1).mean(axis=1)
        away.append(int((far > 0.6 * far.max()).sum()))
    assert away[1] - away[0] > 0.6 * (LASTS_S - BRIEF_S) * LAYOUT.fps


@pytest.mark.parametrize("action", ["jumping-jacks", "kick", "hop", "squat", "sit-ups"])
def test_a_movement_is_done_again_for_as_long_as_words_say(action: str) -> None:
    numbers = list[int]()
    for prompt in ("a person does it for 14 seconds", "a person does it"):
        made = drawn_whole(LAYOUT, action, FineWish(None, "", prompt, True), 3, round(14 * LAYOUT.fps))
        assert made is not None
        assert len(made.features) == 14 * LAYOUT.fps
        numbers.append(len(REPETITIONS[action](Motion(LAYOUT.decode(made.features), LAYOUT.fps))))
    assert numbers[0] >= 4
    assert numbers[0] >= numbers[1] + 2
