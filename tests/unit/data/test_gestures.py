"""Gestures made on captured idles: what they show, what is said of them, and where they end up."""

from __future__ import annotations

import random
import re
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from marey.data import gestures
from marey.data.describe import describe_text
from marey.data.gestures import KINDS, made_gestures, read_captions
from marey.data.pack import PackClip
from marey.data.part import MAX_FRAMES, Part
from marey.data.sampling import sampling_weights
from marey.data.spoken import spoken
from marey.motion.skeleton import HUMANML3D
from tests.support.bodies import FPS, Body, steady
from tests.unit.data.test_sampling import clip

WRIST, SHOULDER = {"left": 20, "right": 21}, {"left": 16, "right": 17}
OTHER = {"left": "right", "right": "left"}
ON_TOES = ("shoot-basket", "reach-up")
FIGHTS = ("punch", "stab", "slash", "block")
STEPPING = ("carry", "draw-bow", "push", "throw", "fight-stance", "dribble", *FIGHTS)
OPEN_ENDED = ("carry", "aim", "talk", "shiver", *STEPPING[1:])
"""Clips that may begin or end within the action."""
SAID = (("stand still",),)
ABSENT = {"run", "sprint", "jump-turn", "leap", "climb-onto", "climb-ladder"}  # of captures that these parts lack
WALKS = {"carry", "walk", "walk-backward", "turn", "turn-around", "sidestep", "spin", "climb-stairs", "sneak"}
POSTURES = {
    *("squat", "bend-over", "pick-up", "sit-down", "stand-up", "sit", "kick", "kick-ball", "balance", "jumping-jacks"),
    *("kneel", "push-ups", "sit-ups", "lie-down", "get-up", "sit-floor", "lie"),
}
"""Actions in which the hips go far down or a foot leaves the floor."""
FALLS = {"die", "dodge", "flinch", "roll", "swim", "flip"}
"""Actions in which the body falls, turns over or floats, or nearly so."""
DEEDS = {
    *("crouch", "cheer", "hop", "twist", "hang", "drive", "cast-spell", "shoot", "wash", "arabesque", "knee-to-elbow"),
    *("jump", "jump-forward", "crawl"),
}
"""Actions of `test_gesture_deeds`."""
TESTED_APART = POSTURES | FALLS | DEEDS
COUNT, FEWER = 10, 3
"""Clips of an action, and of one of `TESTED_APART`."""


def idle(seconds: float = 4.0, content: str = "idle", speed: float = 0.0) -> Part:
    joints = Body(seconds, speed=steady(speed)).joints().astype(np.float32)
    source = PackClip("idle-1", "cmu", content, "", "train", 0, 0, source="idle-1", captions=SAID)
    return Part("idle-1", source, content, False, joints, describe_text(SAID, joints, FPS))


def few(count: int) -> dict[str, gestures.Kind]:
    return {action: replace(kind, count=count) for action, kind in KINDS.items()}


@pytest.fixture(scope="module")
def made() -> list[Part]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(gestures, "KINDS", few(COUNT) | {action: few(FEWER)[action] for action in TESTED_APART})
        return list(made_gestures([idle(), idle(2.0), idle(content="walk"), idle(content="walk", speed=1.2)]))


def of(made: list[Part], action: str) -> list[Part]:
    return [part for part in made if part.content == action]


def height(part: Part, side: str) -> np.ndarray:
    """Metres of a wrist over its shoulder, (T,)."""
    return part.joints[:, WRIST[side], 1] - part.joints[:, SHOULDER[side], 1]


def tilt(part: Part) -> np.ndarray:
    """Degrees between the trunk and the vertical, (T,)."""
    trunk = part.joints[:, 12] - part.joints[:, 0]
    return np.degrees(np.arccos(trunk[:, 1] / np.linalg.norm(trunk, axis=-1)))


