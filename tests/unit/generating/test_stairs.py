"""Stairs that are gone up and down, step over step."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from marey.generation.fine_wish import FineWish
from marey.generation.stated import stated_features
from marey.motion.features import HUMANML3D_263
from marey.motion.feet import runs
from marey.selector.motion import Motion
from marey.selector.rules import RULES

LAYOUT = HUMANML3D_263
FPS = LAYOUT.fps
TOES = [10, 11]
SEEDS = range(4)


def features_of(prompt: str, *, seed: int = 1, frames: int | None = None, **more: object) -> np.ndarray | None:
    wish = FineWish(prompt=prompt, fixed=frames is not None, **more)  # type: ignore[arg-type]
    return stated_features(LAYOUT, "climb-stairs", wish, frames, seed)


def drawn(prompt: str, *, seed: int = 1, frames: int | None = None, **more: object) -> np.ndarray:
    features = features_of(prompt, seed=seed, frames=frames, **more)
    assert features is not None
    return LAYOUT.decode(features).astype(np.float64)


def treads(joints: np.ndarray, foot: int) -> list[float]:
    """Heights on which a foot stands, in their order."""
    toe = joints[:, TOES[foot]]
    still = np.linalg.norm(np.gradient(toe, axis=0), axis=-1) * FPS < 0.12
    return [float(np.median(toe[a:b, 1])) for a, b in runs(still) if b - a >= 3]


@pytest.mark.parametrize(
    ("prompt", "stairs"),
    [
        ("climbs four stairs", 4),
        ("a man walks up three steps", 3),
        ("goes down 5 steps", -5),
        ("descends six stairs slowly", -6),
        ("runs up seven stairs", 7),
    ],
)
@pytest.mark.parametrize("seed", SEEDS)
def test_as_many_stairs_as_are_named(prompt: str, stairs: int, seed: int) -> None:
    joints = drawn(prompt, seed=seed)
    feet = [treads(joints, foot) for foot in (0, 1)]
    levels = np.unique(np.round([height for foot in feet for height in foot], 1))
    assert len(levels) == abs(stairs) + 1
    rise = joints[-1, 0, 1] - joints[0, 0, 1]
    assert 0.15 < rise / stairs < 0.19
    assert feet[0][-1] == pytest.approx(feet[1][-1], abs=0.02), "both feet stand on the last tread"
    for foot in feet:
        assert all((after - before) * np.sign(stairs) > 0.1 for before, after in pairwise(foot)), "step over step"
    assert RULES["climb-stairs"](Motion(joints, FPS), "") >= 0.5


@pytest.mark.parametrize("prompt", ["walks up the stairs", "goes downstairs", "an old man climbs the stairs"])
@pytest.mark.parametrize("seed", SEEDS)
def test_one_foot_stands_while_the_other_one_goes_to_its_tread(prompt: str, seed: int) -> None:
    joints = drawn(prompt, seed=seed)
    toes = joints[:, TOES]
    speeds = np.linalg.norm(np.gradient(toes, axis=0), axis=-1) * FPS
    assert speeds.min(axis=1).max() < 0.35
    assert toes[..., 1].min() == pytest.approx(toes[[0, -1], :, 1].min(), abs=0.02), "no foot is under the floor"
    assert np.abs(np.diff(joints[:, 0, 1], 2)).max() < 0.02, "the hips rise evenly"
    for hip, knee, ankle in ((1, 4, 7), (2, 5, 8)):
        upper, lower = joints[-1, hip] - joints[-1, knee], joints[-1, ankle] - joints[-1, knee]
        cosine = upper @ lower / np.linalg.norm(upper) / np.linalg.norm(lower)
        assert np.degrees(np.arccos(cosine)) > 155, "it ends with straight knees"


def test_stairs_at_their_pace() -> None:
    slow, usual, fast = (len(drawn(f"{how}goes up five stairs")) for how in ("slowly ", "", "quickly "))
    assert slow > 1.3 * usual > 1.3 * 1.2 * fast
    assert len(drawn("runs up five stairs")) < 0.85 * usual
    assert len(drawn("an old woman goes up five stairs")) > 1.2 * usual


def test_stairs_of_a_fixed_length_fill_it() -> None:
    for frames in (80, 120, 180):
        joints = drawn("walks up the stairs", frames=frames)
        assert len(joints) == frames
        moves = np.abs(np.gradient(joints[:, 0, 1])) > 0.005
        assert np.flatnonzero(moves).max() > 0.7 * frames


@pytest.mark.parametrize(
    "prompt", ["crawls up the stairs", "walks up the stairs backwards", "falls down the stairs", "hops down the steps"]
)
def test_other_ways_over_stairs_are_left_to_networks(prompt: str) -> None:
    assert features_of(prompt) is None
