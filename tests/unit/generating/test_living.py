"""Heads, trunks and arms that live."""

from __future__ import annotations

import random
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from marey.bundles import Bundle
from marey.generation.drawn_whole import drawn_whole
from marey.generation.export import finish
from marey.generation.fine_wish import FineWish
from marey.generation.living import with_life
from marey.generation.port import Request
from marey.generation.shots.dispatch import generate_any
from marey.generation.shots.windows import no_text
from marey.motion.clip import MotionClip
from marey.motion.features import HUMANML3D_263, encode_all
from marey.motion.finish import finish_motion
from marey.motion.kinematics import forward_kinematics, global_rotations
from marey.motion.rotations import angle_between, conjugate, multiply
from marey.motion.skeleton import HUMANML3D
from marey.posing.still import standing_still
from tests.unit.generating.test_timelines import load, text_of

HEAD, CHEST = HUMANML3D.index("head"), HUMANML3D.index("spine3")
WRISTS = [HUMANML3D.index("L_wrist"), HUMANML3D.index("R_wrist")]
FEET = list(HUMANML3D.feet)


def ask(prompt: str, seed: int = 1, **more: Any) -> Request:
    return Request(replace(no_text(4), prompt=prompt, rewritten=prompt), seed, **more)


def drawn(action: str, prompt: str, **manifest: Any) -> MotionClip:
    made = drawn_whole(HUMANML3D_263, action, FineWish(prompt=prompt), 1, None)
    assert made is not None
    return finish_motion(made.features, HUMANML3D_263, manifest={"drawn": action, **manifest})


def standing(frames: int = 100, **manifest: Any) -> MotionClip:
    features = encode_all(HUMANML3D_263, standing_still(frames, random.Random(3)))
    return finish_motion(features, HUMANML3D_263, manifest=manifest)


def turned(clip: MotionClip) -> Any:
    """Return degrees (T,) by which the head is turned from how it is at first, against the chest."""
    world = global_rotations(clip.skeleton, clip.rotations.astype(float))
    against = multiply(conjugate(world[:, CHEST]), world[:, HEAD])
    return np.degrees(angle_between(against, against[:1]))


def wrists(clip: MotionClip) -> Any:
    """Return the way of the left wrist and that of the right one as in a mirror, from the pelvis (T, 2, 3)."""
    return (clip.joints[:, WRISTS] - clip.joints[:, :1]) * np.array([[[1, 1, 1], [-1, 1, 1]]])


@pytest.mark.parametrize("manifest", [{}, {"drawn": "idle"}])
def test_a_head_looks_here_and_there_and_a_little(manifest: Any) -> None:
    clip = standing(**manifest)
    made = with_life(clip, ask("a person stands"))
    assert turned(clip).max() < 2
    assert 3 < turned(made).max() < 16
    assert np.abs(made.joints[:, FEET] - clip.joints[:, FEET]).max() < 1e-5
    assert np.abs(made.joints - clip.joints).max() < 0.04
    np.testing.assert_allclose(forward_kinematics(made.skeleton, made.rotations, made.root), made.joints, atol=1e-5)


def test_the_seed_and_the_words_decide_it() -> None:
    clip = standing()
    one, again = (with_life(clip, ask("a person stands")).rotations for _ in range(2))
    np.testing.assert_array_equal(one, again)
    for other in (ask("a person stands", seed=2), ask("a man waits")):
        assert np.abs(with_life(clip, other).rotations - one).max() > 0.01


@pytest.mark.parametrize(
    ("prompt", "manifest"),
    [
        ("he looks left", {"gaze": ["left"]}),
        ("she nods", {"drawn": "nod"}),
        ("he stands on one leg", {"drawn": "balance"}),
        ("a man is hit", {"drawn": "idle", "bearing": [{"name": "flinch"}]}),
        ("a man stands perfectly still", {"drawn": "idle"}),
        ("she squats and holds it for five seconds", {"drawn": "squat"}),
    ],
)
def test_stated_gazes_and_poses_stay(prompt: str, manifest: Any) -> None:
    clip = standing(**manifest)
    made = with_life(clip, ask(prompt))
    assert np.abs(made.joints - clip.joints).max() < 1e-5
    assert np.degrees(angle_between(made.rotations.astype(float), clip.rotations.astype(float))).max() < 0.1


@pytest.mark.parametrize("more", [{"free": True}, {"kept": (SimpleNamespace(),)}])
def test_motions_around_kept_frames_stay(more: Any) -> None:
    clip = standing(drawn="idle")
    assert with_life(clip, ask("a person stands", **more)) is clip


def test_a_row_of_a_timeline_that_looks_stays_and_the_others_live() -> None:
    rows = [{"start": 0.0, "end": 4.0, "drawn": "idle"}, {"start": 4.0, "end": 8.0, "drawn": "idle", "gaze": ["left"]}]
    clip = standing(160, timeline={"rows": rows})
    timed = tuple(SimpleNamespace(start=row["start"], end=row["end"], text=no_text(4)) for row in rows)
    made = with_life(clip, ask("a person stands", timeline=timed))
    apart = np.degrees(angle_between(made.rotations.astype(float), clip.rotations.astype(float)))[:, HEAD]
    assert apart[:60].max() > 1.5
    assert apart[105:].max() < 0.05


def test_both_arms_of_a_drawn_movement_are_not_one_the_mirror_of_the_other() -> None:
    clip = drawn("jump", "a person jumps")
    made = with_life(clip, ask("a person jumps"))
    before, after = (np.abs(np.diff(wrists(each), axis=1)).max() for each in (clip, made))
    assert after > before + 0.02
    assert np.abs(made.joints[:, FEET] - clip.joints[:, FEET]).max() < 1e-5


def test_arms_of_what_a_network_made_stay() -> None:
    clip = replace(drawn("jump", "a person jumps"), manifest={})
    made = with_life(clip, ask("a person jumps"))
    assert np.abs(made.joints[:, WRISTS] - clip.joints[:, WRISTS]).max() < 1e-5


@pytest.mark.parametrize("action", ["push-ups", "crawl"])
def test_hands_on_the_floor_stay(action: str) -> None:
    clip = drawn(action, f"a person does {action}")
    made = with_life(clip, ask(f"a person does {action}"))
    low = clip.joints[:, WRISTS, 1] < 0.1
    assert low.any()
    assert np.linalg.norm(made.joints[:, WRISTS] - clip.joints[:, WRISTS], axis=-1)[low].max() < 0.005


def test_hands_that_clap_still_meet() -> None:
    clip = drawn("clap", "a person claps")
    made = with_life(clip, ask("a person claps"))
    far = [np.linalg.norm(np.diff(each.joints[:, WRISTS], axis=1), axis=-1)[:, 0] for each in (clip, made)]
    near = far[0] < 0.25
    assert near.any()
    assert np.abs(far[1] - far[0])[near].max() < 0.02


def test_heads_live_where_rules_may_draw(tmp_path: Path) -> None:
    generator: Any = load("hgm3", tmp_path)
    manifest = generator.bundle.manifest
    text = manifest.text.model_copy(update={"plain_action": True})
    generator.bundle = Bundle(generator.bundle.path, manifest.model_copy(update={"text": text}))
    request = Request(text_of("a person stands", generator.limits.text_width), 3, frames=80)
    (made,) = generate_any(generator, [request])
    assert made is not None
    alive, still = (
        finish(generator, replace(request, drawing=drawing), made, generator.settings({})).rotations[:, HEAD]
        for drawing in (True, False)
    )
    assert np.abs(still - still[:1]).max() < 1e-6
    assert np.abs(alive - still).max() > 0.005
