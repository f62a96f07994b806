"""Ways that are as long as their prompts say."""

from __future__ import annotations

import random

import numpy as np
import pytest

from marey.drawing.crawls import crawl, low_crawl
from marey.drawing.sidesteps import sidestep
from marey.generation.distances import as_far, distance_of, farther, frames_of_distance, with_distance
from marey.generation.fine_wish import FineWish
from marey.generation.port import Limits
from marey.generation.shots.way_lengths import WayRow, as_long_as, ways_back
from marey.generation.stated import stated_features
from marey.generation.timed import CUT
from marey.motion.features import HUMANML3D_263
from marey.motion.feet import find_contacts, skate
from marey.motion.skeleton import HUMANML3D
from marey.posing.standing import StandingBody
from marey.posing.still import standing_still
from tests.support.bodies import Body, walker

LAYOUT = HUMANML3D_263
FPS = LAYOUT.fps
LIMITS = Limits(40, 196, FPS, 8)


@pytest.mark.parametrize("metres", [3.0, 4.0, 6.0])
def test_ways_are_cut_to_their_length(metres: float) -> None:
    walk = LAYOUT.encode(walker(8.0))
    far = as_far(walk, LAYOUT, metres)
    assert far is not None
    assert len(far) < len(walk)
    assert distance_of(far, LAYOUT) == pytest.approx(metres, rel=0.04)
    joints = LAYOUT.decode(far).astype(np.float64)
    assert skate(joints, find_contacts(joints, HUMANML3D, FPS), HUMANML3D, FPS) < 0.08


@pytest.mark.parametrize("share", [0.8, 1.15])
def test_ways_fill_a_length_that_is_fixed(share: float) -> None:
    walk = LAYOUT.encode(walker(6.0))
    metres = share * distance_of(walk, LAYOUT)
    far = as_far(walk, LAYOUT, metres, fixed=len(walk))
    assert far is not None
    assert len(far) == len(walk)
    assert distance_of(far, LAYOUT) == pytest.approx(metres, rel=0.04)


def test_ways_that_no_body_goes_stay() -> None:
    walk = LAYOUT.encode(walker(4.0))
    assert as_far(walk, LAYOUT, 40.0) is None
    assert as_far(LAYOUT.encode(Body(4.0).joints()), LAYOUT, 3.0) is None
    assert frames_of_distance(5.0, "swim", LIMITS) is None


@pytest.mark.parametrize("metres", [12.0, 20.0])
def test_long_ways_go_on_with_strides_of_their_own(metres: float) -> None:
    longer = farther(LAYOUT.encode(walker(6.0)), LAYOUT, metres, 1200)
    assert longer is not None
    joints = LAYOUT.decode(longer).astype(np.float64)
    assert np.linalg.norm((joints[-1, 0] - joints[0, 0])[[0, 2]]) == pytest.approx(metres, rel=0.05)
    assert skate(joints, find_contacts(joints, HUMANML3D, FPS), HUMANML3D, FPS) < 0.08
    assert farther(LAYOUT.encode(walker(6.0)), LAYOUT, 90.0, 1200) is None


def test_a_part_of_a_motion_goes_as_far_as_said() -> None:
    walk = LAYOUT.encode(walker(6.0))
    half = len(walk) // 2
    made = distance_of(walk[:half], LAYOUT)
    longer = with_distance(walk, LAYOUT, [(0, half, 1.15 * made)])
    assert distance_of(longer[:half], LAYOUT) == pytest.approx(1.15 * made, rel=0.03)
    assert distance_of(longer[half + 8 :], LAYOUT) == pytest.approx(distance_of(walk[half + 8 :], LAYOUT), rel=0.04)


@pytest.mark.parametrize(
    ("action", "prompt", "metres"),
    [
        ("walk", "an usher walks two metres ahead", 2.0),
        ("walk", "she walks nine feet", 2.74),
        ("walk-backward", "backs away one metre", -1.0),
    ],
)
def test_short_ways_are_strides(action: str, prompt: str, metres: float) -> None:
    features = stated_features(LAYOUT, action, FineWish(prompt=prompt), None, 1)
    assert features is not None
    joints = LAYOUT.decode(features)
    assert joints[-1, 0, 2] - joints[0, 0, 2] == pytest.approx(metres, abs=0.06)


def test_longer_ways_are_a_network_s() -> None:
    assert stated_features(LAYOUT, "walk", FineWish(prompt="an usher walks nine metres"), None, 1) is None


@pytest.mark.parametrize("metres", [0.5, 1.2, 2.5])
def test_drawn_ways_go_so_far(metres: float) -> None:
    aside = sidestep(random.Random(1), "left", metres=metres)
    for gesture in (
        aside,
        crawl(random.Random(2), back=False, metres=metres),
        low_crawl(random.Random(3), metres=metres),
    ):
        body = StandingBody(standing_still(max(round(gesture.seconds * FPS), 20), random.Random(1)))
        gesture.change(body)
        way = body.solved()[-1, 0] - body.solved()[0, 0]
        assert np.linalg.norm(way[[0, 2]]) == pytest.approx(metres, abs=0.06)


WAY, AROUND, STANDS = WayRow(way=True), WayRow(turn=-180.0), WayRow()


@pytest.mark.parametrize(
    ("said", "rows", "back"),
    [
        ("a waiter walks ahead, turns around and walks back", (WAY, AROUND, WAY), {2: 0}),
        ("she runs off, stops, turns and returns to her starting point", (WAY, STANDS, AROUND, WAY), {3: 0}),
        ("walks, turns around and walks on", (WAY, AROUND, WAY), {}),
        ("walks forward, turns left and walks back", (WAY, WayRow(turn=90.0), WAY), {}),
        ("turns around and walks back", (AROUND, WAY), {}),
        ("walks ahead, turns around and walks back 2 m", (WAY, AROUND, WayRow(way=True, metres=2.0)), {}),
        ("walks back and forth, turns around and walks", (WAY, AROUND, WAY), {}),
    ],
)
def test_ways_back(said: str, rows: tuple[WayRow, ...], back: dict[int, int]) -> None:
    assert ways_back(said, rows) == back


def test_the_longer_of_two_ways_ends_sooner() -> None:
    short, long = LAYOUT.encode(walker(3.0)), LAYOUT.encode(walker(6.0))
    lost = distance_of(long[: CUT + 1], LAYOUT)  # the transition to the way back takes it
    for there, back, more in ((short, long, lost), (long, short, 0.0)):
        ways = as_long_as(there, back, LAYOUT)
        assert distance_of(ways[1], LAYOUT) == pytest.approx(distance_of(ways[0], LAYOUT) + more, rel=0.04)