def test_as_many_as_asked_for_are_made_of_every_action(made: list[Part]) -> None:
    wanted = {action: FEWER if action in TESTED_APART else COUNT for action in KINDS.keys() - ABSENT}
    assert Counter(part.content for part in made) == wanted
    assert all(part.made and part.source.split == "train" for part in made)
    assert len({part.id for part in made}) == len(made)


def test_feet_stay_bones_keep_their_length_and_the_body_ends_as_it_began(made: list[Part]) -> None:
    lengths = np.linalg.norm(HUMANML3D.offsets[1:], axis=-1)
    for part in made:
        if part.content in TESTED_APART:
            continue
        assert 20 < len(part.joints) <= MAX_FRAMES + 1
        stays = [10, 11] if part.content in ON_TOES else [7, 8, 10, 11]
        assert part.content in {*STEPPING, *WALKS} or np.ptp(part.joints[:, stays], axis=0).max() < 0.02
        bones = np.linalg.norm(part.joints[:, 1:] - part.joints[:, list(HUMANML3D.parents[1:])], axis=-1)
        assert np.abs(bones - lengths).max() < 1e-4
        if part.content not in {*OPEN_ENDED, *WALKS}:
            assert np.abs(part.joints[-1] - part.joints[0]).max() < 0.12


def test_the_hand_that_is_told_waves_and_the_other_hangs(made: list[Part]) -> None:
    waves = of(made, "wave")
    assert {part.source.side for part in waves} == {"left", "right", "both"}
    for part in waves:
        side = part.source.side
        for one in ("left", "right") if side == "both" else (side,):
            up = height(part, one) > -0.25
            aside = part.joints[up, WRIST[one]] - part.joints[up, SHOULDER[one]]
            path = np.linalg.norm(np.diff(aside, axis=0), axis=-1).sum()
            assert up.sum() >= 12
            assert path > 0.5
        if side != "both":
            assert height(part, OTHER[side]).max() < -0.3


def test_a_raised_arm_stays_over_the_shoulder(made: list[Part]) -> None:
    for part in of(made, "raise-arm"):
        side = part.source.side
        for one in ("left", "right") if side == "both" else (side,):
            over = height(part, one) > 0.0
            assert over.sum() >= 6
            assert not over[0]
            assert not over[-1]
        if side != "both":
            assert height(part, OTHER[side]).max() < -0.3


def test_a_bow_tips_the_trunk_and_is_told_by_its_depth_and_number(made: list[Part]) -> None:
    for part in of(made, "bow"):
        degrees = tilt(part)
        assert degrees.max() > 15
        assert max(degrees[0], degrees[-1]) < 12
        told = {text for author in part.source.captions for text in author}
        down = degrees > 0.7 * degrees.max()
        times = int((down[1:] & ~down[:-1]).sum())
        assert bool(re.search(r"\b(twice|three times)\b", " ".join(told))) == (times > 1)


def test_hands_meet_in_a_clap_and_a_nod_moves_the_head_alone(made: list[Part]) -> None:
    for part in of(made, "clap"):
        apart = np.linalg.norm(part.joints[:, 20] - part.joints[:, 21], axis=-1)
        near = apart < 0.2
        assert int((near[1:] & ~near[:-1]).sum()) + int(near[0]) >= 3
    for part in of(made, "nod"):
        neck = part.joints[:, 15] - part.joints[:, 12]
        angle = np.degrees(np.arctan2(neck[:, 2], neck[:, 1]))
        assert np.ptp(angle) > 6
        assert np.ptp(part.joints[:, [20, 21]], axis=0).max() < 0.12


def ahead(part: Part) -> np.ndarray:
    """Metres by which the foremost wrist is before the middle of the trunk, (T,); the body faces +Z."""
    return part.joints[:, [20, 21], 2].max(1) - part.joints[:, [0, 12], 2].mean(1)


def test_hands_reach_and_aim_ahead_and_shoot_over_the_head(made: list[Part]) -> None:
    for part in of(made, "reach-forward"):
        assert (ahead(part) > 0.4).sum() >= 5
        assert ahead(part)[-1] < 0.3
        assert height(part, part.source.side).max() < 0.0
    for part in of(made, "aim"):
        assert (ahead(part) > 0.35).sum() >= FPS
    for part in of(made, "shoot-basket"):
        assert part.joints[:, [20, 21], 1].max() > part.joints[:, 15, 1].max() + 0.05


def test_a_load_is_held_still_and_shivering_hands_shake(made: list[Part]) -> None:
    for part in of(made, "carry"):
        side = part.source.side
        for one in ("left", "right") if side == "both" else (side,):
            seen = part.joints[:, WRIST[one]] - part.joints[:, [16, 17]].mean(1)
            assert np.ptp(seen, axis=0).max() < 0.12
            assert seen[:, 1].min() > -0.5
    for part in of(made, "shiver"):
        middle = part.joints[8:-8, 20] - part.joints[8:-8, 0]
        assert np.abs(np.diff(middle, 2, axis=0)).mean() > 0.004


def test_captions_are_in_three_voices_and_name_the_side_that_acts(made: list[Part]) -> None:
    for part in made:
        *voices, words = part.source.captions
        assert len(voices) == 3
        assert set(words) <= set(spoken(part.content, part.id)) or part.content in WALKS | FALLS | DEEDS
        assert part.facts.text == part.source.captions
        for text in (text for author in voices for text in author):
            assert "{" not in text
            if part.content in ("wave", "raise-arm", "guide", "reach-forward") and part.source.side != "both":
                assert part.source.side in text.lower(), text
                assert OTHER[part.source.side] not in text.lower(), text


def test_captions_come_from_several_files_and_no_key_stands_twice(tmp_path: Path) -> None:
    (tmp_path / "gestures.toml").write_text('[a]\nwave = ["wave"]\n[b]\nwave = ["She waves."]\n', "utf-8")
    (tmp_path / "gestures_more.toml").write_text('[a]\nbow = ["bow"]\n', "utf-8")
    assert read_captions(tmp_path) == {"a": {"wave": ["wave"], "bow": ["bow"]}, "b": {"wave": ["She waves."]}}
    (tmp_path / "gestures_other.toml").write_text('[b]\nwave = ["He waves."]\n', "utf-8")
    with pytest.raises(ValueError, match="wave"):
        read_captions(tmp_path)


def test_the_same_idles_give_the_same_gestures(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gestures, "KINDS", {"wave": few(3)["wave"]})
    first, second = (list(made_gestures([idle()])) for _ in range(2))
    for a, b in zip(first, second, strict=True):
        assert a.source == b.source
        np.testing.assert_array_equal(a.joints, b.joints)


def test_nothing_is_made_without_an_idle_that_stands() -> None:
    crouched = idle()
    crouched.joints[:, 0, 1] -= 0.2
    assert list(made_gestures([crouched, idle(content="walk")])) == []


def test_made_clips_are_at_most_half_of_what_is_drawn_of_an_action() -> None:
    captured, made = clip("guide"), clip("guide").model_copy(update={"made": True})
    clips = [captured] * 2 + [made] * 30 + [clip("sit")] * 32
    weights = sampling_weights(clips)
    assert weights[:2].sum() == pytest.approx(weights[2:32].sum())
    assert weights[:32].sum() == pytest.approx(weights[32:].sum())
    few = sampling_weights([captured] * 30 + [made] * 2)
    assert few[:30].sum() == pytest.approx(15 * few[30:].sum())


def test_every_special_kind_that_is_drawn_has_captions_in_every_voice() -> None:
    voices = read_captions(Path(gestures.__file__).parent)
    assert set(voices) == {"a", "b", "c"}
    for kind in KINDS.values():
        drawn = {key for number in range(80) for key in kind.draw(random.Random(number)).kinds}
        for said in voices.values():
            assert drawn <= said.keys()
    keys = [set(said) for said in voices.values()]
    assert keys[0] == keys[1] == keys[2]
